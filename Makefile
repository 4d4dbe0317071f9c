# `make help` lists the targets.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# As the package sets it for itself: where numpy is loaded before, as in the tests, that is too late.
export OMP_NUM_THREADS := 1
# Compiled files are kept, whatever the shell says: every process that a test starts would compile the package again.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.PHONY: help run reproduce audit readings test fast lint format cover bench package docs pictures clean schema suite

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

run: $(VENV)/.installed ## set up, then run the third trajectory of the PMKE paper
	$(BIN)/python -m pipeline +experiment=traj3

reproduce: $(VENV)/.installed-dev ## every printed number and figure of the documents, side by side, and every erratum
	$(BIN)/python -m pipeline.reproduce
	$(BIN)/python -m tests.reproduce.errata

audit: $(VENV)/.installed-dev ## recompute the shipped experiments' tables by pinocchio and coal (docs/audit.md)
	$(BIN)/python -m tests.audit

readings: $(VENV)/.installed-dev ## what the documents' open steps can be read as, and what each reading gives (docs/readings.md)
	$(BIN)/python -m tests.readings

test: $(VENV)/.installed-dev ## set up, then run the whole test suite
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal

fast: $(VENV)/.installed-dev ## the tests that take no more than about half a second each
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m "not slow"

lint: $(VENV)/.installed-dev ## lint, format, types, and which package may import which
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

format: $(VENV)/.installed-dev ## put the code into its form, and mend what the linter can mend by itself
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

cover: $(VENV)/.installed-dev ## which lines the tests do not reach
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal --cov pipeline --cov-report term-missing:skip-covered

schema: $(VENV)/.installed ## write conf/schema.json, by which editors check the files of conf/
	$(BIN)/python -m pipeline.config

bench: $(VENV)/.installed-dev ## time the solver side by side with CasADi (the tests run it small and judge no times)
	$(BIN)/python -m tests.benchmarks

package: $(VENV)/.installed-dev ## sdist and wheel, tried in an environment of their own from another folder
	sh tests/package.sh $(BIN)/python

docs: $(VENV)/.installed-dev ## the reference of the public names as a static site, outputs/docs/index.html
	$(BIN)/pdoc --output-directory outputs/docs --docformat google pipeline

suite: $(VENV)/.installed-dev ## solve the problems of tests/suite/problems and write their table (outputs/suite/)
	$(BIN)/python -m pipeline.suite tests/suite/problems

clean: ## remove the environment and all caches, keep outputs/
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .coverage build dist

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and f"needs Python 3.11 or newer: {sys.version}")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

pictures: $(VENV)/.installed-dev ## make the pictures under docs/ again (needs the viewer's system libraries)
	$(BIN)/python docs/make_pictures.py
