.PHONY: planar

planar: setup ## bent arms and payloads that are bodies: coverage of intervals, by parameter; into build/planar
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.planar -o build/planar
