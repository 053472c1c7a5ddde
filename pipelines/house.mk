.PHONY: house

house: setup ## files, lines, helpers with one caller, tests to code, a log's way through the rooms
	$(BIN)/python -m pipelines.house
