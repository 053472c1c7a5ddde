.PHONY: planar

planar: setup ## bent arms and payloads that are bodies: coverage of intervals, by parameter; into build/planar
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.planar -o build/planar

.PHONY: efforts

efforts: setup ## what drivers call effort: named by the logs, and the payload's interval; into build/efforts
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.efforts -o build/efforts

.PHONY: passive

passive: setup ## acrobots and pendubots with friction and cables: coverage of intervals; into build/passive
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.passive -o build/passive

.PHONY: misfit

misfit: setup ## errors of drives that no term is: said, or silent; into build/misfit
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.misfit -o build/misfit

.PHONY: prior

prior: setup ## a prior from CAD, true, off and wrong: coverage of intervals, what is measured; into build/prior
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pipelines.prior -o build/prior
