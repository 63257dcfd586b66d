# One command each; every target makes its own environment (.venv) when there is none.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
PAGE   := $(wildcard page/*.json page/*.ts page/*.html page/src/*)

# Several processes with several BLAS threads each on a few cores fight.
export OPENBLAS_NUM_THREADS = 1
export OMP_NUM_THREADS = 1

.PHONY: demo test check lint types contracts bench browser screenshots video docs clean setup
demo: $(STAMP)          ## the whole system on this machine
	$(BIN)/uavrt demo

test: $(STAMP) browser  ## lint, types, import contracts, manual, all tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/sphinx-build -W -q docs docs/_build
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder -r fEsxR

bench: $(STAMP)         ## speed of every stage, written to benchmarks/results.md
	$(BIN)/python -m benchmarks

docs: $(STAMP)          ## the manual, as HTML in docs/_build
	$(BIN)/sphinx-build -W -q docs docs/_build

browser:                ## Chromium, which the tests of the page drive
	@command -v chromium >/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium >/dev/null; \
	  else echo "The tests of the page need Chromium: sudo apt install chromium"; fi; }

screenshots: $(STAMP) browser  ## pictures of the page, by its test, into docs/images
	UAVRT_SCREENSHOTS=docs/images $(BIN)/pytest tests/flight/test_page.py tests/flight/test_page_past.py tests/flight/test_page_strength.py

video: $(STAMP) browser  ## a captioned film of a flight through the page, uavrt.webm
	UAVRT_VIDEO=uavrt.webm $(BIN)/pytest tests/flight/test_page.py -k whole_flight

setup: $(STAMP)         ## only the environment

$(STAMP): pyproject.toml hatch_build.py src/uavrt/mavlink/dialect.toml src/uavrt/mavlink/extra.xml $(PAGE)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[ground,analysis,ros2,dev]'
	@# GPL, so only ever run as a program by one test, which is left out without it.
	-$(BIN)/python -m pip install --quiet --no-deps 'MAVProxy==1.8.75'
	touch $@

clean:
	rm -rf $(VENV) docs/_build dist
