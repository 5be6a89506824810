"""The paper's checkerboards: white tiles that turn to black through the grays (section 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.sequence_format import BuiltInSequence, on_grid

VERSION = 1  # to be raised when the pictures change
# Three boards side by side: share of the width they end at, and tiles on the height.
BOARDS = ((0.375, 6), (0.75, 12), (1.0, 24))


@dataclass(frozen=True, slots=True)
class Checkerboard(BuiltInSequence):
    """Checkerboards of three tile sizes, whose white tiles fade to black.

    The pixel value of the white tiles falls at a constant rate, from 1 in the first frame to 0 in the last:
    even steps of gray, as they look, not even steps of light.
    """

    @property
    def name(self) -> str:
        """Short name for titles."""
        return "checkerboard"

    def sha256(self) -> str:
        """Return the SHA-256 of the sequence's definition."""
        return sha256_of_bytes(f"checkerboard {VERSION} {self.format!r}".encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order."""
        white = white_tiles(self.format.width, self.format.height)
        for k, (time, duration) in enumerate(self.format.times()):
            gray = on_grid(1 - k / (self.n_frames - 1))
            pixels = np.where(white, gray, np.uint16(0))
            yield Frame(time, duration, np.repeat(pixels[..., np.newaxis], 3, axis=-1))


def white_tiles(width: int, height: int) -> NDArray[np.bool_]:
    """Return where the white tiles lie, as an array (height, width)."""
    rows = np.arange(height)[:, np.newaxis]
    columns = np.arange(width)[np.newaxis, :]
    white = np.zeros((height, width), dtype=np.bool_)
    start = 0
    for share, tiles in BOARDS:
        end = round(share * width)
        board = (rows * tiles // height + (columns[:, start:end] - start) * tiles // height) % 2 == 0
        white[:, start:end] = board
        start = end
    return white
