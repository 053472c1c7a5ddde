.PHONY: bench bench-day bench-ingest bench-batch fuzz

BENCH_ROUNDS ?= 5

bench: setup ## time algid as whole processes; into build/bench
	$(BIN)/python -m pipelines.bench_processor --rounds $(BENCH_ROUNDS)

bench-day: setup ## 24 h at 1 kHz as Parquet and MCAP: memory and time, 7 GB of disk
	$(BIN)/python -m pipelines.bench_processor --day --rounds 1 -o build/bench-day
	rm -f build/bench-day/day.parquet build/bench-day/day.mcap

bench-ingest: setup ## time the readers against decompression, polars and other readers
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[bench]'
	$(BIN)/python -m pipelines.bench_ingest

bench-batch: setup ## throughput of batches
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[dask]'
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 POLARS_MAX_THREADS=1 $(BIN)/python -m pipelines.bench_batch build/bench-batch

fuzz: setup ## read 20,000 damaged logs and 20,000 hostile ones, these by a batch too; 5,000 hostile calls and batches
	$(BIN)/python -m pipelines.fuzz
	$(BIN)/python -m pipelines.fuzz 5000 1 calls batches
