"""Designs of the ramp experiment: presets by name, files by path."""

from __future__ import annotations

import difflib
from pathlib import Path

from data_schema.errors import InputError
from data_schema.ramp import RampDesign
from data_schema.text_files import read_toml_record

DESIGNS = Path(__file__).parent / "designs"
SUFFIX = ".design.toml"


def load_design(name_or_path: str) -> RampDesign:
    """Return the design of a preset (`paper`, `recommended`, ...) or of a toml file.

    Raises
    ------
    InputError
        If there is neither a preset nor a file of that name, or the file is no design.

    >>> load_design("recommended").procedure.value
    'two_interval'
    """
    known = design_names()
    if name_or_path in known:
        return read_toml_record(RampDesign, DESIGNS / f"{name_or_path}{SUFFIX}")
    path = Path(name_or_path)
    if not path.exists():
        hint = difflib.get_close_matches(name_or_path, known, n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        raise InputError(
            f"{name_or_path}: no such design; {guess}give a preset ({', '.join(known)}) or a toml file"
        )
    return read_toml_record(RampDesign, path)


def design_names() -> list[str]:
    """Return the names of the presets."""
    return sorted(path.name.removesuffix(SUFFIX) for path in DESIGNS.glob(f"*{SUFFIX}"))
