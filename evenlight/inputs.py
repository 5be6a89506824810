"""What the public functions take: a preset's name, a file's path or a record; a video or frames."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.method.preset_files import (
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
)
from evenlight.method.rate_limit import require_same_display
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import VideoSource

Named = str | PathLike[str]
Frames = Iterable[Frame] | Iterable[NDArray[Any]]
FRAMES_PER_SECOND = 25.0


def display_of(given: Named | Display) -> Display:
    """Return the display of a preset, of a file, or the record itself."""
    return given if isinstance(given, Display) else load_display(fspath(given))


def power_model_of(given: Named | PowerModel) -> PowerModel:
    """Return the power model of a preset, of a file, or the record itself."""
    return given if isinstance(given, PowerModel) else load_power_model(fspath(given))


def contrast_model_of(given: Named | ContrastModel) -> ContrastModel:
    """Return the contrast model of a preset, of a file, or the record itself."""
    return given if isinstance(given, ContrastModel) else load_contrast_model(fspath(given))


def rate_limit_of(given: Named | RateLimit, display: Display, other_display_ok: bool = False) -> RateLimit:
    """Return the rate limit of a preset, of a file, or the record itself, if it holds for a display."""
    limit = given if isinstance(given, RateLimit) else load_rate_limit(fspath(given))
    if not other_display_ok:
        require_same_display(limit, display)
    return limit


def video_of(given: Named | VideoSource | Frames, frames_per_second: float | None = None) -> VideoSource:
    """Return a video: of a path or built-in name, a source that is one already, or frames in memory."""
    if isinstance(given, str | PathLike):
        return open_video(fspath(given), frames_per_second)
    if isinstance(given, VideoSource):
        return given
    return FramesInMemory(given, FRAMES_PER_SECOND if frames_per_second is None else frames_per_second)


class FramesInMemory:
    """A video of frames that a program hands over.

    Parameters
    ----------
    frames : iterable of array, (height, width, 3), or of Frame
        Arrays are gamma-encoded R, G, B: uint8 or uint16 over their full range, floats in [0, 1]. An iterator
        is read once, few frames in memory at a time.
    frames_per_second : float
        Frame rate of arrays [Hz]; a `Frame` has a time and a duration of its own.
    """

    name = "frames"

    def __init__(self, frames: Frames, frames_per_second: float) -> None:
        if not frames_per_second > 0:
            raise InputError(f"frames_per_second must be above 0 Hz, got {frames_per_second:g}")
        self._frames, self._rate = frames, frames_per_second
        self.n_frames = len(frames) if isinstance(frames, Sequence | np.ndarray) else None
        self._begun = False

    def frames(self) -> Iterator[Frame]:
        """Yield the frames; of an iterator only once."""
        if self.n_frames is None and self._begun:
            raise InputError("the frames of an iterator can be read once; give a list, or an iterator anew")
        self._begun = True
        for number, frame in enumerate(self._frames):
            if isinstance(frame, Frame):
                yield frame
                continue
            try:
                yield Frame(number / self._rate, 1 / self._rate, np.asarray(frame))
            except ValueError as error:
                raise InputError(f"frame {number}: {error}") from error

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
