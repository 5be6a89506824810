"""The gamma curve L'^γ (L_max - L_black) + L_black of Eq. 1, and its best fit to the levels of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from evenlight.analysis.measurement.meter_noise import (
    Noise,
    Repeats,
    last_digits,
    scattered_rounding,
    shared_rounding,
    without_drift,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError


@dataclass(frozen=True, slots=True)
class PixelLevel:
    """The readings of one pixel value at full brightness.

    Attributes
    ----------
    pixel_value : float
        L'.
    repeats : Repeats
        Those with a value, without reflected light [cd/m^2].
    n_under_range : int
        Those that were too dark for the meter.
    """

    pixel_value: float
    repeats: Repeats
    n_under_range: int = 0


@dataclass(frozen=True, slots=True)
class Curve:
    """A gamma curve, without reflected light.

    Attributes
    ----------
    gamma : float
        γ.
    peak : float
        L_max [cd/m^2].
    black : float
        L_black [cd/m^2].
    """

    gamma: float
    peak: float
    black: float

    def luminance(self, pixel_values: ArrayLike) -> Array:
        """Return the luminance of pixel values L' [cd/m^2].

        >>> Curve(gamma=2.0, peak=100.0, black=0.4).luminance([0.0, 0.5, 1.0]).round(9).tolist()
        [0.4, 25.3, 100.0]
        """
        linear = np.asarray(pixel_values, dtype=np.float64) ** self.gamma
        return np.asarray(linear * (self.peak - self.black) + self.black)


@dataclass(frozen=True, slots=True)
class Solution:
    """A best curve.

    Attributes
    ----------
    parameters : array (3,)
        γ, peak and black.
    residuals : array (k + d,)
        Over their errors: of the levels that were read, then of the readings under range.
    derivatives : array (k + d, m)
        Of the residuals by the parameters that were fitted: two if black was given.
    n_levels : int
        k, how many levels were read.
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

    def fit(self, black: float | None = None) -> Solution:
        """Return the best curve, or the best one with a given black level."""
        start = self._start()
        fixed = black is not None

        def residuals(free: Array) -> Array:
            return self._residuals(np.array([*free, black]) if fixed else free)

        found = optimize.least_squares(
            residuals, start[:2] if fixed else start, method="lm", x_scale=np.abs(start[: 2 + (not fixed)])
        )
        parameters = np.array([*found.x, black]) if fixed else found.x
        return Solution(parameters, found.fun, np.asarray(found.jac), self.means.size)

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
        curve = Curve(float(np.clip(parameters[0], 0.05, 20.0)), float(parameters[1]), float(parameters[2]))
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
