.PHONY: conventions

conventions: setup ## every wrong convention of a log, on five arms, with and without friction; into build/conventions
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.conventions -o build/conventions
