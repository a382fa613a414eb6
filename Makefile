# Every target does its own set-up: a local .venv made with venv and pip.
PYTHON ?= python3
CXX    ?= g++
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check

.PHONY: setup demo test lint site bench blind figures firmware clean

# what users run; nothing in it needs a compiler
$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP) -e '.[learn,arm]'
	touch $@

# what developers add: linters, tests, and the oracles they compare with
$(VENV)/.developing: $(VENV)/.installed
	$(PIP) -e '.[dev,learn]'
	touch $@

setup: $(VENV)/.installed firmware

demo: setup
	$(BIN)/rig demo

test: lint
	$(BIN)/python -m pytest -n auto --dist worksteal

lint: $(VENV)/.developing firmware
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

site: $(VENV)/.developing
	$(BIN)/mkdocs build --strict

bench: $(VENV)/.developing firmware
	$(BIN)/python -m benchmarks

# resumes where it stopped; BLIND="--counts strong=5,control=10 --workers 2" for less or faster
BLIND ?=
blind: $(VENV)/.installed
	$(BIN)/python -m tests.blind --out build/blind --report docs/results/blind.md --baselines $(BLIND)

figures: $(VENV)/.installed
	for script in docs/figures/*.py; do $(BIN)/python $$script || exit 1; done

# the C++ core is optional: without a compiler the Python fake speaks for the board
firmware:
	@if command -v $(CXX) >/dev/null 2>&1; then $(MAKE) --no-print-directory -C firmware CXX=$(CXX); \
	else echo "no C++ compiler ($(CXX)): left out the firmware in the loop" >&2; fi

clean:
	rm -rf $(VENV) firmware/build
