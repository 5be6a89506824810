"""Tables of workbooks (.xlsx, .xls, .ods) and of statistics programs (.sav, .dta), as texts of cells.

The libraries that read them run in a process of their own: some damaged files end the process, and a cell far
off asks for more memory than there is.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError

# How each kind begins; a workbook is a zip archive, or one of Microsoft's older compound files.
_BEGINNINGS = {
    b"PK\x03\x04": "a workbook",
    b"\xd0\xcf\x11\xe0": "a workbook",
    b"$FL2": "SPSS",
    b"$FL3": "SPSS",
    b"<stata_dta>": "Stata",
}
_OLD_STATA = re.compile(rb"[\x66-\x73][\x01\x02]")  # its version, and the order of its bytes; until 2013
_LIBRARIES = {"a workbook": "python_calamine", "SPSS": "pyreadstat", "Stata": "pyreadstat"}
MOST_MEMORY = 8 << 30  # [bytes]
LONGEST = 300.0  # [s]


def binary_kind(content: bytes) -> str | None:
    """Return what a file of such a table is, by its first bytes; None for any other file."""
    kinds = (kind for beginning, kind in _BEGINNINGS.items() if content.startswith(beginning))
    return "Stata" if _OLD_STATA.match(content) else next(kinds, None)


def read_binary_table(path: Path, kind: str, sheet: str = "") -> dict[str, Any]:
    """Return `kind`, `rows` (number and cells), `names`, `labels` and `title` of a file's table.

    Of a workbook it is the first sheet that is not empty, or that of a name, without the last three, but with
    `others`, its other sheets. Whole
    numbers are texts without a point, dates and times as ISO 8601 writes them; what is missing, also by a
    user's definition, is empty.

    Raises
    ------
    InputError
        If the file is damaged or protected, has no such sheet, or what reads it is not installed.
    """
    if importlib.util.find_spec(_LIBRARIES[kind]) is None:
        raise InputError(
            f"{path}: {kind} needs an extra: pip install 'evenlight[tables]'; or save the table as CSV"
        )
    try:
        # It finds modules where this process does, and none in the current folder (-P), maybe of strangers.
        command = [sys.executable, "-P", "-m", __name__, str(path), kind, sheet]
        paths = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        done = subprocess.run(command, env=paths, capture_output=True, timeout=LONGEST, check=True)
        found: dict[str, Any] = json.loads(done.stdout)
    except (subprocess.SubprocessError, ValueError):
        raise InputError(f"{path}: cannot be read as {kind}; is it damaged, or protected?") from None
    if "sheets" in found:
        raise InputError(f"{path}: no sheet {sheet!r}; its sheets are {', '.join(found['sheets'])}")
    return found


def _workbook(path: str, sheet: str) -> dict[str, Any]:
    import python_calamine

    book = python_calamine.CalamineWorkbook.from_path(path)
    if sheet and sheet not in book.sheet_names:
        return {"sheets": book.sheet_names}
    rows: list[tuple[int, list[str]]] = []
    for name in [sheet] if sheet else book.sheet_names:
        cells = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
        texts = (list(map(cell_text, row)) for row in cells)
        rows = [(number, row) for number, row in enumerate(texts, start=1) if any(row)]
        if rows and len(book.sheet_names) > 1:
            others = [each for each in book.sheet_names if each != name]
            return {"kind": f"workbook, sheet {name!r}", "rows": rows, "others": others}
    return {"kind": "workbook", "rows": rows}


def _statistics_file(path: str, kind: str) -> dict[str, Any]:
    import pyreadstat

    read: Callable[..., Any] = pyreadstat.read_sav if kind == "SPSS" else pyreadstat.read_dta
    columns, told = read(path, output_format="dict")
    rows = [list(map(cell_text, row)) for row in zip(*columns.values(), strict=True)]
    labels = {
        name: {cell_text(value): str(label) for value, label in meant.items()}
        for name, meant in told.variable_value_labels.items()
    }
    names = [str(name) for name in columns]
    found = {"kind": kind, "rows": list(enumerate(rows, start=1)), "names": names, "labels": labels}
    return found | {"title": told.file_label or ""}


def cell_text(value: Any) -> str:
    """Return what a cell holds as a text of CSV.

    >>> [cell_text(value) for value in (3.0, 0.25, True, None, float("nan"))]
    ['3', '0.25', 'true', '', '']
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return value.isoformat().removesuffix("T00:00:00") if hasattr(value, "isoformat") else str(value)


if __name__ == "__main__":
    if sys.platform != "win32":
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[1]
        within = MOST_MEMORY if most == resource.RLIM_INFINITY else min(MOST_MEMORY, most)
        resource.setrlimit(resource.RLIMIT_AS, (within, most))
    file, of, named = sys.argv[1:]
    json.dump(_workbook(file, named) if of == "a workbook" else _statistics_file(file, of), sys.stdout)
