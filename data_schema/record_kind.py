"""What is known of a kind of file: which record it holds, how the record lies in it, and who writes it."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any


class FileFormat(enum.Enum):
    """How a record lies in a file."""

    TOML = "toml"
    JSON = "json"
    JSON_LINES = "jsonl"  # one record per line
    CSV = "csv"  # one record per row
    NPZ = "npz"  # arrays


@dataclass(frozen=True, slots=True)
class RecordKind:
    """A record that is a file, or a line or row of one.

    Attributes
    ----------
    name : str
        Its name; `schemas/<name>.json` is its JSON Schema.
    record : type
        Its class.
    file_format : FileFormat
        How it lies in a file.
    file_names : tuple of str
        Patterns of the names that such a file has.
    origin : str
        What writes the file.
    """

    name: str
    record: type[Any]
    file_format: FileFormat
    file_names: tuple[str, ...]
    origin: str

    @property
    def words(self) -> str:
        """Its name in words."""
        return self.name.replace("_", " ")
