"""What set-up compiles is all that a first command needs, and never what other source was."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import event

import evenlight
from evenlight.compile_kernels import compile_kernels
from evenlight.method import compiled_loop

LOOPS = "from evenlight.method.compiled_loop import compiled_loop\n"
OUTER = "from tiny_inner import FACTOR, raised\n@compiled_loop()\ndef outer(x): return FACTOR * raised(x)\n"
ROOMS = [Path(evenlight.__file__).parent / room for room in ("method", "stimuli", "analysis")]


@pytest.mark.slow
def test_after_set_up_nothing_is_left_to_compile() -> None:
    @numba.njit
    def fresh(x: float) -> float:
        return x + 1.0

    compile_kernels()
    noise = np.random.default_rng(2).integers(0, 255, (4, 240, 320, 3), dtype=np.uint8)
    with event.install_recorder("numba:compile") as recorder:
        for frames in (noise, noise.astype(np.uint16), noise / 255):
            evenlight.optimize(frames, 0.6, calm=0.05)
        evenlight.frame_loss(noise[0], [0.3, 0.7])
        assert not recorder.buffer
        fresh(1.0)
        assert recorder.buffer


def test_set_up_compiles() -> None:
    script = (Path(evenlight.__file__).parents[1] / "setup.sh").read_text()
    assert script.index("pip install") < script.index(".venv/bin/python -m evenlight.compile_kernels")


@pytest.mark.parametrize(
    ("changed", "to", "expected"), [("x + 1", "x + 5", 22), ("FACTOR = 2", "FACTOR = 3", 21)]
)
def test_a_loop_is_compiled_again_when_what_it_uses_in_another_file_has_changed(
    changed: str, to: str, expected: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def outcome(inner: str) -> int:
        """Of 6, in modules that are imported as by another process."""
        (tmp_path / "tiny_inner.py").write_text(inner)
        (tmp_path / "tiny_outer.py").write_text(LOOPS + OUTER)
        for name in ("tiny_inner", "tiny_outer"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        importlib.invalidate_caches()
        compiled_loop._sources_sha256.cache_clear()
        return int(importlib.import_module("tiny_outer").outer(6))

    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    inner = LOOPS + "FACTOR = 2\n@compiled_loop()\ndef raised(x): return x + 1\n"
    assert outcome(inner) == 14
    with event.install_recorder("numba:compile") as recorder:
        assert outcome(inner) == 14
    assert not recorder.buffer
    assert outcome(inner.replace(changed, to)) == expected


def loops() -> Iterator[tuple[Path, ast.Module, ast.FunctionDef]]:
    """All functions that are compiled, with their file."""
    for file in (file for room in ROOMS for file in room.resolve().rglob("*.py")):
        if "@compiled" in (text := file.read_text()) or "njit" in text:
            tree = ast.parse(text)
            for node in tree.body:
                if isinstance(node, ast.FunctionDef) and node.decorator_list:
                    decorators = ast.unparse(node.decorator_list[0])
                    assert "njit" not in decorators, file
                    if decorators.startswith("compiled"):
                        yield file, tree, node


def test_loops_use_nothing_of_other_folders() -> None:
    """They would not be compiled again when that changes."""
    seen = 0
    for file, tree, loop in loops():
        seen += 1
        used = {node.id for part in loop.body for node in ast.walk(part) if isinstance(node, ast.Name)}
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("evenlight."):
                foreign = used & {alias.asname or alias.name for alias in node.names}
                folder = str(node.module).split(".")[-2]
                assert not foreign or folder == file.parent.name, (file, loop.name, foreign)
    assert seen > 50
