.PHONY: race race-setup

race: race-setup ## every contender on the same simulated and real logs: errors, intervals, time
	$(MEASURE).race $(EXPERIMENT)
	$(MEASURE).run_to_run --splits 8

race-setup: setup
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[race]'
