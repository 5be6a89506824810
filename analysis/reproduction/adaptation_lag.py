"""How far the cones' response lags behind the picture, under three ways to dim it (Section 4.4).

The luminance of each frame is kept at a few pixels while the video streams past.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.adaptation import adapting
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS, dimmed_luminance, linear_channels
from evenlight.method.optimizer.optimize import Problem, Solver, optimize

DECADES = (-6, 0)  # of the histogram; smaller differences, none included, count in its lowest bin
BINS_PER_DECADE = 10
LARGE = 0.01  # a difference to count; the static response to a display lies between 0.02 and 0.12
NO_LIMIT = 1e9  # [cd/m^2/s] the sun's luminance within a second: no step of a display comes near
Map = NDArray[np.float32]


@dataclass(slots=True)
class LuminanceMaps:
    """Means of the luminance at factor 1 over blocks of pixels, frame by frame.

    Attributes
    ----------
    display : Display
        The display that shows the video; channels are linearized, then weighed to luminance.
    width : int
        Blocks across; as many down as make them nearly square, and no more than there are pixels.
    durations : list of float
        How long each frame is shown [s].
    emitted : list of array, (h, w)
        I of each frame, reflected light excluded [cd/m^2].

    >>> maps = LuminanceMaps(Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0), width=2)
    >>> white = Frame(0.0, 0.04, np.full((9, 18, 3), 255, np.uint8))
    >>> _ = list(maps.watch([white]))
    >>> maps.luminance.round(4).tolist()
    [[[100.0, 100.0]]]
    """

    display: Display
    width: int = 48
    durations: list[float] = field(default_factory=list)
    emitted: list[Map] = field(default_factory=list)
    _table: NDArray[Any] = field(default_factory=lambda: np.empty(0), repr=False)

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames unchanged, keeping the luminance of each."""
        for frame in frames:
            self.durations.append(frame.duration)
            self.emitted.append(self._reduced(frame.pixel_values))
            yield frame

    @property
    def luminance(self) -> Map:
        """I of all frames, (N, h, w) [cd/m^2]."""
        return np.stack(self.emitted)

    def _reduced(self, pixel_values: NDArray[Any]) -> Map:
        """Return the means of a frame's blocks; blocks of linear values, so that the mean is the light's."""
        height, width = pixel_values.shape[:2]
        across = min(self.width, width)
        down = min(max(round(across * height / width), 1), height)
        linear = self._linear(pixel_values) @ np.array(LUMINANCE_WEIGHTS)
        blocks = block_means(linear, (down, across))
        span = self.display.peak_luminance - self.display.black_level
        return (blocks * span + self.display.black_level).astype(np.float32)

    def _linear(self, pixel_values: NDArray[Any]) -> NDArray[Any]:
        """Return linear channels in [0, 1]; of integers by a table, which takes a tenth of the time."""
        if not np.issubdtype(pixel_values.dtype, np.integer):
            return linear_channels(pixel_values, self.display.gamma)
        codes = np.iinfo(pixel_values.dtype).max + 1
        if len(self._table) != codes:
            self._table = linear_channels(np.arange(codes, dtype=pixel_values.dtype), self.display.gamma)
        return np.asarray(self._table[pixel_values])


def block_means(values: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Return the means of an image over a grid of blocks, as equal in size as whole pixels allow.

    Parameters
    ----------
    values : array, (..., height, width)
        The image, or several.
    shape : (h, w)
        Blocks down and across, at most as many as there are pixels.

    >>> block_means(np.arange(6.0).reshape(2, 3), (1, 3)).tolist()
    [[1.5, 2.5, 3.5]]
    """
    for axis, count in ((-2, shape[0]), (-1, shape[1])):
        edges = np.arange(count + 1) * values.shape[axis] // count
        sums = np.add.reduceat(values, edges[:-1], axis=axis, dtype=np.float64)
        values = sums / np.expand_dims(np.diff(edges), -1 if axis == -2 else 0)
    return values


def seen_luminance(emitted: NDArray[Any], factors: NDArray[np.float64], display: Display) -> Map:
    """Return L = b · I + L_refl of each frame and block [cd/m^2].

    Parameters
    ----------
    emitted, factors : array, (N, ...), array, (N,)
        I [cd/m^2], and b of each frame.
    display : Display
        For L_refl.
    """
    factor = np.asarray(factors).reshape(-1, *(1,) * (emitted.ndim - 1))
    return dimmed_luminance(emitted, factor, display).astype(np.float32)


class DimmingCondition(enum.Enum):
    """How a sequence is dimmed to its mean brightness factor."""

    CONSTANT = "constant dimming"
    CONSTRAINED = "within the rate limit"
    UNCONSTRAINED = "without a rate limit"


class ConeInput(enum.Enum):
    """Where the cones are."""

    PIXEL = "per pixel"  # the eye rests on the display: each pixel keeps its cones
    FRAME_MEAN = "frame mean"  # the eye wanders: all cones see the mean


@dataclass(frozen=True, slots=True)
class AdaptationInput:
    """A sequence of N frames, and three tracks of brightness factors for it.

    Attributes
    ----------
    name, budget : str, float
        Of the sequence, and the mean brightness factor that the tracks were made for.
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
        for dimming in DimmingCondition:
            if len(self.factors(dimming)) != len(self.maps.emitted):
                raise InputError(
                    f"{self.name}, {dimming.value}: expected a factor for each of "
                    f"{len(self.maps.emitted)} frames, got {len(self.factors(dimming))}"
                )
        if not self.maps.emitted:
            raise InputError(f"{self.name}: expected at least one frame, got none")

    def factors(self, dimming: DimmingCondition) -> Array:
        """Return the factors of a way to dim."""
        tracks = (self.constant, self.constrained, self.unconstrained)
        return dict(zip(DimmingCondition, tracks, strict=True))[dimming]


@dataclass(frozen=True, slots=True)
class ResponseDifferences:
    """|static - dynamic response| over the time and the pixels of a sequence.

    Attributes
    ----------
    integral, mean : float
        Integral over time, mean of the pixels [s]; and mean over time and pixels, in [0, 1].
    root_mean_square, largest : float
        Over time and pixels, which counts what is large more; and of any pixel at any moment.
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


def differences(luminance: NDArray[np.floating], durations: NDArray[np.floating]) -> ResponseDifferences:
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
    return ResponseDifferences(
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
    sequence: AdaptationInput, dimming: DimmingCondition, place: ConeInput, coarser: int = 1
) -> ResponseDifferences:
    """Return the differences of a sequence under a way to dim it.

    Parameters
    ----------
    sequence, dimming, place : AdaptationInput, DimmingCondition, ConeInput
        The sequence, which of its tracks, and where the cones are.
    coarser : int
        By how much fewer blocks across and down than the maps have.
    """
    maps = sequence.maps
    emitted = maps.luminance
    _, high, wide = emitted.shape
    shape = (max(high // coarser, 1), max(wide // coarser, 1))
    blocks = block_means(emitted, (1, 1) if place is ConeInput.FRAME_MEAN else shape)
    return differences(
        seen_luminance(blocks, sequence.factors(dimming), maps.display), np.array(maps.durations)
    )


def adaptation_input(
    problem: Problem, factors: NDArray[np.float64], maps: LuminanceMaps, solver: Solver
) -> AdaptationInput:
    """Return a sequence with its track, with the one that no rate limit binds, and with constant dimming.

    Parameters
    ----------
    problem, solver : Problem, Solver
        What was solved; solves the same problem without a rate limit.
    factors, maps : array, (N,), LuminanceMaps
        b of the track within the rate limit, and the luminance of the same frames.
    """
    free = replace(problem, rate_limit=lambda luminance: np.full_like(luminance, NO_LIMIT))
    return AdaptationInput(
        name=problem.curves.video,
        budget=problem.baseline_factor,
        maps=maps,
        constrained=factors,
        unconstrained=optimize(free, solver).factors,
        constant=problem.baseline(),
    )
