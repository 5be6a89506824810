"""The display model L = L'^γ (L_max - L_black) + L_black + L_refl (Eq. 1), fitted to a luminance sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from evenlight.analysis.sweeps.repeated_readings import (
    UNLIKELY,
    Noise,
    Repeats,
    half_width,
    lack_of_fit,
    noise_of,
    scattered_rounding,
    shared_rounding,
    without_drift,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import (
    DIMMEST,
    HIGHEST_GAMMA,
    HIGHEST_LUMINANCE,
    LOWEST_CONTRAST,
    LOWEST_GAMMA,
)
from evenlight.data_schema.errors import InputError
from evenlight.method.suspect_readings import LUMINANCE_TOLERANCE, last_digits

LARGEST_DOUBT = 0.05  # share of a luminance, to either side (choice: more than twice what a level may be off)
FEWEST_LEVELS = 3  # with a value: as many as the curve has parameters
ASSUMED_NOISE = Noise(0.01, 0.01, 0)  # [cd/m^2, 1] of a meter where no level was read twice

Interval = tuple[float, float]


class PixelLevel(NamedTuple):
    """The readings of one pixel value L' at full brightness.

    Those with a value, without reflected light [cd/m^2], and how many were too dark for the meter.
    """

    pixel_value: float
    repeats: Repeats
    n_under_range: int = 0


@dataclass(frozen=True, slots=True)
class GammaFit:
    """A gamma curve fitted to levels, without reflected light, and what it misses.

    What it has in common with `DisplayFit` is described there.

    Attributes
    ----------
    noise : Noise
        Of single readings.
    pixel_values, means, errors : array (k,)
        Of levels with a value: L', luminance without the drift and its standard error [cd/m^2].
    """

    gamma: float
    gamma_interval: Interval
    peak_luminance: float
    peak_luminance_interval: Interval
    black_level: float
    black_level_interval: Interval
    reflected_luminance: float
    noise: Noise
    pixel_values: Array
    means: Array
    errors: Array
    lack_of_fit_f: float | None
    lack_of_fit_p: float | None

    def luminance(self, pixel_values: ArrayLike) -> Array:
        """Return the luminance of pixel values L' on the curve [cd/m^2]."""
        return gamma_curve(pixel_values, self.gamma, self.peak_luminance, self.black_level)

    @property
    def deviations(self) -> Array:
        """Measured over fitted luminance, less 1, of each level with a value."""
        return np.asarray((self.means - self.luminance(self.pixel_values)) / self.shown)

    @property
    def shown(self) -> Array:
        """The fitted luminance of each level, reflected light included; where 0, what is tolerated."""
        shown = self.luminance(self.pixel_values) + self.reflected_luminance
        return np.where(shown > 0, shown, LUMINANCE_TOLERANCE.floor)

    @property
    def worst_level(self) -> int:
        """The level whose deviation exceeds what is tolerated by the largest factor."""
        return int(np.argmax(self._excess()))

    @property
    def is_gamma(self) -> bool:
        """Whether a gamma curve describes the display.

        Decision (docs/decisions/display-fit.md): it does not if the levels deviate by more than their repeats
        scatter (F test, p < 1 %), and one of them by more than 2 % and 0.02 cd/m^2.
        """
        told = self.lack_of_fit_p is None or self.lack_of_fit_p < UNLIKELY
        return not (told and self._excess().max() > 1)

    @property
    def is_vague(self) -> bool:
        """Whether the intervals leave open by more than 5 % what L' = 0.5, or 1, shows."""
        low, high = self.gamma_interval
        darkest, brightest = self.peak_luminance_interval
        at_half = np.log(2) * (high - low) / 2
        return bool(max(at_half, (brightest - darkest) / 2 / self.peak_luminance) > LARGEST_DOUBT)

    def _excess(self) -> Array:
        """Return each level's deviation over the tolerated one."""
        fitted = self.luminance(self.pixel_values)
        return np.asarray(
            np.abs(self.means - fitted) / LUMINANCE_TOLERANCE.of(fitted + self.reflected_luminance)
        )


def gamma_curve(pixel_values: ArrayLike, gamma: float, peak: float, black: float) -> Array:
    """Return the luminance of pixel values L' on a gamma curve [cd/m^2].

    >>> gamma_curve([0.0, 0.5, 1.0], gamma=2.0, peak=100.0, black=0.4).round(9).tolist()
    [0.4, 25.3, 100.0]
    """
    return np.asarray(np.asarray(pixel_values, dtype=np.float64) ** gamma * (peak - black) + black)


def fit_gamma(levels: Sequence[PixelLevel], reflected: float, time: float) -> GammaFit:
    """Return the gamma curve that fits the readings of pixel values best.

    Levels are weighed by the noise that their repeats show; a linear drift in time, told apart from the curve
    by those repeats, is taken out; a reading under the meter's range counts for what it says, that the
    luminance lies below all that the meter could read.

    Parameters
    ----------
    levels : sequence of PixelLevel
        Black and white are among them.
    reflected : float
        L_refl, which is in no reading any more, but was when the meter rounded it [cd/m^2].
    time : float
        At which the curve is wanted, the middle of the sweep [s].

    Raises
    ------
    InputError
        If there are too few levels with a value, or they do not rise.
    """
    read = [level for level in levels if level.repeats.values.size]
    if len(read) < FEWEST_LEVELS:
        raise InputError(
            f"a gamma curve needs luminances of {FEWEST_LEVELS} or more pixel values, got {len(read)} "
            f"({len(levels) - len(read)} more were too dark for the meter)"
        )
    steps = _digits_of([level.repeats for level in read], reflected)
    noise, drift_rate = _noise_and_drift([level.repeats for level in read], steps)
    if noise.freedom == 0 and len(read) == FEWEST_LEVELS:
        raise InputError(
            f"{FEWEST_LEVELS} pixel values, each read once, leave nothing to tell the noise by; read each "
            "three times"
        )
    repeats = [without_drift(level.repeats, drift_rate, time) for level in read]
    data = _CurveData(
        pixel_values=np.array([level.pixel_value for level in read]),
        means=np.array([values.mean() for values in repeats]),
        errors=_errors_of_means(repeats, noise, steps),
        dark_values=np.repeat([lv.pixel_value for lv in levels], [lv.n_under_range for lv in levels]),
        limit=min(float(level.repeats.values.min()) for level in read),
        noise=noise,
    )
    free = data.fit()
    unconstrained = float(free.parameters[2])
    best = free if unconstrained >= 0 else data.fit(black=0.0)
    f, p = lack_of_fit(best.misfit, best.freedom, noise.freedom)
    gamma, peak = float(best.parameters[0]), float(best.parameters[1])
    _require_possible(gamma, peak, unconstrained)
    intervals = _intervals(data, free, best, _half_width(best, p, noise))
    return GammaFit(
        gamma=gamma,
        gamma_interval=intervals[0],
        peak_luminance=peak,
        peak_luminance_interval=intervals[1],
        black_level=max(unconstrained, 0.0),
        black_level_interval=intervals[2],
        reflected_luminance=reflected,
        noise=noise,
        pixel_values=data.pixel_values,
        means=data.means,
        errors=data.errors,
        lack_of_fit_f=f,
        lack_of_fit_p=p,
    )


def _require_possible(gamma: float, peak: float, black: float) -> None:
    possible = LOWEST_GAMMA <= gamma <= HIGHEST_GAMMA and DIMMEST <= peak <= HIGHEST_LUMINANCE
    if not possible or black * LOWEST_CONTRAST >= peak:
        raise InputError(
            f"no display has the curve that fits best: gamma {gamma:.3g}, {black:.3g} to {peak:.3g} cd/m^2; "
            "was the meter aimed at the screen?"
        )


def _digits_of(repeats: Sequence[Repeats], reflected: float) -> Array:
    """Return the last digit of the meter at each level."""
    sizes = [level.values.size for level in repeats]
    read = last_digits(np.concatenate([level.values for level in repeats]) + reflected)
    return np.array([part.min() for part in np.split(read, np.cumsum(sizes)[:-1])])


def _noise_and_drift(repeats: Sequence[Repeats], steps: Array) -> tuple[Noise, float]:
    """Return the noise of the readings and their drift, as a share per second.

    The drift is told from repeats of a level at different times. One round suffices: it changes the noise
    little, and the noise changes it only as weights.
    """
    if all(level.values.size < 2 for level in repeats):
        return ASSUMED_NOISE, 0.0
    noise = noise_of(repeats, steps)
    weights = 1 / noise.variance([level.mean for level in repeats])
    product = square = 0.0
    for level, weight in zip(repeats, weights, strict=True):
        moved = level.mean * (level.times - level.times.mean())
        product += weight * float(moved @ level.values)
        square += weight * float(moved @ moved)
    slope = product / square if square > 0 else 0.0
    return noise_of(repeats, steps, slope), slope


def _errors_of_means(repeats: Sequence[Array], noise: Noise, steps: Array) -> Array:
    """Return the standard errors of levels' means; rounding is partly the same in all readings of a level."""
    variance = noise.variance([values.mean() for values in repeats])
    apart = variance + scattered_rounding(np.sqrt(variance), steps)
    shared = shared_rounding(np.sqrt(variance), steps)
    return np.asarray(np.sqrt(apart / np.array([values.size for values in repeats]) + shared))


class _Solution(NamedTuple):
    """A best curve."""

    parameters: Array  # (3,): γ, peak and black
    residuals: Array  # over their errors: of the levels that were read, then of the readings under range
    derivatives: Array  # of the residuals by the parameters that were fitted: two if black was given
    n_levels: int  # that were read

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the levels' deviations; readings under range deviate from nothing."""
        return self.n_levels - int(self.derivatives.shape[1])

    @property
    def misfit(self) -> float:
        """Sum of squares of the levels' deviations over their errors."""
        own = self.residuals[: self.n_levels]
        return float(own @ own)


def _half_width(solution: _Solution, p: float | None, noise: Noise) -> float:
    """Return how many standard errors the half of an interval has.

    Repeats say how large they are, unless the levels deviate by more (or there were no repeats): then those
    deviations do, so that intervals are honest about a curve that does not fit.
    """
    if noise.freedom and (p is None or p >= UNLIKELY):
        return float(half_width(1.0, noise.freedom))
    scale = solution.misfit / solution.freedom
    return float(half_width(np.sqrt(scale), solution.freedom))


def _intervals(
    data: _CurveData, free: _Solution, best: _Solution, half: float
) -> tuple[Interval, Interval, Interval]:
    covariance = np.linalg.inv(free.derivatives.T @ free.derivatives)
    errors = half * np.sqrt(np.diag(covariance))
    gamma, peak = ((float(p - e), float(p + e)) for p, e in zip(best.parameters[:2], errors[:2], strict=True))
    black = free.parameters[2]
    low, high = float(black - errors[2]), float(black + errors[2])
    if data.dark_values.size:
        low, high = _profile(data, best, half)
    return gamma, peak, (max(low, 0.0), max(high, 0.0))


def _profile(data: _CurveData, best: _Solution, half: float) -> Interval:
    """Return the black levels at which the best curve fits worse by half² (the likelihood ratio).

    Where black itself was too dark for the meter, its likelihood is no parabola.
    """
    least = float(best.residuals @ best.residuals)

    def excess(black: float) -> float:
        residuals = data.fit(black=black).residuals
        return float(residuals @ residuals) - least - half**2

    at = float(max(best.parameters[2], 0.0))
    low = 0.0 if excess(0.0) <= 0 else optimize.brentq(excess, 0.0, at, xtol=1e-6)
    step = max(data.limit, 1e-3)
    above = at + step
    while excess(above) <= 0:
        above += step
        step *= 2
    return float(low), float(optimize.brentq(excess, at, above, xtol=1e-6))


@dataclass(frozen=True, slots=True)
class _CurveData:
    """What the curve is fitted to: means of levels with their errors, and the levels that were too dark."""

    pixel_values: Array
    means: Array
    errors: Array
    dark_values: Array  # pixel values of readings under range, one for each
    limit: float  # below which they lie
    noise: Noise

    def fit(self, black: float | None = None) -> _Solution:
        """Return the best curve, or the best one with a given black level."""
        start = self._start()
        fixed = black is not None

        def residuals(free: Array) -> Array:
            return self._residuals(np.array([*free, black]) if fixed else free)

        found = optimize.least_squares(
            residuals, start[:2] if fixed else start, method="lm", x_scale=np.abs(start[: 2 + (not fixed)])
        )
        parameters = np.array([*found.x, black]) if fixed else found.x
        return _Solution(parameters, found.fun, np.asarray(found.jac), self.means.size)

    def _start(self) -> Array:
        """Return a first guess: the ends, and the γ of the level that is nearest to half the pixel value."""
        peak, black = float(self.means.max()), float(self.means.min())
        middle = int(np.argmin(np.abs(self.pixel_values - 0.5)))
        share = (self.means[middle] - black) / (peak - black) if peak > black else 0.0
        if not 0 < share < 1 or not 0 < self.pixel_values[middle] < 1:
            raise InputError(
                f"luminance does not rise with pixel value: {black:g} to {peak:g} cd/m^2 were read, "
                f"{self.means[middle]:g} at {self.pixel_values[middle]:g}; was the meter aimed at the screen?"
            )
        return np.array([np.log(share) / np.log(self.pixel_values[middle]), peak, max(black, 1e-3 * peak)])

    def _residuals(self, parameters: Array) -> Array:
        """Return the residuals over their errors; of a reading under range, as large as it is improbable."""
        curve = float(np.clip(parameters[0], 0.05, 20.0)), float(parameters[1]), float(parameters[2])
        own = (self.means - gamma_curve(self.pixel_values, *curve)) / self.errors
        if not self.dark_values.size:
            return np.asarray(own)
        dark_error = float(self.noise.variance(self.limit)) ** 0.5
        below = (self.limit - gamma_curve(self.dark_values, *curve)) / dark_error
        return np.concatenate([own, np.sqrt(-2 * special.log_ndtr(below))])
