.PHONY: bench-design bench-design-quick

BENCH_DESIGN_DRAWS ?= 100

bench-design: setup ## what designed motions are worth, and whether their error bars come true; into build/bench-design
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.bench_design --draws $(BENCH_DESIGN_DRAWS) -o build/bench-design

bench-design-quick: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.bench_design --arms case1,arm3 --draws 12 --randoms 30 -o build/bench-design
