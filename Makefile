PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help setup demo test test-slow test-processor test-pythons check lint format pipelines clean

help:
	@echo "make demo       synthesise, identify and print Table 4 beside the paper's"
	@echo "make test       set up and run the tests"
	@echo "make test-processor  the numerical tests as two other processors round"
	@echo "make test-pythons  the quick tests with Python 3.12 and 3.13 where they are found"
	@echo "make test-slow  statistics of intervals, kills of batches, pages in a browser: some minutes"
	@echo "make check      format, lint, types, tests: what every commit passes"
	@echo "make pipelines  case 1 through three formats, and case 2, failing when a reported error grows"

setup: $(READY)

# Python compiles a module when it first imports it: of most packages that is a small part, and two cores share it.
$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --no-compile --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

# Tests start some hundred processes: each would compile algid's modules anew.
unexport PYTHONDONTWRITEBYTECODE

# A test process a core: threads of BLAS beside it only wait for each other.
test test-slow test-processor test-pythons: export OPENBLAS_NUM_THREADS = 1

test: setup
	$(BIN)/python -m pytest

# Many of them wait for other processes, hence one worker more than the two cores of CI. The longest, an installation, starts
# among the first.
test-slow: setup
	$(BIN)/python -m pytest -n 3 -m slow tests/test_docs.py $$(grep -rl mark.slow tests --include='test_*.py')

# Sums in another order, as other processors take them: two of OpenBLAS's kernels that are not the default here, and
# NumPy without AVX2 and AVX-512.
NUMERICAL ?= tests/test_arm.py tests/estimators tests/signals tests/synth \
  $(addprefix tests/tracks/test_, track.py cells.py change_points.py) \
  $(addprefix tests/identification/test_, identify.py known.py outcome.py series.py streaming.py \
    validate.py velocities.py)
test-processor: setup
	@for kernel in $${KERNELS:-$$($(BIN)/python -m pipelines.kernels)}; do \
	  echo "== OpenBLAS's kernels for $$kernel"; \
	  OPENBLAS_CORETYPE=$$kernel NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR" \
	  $(BIN)/python -m pytest $(NUMERICAL) || exit; \
	done

check: lint test

lint: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:
	rm -rf $(VENV) build dist

include pipelines/*.mk
