"""Tables as they are shared: one name per participant in all of them, so that they join; no empty cells.

In a data set itself a table of trials has `01` and empty cells, as the trials do, and the list of
participants `sub-01`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_writing import MISSING
from evenlight.data_schema.storage.text_files import read_json, read_text


def shared_table(path: Path) -> list[list[str]]:
    """Return the lines of a table from its header on, with `sub-01` for `01` and `n/a` for an empty cell.

    Parameters
    ----------
    path : Path
        A table with tabs: of trials or of participants.

    Raises
    ------
    InputError
        If it cannot be read, or a line has not as many cells as the first.
    """
    header, *rows = [line.split("\t") for line in read_text(path, "a table").rstrip("\n").split("\n")]
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise InputError(f"{path}, line {number}: expected {len(header)} cells, got {len(row)}")
        for place, (name, cell) in enumerate(zip(header, row, strict=True)):
            shared = f"sub-{cell.removeprefix('sub-')}" if name == "participant_id" else cell
            row[place] = shared if shared.strip() else MISSING
    return [header, *rows]


def shared_descriptions(path: Path) -> dict[str, Any]:
    """Return the descriptions of a table's columns; a level that was an empty cell is `n/a`."""
    content: dict[str, Any] = read_json(path, "a description of columns")
    for entry in content.values() if isinstance(content, dict) else ():
        if isinstance(entry, dict) and isinstance(entry.get("Levels"), dict):
            entry["Levels"] = {level or MISSING: words for level, words in entry["Levels"].items()}
    return content
