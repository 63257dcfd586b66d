# One command each; every target makes its own environment (.venv) when there is none.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.PHONY: demo test check lint types contracts bench docs clean setup
demo: $(STAMP)          ## the whole system on this machine
	$(BIN)/uavrt demo

test: $(STAMP)          ## lint, types, import contracts, all tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest

bench: $(STAMP)         ## speed of every stage, written to benchmarks/results.md
	$(BIN)/python -m benchmarks

docs: $(STAMP)          ## the manual, as HTML in docs/_build
	$(BIN)/sphinx-build -W -q docs docs/_build

setup: $(STAMP)         ## only the environment

$(STAMP): pyproject.toml hatch_build.py src/uavrt/mavlink/dialect.toml src/uavrt/mavlink/extra.xml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[ground,analysis,ros2,dev]'
	touch $@

clean:
	rm -rf $(VENV) docs/_build dist
