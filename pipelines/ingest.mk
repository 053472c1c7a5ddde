.PHONY: bench-ingest fuzz

BENCH_DIR ?= build/bench-ingest

bench-ingest: setup ## time the readers against decompression, polars and other readers
	$(BIN)/python -m pipelines.bench_ingest $(BENCH_DIR)

fuzz: setup ## read 20,000 damaged logs and 20,000 hostile ones, these by a batch too; 5,000 hostile calls and batches
	$(BIN)/python -m pipelines.fuzz
	$(BIN)/python -m pipelines.fuzz_calls
	$(BIN)/python -m pipelines.fuzz_batches
