"""A folder of results that a later run may replace as a whole, known by a seal: its SHA-256 beside it."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.files import write_whole
from evenlight.data_schema.provenance import sha256_of_file

SEAL = ".sha256"


def seal(folder: Path) -> None:
    """Write the SHA-256 of a folder beside it: `NAME.sha256`."""
    write_whole(_seal_of(folder), sha256_of_file(folder) + "\n")


def require_sealed(folder: Path, maker: str) -> None:
    """Raise `InputError` if a folder that is to be replaced holds what its maker did not make, or is changed.

    Parameters
    ----------
    folder : Path
        Which would be replaced; it need not be there.
    maker : str
        What makes such folders, for the message.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    beside = _seal_of(folder)
    if not beside.is_file() or beside.read_text(errors="replace").strip() != sha256_of_file(folder):
        raise InputError(
            f"{folder} holds data that no {maker} made, or that were changed since; "
            f"choose another folder with --out"
        )


def _seal_of(folder: Path) -> Path:
    """Return the file that holds the seal of a folder."""
    return folder.with_name(folder.name + SEAL)
