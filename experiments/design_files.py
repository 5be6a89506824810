"""Designs of the experiments: presets by name, files by path."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, cast

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.session import TASKS, Design
from evenlight.data_schema.recordings.sweep import DESIGN_OF_SWEEP, SweepDesign
from evenlight.data_schema.storage.text_files import read_toml_record

DESIGNS = Path(__file__).parent / "designs"
SUFFIX = ".design.toml"


def load_design(name_or_path: str) -> RampDesign:
    """Return the ramp design of a preset (`paper`, `recommended`, ...) or of a toml file.

    Raises
    ------
    InputError
        If there is neither a preset nor a file of that name, or the file is no design of a ramp.

    >>> load_design("recommended").procedure.value
    'two_interval'
    """
    return cast(RampDesign, load_task_design("ramp", name_or_path))


def load_task_design(task: str, name_or_path: str | None) -> Design:
    """Return the design of a preset, or of a toml file, for a task, None for its default; errors as there.

    >>> load_task_design("search", "paper").ring_gap
    10.0
    """
    cls = TASKS[task].design
    return cast(Design, cls() if name_or_path is None else _load(cls, task, name_or_path))


def _load(cls: type[Any], task: str, name_or_path: str) -> Any:
    """Return the design of a preset, or of a toml file, for a task or sweep."""
    known = design_names(task)
    if name_or_path in known:
        return read_toml_record(cls, DESIGNS / f"{name_or_path}{_suffix(task)}")
    path = Path(name_or_path)
    if not path.exists():
        hint = difflib.get_close_matches(name_or_path, known, n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        preset = f"a preset ({', '.join(known)}) or " if known else ""
        raise InputError(f"{name_or_path}: no such design; {guess}give {preset}a toml file")
    return read_toml_record(cls, path)


def load_sweep_design(task: str, name_or_path: str) -> SweepDesign:
    """Return the design of a preset, or of a toml file, for a sweep; errors as `load_design`.

    >>> load_sweep_design("power-sweep", "quick").repeats
    3
    """
    return cast(SweepDesign, _load(DESIGN_OF_SWEEP[task], task, name_or_path))


def design_names(task: str = "ramp") -> list[str]:
    """Return the names of the presets of a task.

    >>> design_names("search")
    ['paper', 'quick']
    """
    suffix = _suffix(task)
    names = (path.name.removesuffix(suffix) for path in DESIGNS.glob(f"*{suffix}"))
    return sorted(name for name in names if "." not in name)


def _suffix(task: str) -> str:
    """Return how the names of a task's designs end; those of ramps have no task in them."""
    return SUFFIX if task == "ramp" else f".{task}{SUFFIX}"
