"""What the public functions take: a preset's name, a file's path or a record; a video or frames."""

from __future__ import annotations

import enum
import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from numbers import Integral, Real
from os import PathLike, fspath
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.loss_curves import LossCurves, require_possible_curves
from evenlight.method.contrast.loss_curves import SMALLEST_SIDE
from evenlight.method.preset_files import (
    display_for,
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
)
from evenlight.stimuli.dimming_options import MIN_FACTORS as MIN_FACTORS
from evenlight.stimuli.sequence_format import NARROWEST, WIDEST
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import VideoSource

Named = str | PathLike[str]
Frames = Iterable[Frame] | Iterable[NDArray[Any]]
FRAMES_PER_SECOND = 25.0
Record = TypeVar("Record")
Choice = TypeVar("Choice", bound=enum.Enum)


def display_of(given: Named | Display | None, limit: RateLimit | None = None) -> Display:
    """Return the display of a preset, of a file, or the record itself; if none, that of a rate limit."""
    if given is None and limit is not None:
        return display_for(limit)
    return _record_of("display", given, Display, load_display)


def power_model_of(given: Named | PowerModel) -> PowerModel:
    """Return the power model of a preset, of a file, or the record itself."""
    return _record_of("power_model", given, PowerModel, load_power_model)


def contrast_model_of(given: Named | ContrastModel) -> ContrastModel:
    """Return the contrast model of a preset, of a file, or the record itself."""
    return _record_of("contrast_model", given, ContrastModel, load_contrast_model)


def rate_limit_of(given: Named | RateLimit) -> RateLimit:
    """Return the rate limit of a preset, of a file, or the record itself."""
    return _record_of("rate_limit", given, RateLimit, load_rate_limit)


def _record_of(name: str, given: Any, cls: type[Record], load: Callable[[str], Record]) -> Record:
    """Return a record, or the one that a name or path stands for."""
    if isinstance(given, cls):
        return given
    if not isinstance(given, str | PathLike):
        kind = type(given).__name__
        raise InputError(f"{name} must be a preset's name, a path or a {cls.__name__}, got a {kind}")
    return load(fspath(given))


def require_own(curves: LossCurves, contrast_model: Any, **given: Any) -> None:
    """Refuse arguments that loss curves were made with already, and curves that cannot be."""
    require_possible_curves(curves)
    own = {"display": (None, curves.display), "min_factor": (0.2, float(curves.factors[0]))}
    if names := ", ".join(name for name, value in given.items() if value not in own.get(name, (None,))):
        raise InputError(f"{names}: loss curves were made with their own; leave this out beside them")
    made_with = curves.provenance.inputs.get("contrast_model")
    if made_with not in (None, sha256_of_record(contrast_model_of(contrast_model))):
        raise InputError("contrast_model is not the one that the loss curves were made with; name that one")


def choice(name: str, value: Any, of: type[Choice]) -> Choice:
    """Return the member of an enum that an argument names."""
    try:
        return of(value)
    except ValueError:
        known = ", ".join(str(member.value) for member in of)
        raise InputError(f"{name} must be one of {known}, got {value!r}") from None


def number(name: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """Return the number that an argument holds, if it lies within its limits."""
    if isinstance(value, bool) or not isinstance(value, Real) or math.isnan(value):
        raise InputError(f"{name} must be a number, got {value!r}")
    if not low <= float(value) <= high:
        raise InputError(f"{name} must lie in {low:g} to {high:g}, got {float(value):.15g}")
    return float(value)


def field_of_view_in(given: Any) -> float | None:
    """Return the angle that an argument `field_of_view` holds [deg], None if it is not given."""
    return None if given is None else number("field_of_view", given, NARROWEST, WIDEST)


def positive(name: str, value: Any) -> float:
    """Return the number that an argument holds, if it is finite and above 0."""
    if not 0 < number(name, value) < math.inf:
        raise InputError(f"{name} must be above 0, got {value!r}")
    return float(value)


def whole(name: str, value: Any) -> int:
    """Return the whole number that an argument holds, if it is not below 0."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise InputError(f"{name} must be a whole number from 0 on, got {value!r}")
    return int(value)


def frame_of(pixel_values: Any, duration: float = 1.0) -> Frame:
    """Return the frame of an array, large enough for two frequency bands."""
    if isinstance(pixel_values, Frame):
        frame = pixel_values
    else:
        try:
            frame = Frame(0.0, duration, np.asarray(pixel_values))
        except ValueError as error:
            raise InputError(str(error).replace("the frame at 0 s needs", "a frame needs")) from None
    shape = frame.pixel_values.shape
    if min(shape[:2]) < SMALLEST_SIDE:
        raise InputError(f"a frame needs at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels, got {shape}")
    return frame


def video_of(given: Named | VideoSource | Frames, fps: float | None = None) -> VideoSource:
    """Return a video: of a path or built-in name, a source that is one already, or frames in memory."""
    if isinstance(given, str | PathLike):
        return open_video(fspath(given), fps)
    if isinstance(given, VideoSource):
        return given
    if isinstance(given, np.ndarray) and given.ndim == 3:
        raise InputError(f"video is one frame of shape {given.shape}; give a list of frames")
    if not isinstance(given, Iterable):
        kind = type(given).__name__
        raise InputError(f"video must be a path, a built-in sequence's name or frames, got a {kind}")
    return FramesInMemory(given, FRAMES_PER_SECOND if fps is None else fps)


class FramesInMemory:
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
