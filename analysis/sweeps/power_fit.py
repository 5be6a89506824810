"""The power of a panel over its luminance, P(L) = P_base + slope · L (Section 5), fitted to a power sweep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from evenlight.analysis.sweeps.repeated_readings import (
    UNLIKELY,
    Noise,
    Repeats,
    half_width,
    lack_of_fit,
    noise_of,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.method.suspect_readings import POWER_TOLERANCE

LARGEST_DOUBT = 0.05  # share of the slope, to either side (choice: as of luminances)
FEWEST_LEVELS = 3  # a line through two tells nothing of its fit


class PowerPoints(NamedTuple):
    """Readings of luminance and power, and the level that each is of."""

    luminance: Array  # (n,): L, without reflected light [cd/m^2]
    power: Array  # (n,): P [W]
    level: NDArray[np.int_]  # (n,): number of the level, from 0, that a reading is of

    @property
    def n_levels(self) -> int:
        """How many levels there are."""
        return int(np.unique(self.level).size)

    def level_means(self, values: Array) -> Array:
        """Return the mean over each level of one number per reading."""
        return np.asarray(np.bincount(self.level, values) / np.bincount(self.level))

    def noise_of(self, values: Array) -> Noise:
        """Return the noise of one number per reading, from the repeats of its levels."""
        levels = (values[self.level == k] for k in range(self.n_levels))
        return noise_of([Repeats(level, np.zeros_like(level)) for level in levels])


@dataclass(frozen=True, slots=True)
class LineFit:
    """A line through readings of power over luminance, and what it misses.

    What it has in common with `PowerFit` is described there.

    Attributes
    ----------
    level_luminance, deviations : array (k,)
        Mean luminance of each level [cd/m^2], and measured over fitted power, less 1.
    half_widths : array (k,)
        Of the 95 % confidence interval of each level's mean power at its luminance [W]; 0 without repeats.
    """

    base_power: float
    base_power_interval: tuple[float, float]
    power_per_luminance: float
    power_per_luminance_interval: tuple[float, float]
    residual_sd: float
    r_squared: float
    lack_of_fit_f: float | None
    lack_of_fit_p: float | None
    bend: float
    bend_p: float | None
    level_luminance: Array
    deviations: Array
    half_widths: Array

    def power(self, luminance: ArrayLike) -> Array:
        """Return P(L) [W]."""
        return np.asarray(
            self.base_power + self.power_per_luminance * np.asarray(luminance, dtype=np.float64)
        )

    @property
    def worst_level(self) -> int:
        """The level that deviates most."""
        return int(np.argmax(np.abs(self.deviations)))

    @property
    def is_linear(self) -> bool:
        """Whether the line describes the panel.

        Decision (docs/decisions/display-fit.md): it does not if the levels deviate by more than their repeats
        scatter, or bend (p < 1 %), and one of them by more than 1 % of its power.
        """
        told = any(p is not None and p < UNLIKELY for p in (self.lack_of_fit_p, self.bend_p))
        return not (told and abs(self.deviations[self.worst_level]) > POWER_TOLERANCE.share)

    @property
    def is_vague(self) -> bool:
        """Whether the interval leaves open by more than 5 % how much power light adds."""
        low, high = self.power_per_luminance_interval
        return (high - low) / 2 > LARGEST_DOUBT * abs(self.power_per_luminance)


def fit_line(points: PowerPoints) -> LineFit:
    """Return the line that fits readings of power over luminance best, with 95 % confidence intervals.

    A reading scatters about the line by the noise of both meters, less what power and luminance do alike.
    Its size is told by the repeats of a level, from P - slope · L, in which both noises are; readings are
    weighed by it. (Noise of L also makes a line flatter, but by less than 1e-5 of its slope for noise of
    0.3 %.) In the test of the levels all degrees of freedom of the repeats count: over the one decade of a
    power sweep, floor and share of the noise are nearly one number (docs/decisions/display-fit.md).

    Raises
    ------
    InputError
        If there are fewer than three levels, or power does not rise with luminance.
    """
    if points.n_levels < FEWEST_LEVELS:
        raise InputError(
            f"a line of power over luminance needs {FEWEST_LEVELS} or more brightness factors with power and "
            f"luminance, got {points.n_levels}"
        )
    freedom, weights = _noise(points)
    design = np.column_stack([np.ones_like(points.luminance), points.luminance])
    coefficients, errors, residuals = _least_squares(design, points.power, weights)
    if coefficients[1] <= 0:
        raise InputError(
            f"power does not rise with luminance (slope {coefficients[1]:.3g} W m^2/cd); does the power "
            "meter measure the rail of the backlight?"
        )
    of_levels, of_repeats = points.n_levels - 2, points.power.size - points.n_levels
    misfit = float(np.bincount(points.level, weights) @ points.level_means(residuals) ** 2)
    f, p = lack_of_fit(misfit, of_levels, of_repeats)
    half = _half_width(float(weights @ residuals**2), points, (f, p), freedom)
    ends = [(float(c - half * e), float(c + half * e)) for c, e in zip(coefficients, errors, strict=True)]
    bend, bend_p = _bend(points, weights)
    fitted = points.level_means(points.power - residuals)
    spread = float(((points.power - points.power.mean()) ** 2).sum())
    return LineFit(
        base_power=float(coefficients[0]),
        base_power_interval=ends[0],
        power_per_luminance=float(coefficients[1]),
        power_per_luminance_interval=ends[1],
        residual_sd=float(np.sqrt(residuals @ residuals / (residuals.size - 2))),
        r_squared=1 - float(residuals @ residuals) / spread,
        lack_of_fit_f=f,
        lack_of_fit_p=p,
        bend=bend,
        bend_p=bend_p,
        level_luminance=points.level_means(points.luminance),
        deviations=points.level_means(residuals) / fitted,
        half_widths=half_width(np.bincount(points.level, weights) ** -0.5 * float(freedom > 0), freedom),
    )


def slope_through(points: PowerPoints, base_power: float) -> float:
    """Return the slope of the best line with a given base power [W m^2/cd]."""
    _, weights = _noise(points)
    moved = weights * points.luminance
    return float(moved @ (points.power - base_power)) / float(moved @ points.luminance)


def _noise(points: PowerPoints) -> tuple[float, Array]:
    """Return the degrees of freedom of the noise, and the weights 1/variance of the readings.

    The scatter of P - slope · L within levels grows with slope · L from that in the dark: P - slope · L is
    P_base everywhere, so its own size tells nothing. Without repeats nothing tells one reading from another,
    and all weigh the same.
    """
    weights = np.ones_like(points.power)
    if np.bincount(points.level).max() < 2:
        return 0, weights
    design = np.column_stack([weights, points.luminance])
    slope = _least_squares(design, points.power, weights)[0][1]
    apart = points.power - slope * points.luminance
    sizes = slope * points.level_means(points.luminance)
    noise = points.noise_of(apart - (points.level_means(apart) - sizes)[points.level])
    return noise.freedom, 1 / noise.variance(sizes)[points.level]


def _least_squares(design: Array, power: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Return coefficients, their standard errors for weights that are 1/variance, and residuals."""
    scale = np.abs(design).max(axis=0)  # so that powers of luminance do not spoil the inverse
    scaled = design / scale
    inverse = np.linalg.inv((scaled * weights[:, None]).T @ scaled)
    coefficients = inverse @ (scaled.T @ (weights * power)) / scale
    return coefficients, np.sqrt(np.diag(inverse)) / scale, power - design @ coefficients


def _half_width(
    squares: float, points: PowerPoints, lack: tuple[float | None, float | None], freedom: float
) -> float:
    """Return how many standard errors the half of an interval has.

    All residuals say how large they are, unless the levels deviate by more than repeats scatter: then those
    deviations do, so that intervals are honest about a line that does not fit.
    """
    f, p = lack
    of_residuals = points.power.size - 2
    scale, known = squares / of_residuals, min(of_residuals, freedom or of_residuals)
    if f is not None and p is not None and p < UNLIKELY:
        scale, known = f, points.n_levels - 2
    return float(half_width(np.sqrt(scale), known))


def _bend(points: PowerPoints, weights: Array) -> tuple[float, float | None]:
    """Return the height of the best quadratic over its chord, relative to the power added, and its p."""
    L = points.luminance
    design = np.column_stack([np.ones_like(L), L, L**2])
    coefficients, errors, residuals = _least_squares(design, points.power, weights)
    low, high = float(L.min()), float(L.max())
    added = coefficients[1] * (high - low) + coefficients[2] * (high**2 - low**2)
    bend = float(-coefficients[2] * ((high - low) / 2) ** 2 / added)
    freedom = residuals.size - 3
    if freedom < 1:
        return bend, None
    error = errors[2] * np.sqrt(float(weights @ residuals**2) / freedom)
    if error == 0:
        return bend, None
    return bend, float(2 * stats.t.sf(abs(coefficients[2]) / error, freedom))


def points_of(luminance: ArrayLike, power: ArrayLike, factors: ArrayLike) -> PowerPoints:
    """Return readings with their levels numbered by brightness factor.

    >>> points_of([50.0, 100.0, 50.2], [1.0, 2.0, 1.0], [0.5, 1.0, 0.5]).level.tolist()
    [0, 1, 0]
    """
    _, level = np.unique(np.asarray(factors, dtype=np.float64), return_inverse=True)
    values = np.asarray(luminance, dtype=np.float64), np.asarray(power, dtype=np.float64)
    return PowerPoints(*values, level)
