.PHONY: conventions

conventions: setup ## every wrong convention of a log, on five arms, with and without friction; into build/conventions
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.conventions -o build/conventions
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.advice -o build/conventions

.PHONY: false-alarms
LOGS ?= 300
FIRST ?= 0
false-alarms: setup ## sound logs of 300 simulated arms: how many are withheld or accused, and by what
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.false_alarms --logs $(LOGS) --first $(FIRST)
