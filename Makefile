# The two commands of the README are `make demo` and `make test`; `make setup` and `make lab` do their installation.
.PHONY: setup lab demo test test-fast check format benchmarks

BIN := .venv/bin

setup: .venv/.ready

.venv/.ready: setup.sh pyproject.toml constraints.txt
	@./setup.sh

# PsychoPy, to run sessions with people; the tests rehearse them on a virtual screen.
lab: .venv/.lab-ready

.venv/.lab-ready: setup.sh pyproject.toml constraints.txt
	@./setup.sh lab

# What the tests need beside it: a browser, and the players that follow a track.
.venv/.test-ready: setup.sh pyproject.toml constraints.txt
	@./setup.sh test

demo: setup
	$(BIN)/evenlight demo --out demo

# The tests start a hundred processes: those find modules compiled, also where the environment asks for no cache.
test: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest

# Without windows, PsychoPy, shaders, baked light and simulated studies; it needs no `make lab`.
test-fast: setup
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 -m "not slow"

check: lab
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The page of speed against error, on this machine: half an hour, in which it should have nothing else to do.
benchmarks: lab
	$(BIN)/evenlight bench all --out out/benchmarks
	mkdir -p docs/benchmarks
	cp out/benchmarks/benchmarks.md out/benchmarks/*.png docs/benchmarks/
