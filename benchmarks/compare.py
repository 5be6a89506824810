"""What takes longer than in a stored run of the benchmarks: two of their pages, row by row."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.chart import UNITS
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import read_text

SLOWER = 1.15  # times as long; two runs of the same differ by less where nothing else runs
MEASURED = ("time", "runs", "ratio", "error", "memory", "note")  # columns; the others say of what
Row = tuple[float, float]  # time [s], and its ratio; NaN where there is none, or it is to a default of ours


def read_page(path: Path) -> str:
    """Return a stored page; raise `InputError` if it holds no times."""
    text = read_text(path, "a page of `evenlight bench`")
    if not dict(_rows(text)):
        raise InputError(f"{path}: holds no times; expected a page benchmarks.md of `evenlight bench`")
    return text


def slower_rows(page: str, stored: str) -> list[str]:
    """Return in lines what was compared, and what takes more than 15 % longer in a page than in a stored one.

    On the machine of the stored page that is each time. On another it is each ratio to what is not ours:
    FFmpeg's decoding takes part in both runs.
    """
    now, then, same = dict(_rows(page)), dict(_rows(stored)), _machine(page) == _machine(stored)
    both = {key: np.divide(now[key], then[key])[0 if same else 1] for key in now if key in then}
    pairs = {key: ratio for key, ratio in both.items() if ratio > 0}
    if not pairs:
        raise InputError("the stored page has no row that can be compared with these; make it anew")
    found = [f"{': '.join(key)}: {ratio:.2f} times" for key, ratio in pairs.items() if ratio > SLOWER]
    what = "times, on the same machine" if same else "ratios to FFmpeg's decoding, on another machine"
    return [
        f"compared {len(pairs)} of {len(then)} {what}; {len(found)} more than 15 % above the stored",
        *found,
    ]


def _machine(page: str) -> list[str]:
    lines: list[str] = re.findall("^Machine: .*", page, re.MULTILINE)
    return [re.sub("system: .*?;", "", line) for line in lines]  # whatever its kernel


def _rows(page: str) -> Iterator[tuple[tuple[str, ...], Row]]:
    """Yield the rows of a page with a time, each with its task, approach and size."""
    for part in re.split("^###? ", page, flags=re.MULTILINE)[1:]:
        task, _, rest = part.partition("\n")
        table = [re.split(r" *(?<!\\)\| *", line)[1:-1] for line in rest.splitlines() if line.startswith("|")]
        is_ours = any(row[0].startswith("**") for row in table)
        for cells in table[2:]:
            row = dict(zip(table[0], cells, strict=True))
            number, _, unit = row.get("time", "").partition(" ")
            if unit in UNITS:
                of = tuple(cell for name, cell in row.items() if name not in MEASURED)
                ratio = np.nan if is_ours else float(row.get("ratio") or np.nan)
                yield (task, *of), (float(number) * UNITS[unit], ratio)
