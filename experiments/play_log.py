"""The log of what was played: a row for each refresh of the display, as csv or jsonl."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.files import write_whole
from evenlight.data_schema.text_files import csv_text
from evenlight.experiments.stage import ShownClip

COLUMNS = (
    "pass",
    "version",
    "refresh",
    "flip_time_s",
    "refreshes_dropped",
    "video_frame",
    "factor",
    "backlight_factor",
)
SUFFIXES = (".csv", ".jsonl")


@dataclass(frozen=True, slots=True)
class Pass:
    """One time through a video.

    Attributes
    ----------
    shown : ShownClip
        What the display showed.
    versions : tuple of str
        How each refresh was dimmed: ours, baseline or full.
    """

    shown: ShownClip
    versions: tuple[str, ...]


def require_log_file(path: Path) -> None:
    """Refuse a log that is neither csv nor jsonl."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"--log {path}: give a file that ends in .csv or .jsonl")


def write_log(path: Path, passes: Sequence[Pass], refresh_rate: float) -> None:
    """Write the log of some passes on a display of some refresh rate [Hz].

    `refreshes_dropped` counts those that passed without a new frame right before a refresh.
    """
    rows = [row for number, one in enumerate(passes, start=1) for row in _rows(number, one, refresh_rate)]
    if path.suffix == ".csv":
        write_whole(path, csv_text(COLUMNS, [["" if cell is None else cell for cell in row] for row in rows]))
    else:
        lines = (json.dumps(dict(zip(COLUMNS, row, strict=True))) for row in rows)
        write_whole(path, "".join(f"{line}\n" for line in lines))


def _rows(number: int, one: Pass, refresh_rate: float) -> Iterator[list[Any]]:
    """Yield the rows of a pass."""
    shown = one.shown
    steps = np.diff(shown.flip_times, prepend=-1 / refresh_rate)
    dropped = np.maximum(np.rint(steps * refresh_rate).astype(int) - 1, 0).tolist()
    backlight: Sequence[float | None] = shown.backlight_factors or [None] * len(dropped)
    columns = (one.versions, shown.flip_times, dropped, shown.video_frames, shown.factors, backlight)
    for refresh, (version, time, missed, frame, factor, reported) in enumerate(zip(*columns, strict=True)):
        yield [number, version, refresh, time, missed, frame, factor, reported]
