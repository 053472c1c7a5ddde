.PHONY: house

house: setup ## syntax nodes, code lines and files of each room beside their budgets, and how many ideas
	$(BIN)/python -m pipelines.house
