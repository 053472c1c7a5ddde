.PHONY: bench-batch

BENCH_BATCH_DIR ?= build/bench-batch

bench-batch: setup ## throughput of batches, kills, the fleet's and the track's figures
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[dask]'
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 POLARS_MAX_THREADS=1 $(BIN)/python -m pipelines.bench_batch $(BENCH_BATCH_DIR)
	$(BIN)/python -m pipelines.bench_fleet $(BENCH_BATCH_DIR)/fleet
	$(BIN)/python -m pipelines.bench_track
	$(BIN)/python -m pipelines.accuracy_track
