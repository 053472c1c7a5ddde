.PHONY: coverage

COVERED ?= tests

coverage: setup ## which branches the quick tests take, workers and commands included; COVERED=tests/readers for one room
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[mutants]'
	rm -rf build/coverage && mkdir -p build/coverage
	COVERAGE_FILE=$(CURDIR)/build/coverage/data $(BIN)/coverage run -m pytest $(COVERED)
	COVERAGE_FILE=$(CURDIR)/build/coverage/data $(BIN)/coverage combine -q
	COVERAGE_FILE=$(CURDIR)/build/coverage/data $(BIN)/coverage report
