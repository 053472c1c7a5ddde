.PHONY: race

race: setup ## every contender on the same simulated and real logs: errors, intervals, time; into build/race
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[race]'
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.race -o build/race
