.PHONY: race race-quick

RACE = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.race

race: race-setup ## every contender on the same simulated and real logs: errors, intervals, time; into build/race
	$(RACE) -o build/race

race-quick: race-setup
	$(RACE) --seeds 3 --splits 2 -o build/race-quick

.PHONY: race-setup
race-setup: setup
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[race]'
