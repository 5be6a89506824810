"""How far the cones' response lags behind the picture, under three ways to dim it (Section 4.4)."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.reproduction.luminance_maps import LuminanceMaps, block_means, seen_luminance
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.method.adaptation import adapting

DECADES = (-6, 0)  # of the histogram; smaller differences, none included, count in its lowest bin
BINS_PER_DECADE = 10
LARGE = 0.01  # a difference to count; the static response to a display lies between 0.02 and 0.12


class Dimming(enum.Enum):
    """How a sequence is dimmed to its mean brightness factor."""

    CONSTANT = "constant dimming"
    CONSTRAINED = "within the rate limit"
    UNCONSTRAINED = "without a rate limit"


class Place(enum.Enum):
    """Where the cones are."""

    PIXEL = "per pixel"  # the eye rests on the display: each pixel keeps its cones
    FRAME_MEAN = "frame mean"  # the eye wanders: all cones see the mean


@dataclass(frozen=True, slots=True)
class AdaptationInput:
    """A sequence of N frames, and three tracks of brightness factors for it.

    Attributes
    ----------
    name : str
        Name of the sequence.
    budget : float
        Mean brightness factor that the tracks were made for.
    maps : LuminanceMaps
        Its luminance at factor 1.
    constrained, unconstrained, constant : array, (N,)
        Factors of the track within the rate limit, of the one without, and of constant dimming.
    """

    name: str
    budget: float
    maps: LuminanceMaps
    constrained: Array
    unconstrained: Array
    constant: Array

    def __post_init__(self) -> None:
        for dimming in Dimming:
            if len(self.factors(dimming)) != len(self.maps.emitted):
                raise InputError(
                    f"{self.name}, {dimming.value}: expected a factor for each of "
                    f"{len(self.maps.emitted)} frames, got {len(self.factors(dimming))}"
                )
        if not self.maps.emitted:
            raise InputError(f"{self.name}: expected at least one frame, got none")

    def factors(self, dimming: Dimming) -> Array:
        """Return the factors of a way to dim."""
        tracks = (self.constant, self.constrained, self.unconstrained)
        return dict(zip(Dimming, tracks, strict=True))[dimming]


@dataclass(frozen=True, slots=True)
class Differences:
    """|static - dynamic response| over the time and the pixels of a sequence.

    Attributes
    ----------
    integral : float
        Integral over time, mean of the pixels [s].
    mean : float
        Mean over time and pixels, in [0, 1].
    root_mean_square : float
        Over time and pixels: it counts what is large more.
    largest : float
        Of any pixel at any moment.
    large : float
        Share of the time, mean of the pixels, in which it is above `LARGE`.
    shares : array, (bins,)
        Share of time and pixels in each bin of `bin_edges()`.
    n_frames, n_pixels : int
        What it rests on.
    """

    integral: float
    mean: float
    root_mean_square: float
    largest: float
    large: float
    shares: Array
    n_frames: int
    n_pixels: int


def bin_edges() -> Array:
    """Return the edges of the histogram, (bins + 1,)."""
    return np.logspace(*DECADES, (DECADES[1] - DECADES[0]) * BINS_PER_DECADE + 1)


def differences(luminance: NDArray[np.floating], durations: NDArray[np.floating]) -> Differences:
    """Return the differences of the responses to a video, integrated exactly over time.

    Parameters
    ----------
    luminance : array, (N, h, w)
        L of each frame and pixel [cd/m^2].
    durations : array, (N,)
        How long each frame is shown [s].

    >>> differences(np.full((2, 1, 1), 50.0), np.full(2, 0.04)).integral
    0.0
    """
    bins = (DECADES[1] - DECADES[0]) * BINS_PER_DECADE
    time_in_bin = np.zeros(bins)
    first = second = large = largest = 0.0
    for parts, weights in adapting(luminance, np.asarray(durations, dtype=np.float64)):
        flat = parts.reshape(len(weights), -1)
        share = weights / flat.shape[1]
        first += float(share @ flat.sum(axis=1))
        second += float(share @ (flat**2).sum(axis=1))
        large += float(share @ (flat > LARGE).sum(axis=1))
        largest = max(largest, float(flat.max()))
        time_in_bin += np.bincount(_bins(flat).ravel(), np.repeat(share, flat.shape[1]), minlength=bins)
    duration = float(np.sum(durations))
    return Differences(
        integral=first, mean=first / duration, root_mean_square=math.sqrt(second / duration),
        largest=largest, large=large / duration, shares=time_in_bin / duration,
        n_frames=len(luminance), n_pixels=int(np.prod(luminance.shape[1:])),
    )  # fmt: skip


def _bins(values: Array) -> NDArray[np.intp]:
    """Return the bin that each value belongs to."""
    low, high = DECADES
    logs = np.log10(np.maximum(values, 10.0**low))
    bins: NDArray[np.intp] = ((logs - low) * BINS_PER_DECADE).astype(np.intp)
    return np.minimum(bins, (high - low) * BINS_PER_DECADE - 1)


def differences_of(
    sequence: AdaptationInput, dimming: Dimming, place: Place, coarser: int = 1
) -> Differences:
    """Return the differences of a sequence under a way to dim it.

    Parameters
    ----------
    sequence : AdaptationInput
        The sequence, and its tracks.
    dimming : Dimming
        Which track.
    place : Place
        Where the cones are.
    coarser : int
        By how much fewer blocks across and down than the maps have.
    """
    maps = sequence.maps
    emitted = maps.luminance
    _, high, wide = emitted.shape
    shape = (max(high // coarser, 1), max(wide // coarser, 1))
    blocks = block_means(emitted, (1, 1) if place is Place.FRAME_MEAN else shape)
    return differences(
        seen_luminance(blocks, sequence.factors(dimming), maps.display), np.array(maps.durations)
    )
