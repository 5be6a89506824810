# The two commands of the README are `make demo` and `make test`; `make setup` and `make lab` do their installation.
.PHONY: setup lab demo test test-fast test-docs test-kills test-realtime test-videos test-headset studies check format docs benchmarks FORCE

BIN := .venv/bin
# Where .venv was set up and works no more (its Python was replaced, the folder moved), all marks are out of date.
NEEDED := setup.sh pyproject.toml $(wildcard requirements/*.txt) \
    $(shell [ ! -e .venv/.ready ] || $(BIN)/python -P -c 'import evenlight' 2>/dev/null || echo FORCE)

# Everything but sessions in a window.
setup: .venv/.ready

.venv/.ready: $(NEEDED)
	@./setup.sh

# With PsychoPy, to run sessions with people: Python 3.11 or 3.12 (`make lab PYTHON=/path/to/python3.12`).
lab: .venv/.lab-ready

# `docs`: what builds the site. `dev`: that, formatter, linter, type checker, and the Python packages that the tests
# need. `test`: also a browser, the players that follow a track, and PsychoPy where Python allows it.
.venv/.%-ready: $(NEEDED)
	@./setup.sh $*

demo: setup
	$(BIN)/evenlight demo --out demo

# The tests start a hundred processes: those find modules compiled, also where the environment asks for no cache.
test: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -m "not real_time and not every_page and not every_kill and not study and not odd_films"

# Six tests of ten, in a minute: after each edit. Without what is slow (tests/conftest.py says what); it needs no
# `make lab`. A test that is named at the end took long: mark it `slow`.
test-fast: .venv/.dev-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 3 --durations 10 --durations-min 1 -m "not slow and not real_time and not every_page and not every_kill and not study and not odd_films"

# Every command of every page and help; `make test` runs those of the README and of the first hour, and parses all.
test-docs: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -m every_page

# Every command, killed at each rename, fsync and half write of a small case. `make test` kills each once.
test-kills: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --timeout 7200 -m every_kill tests/recovery

# Real time by nature (keys, players, a browser, a headset's runtime, replies by a clock): on a computer that does
# nothing else.
test-realtime: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 1 -m real_time

# Films of every kind and fault, made with FFmpeg: two minutes.
test-videos: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 2 --dist load tests/stimuli/test_odd_films.py

# Simulate, fit, recover: data sets enough to see a bias of some percent. `make test` has a small case of each.
# And claims on any input, with other inputs each time: `make test` has the same in each run.
studies: .venv/.test-ready
	$(BIN)/python -m pytest -n 2 -o "python_files=claims_*.py" benchmarks/studies
	$(BIN)/python -m pytest -n 2 -m "study or hypothesis" --hypothesis-profile random tests

# Sessions in an OpenXR runtime with a simulated headset, which `make test-realtime` has too: as root, with debootstrap.
test-headset: .venv/.test-ready
	PYTHONDONTWRITEBYTECODE= tests/headset/runtime-tree.sh $(BIN)/python -m pytest -n 0 tests/headset

check: .venv/.dev-ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python tests/companions/line_budget.py

format: .venv/.dev-ready
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The pages of docs/ as a site, in site/.
docs: .venv/.docs-ready
	$(BIN)/mkdocs build --strict

# The page of speed against error, on this machine: half an hour, in which it should have nothing else to do.
benchmarks: .venv/.test-ready
	$(BIN)/evenlight bench all --out out/benchmarks
	mkdir -p docs/benchmarks
	cp out/benchmarks/benchmarks.md out/benchmarks/*.png docs/benchmarks/
