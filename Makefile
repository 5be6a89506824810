# The two commands of the README are `make demo` and `make test`; `make setup` alone does their installation.
.PHONY: setup demo test check format

BIN := .venv/bin

setup: .venv/.ready

.venv/.ready: setup.sh pyproject.toml constraints.txt
	@./setup.sh

demo: setup
	$(BIN)/evenlight demo --out demo

test: setup
	$(BIN)/python -m pytest

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
