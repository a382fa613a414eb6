# Every target does its own set-up: a local .venv made with venv and pip.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
# the C++ firmware core is optional: without a compiler the Python fake speaks for the board
CXX    ?= g++

.PHONY: setup demo test lint bench blind firmware clean

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev,learn]'
	touch $@

setup: $(STAMP) firmware

demo: setup
	$(BIN)/rig demo

test: lint
	$(BIN)/python -m pytest -n auto

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: setup
	$(BIN)/python -m benchmarks

# resumes where it stopped; BLIND="--counts strong=5,control=10 --workers 2" for less or faster
BLIND ?=
blind: setup
	$(BIN)/python -m tests.blind --out build/blind --report docs/results/blind.md --baselines $(BLIND)

firmware:
	@if command -v $(CXX) >/dev/null 2>&1; then $(MAKE) --no-print-directory -C firmware CXX=$(CXX); \
	else echo "no C++ compiler ($(CXX)): the Python fake will stand in for the firmware" >&2; fi

clean:
	rm -rf $(VENV) firmware/build
