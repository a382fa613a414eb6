# Every target does its own set-up: a local .venv made with venv and pip.
PYTHON ?= python3
CXX    ?= g++
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile

# some containers forbid Python to keep what it compiled; then each process compiles numba and scipy
# again, for five seconds
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup demo demo-real test test-unit test-long lint site bench measure results mutants mutants-core proofs soak fuzz hunt figures firmware firmware-arm firmware-teensy clean

# what users run; nothing in it needs a compiler. A command that needs more says so and offers it.
$(VENV)/.installed: pyproject.toml
	@echo "setup: what the demo needs, into $(VENV)"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) -e .
	@touch $@

# what developers add: linters, tests, the oracles they compare with, and the extras they test
$(VENV)/.developing: $(VENV)/.installed
	@echo "setup: what tests need (torch and Pinocchio among it), into $(VENV); minutes, once"
	@$(PIP) -e '.[dev,learn]'
	@touch $@

setup: $(VENV)/.installed firmware

demo: setup
	$(BIN)/rig demo

# the same on measured data: a folder or archive of recordings; DATA=FOLDER. EQUATION="" for all
EQUATION ?= gearbox
demo-real: setup
	@test -n "$(DATA)" || { echo "name the recordings: make demo-real DATA=FOLDER; public ones:" \
	"git clone https://github.com/MRDLab/mis-tool-characterization" >&2; exit 2; }
	$(BIN)/rig diagnose "$(DATA)" $(if $(EQUATION),--equation $(EQUATION)) --quick \
	  --report logs/demo-real --ledger logs/demo-real/looks.jsonl
	@echo "Open the page:"; echo "  $(BIN)/python -m webbrowser logs/demo-real/diagnosis.html"

PYTEST := $(BIN)/python -m pytest -q -n auto --dist worksteal

# what is checked before every commit: all but the long tests
test: lint
	@echo "test: unit and integration tests, on every core; the others: make test-long"
	@$(PYTEST) -m "not long"

# parts by themselves: no session, no process, no simulated campaign
test-unit: $(VENV)/.developing
	@echo "test: unit tests, on every core"
	@$(PYTEST) -m "not long and not integration"

# whole diagnoses, studies and trained networks
test-long: $(VENV)/.developing firmware
	@echo "test: long tests, on every core; tens of minutes"
	@$(PYTEST) -m long

lint: $(VENV)/.developing firmware
	@echo "lint: rules and format"
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check .
	@echo "lint: types"
	@$(BIN)/mypy
	@echo "lint: who may import whom"
	@$(BIN)/lint-imports --no-cache

site: $(VENV)/.developing
	$(BIN)/mkdocs build --strict

bench: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks
	$(BIN)/python docs/figures/diagnosis_cost.py

# how good the diagnosis is: appends a line to docs/results/diagnosis-versions.md; resumes where it
# stopped; MEASURE="--otherlab FOLDER --machines FOLDER --rig OTHER_CHECKOUT/.venv/bin/rig" for more
MEASURE ?=
measure: $(VENV)/.developing
	$(BIN)/python -m benchmarks.diagnosis measure $(MEASURE)

# the pages of docs/results and how old they are; REMAKE=loop,pique makes them again, REMAKE=old all
# that are older than their code; RIG_DATA is the folder of the measured data
REMAKE ?=
results: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks.results $(if $(REMAKE),--remake $(REMAKE))

# an hour of virtual time, ten minutes on a pty, one on a CAN bus, injected faults, dying encoders, killed recorders,
# listening sockets;
# SOAK="soak --virtual 60" for one part or less of it
SOAK ?=
soak: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks.reliability $(SOAK)

# resumes where it stopped; FUZZ="--seconds 60 --total 100000" for less
FUZZ ?=
fuzz: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks.reliability.fuzz $(FUZZ)
	$(BIN)/python -m benchmarks.reliability fuzz

# searches on for what breaks a rule of the core's safety; HUNT="--hours 1000" for a night
HUNT ?=
hunt: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks.hunt $(HUNT)

# damages the drivers' wire formats in 200 places and runs their tests on each; a quarter of an hour.
# MUTANTS="ati_net amt21" for some drivers
MUTANTS ?=
mutants: $(VENV)/.developing
	$(BIN)/python -m benchmarks.mutants $(MUTANTS)

# decides the theorems on the firmware's core for all values; five minutes. angr has its own environment, since it
# pins much of what it needs
PROOFS := .venv-proofs
$(PROOFS)/.installed:
	@echo "setup: angr, into $(PROOFS); half a minute, once"
	@$(PYTHON) -m venv $(PROOFS)
	@$(PROOFS)/bin/pip install --quiet --disable-pip-version-check \
	    'angr==9.2.213' 'bitstring<5' 'pycparser==3.0'
	@touch $@

proofs: $(VENV)/.developing $(PROOFS)/.installed
	$(BIN)/python -m benchmarks.core_proofs --python $(PROOFS)/bin/python

# damages the firmware's core in 200 places; goes on where it stopped; an hour
mutants-core: $(VENV)/.developing $(PROOFS)/.installed firmware
	$(BIN)/python -m benchmarks.core_mutants $(MUTANTS)

figures: $(VENV)/.developing
	for script in docs/figures/*.py; do $(BIN)/python $$script || exit 1; done

# the C++ core is optional: without a compiler the Python fake speaks for the board
firmware:
	@if command -v $(CXX) >/dev/null 2>&1; then $(MAKE) --no-print-directory -C firmware CXX=$(CXX); \
	else echo "no C++ compiler ($(CXX)): left out the firmware in the loop" >&2; fi

# the core on an emulated Cortex-M4, held to the contract every driver keeps; optional
ARM_CXX ?= arm-none-eabi-g++
firmware-arm: $(VENV)/.developing
	@for tool in $(ARM_CXX) qemu-system-arm; do command -v $$tool >/dev/null 2>&1 || { \
	echo "no $$tool: left out the firmware on an emulated processor; apt-get install gcc-arm-none-eabi" \
	"libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm" >&2; exit 0; }; done; \
	$(MAKE) --no-print-directory -C firmware arm ARM_CXX=$(ARM_CXX) && \
	$(BIN)/python -m pytest -q -rs tests/drivers/test_contract.py -k Cortex

# the three Teensy images with Debian's Arm compiler, run instruction by instruction in an emulator;
# TEENSY_CORES is a folder or archive of PJRC's cores, see firmware/teensy.mk; optional
TEENSY_CORES ?=
firmware-teensy: $(VENV)/.developing
	@if [ ! -e "$(TEENSY_CORES)" ]; then echo "no Teensy cores at TEENSY_CORES=$(TEENSY_CORES): left out" \
	"the Teensy images; give a folder or archive with PJRC's cores and QuadEncoder" >&2; \
	elif ! command -v $(ARM_CXX) >/dev/null 2>&1; then echo "no $(ARM_CXX): left out the Teensy images;" \
	"apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib" >&2; \
	else $(MAKE) --no-print-directory -C firmware -f teensy.mk TEENSY_CORES=$(abspath $(TEENSY_CORES)) && \
	TEENSY_CORES=$(abspath $(TEENSY_CORES)) $(BIN)/python -m pytest -q -rs tests/drivers/test_teensy_images.py; fi

clean:
	rm -rf $(VENV) firmware/build
