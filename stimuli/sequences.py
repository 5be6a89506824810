"""The built-in sequences by name; a new one gets a line in the table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from data_schema.errors import InputError
from stimuli.checkerboard import Checkerboard
from stimuli.sequence_format import SequenceFormat
from stimuli.sunrise import Sunrise
from stimuli.video_source import VideoSource


class BuiltInSequence(VideoSource, Protocol):
    """A video that is rendered in a format of choice."""

    @property
    def format(self) -> SequenceFormat:
        """Size, length and rate."""


# How each is made, and the format it has if nothing else is asked for.
SEQUENCES: dict[str, tuple[Callable[[SequenceFormat], BuiltInSequence], SequenceFormat]] = {
    "checkerboard": (Checkerboard, SequenceFormat(duration=20.0)),
    "sunrise": (Sunrise, SequenceFormat(duration=40.0)),
}


def built_in_sequence(
    name: str,
    size: tuple[int, int] | None = None,
    duration: float | None = None,
    frames_per_second: float | None = None,
) -> BuiltInSequence:
    """Return a built-in sequence.

    Parameters
    ----------
    name : str
        Its name in `SEQUENCES`.
    size : (int, int), optional
        Width and height [pixels].
    duration, frames_per_second : float, optional
        Length [s] and frame rate [Hz].

    Raises
    ------
    InputError
        If there is no such sequence, or it cannot be rendered in that format.

    >>> built_in_sequence("checkerboard", duration=2.0).n_frames
    50
    """
    if name not in SEQUENCES:
        raise InputError(f"no built-in sequence {name!r}: there are {', '.join(SEQUENCES)}")
    make, standard = SEQUENCES[name]
    width, height = size or (standard.width, standard.height)
    seconds = standard.duration if duration is None else duration
    rate = standard.frames_per_second if frames_per_second is None else frames_per_second
    try:
        return make(SequenceFormat(width, height, seconds, rate))
    except ValueError as error:
        raise InputError(f"cannot render {name}: {error}") from error
