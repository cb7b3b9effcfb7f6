# Two commands do all on a fresh machine: `make demo` and `make test`. Both make .venv first if it is missing.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
BUNDLE := biodance/report/feedback/bundle
ROOM   ?= yes

.PHONY: demo test hidden lint docs tutorials bundle bundle-if-possible sbom lock clean
demo: $(STAMP) bundle-if-possible
	$(BIN)/biodance demo --out demo --force || [ $$? -eq 1 ] # 1: done, and something needs a person

test: $(STAMP) bundle-if-possible
	$(BIN)/python -m pytest -n 2 --dist worksteal # halves that stay whole: what a file's tests share is made once

PART ?= 1/1
hidden: $(STAMP) # every cause hidden in sessions of two people and found again; by hand PART=all: of three, PART=2/7: a seventh
	BIODANCE_HIDDEN=$(PART) $(BIN)/python -m pytest -n 2 --dist worksteal tests/test_hidden_causes.py

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

bundle: $(BUNDLE)/NOTICES.txt # what lets the page that leads follow the person: from npm, as its lock file says
$(BUNDLE)/NOTICES.txt: web/package-lock.json web/pose.js web/build.mjs | $(STAMP)
	PYTHON=$(abspath $(BIN)/python) sh web/build.sh $(abspath $(BUNDLE))

bundle-if-possible: $(STAMP)
	@$(MAKE) --no-print-directory bundle || echo "Without npm the page that leads does not follow the person; all else works."

TOO_OLD := biodance needs Python 3.11 to 3.13. Name one: make PYTHON=python3.12 ... (see README.md). $(PYTHON) is
$(STAMP): pyproject.toml locked.txt
	@$(PYTHON) -c 'import sys; (3, 11) <= sys.version_info < (3, 14) or sys.exit("$(TOO_OLD) " + sys.version.split()[0])'
	@[ $(ROOM) = no ] || $(PYTHON) .ci/room.py $(VENV)=$(if $(wildcard $(VENV)),1,3) "$${TMPDIR:-/tmp}=1" # of 2.8 and 0.8 GB
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r locked.txt # nothing but what was locked
	$(BIN)/python -m pip install --quiet --no-deps -e .
	$(BIN)/python -m compileall -q biodance # pip leaves an editable package as text
	touch $(STAMP)

sbom: # what is installed, as a bill of materials: CycloneDX JSON
	@$(PYTHON) .ci/sbom.py > sbom.cdx.json && echo sbom.cdx.json

lock: # after a change of pyproject.toml or constraints.txt; needs uv
	head -1 locked.txt > locked.new
	uv pip compile -q pyproject.toml $(addprefix --extra ,test lint peers docs pictures) -c constraints.txt --universal \
	  --python-version 3.11 --generate-hashes --no-annotate --no-header >> locked.new
	mv locked.new locked.txt

clean:
	rm -rf $(VENV) demo build/site web/node_modules $(BUNDLE)
