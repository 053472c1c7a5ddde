.PHONY: docs

docs: setup ## the guide and the API's reference as a site in build/docs, its links checked
	$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt -e '.[docs]'
	$(BIN)/python -m pipelines.docs build/docs-pages
	$(BIN)/mkdocs build --strict --quiet --config-file pipelines/mkdocs.yml
