# Every target does its own set-up: a local .venv made with venv and pip.
PYTHON ?= python3
CXX    ?= g++
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile

.PHONY: setup demo test lint site bench blind soak fuzz figures firmware firmware-arm clean

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

test: lint
	@echo "test: all tests, on every core"
	@$(BIN)/python -m pytest -q -n auto --dist worksteal

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

# resumes where it stopped; BLIND="--counts strong=5,control=10 --workers 2" for less or faster,
# BLIND=--baselines for textbook methods beside it (minutes a case)
BLIND ?=
blind: $(VENV)/.developing
	$(BIN)/python -m tests.blind --out build/blind --report docs/results/blind.md $(BLIND)

# an hour of virtual time, ten minutes on a pty, one on a CAN bus, injected faults, killed recorders,
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

clean:
	rm -rf $(VENV) firmware/build
