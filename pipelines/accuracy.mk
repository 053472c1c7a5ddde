.PHONY: accuracy accuracy-quick run-to-run contradictions saturation

ACCURACY_DRAWS ?= 100
ACCURACY_MODEL_DRAWS ?= 4

accuracy: setup ## errors against the Cramér-Rao bound, peers, errors of real joints; into build/accuracy
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.accuracy --draws $(ACCURACY_DRAWS) -o build/accuracy
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.accuracy_models --draws $(ACCURACY_MODEL_DRAWS) -o build/accuracy

accuracy-quick: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.accuracy --quick -o build/accuracy

run-to-run: setup ## all splits of two real arms' runs into halves: whether intervals hold, and repeatability
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.run_to_run ../shared/data

contradictions: setup ## real runs whose second torque is scaled: whether that is named, and from which factor on
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.contradictions ../shared/data

saturation: setup ## torques cut off by a sensor or a drive: whether they are found and left out, and coverage
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.saturation
