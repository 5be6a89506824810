"""A video of frames that a program hands over, and what a program may mean by a video."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arguments import positive
from evenlight.data_schema.errors import ArgumentError, InputError, shown_kind
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.method.contrast.loss_curves import SMALLEST_SIDE
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import FramesInALoop, VideoSource

Named = str | PathLike[str]
Frames = Iterable[Frame] | Iterable[NDArray[Any]]
FRAMES_PER_SECOND = 25.0


def frame_of(pixel_values: Any, duration: float = 1.0) -> Frame:
    """Return the frame of an array, large enough for two frequency bands."""
    if isinstance(pixel_values, Frame):
        frame = pixel_values
    else:
        try:
            frame = Frame(0.0, duration, _array_of(pixel_values))
        except ValueError as error:
            raise InputError(str(error).replace("the frame at 0 s needs", "a frame needs")) from None
    shape = frame.pixels.shape
    if min(shape[:2]) < SMALLEST_SIDE:
        raise InputError(f"a frame needs at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels, got {shape}")
    return frame


def _array_of(pixel_values: Any) -> NDArray[Any]:
    """Return the array of any library, from a graphics card too (DLPack)."""
    try:
        return np.asarray(pixel_values)
    except (TypeError, RuntimeError):  # of a library that copies from its device only when told so
        if not hasattr(pixel_values, "__dlpack__"):
            raise
        return np.from_dlpack(pixel_values, device="cpu", copy=True)


def video_of(
    given: Named | VideoSource | Frames,
    fps: float | None = None,
    argument: str = "video",
    damaged: Damaged | str = "refuse",
    stream: int | None = None,
) -> VideoSource:
    """Return a video: of a path or built-in name, a source that is one already, or frames in memory."""
    if isinstance(given, str | PathLike):
        return open_video(given, fps, damaged, stream)
    if isinstance(given, VideoSource):
        return given
    if getattr(given, "ndim", None) in (2, 3):
        shape = tuple(getattr(given, "shape", ()))
        raise ArgumentError(argument, f"is one frame of shape {shape}; give a list of frames")
    if not isinstance(given, Iterable) or isinstance(given, bytes):
        kind = shown_kind(given)
        raise ArgumentError(argument, f"must be a path, a built-in sequence's name or frames, got {kind}")
    return FramesInMemory(given, FRAMES_PER_SECOND if fps is None else fps)


class FramesInMemory(FramesInALoop):
    """A video of frames that a program hands over.

    Parameters
    ----------
    frames : iterable of array, (height, width, 3), or of Frame
        Arrays are gamma-encoded R, G, B: uint8 or uint16 over their full range, floats in [0, 1]. An iterator
        is read once, few frames in memory at a time.
    fps : float
        Frame rate of arrays [Hz]; a `Frame` has a time and a duration of its own.
    """

    name = "frames"

    def __init__(self, frames: Frames, fps: float) -> None:
        self._frames, self._rate = frames, positive("fps", fps)
        self.n_frames = len(frames) if isinstance(frames, Sequence | np.ndarray) else None
        self._begun = False

    def frames(self) -> Iterator[Frame]:
        """Yield the frames; of an iterator only once."""
        if self.n_frames is None and self._begun:
            raise InputError("the frames of an iterator can be read once; give a list or a new iterator")
        self._begun = True
        for number, frame in enumerate(self._frames):
            if isinstance(frame, Frame):
                yield frame
                continue
            try:
                pixels = frame_of(frame).pixel_values
            except InputError as error:
                raise InputError(f"frame {number}: {error}") from None
            yield Frame(number / self._rate, 1 / self._rate, pixels)

    def sha256(self) -> str:
        """Return the SHA-256 of times and pixel values; "unknown" of an iterator, which is read once."""
        if self.n_frames is None:
            return "unknown"
        digest = hashlib.sha256()
        for frame in self.frames():
            pixels = np.ascontiguousarray(frame.pixel_values)
            digest.update(f"{frame.time!r} {frame.duration!r} {pixels.shape} {pixels.dtype}".encode())
            digest.update(pixels.tobytes())
        return digest.hexdigest()
