"""What repeated readings show: the noise of a meter, and whether the display was steady.

Steady means: at the end of its warm-up, and from the sweep to the repeats after it.

A fit that gave every reading the same weight would be ruled by the brightest level, one that gave equal
weight to ratios by the darkest, whose last digit flickers. The repeats of a sweep tell what the weights are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from evenlight.data_schema.arrays import Array

UNLIKELY = 0.01  # probability of a lack of fit or a bend, below which it is taken for one
SMALLEST_SHARE = 1e-6  # no instrument is finer; readings without any scatter still need a weight
ROUNDS = 100  # of scoring, which takes five to thirty
SMALLEST_STEP = 1e-4  # of the logarithms
HARMONICS = np.arange(1, 31)  # of the saw-tooth of rounding; those left out hold 2 % of its variance
LARGEST_CHANGE = 0.01  # share, twice what a peak is to be known to; late in the warm-up: per ten minutes
TEN_MINUTES = 600.0  # [s]
LATE = 2 / 3  # of the warm-up: what comes after is looked at
FEWEST_LATE = 3  # readings there, of which a line says more than its ends


class Repeats(NamedTuple):
    """The readings of one level."""

    values: Array  # (n,): what was read
    times: Array  # (n,): when, since the sweep began [s]

    @property
    def mean(self) -> float:
        """Mean of the readings."""
        return float(self.values.mean())


class Noise(NamedTuple):
    """Standard deviation of single readings: a floor, and a share of the value, added in squares."""

    floor: float  # in the unit of the readings
    share: float
    freedom: float  # degrees of freedom of the variance at a level, on average; 0 if it is assumed

    def variance(self, values: ArrayLike) -> Array:
        """Return the variance of a reading of these values.

        >>> Noise(floor=0.3, share=0.01, freedom=20).variance([0.0, 40.0]).round(6).tolist()
        [0.09, 0.25]
        """
        size = np.asarray(values, dtype=np.float64)
        return np.asarray(self.floor**2 + (self.share * size) ** 2)


def noise_of(levels: Sequence[Repeats], steps: ArrayLike = 0.0, slope: float = 0.0) -> Noise:
    """Return the noise that explains the scatter of repeats within their levels best.

    The likelihood is that of normal readings with variance floor² + (share · value)² and what rounding adds
    to the scatter; the levels' means are taken out, each at the cost of one degree of freedom. Three or four
    dark levels say little about the floor, and its likeliest value is often 0, which would give the darkest
    readings any weight. A prior in proportion to the standard deviations (Chung et al. 2013) moves them by
    about one standard error where the data say little, and not where they say much.

    Parameters
    ----------
    levels : sequence of Repeats
        At least one of them with two readings.
    steps : array_like, (len(levels),) or scalar
        Last digit of the readings; noise below a tenth of the finest is taken for none.
    slope : float
        Of a drift that is taken out first, and was estimated from the same repeats: share of the value per
        second.
    """
    means = np.array([level.mean for level in levels])
    freedom = np.array([level.values.size - 1 for level in levels])
    used = freedom > 0
    if not used.any():
        raise ValueError("no level was read twice; noise cannot be estimated")
    digits = np.broadcast_to(np.asarray(steps, dtype=np.float64), means.shape)
    steady = [without_drift(level, slope, float(level.times.mean())) for level in levels]
    scatter = np.array([((values - values.mean()) ** 2).sum() for values in steady])
    least = np.array([max(digits.min() / 10, SMALLEST_SHARE * np.abs(means).max()), SMALLEST_SHARE])
    start = np.maximum(least, [np.sqrt((scatter[used] / freedom[used]).min()), 0.01])
    seen = _Scatter(means[used], scatter[used], freedom[used], digits[used])
    found = _most_probable(seen, start, least)
    told = seen.freedom_at(np.log(found))
    return Noise(float(found[0]), float(found[1]), max(told - (slope != 0), 1.0))


@dataclass(frozen=True, slots=True)
class _Scatter:
    """How the repeats of levels scatter: means, sums of squares, degrees of freedom, and last digits."""

    means: Array
    squares: Array
    freedom: NDArray[np.int_]
    steps: Array

    def cost(self, logs: Array) -> tuple[float, Array, Array]:
        """Return -ln of likelihood times prior at ln floor and ln share, with its gradient and curvature."""
        seen, slopes = self._variance(logs)
        cost = 0.5 * float(self.freedom @ np.log(seen) + (self.squares / seen).sum()) - float(logs.sum())
        gradient = (self.freedom - self.squares / seen) @ slopes - 1
        return cost, gradient, 2 * (slopes * self.freedom[:, None]).T @ slopes

    def freedom_at(self, logs: Array) -> float:
        """Return the degrees of freedom of a variance as uncertain as that of a level is on average.

        They are half of those of the repeats where floor and share rule some levels each, as two numbers are
        told, and nearly all of them where the levels are alike: the logarithms count as known to 1
        beforehand, so that two parts that the levels do not tell apart make no level uncertain.
        """
        slopes = self._variance(logs)[1]
        errors = np.linalg.inv(self.cost(logs)[2] + np.eye(2))
        uncertain = 4 * float(np.einsum("ij,jk,ik->i", slopes, errors, slopes).mean())  # 2/ν of one variance
        own = float(self.freedom.sum())
        return own if uncertain * own < 2 else 2 / uncertain

    def _variance(self, logs: Array) -> tuple[Array, Array]:
        """Return the variance of readings, and half the derivatives of its logarithm by the logarithms."""
        columns = np.column_stack([np.ones_like(self.means), self.means**2])
        parts = np.exp(2 * logs)
        own = columns @ parts
        seen = own + scattered_rounding(np.sqrt(own), self.steps)
        return seen, columns * parts * (_rounding_slope(own, self.steps) / seen)[:, None]


def _most_probable(scatter: _Scatter, start: Array, least: Array) -> Array:
    """Return the most probable floor and share, by steps that are halved until they lead down.

    Each coordinate has its own step, the gradient over the row sum of the curvature, so that one at its lower
    end does not hold up the other.
    """
    logs, lowest = np.log(start), np.log(least)
    cost, gradient, curvature = scatter.cost(logs)
    for _ in range(ROUNDS):
        step = -np.clip(gradient / (curvature.sum(axis=1) + 0.01), -2, 2)
        while True:
            moved = np.maximum(logs + step, lowest)
            there = scatter.cost(moved)
            if there[0] <= cost or np.abs(step).max() < SMALLEST_STEP:
                break
            step = step / 2
        if np.abs(moved - logs).max() < SMALLEST_STEP:
            break
        logs, (cost, gradient, curvature) = moved, there
    return np.asarray(np.exp(logs))


def _rounding_slope(variance: Array, steps: Array) -> Array:
    """Return by how much the scatter of rounded readings grows with the variance of unrounded ones."""
    ratio = np.divide(variance, steps**2, out=np.full(steps.shape, np.inf), where=steps > 0)
    return np.asarray(1 + 2 * np.exp(-((2 * np.pi * HARMONICS) ** 2) * ratio[..., None]).sum(axis=-1))


def without_drift(level: Repeats, slope: float, at: float) -> Array:
    """Return the readings of a level as they would have been at one time [s].

    >>> without_drift(Repeats(np.array([99.0, 101.0]), np.array([0.0, 20.0])), 0.001, 10.0).tolist()
    [100.0, 100.0]
    """
    return np.asarray(level.values - slope * level.mean * (level.times - at))


def shared_rounding(deviation: ArrayLike, steps: ArrayLike) -> Array:
    """Return the variance of what rounding does to all readings of a level alike.

    Readings that scatter less than their last digit are all rounded to the same side, and their mean is no
    better than one of them; readings that scatter more are rounded either way, and it averages out. A
    saw-tooth of height q, smeared by noise of standard deviation s, has the variance
    sum over k of q²/(2 π² k²) · exp(-(2 π k s/q)²), which is q²/12 without noise.

    Parameters
    ----------
    deviation : array_like, (n,)
        Standard deviation of single readings.
    steps : array_like, (n,)
        Their last digit; 0 for none.

    >>> shared_rounding([0.0, 1.0], [1.2, 1.2]).round(2).tolist()  # 1.2²/12 = 0.12
    [0.12, 0.0]
    """
    step = np.asarray(steps, dtype=np.float64)
    ratio = np.divide(deviation, step, out=np.full(step.shape, np.inf), where=step > 0)
    smeared = np.exp(-((2 * np.pi * HARMONICS * ratio[..., None]) ** 2)) / (2 * np.pi**2 * HARMONICS**2)
    return np.asarray(step**2 * smeared.sum(axis=-1))


def scattered_rounding(deviation: ArrayLike, steps: ArrayLike) -> Array:
    """Return the variance of what rounding does to each reading of a level apart: the rest of q²/12.

    >>> scattered_rounding([0.0, 1.0], [1.2, 1.2]).round(2).tolist()
    [0.0, 0.12]
    """
    step = np.asarray(steps, dtype=np.float64)
    return np.asarray(np.maximum(step**2 / 12 - shared_rounding(deviation, step), 0.0))


class RelativeChange(NamedTuple):
    """A change as a share of the value, with its 95 % confidence interval; None if not known."""

    share: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def is_large(self) -> bool:
        """Whether to look at it: the interval excludes no change, and it is more than 1 %."""
        if self.share is None or self.interval is None:
            return False
        clear = self.interval[0] > 0 or self.interval[1] < 0
        return clear and abs(self.share) > LARGEST_CHANGE

    @property
    def is_vague(self) -> bool:
        """Whether it leaves open if there was a large one."""
        if self.interval is None:
            return True
        return (self.interval[1] - self.interval[0]) / 2 > LARGEST_CHANGE and not self.is_large


def change_at_the_end(levels: Iterable[Sequence[Repeats]], noise: Noise) -> RelativeChange:
    """Return by how much the repeats at the end differ from the sweep; not known if nothing was repeated.

    Parameters
    ----------
    levels : iterable of two Repeats
        Of each level that was repeated: its readings in the sweep, and those at the end.
    noise : Noise
        Of single readings, by which the levels are weighed.
    """
    shares, weights = [], []
    for before, after in levels:
        if before.values.size and after.values.size and before.mean > 0:
            variance = float(noise.variance(before.mean)) / before.mean**2
            shares.append(after.mean / before.mean - 1)
            weights.append(1 / (variance * (1 / before.values.size + 1 / after.values.size)))
    if not shares:
        return RelativeChange()
    return _change(float(np.average(shares, weights=weights)), float(np.sum(weights)) ** -0.5, noise)


def late_change(warm_up: Repeats, noise: Noise) -> RelativeChange:
    """Return the change over the last third of a warm-up, per ten minutes; not known of too few readings."""
    if not warm_up.values.size:
        return RelativeChange()
    late = warm_up.times >= LATE * warm_up.times.max()
    times, values = warm_up.times[late], warm_up.values[late]
    spread = float(((times - times.mean()) ** 2).sum())
    mean = float(values.mean())
    if values.size < FEWEST_LATE or spread == 0 or mean <= 0:
        return RelativeChange()
    slope = float((times - times.mean()) @ values) / spread
    error = float(noise.variance(mean)) ** 0.5 / spread**0.5
    return _change(slope / mean * TEN_MINUTES, error / mean * TEN_MINUTES, noise)


def _change(share: float, error: float, noise: Noise) -> RelativeChange:
    half = float(half_width(error, noise.freedom))
    return RelativeChange(share, (share - half, share + half))


def half_width(errors: ArrayLike, freedom: float) -> Array:
    """Return half the 95 % confidence interval of means with some standard errors.

    Parameters
    ----------
    errors : array_like
        Standard errors.
    freedom : float
        Degrees of freedom that they are known with (Student's t); 0 for errors that are assumed.

    >>> half_width([1.0, 2.0], 10).round(3).tolist()  # t of 10 degrees of freedom: 2.228
    [2.228, 4.456]
    """
    return np.asarray(stats.t.ppf(0.975, freedom or np.inf) * np.asarray(errors, dtype=np.float64))


def lack_of_fit(misfit: float, freedom: int, of_noise: float) -> tuple[float | None, float | None]:
    """Return F of levels' deviations over the scatter of repeats, and its probability; None without repeats.

    Parameters
    ----------
    misfit : float
        Sum of squares of the deviations, in units of what the repeats say.
    freedom, of_noise : int, float
        Degrees of freedom of the deviations, and of the repeats.
    """
    if freedom == 0 or of_noise == 0:
        return None, None
    f = misfit / freedom
    return f, float(stats.f.sf(f, freedom, of_noise))
