"""Stretches of frames that one scale serves: programs that take commands or events need fewer of them."""

from __future__ import annotations

from typing import NamedTuple

from evenlight.data_schema.tracks.exported_track import ExportedTrack
from evenlight.stimuli.dimmed.dimming import pixel_scale

TOLERANCE = 1 / 2040  # an eighth of white's 8-bit code value


class Stretch(NamedTuple):
    """Frames `first` to `last`, both included, whose pixel values take one scale."""

    first: int
    last: int
    scale: float  # b^(1/γ)


def stretches_of(track: ExportedTrack, tolerance: float = TOLERANCE) -> list[Stretch]:
    """Return the longest stretches from the first frame on in which one scale is right within a tolerance.

    Parameters
    ----------
    track : ExportedTrack
        Factors and γ.
    tolerance : float
        How far the scale may be off: as a share of white's pixel value.
    """
    scales = pixel_scale(track.factors, track.gamma).tolist()
    found, first, low, high = [], 0, scales[0], scales[0]
    for frame, scale in enumerate(scales):
        lower, higher = min(low, scale), max(high, scale)
        if higher - lower > 2 * tolerance:
            found.append(Stretch(first, frame - 1, (low + high) / 2))
            first, low, high = frame, scale, scale
        else:
            low, high = lower, higher
    return [*found, Stretch(first, len(scales) - 1, (low + high) / 2)]
