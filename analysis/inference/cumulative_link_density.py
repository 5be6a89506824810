"""The log-probability of an ordered category between two cut points, with its derivatives."""

from __future__ import annotations

import enum

import numpy as np
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import Derivatives
from evenlight.data_schema.arrays import Array

ROOT_2PI = np.sqrt(2 * np.pi)
LARGEST_GAP = 500.0  # e^-500: a gap between cut points that costs nothing


class Link(enum.Enum):
    """Distribution of the latent answer: its cumulative distribution function is F."""

    LOGIT = "logit"  # logistic: effects are log-odds (McCullagh 1980)
    PROBIT = "probit"  # normal: effects are in standard deviations of an answer


def category_density(link: Link, a: Array, b: Array) -> Derivatives:
    """Return ln(F(a) - F(b)) and its derivatives, for cut points above (a) and below (b) a category.

    Parameters
    ----------
    link : Link
        F.
    a, b : array (..., Q)
        Distance of the upper and lower cut point from the linear predictor, ± infinity at the ends; along
        the last axis the predictor alone differs.
    """
    return _logistic(a, b) if link is Link.LOGIT else _normal(a, b)


def _logistic(a: Array, b: Array) -> Derivatives:
    """F(a) - F(b) = F(a) F(-b) (1 - e^(b - a)), which cancels nowhere.

    a and b are shifted alike along the last axis, so that a - b is the same all along it.
    """
    gap = np.minimum(a[..., :1] - b[..., :1], LARGEST_GAP)
    with np.errstate(divide="ignore", invalid="ignore"):  # cut points out of order: refused by their value
        ln_between = np.where(gap > 0, np.log(-np.expm1(-gap)), -np.inf)
        between = 1.0 / np.expm1(gap)
    ln_below_a, above = _logistic_tail(a)
    ln_above_b, below = _logistic_tail(-b)
    bend = between * (1 + between)
    return Derivatives(
        value=ln_below_a + ln_above_b + ln_between,
        a=above + between,
        b=-below - between,
        aa=-above * (1 - above) - bend,
        ab=np.broadcast_to(bend, a.shape),
        bb=-below * (1 - below) - bend,
    )


def _logistic_tail(x: Array) -> tuple[Array, Array]:
    """Return ln F(x) and F(-x), with one exponential for both."""
    small = np.exp(-np.abs(x))
    return np.minimum(x, 0.0) - np.log1p(small), np.where(x > 0, small, 1.0) / (1 + small)


def _normal(a: Array, b: Array) -> Derivatives:
    """ln(Φ(a) - Φ(b)) in the tail where both are small, so that nothing cancels."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # as above
        flip = a + b > 0  # by symmetry Φ(a) - Φ(b) = Φ(-b) - Φ(-a)
        high, low = np.where(flip, -b, a), np.where(flip, -a, b)
        ln_high = special.log_ndtr(high)
        value = ln_high + np.log1p(-np.exp(special.log_ndtr(low) - ln_high))
        value = np.where(a > b, value, -np.inf)
        ordered = np.isfinite(value)
        first_a = np.where(ordered, np.exp(-0.5 * a**2 - value) / ROOT_2PI, 0.0)
        first_b = np.where(ordered, -np.exp(-0.5 * b**2 - value) / ROOT_2PI, 0.0)
    a_end, b_end = (np.where(np.isfinite(x), x, 0.0) for x in (a, b))
    return Derivatives(
        value=value,
        a=first_a,
        b=first_b,
        aa=-a_end * first_a - first_a**2,
        ab=-first_a * first_b,
        bb=-b_end * first_b - first_b**2,
    )
