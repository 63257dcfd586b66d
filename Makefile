# One command each; every target creates the environment (.venv) if it is missing.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
PYTEST := $(BIN)/pytest -r fEsxR --durations 15 --durations-min 5
CC_X86_64  ?= x86_64-linux-gnu-gcc
CC_AARCH64 ?= aarch64-linux-gnu-gcc
LOCK   := --universal --generate-hashes --python-version 3.11 --no-header -q
RADIOS := gcc g++ airspy airspyhf rtl-sdr hackrf python3-soapysdr libsoapysdr-dev
PAGE   := $(wildcard page/*.json page/*.ts page/*.html page/src/* page/src/*/*)

# Several processes with several BLAS threads each would compete for few cores.
export OPENBLAS_NUM_THREADS = 1
export OMP_NUM_THREADS = 1
# A container may ask for no bytecode: then each of a thousand programs that the tests start
# compiles all that it imports, and each worker rewrites the assertions of all tests.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo check quick test realtime computing unit system full-rate flights claims claims-status lint types bench locks licences browser disk-tools radio-tools screenshots video docs clean setup wheels try-arm64
demo: $(STAMP)          ## the whole system on this machine
	$(BIN)/uavrt demo

check: $(STAMP)         ## before each commit: style, types, import contracts, quick unit tests
	$(MAKE) --no-print-directory -j 3 lint types quick

quick: $(STAMP)         ## unit tests of files that compute for less than ten seconds
	$(PYTEST) -n 2 --dist loadfile -m "not slow" tests/unit

test: $(STAMP) browser disk-tools radio-tools  ## everything that belongs to a change: check, manual, all tests
	$(MAKE) --no-print-directory -k -j 2 realtime computing

realtime: $(STAMP)      ## all that waits for real time, one after the other
	$(MAKE) --no-print-directory -k -j 1 full-rate flights system

computing: $(STAMP)     ## what only computes, at low priority: what waits for real time runs at the same time
	nice -n 19 $(MAKE) --no-print-directory -k -j 1 lint types docs unit

unit: $(STAMP)          ## all unit tests
	$(PYTEST) -n 2 --dist loadfile --no-loadscope-reorder tests/unit

# Real time is mostly waiting: more workers than cores.
system: $(STAMP)        ## tests with sockets, programs and threads in real time
	$(PYTEST) -n 4 --dist loadfile -m "not full_rate" tests/system

full-rate: $(STAMP)     ## flights and radios that need a core of their own
	$(PYTEST) -m full_rate tests/flight tests/system/radio

flights: $(STAMP)       ## all other flights in real time, and the page in a browser
	$(PYTEST) -n 4 --dist loadfile --no-loadscope-reorder -m "not full_rate" tests/flight

claims: $(STAMP) browser disk-tools radio-tools  ## hours: campaigns, guides word by word, all seeds, new random examples, emulated ARM
	UAVRT_ALL_SEEDS=1 UAVRT_NEW_EXAMPLES=1 UAVRT_DEPTH=12 UAVRT_LINK_DEPTH=8 UAVRT_LINK_TRIALS=200 \
	  $(PYTEST) -n 2 --dist loadfile tests/claims tests/unit tests/flight/test_stops.py

claims-status: $(STAMP) ## which tables of results are older than the code that they speak of
	-$(BIN)/python -m uavrt_experiments.measured

lint: $(STAMP)          ## style, layers, dead code, licences
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/vulture
	$(BIN)/python deploy/licences.py --check

types: $(STAMP)         ## every annotation
	$(BIN)/mypy

locks: $(STAMP)         ## pin what the drone installs, with hashes (needs uv)
	uv pip compile pyproject.toml $(LOCK) -o deploy/locks/drone.txt
	uv pip compile pyproject.toml --extra ros2 $(LOCK) -c deploy/locks/drone.txt -o deploy/locks/drone-ros2.txt
	uv pip compile pyproject.toml --extra ground $(LOCK) -c deploy/locks/drone.txt -o deploy/locks/drone-page.txt
	$(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")' \
	  | uv pip compile - $(LOCK) -o deploy/locks/build.txt

licences: $(STAMP)      ## what runs on the drone, and under which licence
	$(BIN)/python deploy/licences.py --check

bench: $(STAMP)         ## speed of every stage, written to benchmarks/results.md
	$(BIN)/python -m benchmarks

docs: $(STAMP)          ## the manual, as HTML in docs/_build
	$(BIN)/sphinx-build -W -q docs docs/_build

browser:                ## Chromium without windows, which the tests of the page drive
	@command -v chromium-headless-shell >/dev/null || { \
	  [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && \
	  apt-get install -y -qq --no-install-recommends chromium-headless-shell >/dev/null; } || \
	  command -v chromium >/dev/null || \
	  echo "The tests of the page need Chromium: sudo apt install chromium-headless-shell"

disk-tools:             ## what packs an image for the drone, of which the tests pack a small one
	@PATH=$$PATH:/usr/sbin:/sbin; { command -v sfdisk && command -v mkfs.vfat && command -v mcopy; } >/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends fdisk dosfstools mtools >/dev/null || echo "Without them the test of the image is skipped"; \
	  else echo "The test of the image needs: sudo apt install fdisk dosfstools mtools"; fi; }

radio-tools:            ## the radios' own programs and SoapySDR, which tests run over stand-in libraries
	@{ command -v airspy_rx && command -v airspyhf_rx && command -v rtl_sdr && command -v hackrf_transfer && [ -d /usr/include/SoapySDR ]; } >/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -y -qq --no-install-recommends $(RADIOS) >/dev/null || echo "Without them the tests of the radios' programs are skipped"; \
	  else echo "The tests of the radios' programs need: sudo apt install $(RADIOS)"; fi; }

screenshots: $(STAMP) browser  ## pictures of the page, by its test, into docs/images
	UAVRT_SCREENSHOTS=docs/images $(BIN)/pytest tests/flight/browser/test_page.py tests/system/browser/test_page_past.py tests/system/browser/test_page_strength.py tests/system/browser/test_page_hands.py tests/flight/browser/test_page_fly.py tests/system/browser/test_page_moves.py tests/system/browser/test_page_wizard.py

try-arm64: $(STAMP)     ## install and fly in an emulated Debian for 64-bit ARM (ten to twenty minutes)
	deploy/try-arm64.sh $(ARM64)

video: $(STAMP) browser  ## captioned films of a flight and of a search through the page, *.webm
	UAVRT_VIDEO=uavrt.webm $(BIN)/pytest tests/flight/browser/test_page.py -k whole_flight
	UAVRT_VIDEO=uavrt-search.webm $(BIN)/pytest tests/flight/browser/test_page_fly.py -k watched_with

setup: $(STAMP)         ## only the environment

$(STAMP): pyproject.toml claims/pyproject.toml hatch_build.py $(wildcard native/*) src/uavrt/link/mavlink/dialect.toml src/uavrt/link/mavlink/extra.xml $(PAGE)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[ground,analysis,batch,ros2,dev]' -e claims
	@# GPL: only run as a separate program, by one test, which is skipped without it.
	-$(BIN)/python -m pip install --quiet --no-deps 'MAVProxy==1.8.75'
	@# Lists the system's fonts once by a program, which unit tests may not start.
	-$(BIN)/python -c 'import matplotlib.font_manager'
	touch $@

# Needs Debian's gcc-x86-64-linux-gnu (on x86-64: gcc) and gcc-aarch64-linux-gnu.
wheels: $(STAMP)        ## wheels: pure, and with kernels for x86-64 and 64-bit ARM, in dist
	rm -rf dist build
	UAVRT_PURE=1 $(BIN)/hatchling build -t wheel
	CC=$(CC_X86_64) UAVRT_PLATFORM=manylinux_2_17_x86_64 $(BIN)/hatchling build -t wheel
	CC=$(CC_AARCH64) UAVRT_PLATFORM=manylinux_2_17_aarch64 $(BIN)/hatchling build -t wheel

clean:
	rm -rf $(VENV) docs/_build dist build
