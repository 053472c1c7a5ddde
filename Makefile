PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help setup demo test test-slow check lint format types pytest pipelines clean

help:
	@echo "make demo       synthesise, identify and print Table 4 beside the paper's"
	@echo "make test       set up and run the tests"
	@echo "make test-slow  the statistics: coverage of intervals and the like, some minutes"
	@echo "make check      format, lint, types, tests: what every commit passes"
	@echo "make pipelines  both cases through every format, failing when a reported error grows"

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

test: setup
	$(BIN)/python -m pytest

test-slow: setup
	$(BIN)/python -m pytest -m slow

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) build dist

include pipelines/*.mk
