.PHONY: bench bench-day

BENCH_ROUNDS ?= 5

bench: setup ## time algid and its peers on the same logs; into build/bench
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[bench]'
	$(BIN)/python -m pipelines.bench_processor --rounds $(BENCH_ROUNDS) -o build/bench

bench-day: setup ## 24 h at 1 kHz as Parquet and MCAP: memory and time, 7 GB of disk
	$(BIN)/python -m pipelines.bench_processor --day --rounds 3 -o build/bench-day
	rm -f build/bench-day/day.parquet build/bench-day/day.mcap
