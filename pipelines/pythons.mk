.PHONY: test-pythons

PYTHONS ?= 3.12 3.13

test-pythons: setup ## the quick tests with every other Python of PYTHONS that is found here
	@for version in $(PYTHONS); do \
	  found=; \
	  for python in python$$version $$HOME/.pyenv/versions/$$version.*/bin/python; do \
	    if $$python -c '' 2>/dev/null; then found=$$python; break; fi; \
	  done; \
	  if [ -z "$$found" ]; then echo "== Python $$version: not found, not tested"; continue; fi; \
	  echo "== Python $$version"; \
	  $$found -m venv --clear build/python$$version && \
	  build/python$$version/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[dev]' && \
	  build/python$$version/bin/python -m pytest || exit; \
	done
