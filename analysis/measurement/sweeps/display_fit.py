"""The display model L = L'^γ (L_max - L_black) + L_black + L_refl (Eq. 1), fitted to a luminance sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special, stats

from evenlight.analysis.measurement.sweeps.repeated_readings import (
    Noise,
    Repeats,
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

FEWEST_LEVELS = 3  # with a value: as many as the curve has parameters
ASSUMED_SHARE, ASSUMED_FLOOR = 0.01, 0.01  # noise of a meter [1, cd/m^2] where no level was read twice
UNLIKELY = 0.01  # probability of a lack of fit, below which it is taken for one
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class GammaFit:
    """A gamma curve fitted to levels, and what it misses.

    Attributes
    ----------
    curve : GammaCurve
        Fitted; black is 0 where the best one would be darker.
    intervals : tuple of three (float, float)
        95 % confidence intervals of γ, peak and black.
    black_unconstrained : float
        The black that fits best, be it below 0 [cd/m^2].
    noise : Noise
        Of single readings.
    drift_rate : float
        Of the luminance during the sweep, as a share per second; the curve is that at `time`.
    time : float
        Middle of the sweep [s].
    pixel_values, means, errors : array (k,)
        Of levels with a value: L', luminance without the drift and its standard error [cd/m^2].
    lack_of_fit_f, lack_of_fit_p : float or None
        F test of the levels' deviations against the scatter of repeats; None without repeats.
    """

    curve: GammaCurve
    intervals: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    black_unconstrained: float
    noise: Noise
    drift_rate: float
    time: float
    pixel_values: Array
    means: Array
    errors: Array
    lack_of_fit_f: float | None
    lack_of_fit_p: float | None

    def deviations(self, reflected: float = 0.0) -> Array:
        """Return measured over fitted luminance, less 1, of each level with a value."""
        fitted = self.curve.luminance(self.pixel_values)
        return np.asarray((self.means - fitted) / (fitted + reflected))

    def worst_level(self, reflected: float = 0.0) -> int:
        """Return the level whose deviation exceeds what is tolerated by the largest factor."""
        return int(np.argmax(self._excess(reflected)))

    def is_gamma(self, reflected: float = 0.0) -> bool:
        """Return whether a gamma curve describes the display.

        Decision (docs/decisions/display-fit.md): it does not if the levels deviate by more than their repeats
        scatter (F test, p < 1 %), and one of them by more than 2 % and 0.02 cd/m^2.
        """
        told = self.lack_of_fit_p is None or self.lack_of_fit_p < UNLIKELY
        return not (told and self._excess(reflected).max() > 1)

    def _excess(self, reflected: float) -> Array:
        """Return each level's deviation over the tolerated one."""
        fitted = self.curve.luminance(self.pixel_values)
        return np.asarray(np.abs(self.means - fitted) / tolerated(fitted + reflected))


def tolerated(luminance: ArrayLike) -> Array:
    """Return by how much a level may deviate, or its repeats differ, without a warning [cd/m^2].

    >>> tolerated([0.0, 100.0]).tolist()
    [0.02, 2.02]
    """
    return LUMINANCE_TOLERANCE.of(luminance)


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
    noise, drift_rate = _noise_and_drift([level.repeats for level in read], reflected)
    if noise.freedom == 0 and len(read) == FEWEST_LEVELS:
        raise InputError(
            f"{FEWEST_LEVELS} pixel values, each read once, leave nothing to tell the noise by; read each "
            "three times"
        )
    data = CurveData.of(levels, read, noise, drift_rate, (reflected, time))
    free = data.fit()
    black = float(free.parameters[2])
    best = free if black >= 0 else data.fit(black=0.0)
    f, p = _lack_of_fit(best, noise)
    gamma, peak, _ = best.parameters
    possible = LOWEST_GAMMA <= gamma <= HIGHEST_GAMMA and DIMMEST <= peak <= HIGHEST_LUMINANCE
    if not possible or black * LOWEST_CONTRAST >= peak:
        raise InputError(
            f"no display has the curve that fits best: gamma {gamma:.3g}, {black:.3g} to {peak:.3g} cd/m^2; "
            "was the meter aimed at the screen?"
        )
    return GammaFit(
        curve=GammaCurve(float(gamma), float(peak), max(black, 0.0)),
        intervals=_intervals(data, free, best, _half_width(best, (f, p), noise)),
        black_unconstrained=black,
        noise=noise,
        drift_rate=drift_rate,
        time=time,
        pixel_values=data.pixel_values,
        means=data.means,
        errors=data.errors,
        lack_of_fit_f=f,
        lack_of_fit_p=p,
    )


def _noise_and_drift(repeats: Sequence[Repeats], reflected: float) -> tuple[Noise, float]:
    """Return the noise of the readings and their drift, as a share per second.

    The drift is told from repeats of a level at different times. One round suffices: it changes the noise
    little, and the noise changes it only as weights.
    """
    if all(level.values.size < 2 for level in repeats):
        return Noise(ASSUMED_FLOOR, ASSUMED_SHARE, 0), 0.0
    steps = digits_of(repeats, reflected)
    noise = noise_of(repeats, steps)
    weights = 1 / noise.variance([level.mean for level in repeats])
    product = square = 0.0
    for level, weight in zip(repeats, weights, strict=True):
        moved = level.mean * (level.times - level.times.mean())
        product += weight * float(moved @ level.values)
        square += weight * float(moved @ moved)
    slope = product / square if square > 0 else 0.0
    return noise_of(repeats, steps, slope), slope


def _lack_of_fit(solution: CurveSolution, noise: Noise) -> tuple[float | None, float | None]:
    """Return F of the levels' deviations over the scatter of repeats, and its probability.

    The residuals are in units of what the repeats say, so that the denominator is 1.
    """
    if noise.freedom == 0 or solution.freedom == 0:
        return None, None
    f = solution.misfit / solution.freedom
    return f, float(stats.f.sf(f, solution.freedom, noise.freedom))


def _half_width(solution: CurveSolution, lack: tuple[float | None, float | None], noise: Noise) -> float:
    """Return how many standard errors the half of an interval has.

    Repeats say how large they are, unless the levels deviate by more (or there were no repeats): then those
    deviations do, so that intervals are honest about a curve that does not fit.
    """
    _, p = lack
    if noise.freedom and (p is None or p >= UNLIKELY):
        return float(stats.t.ppf((1 + CONFIDENCE) / 2, noise.freedom))
    scale = solution.misfit / solution.freedom
    return float(np.sqrt(scale) * stats.t.ppf((1 + CONFIDENCE) / 2, solution.freedom))


def _intervals(
    data: CurveData, free: CurveSolution, best: CurveSolution, half: float
) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Return the intervals of γ, peak and black."""
    covariance = np.linalg.inv(free.derivatives.T @ free.derivatives)
    errors = half * np.sqrt(np.diag(covariance))
    ends = [(float(p - e), float(p + e)) for p, e in zip(best.parameters, errors, strict=True)]
    black = free.parameters[2]
    low, high = float(black - errors[2]), float(black + errors[2])
    if data.dark_values.size:
        low, high = _profile(data, best, half)
    return ends[0], ends[1], (max(low, 0.0), max(high, 0.0))


def _profile(data: CurveData, best: CurveSolution, half: float) -> tuple[float, float]:
    """Return the black levels at which the best curve fits worse by half² (the likelihood ratio).

    Where black itself was too dark for the meter, its likelihood is no parabola.
    """
    least = float(best.residuals @ best.residuals)

    def excess(black: float) -> float:
        residuals = data.fit(black=black).residuals
        return float(residuals @ residuals) - least - half**2

    at = float(max(best.parameters[2], 0.0))
    low = 0.0 if excess(0.0) <= 0 else optimize.brentq(excess, 0.0, at, xtol=1e-6)
    high = _first_above(excess, at, max(data.limit, 1e-3))
    return float(low), float(optimize.brentq(excess, at, high, xtol=1e-6))


def _first_above(function: Callable[[float], float], start: float, step: float) -> float:
    """Return a point after the start where a rising function is above 0."""
    point = start + step
    while function(point) <= 0:
        point += step
        step *= 2
    return point


@dataclass(frozen=True, slots=True)
class PixelLevel:
    """The readings of one pixel value at full brightness.

    Attributes
    ----------
    pixel_value, repeats : float, Repeats
        L', and the readings with a value, without reflected light [cd/m^2].
    n_under_range : int
        Those that were too dark for the meter.
    """

    pixel_value: float
    repeats: Repeats
    n_under_range: int = 0


@dataclass(frozen=True, slots=True)
class GammaCurve:
    """A gamma curve, without reflected light.

    Attributes
    ----------
    gamma, peak, black : float
        γ, L_max and L_black [cd/m^2].
    """

    gamma: float
    peak: float
    black: float

    def luminance(self, pixel_values: ArrayLike) -> Array:
        """Return the luminance of pixel values L' [cd/m^2].

        >>> GammaCurve(gamma=2.0, peak=100.0, black=0.4).luminance([0.0, 0.5, 1.0]).round(9).tolist()
        [0.4, 25.3, 100.0]
        """
        linear = np.asarray(pixel_values, dtype=np.float64) ** self.gamma
        return np.asarray(linear * (self.peak - self.black) + self.black)


@dataclass(frozen=True, slots=True)
class CurveSolution:
    """A best curve.

    Attributes
    ----------
    parameters, n_levels : array (3,), int
        γ, peak and black; and k, how many levels were read.
    residuals : array (k + d,)
        Over their errors: of the levels that were read, then of the readings under range.
    derivatives : array (k + d, m)
        Of the residuals by the parameters that were fitted: two if black was given.
    """

    parameters: Array
    residuals: Array
    derivatives: Array
    n_levels: int

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the levels' deviations; readings under range deviate from nothing."""
        return self.n_levels - int(self.derivatives.shape[1])

    @property
    def misfit(self) -> float:
        """Sum of squares of the levels' deviations over their errors."""
        own = self.residuals[: self.n_levels]
        return float(own @ own)


@dataclass(frozen=True, slots=True)
class CurveData:
    """What the curve is fitted to: means of levels with their errors, and the levels that were too dark."""

    pixel_values: Array
    means: Array
    errors: Array
    dark_values: Array  # pixel values of readings under range, one for each
    limit: float  # below which they lie
    dark_error: float

    @classmethod
    def of(
        cls,
        levels: Sequence[PixelLevel],
        read: Sequence[PixelLevel],
        noise: Noise,
        drift_rate: float,
        place: tuple[float, float],
    ) -> CurveData:
        """Return the means of levels at the middle of the sweep, with their standard errors."""
        reflected, time = place
        repeats = [level.repeats for level in read]
        means = np.array([without_drift(level, drift_rate, time).mean() for level in repeats])
        variance, steps = noise.variance(means), digits_of(repeats, reflected)
        shared = shared_rounding(np.sqrt(variance), steps)
        apart = variance + scattered_rounding(np.sqrt(variance), steps)
        errors = np.sqrt(apart / np.array([level.values.size for level in repeats]) + shared)
        dark = np.repeat([lv.pixel_value for lv in levels], [lv.n_under_range for lv in levels])
        limit = min(float(level.values.min()) for level in repeats)
        values = np.array([level.pixel_value for level in read])
        return cls(values, means, errors, dark, limit, float(noise.variance(limit)) ** 0.5)

    def fit(self, black: float | None = None) -> CurveSolution:
        """Return the best curve, or the best one with a given black level."""
        start = self._start()
        fixed = black is not None

        def residuals(free: Array) -> Array:
            return self._residuals(np.array([*free, black]) if fixed else free)

        found = optimize.least_squares(
            residuals, start[:2] if fixed else start, method="lm", x_scale=np.abs(start[: 2 + (not fixed)])
        )
        parameters = np.array([*found.x, black]) if fixed else found.x
        return CurveSolution(parameters, found.fun, np.asarray(found.jac), self.means.size)

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
        curve = GammaCurve(
            float(np.clip(parameters[0], 0.05, 20.0)), float(parameters[1]), float(parameters[2])
        )
        own = (self.means - curve.luminance(self.pixel_values)) / self.errors
        if not self.dark_values.size:
            return np.asarray(own)
        below = (self.limit - curve.luminance(self.dark_values)) / self.dark_error
        return np.concatenate([own, np.sqrt(-2 * special.log_ndtr(below))])


def digits_of(repeats: Sequence[Repeats], reflected: float) -> Array:
    """Return the last digit of the meter at each level."""
    sizes = [level.values.size for level in repeats]
    read = last_digits(np.concatenate([level.values for level in repeats]) + reflected)
    return np.array([part.min() for part in np.split(read, np.cumsum(sizes)[:-1])])
