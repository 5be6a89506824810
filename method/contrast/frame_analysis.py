"""The analysis of one frame: its contrast loss at all brightness factors, in one pass over its pixels.

It can be done in parts, band by band: the finest bands hold most of the pixels but change least from frame to
frame, so that `contrast.frame_losses` need not count them in every one. Frames are large, and fresh memory
can cost more than the work done on it, so `SpareArrays` are filled again and again.
"""

from __future__ import annotations

import threading
from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import Any, Protocol

import numba
import numpy as np
from numpy.typing import DTypeLike, NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Pixels
from evenlight.method.contrast.band_shares import BandShares
from evenlight.method.contrast.contrast_loss import loss_of, visible_contrast
from evenlight.method.contrast.critical_factor import TABLE_STEPS, BandTable, band_tables, tables_hold
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.one_pass import compiled, reduced
from evenlight.method.contrast.pyramid import level_shapes

_FINE_BANDS = 2  # bands that may be taken from other frames, at most: with 94 % of all pixels
MANY_PIXELS = 65536  # in a smaller band, single pixels make the count unsteady, and there is little to save
# The least contrast seen among equal neighbours, in units of the threshold: t^0.7 = 1 + t^0.2 at t = 3.2.
_AMONG_EQUALS = 3.2
_STEPS = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # of g, around what is just visible
_BELOW_PEAK = 0.1  # share of the peak luminance at which sensitivity is taken for these thresholds
_Kind = tuple[tuple[int, ...], np.dtype[Any]]  # shape and type of an array


@dataclass(frozen=True, slots=True)
class FrameLoss:
    """What the analysis of a frame gives: a row of `LossCurves`."""

    loss: Array  # (K,): 𝓛_c at each knot
    visible_contrast: float  # C_v of the undimmed frame
    mean_luminance: float  # Ī, mean luminance emitted at b = 1 [cd/m^2]
    channel_means: Array  # (3,): means of the linear R, G, B channels
    counted: float = 1.0  # share of the frame's pixels, over all bands, that were counted


class FrameAnalyzer(Protocol):
    """Gives the contrast loss of frames of one size."""

    def of(self, pixels: Pixels) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""


@dataclass(slots=True)
class FrameCounts:
    """A frame whose finest bands may not have been counted yet."""

    mean_luminance: float  # Ī, mean luminance emitted at b = 1 [cd/m^2]
    channel_means: Array  # (3,): means of the linear R, G, B channels
    # (bands, K): share of visible pixels of each band at each knot; nan where a band has not been counted
    shares: Array
    counted: float = 1.0  # share of the frame's pixels, over all bands, that were counted
    differences: tuple[Array, ...] = ()  # `difference_shares` of each fine band: signs of change
    # (height, width): I [cd/m^2]; None once no band is left to be counted
    luminance: NDArray[np.float32] | None = None


class FrameAnalysis:
    """Tables for frames of one size on one display, and the analysis of a frame with them.

    Parameters
    ----------
    shape : (height, width)
        Of the frames.
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    table_steps : int
        Of the tables of each band's sensitivity.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        factors: Array,
        table_steps: int = TABLE_STEPS,
    ) -> None:
        self._display, self._model, self._factors = display, model, factors
        self._bands = band_tables(shape, float(factors[0]), display, model, table_steps)
        self._band_shares = BandShares(model, factors, self._bands)
        self._spare, self._frame_bytes = SpareArrays(), 4 * shape[0] * shape[1]
        self._light = FrameLight(display, model.pixel_to_luminance, self._spare.take)
        sizes = zip(self._bands, level_shapes(shape), strict=False)
        self._pixels = [height * width * band.can_be_seen for band, (height, width) in sizes]
        self.fine_bands = self._fine_bands()
        self._differences = [difference_thresholds(self._bands[band]) for band in self.fine_bands]

    def _fine_bands(self) -> range:
        """Return the bands that may be taken from other frames: the finest visible ones, but small ones."""
        if not self.in_one_pass or not any(self._pixels):
            return range(0)
        first = next(k for k, pixels in enumerate(self._pixels) if pixels > 0)
        finest = self._pixels[first : first + _FINE_BANDS]
        return range(first, first + sum(pixels > MANY_PIXELS for pixels in finest))

    @property
    def held_bytes(self) -> int:
        """Memory that a frame takes while its fine bands are still to be counted."""
        return self._frame_bytes

    @property
    def in_one_pass(self) -> bool:
        """Whether one pass gives the curve; otherwise each knot is computed by definition.

        It does not where reflected light meets a sensitivity taken at another luminance than the pixel's.
        """
        return tables_hold(self._display, self._model)

    def of(self, pixels: Pixels) -> FrameLoss:
        """Return the loss curve and the means of a frame, (height, width, 3) gamma-encoded."""
        luminance, means = self._light.luminance_and_means(pixels)
        mean = float(luminance.mean(dtype=np.float64))
        if self.in_one_pass:
            shares = self._shares([luminance, reduced(luminance)], later=range(0))
        else:
            shares = self._by_definition(luminance)
        self._spare.give_back(luminance)
        return self.loss_of(FrameCounts(mean, means, shares))

    def begin(self, pixels: Pixels) -> FrameCounts:
        """Count all bands of a frame but the fine ones; there must be some."""
        luminance, means = self._light.luminance_and_means(pixels)
        mean = float(luminance.mean(dtype=np.float64))
        levels, later = [luminance, reduced(luminance)], self.fine_bands
        shares = self._shares(levels, later)
        finest = levels[later.start : later.stop]
        pairs = zip(finest, self._differences, strict=True)
        differences = tuple(difference_shares(level, steps) for level, steps in pairs)
        return FrameCounts(mean, means, shares, 1 - self._share_of_pixels(later), differences, luminance)

    def count(self, counts: FrameCounts, band: int) -> None:
        """Count a fine band that was left for later."""
        fine: Any = counts.luminance
        for _ in range(band):  # cheaper than to hold it, and the memory that takes
            fine = reduced(fine)
        coarse = reduced(fine)
        counts.shares[band] = self._band_shares.of(fine, coarse, reduced(coarse), band)
        counts.counted = min(1.0, counts.counted + self._share_of_pixels(range(band, band + 1)))

    def complete(self, counts: FrameCounts) -> FrameCounts:
        """Count what is left of a frame, and return it."""
        for band in self.fine_bands:
            if np.isnan(counts.shares[band, 0]):
                self.count(counts, band)
        self.release(counts)
        return counts

    def release(self, counts: FrameCounts) -> None:
        """Let go of a frame's luminance: no band is left to be counted."""
        if counts.luminance is not None:
            self._spare.give_back(counts.luminance)
            counts.luminance = None

    def loss_of(self, counts: FrameCounts) -> FrameLoss:
        """Return the loss curve of a frame all of whose bands have been counted."""
        visible = np.zeros(len(self._factors))
        for share in counts.shares:
            visible += share
        visible /= len(counts.shares)
        reference = float(visible[-1])
        loss = np.array([loss_of(float(C_v), reference, self._model.loss) for C_v in visible])
        return FrameLoss(loss, reference, counts.mean_luminance, counts.channel_means, counts.counted)

    def _share_of_pixels(self, bands: range) -> float:
        """Return the share that some bands have in the pixels of all."""
        return sum(self._pixels[band] for band in bands) / sum(self._pixels)

    def _by_definition(self, emitted: NDArray[np.float32]) -> Array:
        """Return the visible contrast at each knot, (1, K), as if all bands were one."""
        dimmed = (dimmed_luminance(emitted, b, self._display) for b in self._factors)
        return np.array([[visible_contrast(D, self._display, self._model) for D in dimmed]])

    def _shares(self, levels: list[NDArray[np.float32]], later: range) -> Array:
        """Return the share of visible pixels of each band at each knot, nan for those left for later.

        `levels` are the first two Gaussian levels; those that follow are added.
        """
        shares = np.full((len(self._bands), len(self._factors)), np.nan)
        for k in range(len(self._bands)):
            levels.append(reduced(levels[-1]))
            if k not in later:
                shares[k] = self._band_shares.of(levels[k], levels[k + 1], levels[k + 2], k)
        return shares


def difference_thresholds(band: BandTable) -> NDArray[np.float32]:
    """Return the thresholds of g²/L for a band [cd/m^2], (5,)."""
    log_e = band.log_luminance_range[1] + np.log2(_BELOW_PEAK)
    at = np.linspace(*band.log_luminance_range, len(band.log_sensitivity))
    sensitivity = np.exp2(np.interp(log_e, at, band.log_sensitivity))
    return np.asarray((_STEPS * _AMONG_EQUALS / sensitivity) ** 2 * np.exp2(log_e), dtype=np.float32)


def difference_shares(luminance: NDArray[np.float32], thresholds: NDArray[np.float32]) -> Array:
    """Return the shares of pixels whose g²/L exceeds each threshold.

    Parameters
    ----------
    luminance : array, (height, width), at least 2 × 2
        Of an image, or of a level of its pyramid [cd/m^2].
    thresholds : array, (n,)
        Of g²/L [cd/m^2].

    >>> edge = np.array([[1, 1, 3], [1, 1, 3], [1, 1, 3]], np.float32)  # g²/L is 4 beside the edge, else 0
    >>> difference_shares(edge, np.array([1, 5], np.float32)).tolist()
    [0.5, 0.0]
    """
    counts = np.zeros(len(thresholds), np.int64)
    count_differences(luminance, thresholds, counts)
    return np.asarray(counts / ((luminance.shape[0] - 1) * (luminance.shape[1] - 1)))


@compiled
def count_differences(luminance: Any, thresholds: Any, counts: Any) -> None:
    """Add to `counts` how many pixels exceed each threshold."""
    height, width = luminance.shape
    row = np.empty(width - 1, np.float32)
    for i in range(height - 1):
        here, below = luminance[i], luminance[i + 1]
        for j in range(width - 1):
            g = abs(here[j] - here[j + 1]) + abs(here[j] - below[j])
            row[j] = g * g / max(here[j], np.float32(1e-9))
        for k in range(thresholds.size):
            threshold, n = thresholds[k], numba.int32(0)
            for j in range(width - 1):
                n += numba.int32(row[j] > threshold)
            counts[k] += n


class SpareArrays:
    """Arrays that were given back, to be filled again; any thread may take and give.

    The system hands out memory page by page, at its first touch: for the luminance of a 1080p frame that can
    take milliseconds. So there are as many arrays as were ever in use at a time, and no more: one that comes
    back when all that were handed out are back is not kept.

    >>> spare = SpareArrays()
    >>> first = spare.take((2, 3), np.float32)
    >>> spare.give_back(first)
    >>> spare.take((2, 3), np.float32) is first
    True
    """

    def __init__(self) -> None:
        self._held: defaultdict[_Kind, list[NDArray[Any]]] = defaultdict(list)
        self._out: Counter[_Kind] = Counter()
        self._one_at_a_time = threading.Lock()

    def take(self, shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
        """Return an array of a shape and type, whatever it holds."""
        asked = shape, np.dtype(kind)
        with self._one_at_a_time:
            self._out[asked] += 1
            held = self._held[asked]
            if held:
                return held.pop()
        return np.empty(shape, kind)

    def give_back(self, array: NDArray[Any]) -> None:
        """Give back an array, for the next `take`."""
        given = array.shape, array.dtype
        with self._one_at_a_time:
            if self._out[given] > 0:
                self._out[given] -= 1
                self._held[given].append(array)

    @property
    def held(self) -> int:
        """How many arrays wait to be filled again."""
        with self._one_at_a_time:
            return sum(map(len, self._held.values()))
