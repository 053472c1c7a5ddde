.PHONY: golden

golden: setup ## write anew what the golden suite expects; the commit says which numbers moved, and why
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.golden.record
