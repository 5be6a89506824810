"""Bands about the population's curve, from curves drawn from its posterior: pointwise and simultaneous."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.calibration.joint.population_curve import PopulationCurve, smooth_basis
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import BAND_SAMPLES
from evenlight.data_schema.arrays import Array


def band_luminances(luminance: Array) -> Array:
    """Return where a band is sampled [cd/m^2]: denser where the curve is steeper; once for one luminance."""
    low, high = float(luminance.min()), float(luminance.max())
    if low == high:
        return np.array([low])
    sampled = np.linspace(low**0.5, high**0.5, BAND_SAMPLES) ** 2
    sampled[[0, -1]] = low, high
    return np.asarray(sampled)


def drawn_curves(population: PopulationCurve, coefficients: Array, luminance: Array) -> Array:
    """Return ln(rate) of curves, shape (curves, luminances).

    Parameters
    ----------
    population : PopulationCurve
        Whose levels the curves are for.
    coefficients : array (curves, q)
        Drawn from its posterior.
    luminance : array (n,)
        Where [cd/m^2].
    """
    n_shape = population.prior.n_shape
    columns = smooth_basis(population.tables.luminance).design(luminance)[:, :n_shape]
    return np.asarray(coefficients[:, :n_shape] @ columns.T)


def pointwise_band(curves: Array, level: float) -> tuple[Array, Array]:
    """Return the edges between which the curve lies at a luminance, for each of them.

    Parameters
    ----------
    curves : array (curves, luminances)
        ln(rate) of curves drawn.
    level : float
        Of the band.
    """
    lower, upper = np.quantile(curves, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return lower, upper


def simultaneous_band(curves: Array, level: float) -> tuple[Array, Array]:
    """Return the edges between which the whole curve lies: mean ± c · standard deviation.

    c is the quantile of the largest deviation of a curve anywhere, in standard deviations there.

    >>> straight = np.linspace(-1, 1, 201)[:, None] * np.ones((1, 3))  # curves that move as a whole
    >>> lower, upper = simultaneous_band(straight, 0.9)
    >>> upper.round(6).tolist()
    [0.9, 0.9, 0.9]
    """
    middle, sd = curves.mean(axis=0), curves.std(axis=0)
    largest = np.max(np.abs(curves - middle) / sd, axis=1)
    half = float(np.quantile(largest, level)) * sd
    return middle - half, middle + half


def narrowed_to_rising(lower: Array, upper: Array) -> tuple[Array, Array] | None:
    """Return the part of a band that a curve which does not fall can run through; None if none can.

    If such a curve lies in the band, it is at least the lower edge's highest value so far, and at most the
    upper edge's lowest value from there on.

    >>> narrowed = narrowed_to_rising(np.array([1.0, 0.5, 2.0]), np.array([3.0, 5.0, 4.0]))
    >>> [edge.tolist() for edge in narrowed]
    [[1.0, 1.0, 2.0], [3.0, 4.0, 4.0]]
    >>> narrowed_to_rising(np.array([2.0, 0.5]), np.array([3.0, 1.0])) is None
    True
    """
    highest = np.maximum.accumulate(lower)
    lowest = np.minimum.accumulate(upper[::-1])[::-1]
    return (highest, lowest) if (highest <= lowest).all() else None
