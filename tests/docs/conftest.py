"""A folder with what a reader has, and somebody who does there what a page says."""

import contextlib
import io
import os
import re
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from catalogues import cluster_here
from command_variants import HERE, in_a_window, parse, trial_of
from emulators.ours import attach
from page_commands import ROOT, Step
from reader_files import Shelf, install
from warm_evenlight import Run

from evenlight.analysis.dataset_findings import ANALYSES
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS, TASKS
from evenlight.experiments.experiment_kinds import EXPERIMENTS

WINDOW = "import os, sys; os.chdir({folder!r}); from evenlight import command; command.main(sys.argv[1:])"
MAKE = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache of loss curves that pages share, beside the light of scenes that earlier runs have stored."""
    folder = tmp_path_factory.mktemp("cache") / "evenlight"
    folder.mkdir()
    usual = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "evenlight"
    for stored in usual.glob("*.npy"):
        (folder / stored.name).symlink_to(stored)
    return folder.parent


@pytest.fixture(scope="module")
def shelf_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("shelf")


@pytest.fixture(scope="module")
def workers() -> Iterator[str]:
    """The address of a cluster."""
    with cluster_here(1) as address:
        yield address


@pytest.fixture
def reader(
    request: pytest.FixtureRequest,
    command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    cache: Path,
    shelf_folder: Path,
    bare_screen: Callable[[], str],
    blank_pictures: None,  # tests/pipeline draws those of a demo, of a reproduction and of tracks
) -> Iterator[Callable[..., list[str]]]:
    """Do what the reader of a page does, and return what went wrong."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "100")
    attach(monkeypatch)  # whose zero is set
    before = list(sys.path)

    def run(*words: str) -> Any:
        monkeypatch.setattr(sys, "stdin", io.StringIO("\n" * 100))  # Enter, whenever it is asked for
        if HERE in words:
            words = tuple(request.getfixturevalue("workers") if word == HERE else word for word in words)
        if not in_a_window(list(words)):
            return command(*words)
        here = shelf_folder / "window.py"  # runs are forked from a process that is in another folder
        here.write_text(WINDOW.format(folder=str(Path.cwd())))
        window = Run(list(words), os.environ | {"DISPLAY": bare_screen()}, here)
        out, err = window.communicate(timeout=280)
        return type("Outcome", (), {"code": window.returncode, "out": out, "err": err})

    def follow(step: Step) -> str:
        if step.is_python:
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(step.text, str(step), "exec"), {"__name__": "page"})
            return ""
        program, *words = step.words
        if program != "evenlight":
            return _another_program(step, tmp_path, monkeypatch)
        trial = trial_of(words)
        if trial.parsed_only or (in_a_window(list(words)) and find_spec("psychopy") is None):
            parse(list(trial.words))
            return ""
        outcome = run(*(name for word in trial.words for name in _expanded(word)))
        if outcome.code:
            return f"{step}\n  ({' '.join(trial.words)}) ended with {outcome.code}: {outcome.err}"
        said = " ".join((outcome.out + outcome.err).split())
        return "".join(
            f"{step}\n  does not print {line!r}, but\n{outcome.out}{outcome.err}"
            for line in step.printed
            if not re.search(r"\S*".join(map(re.escape, " ".join(line.split()).split("…"))), said)
        )

    def do(page: str, todo: list[Step], has: tuple[str, ...]) -> list[str]:
        monkeypatch.chdir(shelf_folder)
        Shelf(shelf_folder, run).put(page, has, tmp_path)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("PWD", str(tmp_path))  # as a shell sets it; players read it
        return [wrong for step in todo if (wrong := follow(step))]

    yield do
    sys.path[:] = before
    for registry in (TASKS, EXPERIMENTS, ANALYSES):
        for name in set(registry) - set(BUILT_IN_TASKS):
            registry.pop(name)


def _expanded(word: str) -> list[str]:
    """Do what a shell does with a word that has a star in it."""
    return sorted(map(str, Path().glob(word))) if "*" in word else [word]


def _another_program(step: Step, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Do what a line says that begins with another word; return what is wrong with it."""
    program, *words = step.words
    if program == "make":
        return "" if {word for word in words if "=" not in word} <= set(MAKE) else f"{step}: no such target"
    if program == "export":
        name, _, value = words[0].partition("=")
        monkeypatch.setenv(name, str(ROOT / value))
        return ""
    if program == "pip":
        install(ROOT / words[-1], folder / "site")
        return ""
    module = words[words.index("-m") + 1].replace(".", "/")
    return "" if (ROOT / f"{module}.py").exists() else f"{step}: no such module"
