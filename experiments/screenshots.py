"""Pictures of the screens of a session, as they were drawn."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from evenlight.hardware.protocols import Window


class Screenshots:
    """Takes one picture of each kind of screen.

    Parameters
    ----------
    folder : Path or None
        Where the pictures go; None to take none.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._taken: set[str] = set()
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def take(self, window: Window, kind: str, text: str = "") -> None:
        """Save what is drawn, before its flip, unless there is one of this kind and text already."""
        name = "-".join([kind, *re.findall(r"\w+", text.strip().partition("\n")[0].lower())[:6]])
        if self._folder is None or name in self._taken:
            return
        from PIL import Image

        codes = window.read_codes() * 255 / ((1 << window.bits()) - 1)
        Image.fromarray(np.rint(codes).astype(np.uint8)).save(self._folder / f"{name}.png")
        self._taken.add(name)
