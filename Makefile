# `make help` lists the targets.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help run reproduce test fast lint bench clean pictures

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

run: $(VENV)/.installed ## set up, then run the third trajectory of the PMKE paper
	$(BIN)/python -m pipeline +experiment=traj3

reproduce: $(VENV)/.installed ## every printed number and figure of the three documents, side by side (outputs/reproduction/)
	$(BIN)/python -m pipeline.reproduce

test: $(VENV)/.installed-dev ## set up, then run the whole test suite
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile

fast: $(VENV)/.installed-dev ## the tests that take less than a few seconds each
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile -m "not slow"

lint: $(VENV)/.installed-dev ## lint, format check and type check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.installed-dev ## time the solver side by side with CasADi (never part of the tests)
	$(BIN)/python -m tests.benchmarks

clean: ## remove the environment and all caches, keep outputs/
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info build

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version.split()[0])'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

pictures: $(VENV)/.installed-dev ## make the pictures under docs/ again (needs the viewer's system libraries)
	$(BIN)/python docs/make_pictures.py
