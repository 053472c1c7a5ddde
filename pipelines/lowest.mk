.PHONY: test-lowest

LOWEST := build/lowest

test-lowest: setup ## the quick tests with every dependency at the lowest version that pyproject.toml allows
	$(PYTHON) -m venv --clear $(LOWEST)
	$(BIN)/python -m pipelines.lower_bounds > $(LOWEST)/constraints.txt
	$(LOWEST)/bin/python -m pip install -q --disable-pip-version-check -c $(LOWEST)/constraints.txt -e '.[dev]'
	ALGID_TESTS_FRESH=1 $(LOWEST)/bin/python -m pytest -o filterwarnings=default
