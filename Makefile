# The same few commands for people and for CI. Each sets up all it needs.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready

.PHONY: demo test lint bench docs clean

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --group dev --editable .
	touch $@

demo: $(READY)  ## scan a bound page virtually, restore it, show the numbers; see planish-demo/
	$(BIN)/planish demo book -o planish-demo

test: $(READY)  ## every test and every example in the docstrings
	$(BIN)/python -m pytest -q

lint: $(READY)  ## style, imports that point one way, types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

bench: $(READY)  ## the figures of docs/benchmarks.md, anew (half an hour)
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	$(BIN)/python benchmarks/run_all.py

docs: $(READY)  ## docs/cli.md and the pictures, anew
	$(BIN)/python docs/make_cli.py
	$(BIN)/python docs/make_picture.py
	$(BIN)/python docs/make_solver_picture.py

clean:
	rm -rf $(VENV) build dist .pytest_cache .ruff_cache .mypy_cache
