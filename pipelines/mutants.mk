.PHONY: mutants

MUTANTS ?= 100
MUTANTS_SEED ?= 1

mutants: setup ## how many small changes of the code the tests see; some tens of minutes
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[mutants]'
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.mutants --count $(MUTANTS) --seed $(MUTANTS_SEED) $(ROOMS)
