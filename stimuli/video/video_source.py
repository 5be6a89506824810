"""A video, as the model and the player see it."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator
from typing import Protocol, runtime_checkable

from evenlight.data_schema.frame import Frame


@runtime_checkable
class VideoSource(Protocol):
    """A video, as the model and the player see it."""

    @property
    def name(self) -> str:
        """Short name for titles."""

    @property
    def n_frames(self) -> int | None:
        """How many frames it has, None if that is not known beforehand."""

    def frames(self) -> Iterator[Frame]:
        """Yield its frames in order, one at a time, from the first one on at every call.

        A frame's pixel values are the reader's until the next frame is asked for: a source may fill the same
        array again, and who keeps pixel values for longer copies them.
        """

    def sha256(self) -> str:
        """Return the SHA-256 of its content: of the file, of the folder, or of the sequence's definition."""


def size_of(video: VideoSource) -> tuple[int, int]:
    """Return width and height of a video [pixels], those of its first frame."""
    frames = video.frames()
    with contextlib.closing(frames) if isinstance(frames, Generator) else contextlib.nullcontext():
        height, width, _ = next(frames).pixel_values.shape
    return width, height
