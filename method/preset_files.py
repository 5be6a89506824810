"""Displays, power models, rate limits and contrast models: presets by name, files by path."""

from __future__ import annotations

import difflib
import os
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import OF_DEVICE, Display
from evenlight.data_schema.errors import ArgumentError, InputError, shown_kind
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.text_files import read_json_record, read_toml_record
from evenlight.data_schema.tracks.loss_curves import read_curves_header
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.detectability import limit_at_share
from evenlight.method.rate_limit import require_known, require_same_display

PRESETS = Path(__file__).parent / "presets"
DEFAULT_DISPLAY = "varjo-xr3"  # where none is given and nothing carries one

Record = TypeVar("Record")


def load_display(named: str | PathLike[str] | Display) -> Display:
    """Return the display of a preset (`varjo-xr3`), a toml file or a folder of `fit`; a display as it is.

    Raises
    ------
    InputError
        If there is neither a preset nor a file of that name, or the file is no display.

    >>> load_display("varjo-xr3").peak_luminance
    104.4
    """
    return _load(named, Display, "display", "toml")


def display_for(
    limit: RateLimit, given: str | PathLike[str] | Display | None = None, curves: Path | None = None
) -> Display:
    """Return the display that is given; else that of loss curves or a rate limit, else `varjo-xr3`.

    Parameters
    ----------
    limit : RateLimit
        A limit of an earlier version carries none.
    given : str, path or Display, optional
        As in `load_display`.
    curves : Path, optional
        Loss curves of an earlier run, which count before the rate limit.

    Raises
    ------
    InputError
        As `load_display`, or if the file holds no loss curves.

    >>> display_for(load_rate_limit("surace2025")).name
    'varjo-xr3'
    """
    if given is not None:
        return load_display(given)
    if curves is not None:
        return whole_device(read_curves_header(curves).display)
    return whole_device(limit.display or load_display(DEFAULT_DISPLAY))


def whole_device(display: Display) -> Display:
    """Return a display; one of an earlier version's file with what the preset of its name and light knows."""
    if display.device or display.name not in preset_names("display"):
        return display
    preset = load_display(display.name)
    if preset.fingerprint != display.fingerprint:
        return display
    return replace(display, **{name: getattr(preset, name) for name in OF_DEVICE})


def power_model_for(
    display: Display, given: str | PathLike[str] | PowerModel | None = None, needed_for: str = ""
) -> PowerModel | None:
    """Return the power model that is given, else that of a display; None if none is known.

    Raises
    ------
    InputError
        As `load_power_model`; or if none is known, and something needs one.

    >>> power_model_for(load_display("varjo-xr3")).name, power_model_for(load_display("laptop-lcd"))
    ('surace2025', None)
    """
    named = (display.power_model or None) if given is None else given
    if named is None and needed_for:
        raise InputError(f"{needed_for}: {no_power_model(display.name)}; give it as `power_model`")
    return None if named is None else load_power_model(named)


def no_power_model(display: str) -> str:
    """Return that none is known of a display, and how to get one."""
    return f"no power model for {display} (`evenlight run power-sweep` measures one)"


def load_power_model(named: str | PathLike[str] | PowerModel) -> PowerModel:
    """Return the power model of a preset (`surace2025`), toml file or folder of `fit`, as `load_display`."""
    return _load(named, PowerModel, "power", "toml")


def load_rate_limit(named: str | PathLike[str] | RateLimit) -> RateLimit:
    """Return the rate limit of a preset (`surace2025`), json file or folder of `fit`, as `load_display`."""
    return _load(named, RateLimit, "rate_limit", "json")


def usable_limit(
    limit: RateLimit,
    display: Display,
    other_display_ok: bool = False,
    accept_wide_band: bool = False,
    noticed: float | None = None,
) -> RateLimit:
    """Return a rate limit, if it was fitted on a display and is known well enough.

    Parameters
    ----------
    limit, display : RateLimit, Display
        The limit, and the display that it is used for.
    other_display_ok : bool
        Whether to accept one that was fitted on another display.
    accept_wide_band : bool
        Whether to accept one whose band is too wide for use.
    noticed : float, optional
        Share of detections that it is moved to where it is used (`limit_at_share`): its band counts there.

    Raises
    ------
    InputError
        If it was fitted on another display, its band is too wide, or the share is none.

    >>> usable_limit(load_rate_limit("surace2025"), load_display("varjo-xr3")).name
    'surace2025'
    """
    if not other_display_ok:
        require_same_display(limit, display)
    require_known(limit if noticed is None else limit_at_share(limit, noticed), accept_wide_band)
    return limit


def load_contrast_model(named: str | PathLike[str] | ContrastModel) -> ContrastModel:
    """Return the contrast model of a measure or preset (`default`, `as-printed`) or of a toml file.

    >>> load_contrast_model("relative") == load_contrast_model("default")
    True
    """
    if isinstance(named, str) and named in MEASURES:
        return MEASURES[named]
    return _load(named, ContrastModel, "contrast_model", "toml")


def preset_names(kind: str) -> list[str]:
    """Return the names of the presets of a kind ("display", "power", "rate_limit", "contrast_model")."""
    files = {path.name.split(".")[0] for path in PRESETS.glob(f"*.{kind}.*")}
    return sorted(files.union(MEASURES if kind == "contrast_model" else ()))


def _load(named: Any, cls: type[Record], kind: str, suffix: str) -> Record:
    if isinstance(named, cls):
        return named
    words = "power model" if kind == "power" else kind.replace("_", " ")
    if not isinstance(named, str | PathLike):
        argument, got = words.replace(" ", "_"), shown_kind(named)
        raise ArgumentError(argument, f"must be a preset's name, a path or a {cls.__name__}, got {got}")
    name, known = os.fspath(named), preset_names(kind)
    path = PRESETS / f"{name}.{kind}.{suffix}" if name in known else Path(name)
    if path.is_dir() and (path / f"{kind}.{suffix}").is_file():
        path /= f"{kind}.{suffix}"  # a folder of `evenlight fit`
    if not path.exists():
        hint = difflib.get_close_matches(name, known, n=1)
        guess = f"did you mean {hint[0]!r}? " if hint else ""
        raise InputError(
            f"{name}: no such {words}; {guess}give a preset ({', '.join(known)}) or a {suffix} file"
        )
    return read_json_record(cls, path) if suffix == "json" else read_toml_record(cls, path)
