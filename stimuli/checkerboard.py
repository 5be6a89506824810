"""The paper's checkerboards: white tiles that turn to black through the grays (section 4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.sequence_format import SequenceFormat, on_grid

VERSION = 1  # to be raised when the pictures change
# Three boards side by side: share of the width they end at, and tiles on the height.
BOARDS = ((0.375, 6), (0.75, 12), (1.0, 24))


@dataclass(frozen=True, slots=True)
class Checkerboard:
    """Checkerboards of three tile sizes, whose white tiles fade to black.

    The pixel value of the white tiles falls at a constant rate, from 1 in the first frame to 0 in the last:
    even steps of gray, as they look, not even steps of light.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate.
    """

    format: SequenceFormat = field(default_factory=SequenceFormat)

    @property
    def name(self) -> str:
        """Short name for titles."""
        return "checkerboard"

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return self.format.n_frames

    @property
    def field_of_view(self) -> float:
        """Angle that the width is to span for the viewer [deg]."""
        return self.format.field_of_view

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
