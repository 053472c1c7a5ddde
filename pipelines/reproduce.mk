.PHONY: reproduce

reproduce: setup ## which share of random torques reaches the paper's Table 4, over speed and observer
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.search_torque
