"""The rig file: a preset by its name, or a toml file."""

from __future__ import annotations

import dataclasses
import difflib
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.storage.text_files import read_toml_record

RIGS = Path(__file__).parent / "rigs"
TABLE = "csv:"  # a table of readings in place of a luminance meter


def load_rig(name_or_path: str) -> tuple[Rig, str]:
    """Return the rig of a preset (`simulated`) or of a toml file, and its display.

    Parameters
    ----------
    name_or_path : str
        A preset, or a toml file.

    Returns
    -------
    rig : Rig
        The rig, as the file has it.
    display : str
        Its display, to be loaded: a preset's name, or a path, which a rig gives relative to its own file.
        The rig's `backlight_curve`, and a table in place of a luminance meter, are paths from there, too, and
        are returned as ones from here.

    Raises
    ------
    InputError
        If there is neither a preset nor a file of that name, or the file is no rig.

    >>> rig, display = load_rig("simulated")
    >>> rig.refresh_rate, display
    (60.0, 'varjo-xr3')
    """
    path = _rig_file(name_or_path)
    rig = read_toml_record(Rig, path)
    if rig.backlight_curve:
        rig = dataclasses.replace(rig, backlight_curve=str(path.parent / rig.backlight_curve))
    if rig.luminance_meter.startswith(TABLE):
        table = path.parent / rig.luminance_meter.removeprefix(TABLE)
        rig = dataclasses.replace(rig, luminance_meter=f"{TABLE}{table}")
    is_file = rig.display.endswith(".toml") or "/" in rig.display
    return rig, str(path.parent / rig.display) if is_file else rig.display


def rig_names() -> list[str]:
    """Return the names of the rigs that come with Evenlight.

    >>> rig_names()
    ['desk', 'headset', 'simulated', 'simulated-headset']
    """
    return sorted(path.name.split(".")[0] for path in RIGS.glob("*.rig.toml"))


def _rig_file(name_or_path: str) -> Path:
    if name_or_path in rig_names():
        return RIGS / f"{name_or_path}.rig.toml"
    path = Path(name_or_path)
    if not path.exists():
        hint = difflib.get_close_matches(name_or_path, rig_names(), n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        raise InputError(
            f"{name_or_path}: no such rig; {guess}give a preset ({', '.join(rig_names())}) or a toml file, "
            "which `evenlight new rig desk.rig.toml` writes for you to fill in"
        )
    return path
