"""Designs of the experiments: presets by name, ours and those of installed packages; files by path."""

from __future__ import annotations

import dataclasses
import difflib
import sys
from importlib import metadata, resources
from pathlib import Path
from typing import Any, cast

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.session import TASKS, Design
from evenlight.data_schema.recordings.sweep import DESIGN_OF_SWEEP, SweepDesign
from evenlight.data_schema.storage.text_files import read_toml_record

GROUP = "evenlight.designs"  # of entry points, each a package with designs beside its modules
DESIGNS = Path(__file__).parent / "designs"
SUFFIX = ".design.toml"
DEFAULT = "paper"
MOST = 10_000  # trials, repeats, rounds
SHORTEST, LONGEST = 0.001, 86_400.0  # [s] of what takes any time at all


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
    """Return the design of a preset, or of a toml file, for a task; errors as there.

    None stands for the preset `paper` or, where a task has none, for its design without any change.

    >>> load_task_design("search", "paper").ring_gap
    10.0
    """
    cls, presets = TASKS[task].design, _presets(task)
    if name_or_path is None and DEFAULT not in presets:
        return cast(Design, cls())
    return cast(Design, _load(cls, presets, name_or_path or DEFAULT))


def _load(cls: type[Any], presets: dict[str, Path], name_or_path: str) -> Any:
    known = sorted(presets)
    if name_or_path in known:
        return _within_reason(read_toml_record(cls, presets[name_or_path]), name_or_path)
    path = Path(name_or_path)
    if not path.exists():
        hint = difflib.get_close_matches(name_or_path, known, n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        preset = f"a preset ({', '.join(known)}) or " if known else ""
        raise InputError(f"{name_or_path}: no such design; {guess}give {preset}a toml file")
    return _within_reason(read_toml_record(cls, path), name_or_path)


def _within_reason(design: Any, name: str) -> Any:
    """Return a design; refuse counts and times of which a session would never end, or not fit into memory."""
    for field in dataclasses.fields(design):
        value = getattr(design, field.name)
        for number in value if isinstance(value, tuple) else (value,):
            if type(number) is int and number > MOST:
                raise InputError(f"{name}: {file_key(field)} must be at most {MOST}, got {number}")
            if field.metadata.get("unit") == "s" and number and not SHORTEST <= number <= LONGEST:
                raise InputError(
                    f"{name}: {file_key(field)} must lie in {SHORTEST:g} to {LONGEST:g} s, got {number:g}"
                )
    return design


def load_sweep_design(task: str, name_or_path: str) -> SweepDesign:
    """Return the design of a preset, or of a toml file, for a sweep; errors as `load_design`.

    >>> load_sweep_design("power-sweep", "quick").repeats
    3
    """
    return cast(SweepDesign, _load(DESIGN_OF_SWEEP[task], _presets(task), name_or_path))


def design_names(task: str = "ramp") -> list[str]:
    """Return the names of the presets of a task.

    >>> {"paper", "quick"} <= set(design_names("search"))
    True
    """
    return sorted(_presets(task))


def _presets(task: str) -> dict[str, Path]:
    """Return the files of the presets of a task, by name; designs that cannot be used are told of."""
    suffix = _suffix(task)
    presets: dict[str, Path] = {}
    for owner, paths in {"": sorted(DESIGNS.iterdir()), **_designs_of_packages()}.items():
        for path in paths:
            name = path.name.removesuffix(suffix)
            if not path.name.endswith(suffix) or "." in name:
                continue
            if name in presets:
                _tell(f"{owner}: its design {path} has the name of {presets[name]}; rename it")
            presets.setdefault(name, path)
    return presets


def _designs_of_packages() -> dict[str, list[Path]]:
    """Return the designs that installed packages name, by what messages call their owners."""
    designs = {}
    for entry in metadata.entry_points(group=GROUP):
        owner = f"the installed package {entry.dist.name if entry.dist else 'of no name'}"
        try:  # a folder without __init__.py lists its files too, but has no path of its own
            paths = [Path(str(each)) for each in resources.files(entry.value).iterdir()]
        except Exception as error:
            _tell(f"{owner}: its designs {entry.name!r} cannot be loaded: {type(error).__name__}: {error}")
            continue
        designs[f"{owner}, {entry.name}"] = sorted(paths)
        if not any(path.name.endswith(SUFFIX) for path in paths):
            _tell(f"{owner}: its designs {entry.name!r}: {entry.value} holds no file *{SUFFIX}")
    return designs


def _tell(words: str) -> None:
    """Say what is wrong with a package; what needs nothing of it goes on."""
    print(f"evenlight: note: {words}", file=sys.stderr)


def _suffix(task: str) -> str:
    """Return how the names of a task's designs end; those of ramps have no task in them."""
    return SUFFIX if task == "ramp" else f".{task}{SUFFIX}"
