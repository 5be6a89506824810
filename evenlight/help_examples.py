"""The examples at the end of each `--help`: two for each command, as they are typed, and what they do.

They stand in `help_examples.txt`, one a line, and use files that a reader has: `film.mp4`, `desk.rig.toml`,
and what earlier examples of the documents made (`film-track`, `lab`, `calibration`,
`study`). The tests run them.
"""

from __future__ import annotations

from pathlib import Path

GROUPS = ("new", "track", "measure")  # of commands


def _examples() -> dict[str, list[str]]:
    """Return the first two lines that begin with the words of each command; "" stands for all of them."""
    examples: dict[str, list[str]] = {}
    for line in Path(__file__).with_name("help_examples.txt").read_text(encoding="utf-8").splitlines():
        words = line.split()[1:3]
        for depth in (0, 1, 2) if words[0] in GROUPS else (0, 1):
            examples.setdefault(" ".join(words[:depth]), []).append(line)
    return {words: lines[:2] for words, lines in examples.items()}


EXAMPLES = _examples()
