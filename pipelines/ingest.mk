.PHONY: bench-ingest fuzz

BENCH_DIR ?= build/bench-ingest

bench-ingest: setup ## time the readers against decompression, polars and other readers
	$(BIN)/python pipelines/bench_ingest.py $(BENCH_DIR)

fuzz: setup ## read 20,000 damaged logs
	$(BIN)/python pipelines/fuzz.py
