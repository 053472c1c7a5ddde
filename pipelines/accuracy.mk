# Experiments of coverage: a table each, into build/; `EXPERIMENT="--arms 2 --draws 3"` makes one short.
EXPERIMENTS := contradictions saturation planar efforts passive misfit prior false-alarms elastic disturbed
.PHONY: accuracy run-to-run conventions $(EXPERIMENTS)

EXPERIMENT ?=
MEASURE = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines

accuracy: setup ## errors against the Cramér-Rao bound, peers, held torques, errors of real joints
	$(MEASURE).accuracy $(EXPERIMENT)
	$(MEASURE).accuracy_hold $(EXPERIMENT)
	$(MEASURE).accuracy_models $(EXPERIMENT)

conventions: setup ## every wrong convention of a log, on five arms, with and without friction; what is advised
	$(MEASURE).conventions $(EXPERIMENT)
	$(MEASURE).advice $(EXPERIMENT)

$(EXPERIMENTS): setup
	$(MEASURE).$(subst -,_,$@) $(EXPERIMENT)

run-to-run: setup ## all splits of two real arms' runs into halves: whether intervals hold, and repeatability
	$(MEASURE).run_to_run
