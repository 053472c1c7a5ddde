.PHONY: bench-batch

BENCH_BATCH_DIR ?= build/bench-batch

bench-batch: setup ## throughput of batches, and kills
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[dask]'
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 POLARS_MAX_THREADS=1 $(BIN)/python -m pipelines.bench_batch $(BENCH_BATCH_DIR)
