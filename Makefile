# Two commands do all on a fresh machine: `make demo` and `make test`. Both make .venv first if it is missing.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.PHONY: demo test hidden lint docs tutorials clean
demo: $(STAMP)
	$(BIN)/biodance demo --out demo --force || [ $$? -eq 1 ] # 1: done, and something needs a person

test: $(STAMP)
	$(BIN)/python -m pytest -n 2

PART ?= 1/1
hidden: $(STAMP) # every cause hidden in a session and found again; PART=2/7: every seventh
	BIODANCE_HIDDEN=$(PART) $(BIN)/python -m pytest -n 2 tests/test_hidden_causes.py

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	PYTHONPATH=tests $(BIN)/python tests/docstrings.py

docs: $(STAMP)
	PYTHONPATH=. NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict # not --quiet: that would swallow the warnings that must stop it

tutorials: $(STAMP) # runs every example, and keeps what it prints and draws for the documentation
	$(BIN)/python docs/hooks/tutorials.py
	$(BIN)/python docs/figures/measured_and_simulated.py docs/figures/measured_and_simulated.png

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[test,lint,peers,docs]"
	touch $(STAMP)

clean:
	rm -rf $(VENV) demo build/site
