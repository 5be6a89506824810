"""Writes the files beside it: what set-up installs, with the SHA-256 of all that an index has of a version.

`python requirements/lock.py`, where `uv` is, after a change of pyproject.toml or constraints.txt. It takes
the versions of constraints.txt, for Python 3.11 to 3.14, on Linux, Windows, macOS; the newest of the rest.
pip refuses hashes in a file of constraints where it installs a folder: hence these files.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

FOLDER = Path(__file__).parent
PROJECT = ("pyproject.toml",)
# What a file is of, and the files whose lines it leaves out. The first installs the others, and builds what
# has no wheel; a pip from 24.1 to 25.3 fails where PsychoPy asks for macOS 20 on Linux 6.1.0-13-amd64.
FILES = {
    "build": ((), ()),
    "base": (PROJECT, ("build",)),
    "docs": ((*PROJECT, "--extra", "docs"), ("build", "base")),
    "dev": ((*PROJECT, "--extra", "dev"), ("build", "base", "docs")),
    "lab": ((*PROJECT, "--extra", "lab"), ("build", "base")),
}


def locked(asked: tuple[str, ...]) -> list[str]:
    """Return the lines of each package that is needed: pin, marker, hashes."""
    command = ["uv", "pip", "compile", "-", *asked, "--constraints", "constraints.txt", "--universal"]
    command += ["--python-version", "3.11", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"]
    found = subprocess.run(
        command,
        cwd=FOLDER.parent,
        input="pip>=26\nsetuptools>=77",
        capture_output=True,
        text=True,
        check=True,
    )
    return re.split(r"^(?=\w)", found.stdout, flags=re.MULTILINE)[1:]


if __name__ == "__main__":
    wanted = {name: locked(asked) for name, (asked, _) in FILES.items()}
    for name, (_, before) in FILES.items():
        there = {text for earlier in before for text in wanted[earlier]}
        (FOLDER / f"{name}.txt").write_text("".join(text for text in wanted[name] if text not in there))
