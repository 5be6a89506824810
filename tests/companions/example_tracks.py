"""A brightness track: a test changes what it is about."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit, TrackHeader
from evenlight.data_schema.tracks.film_reading import FilmReading

HEADER = TrackHeader("v", "d", "f", "p", "r", 0.5, BudgetUnit.FACTOR, "splitting", Provenance())


def header_of(display: Display, /, **changed: Any) -> TrackHeader:
    """Return the header of a track for a display, which it names; it holds none unless one is given."""
    of_display = {"display_name": display.name, "display_fingerprint": display.fingerprint}
    return replace(HEADER, film=FilmReading(), **of_display, **changed)


def example_track(
    factors: ArrayLike, hz: float = 25.0, header: TrackHeader = HEADER, **columns: ArrayLike
) -> BrightnessTrack:
    """Return a track of N factors at a frame rate; columns, (N,) or numbers, are 0 where none are given."""
    b = np.asarray(factors, dtype=float)
    names = ("contrast_loss", "mean_luminance", "rate", "rate_limit", "power")
    rest = {name: np.broadcast_to(columns.pop(name, 0.0), b.shape) for name in names}
    times = columns.pop("times", np.arange(b.size) / hz)
    return BrightnessTrack(times, b, **rest, **columns, header=header)
