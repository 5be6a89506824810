"""Ordered answers as a likelihood model: what can be fitted, where the search starts, probabilities."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import Derivatives, PaddedModel, padded
from evenlight.analysis.inference.mixed_designs import (
    Columns,
    estimable_columns,
    loadings_of,
    require_effects,
    slope_of,
    start_of_loadings,
)
from evenlight.data_schema.arrays import Array

START_SD = (0.7, 0.4)  # of intercept and slope, between participants [log-odds]
ROOT_2PI = np.sqrt(2 * np.pi)
LARGEST_GAP = 500.0  # e^-500: a gap between cut points that costs nothing


@dataclass(frozen=True, slots=True)
class OrdinalData:
    """Ordered answers of several participants.

    Attributes
    ----------
    responses, n_categories : array (n,) of int, int
        Category of each answer, 0 to K - 1, and K, at least 2.
    design, names : array (n, k), tuple of str (k,)
        Fixed effects, without an intercept (the cut points are it), and their names; k may be 0.
    groups : array (n,) of int
        Which participant each answer belongs to.
    slope_column : int, optional
        Column whose effect differs between participants too, correlated with their intercept.
    """

    responses: NDArray[np.int64]
    n_categories: int
    design: NDArray[np.float64]
    names: tuple[str, ...]
    groups: NDArray[np.int64]
    slope_column: int | None = None

    def __post_init__(self) -> None:
        n = self.responses.size
        if n == 0:
            raise ValueError("need at least one answer, got none")
        if self.n_categories < 2:
            raise ValueError(f"need at least 2 categories, got {self.n_categories}")
        if self.responses.min() < 0 or self.responses.max() >= self.n_categories:
            raise ValueError(
                f"responses must lie in 0 to {self.n_categories - 1}, got {self.responses.min()} to "
                f"{self.responses.max()}"
            )
        if self.design.shape != (n, len(self.names)) or self.groups.shape != (n,):
            raise ValueError(
                f"need a design of shape ({n}, {len(self.names)}) and {n} groups, got {self.design.shape} "
                f"and {self.groups.shape}"
            )
        require_effects(self.design, self.names, self.slope_column)


@dataclass(frozen=True, slots=True)
class OrdinalModel:
    """The likelihood model of ordered answers.

    Attributes
    ----------
    padded, start : PaddedModel, array (d,)
        Parameters: cut points between the categories used, effects of the fitted columns, rows of Λ; and
        where the search starts.
    columns, n_cuts : Columns, int
        Which columns of the design are fitted, and the number of cut points.
    slope : int or None
        Column of the design that has a participant effect too; None without one.
    groups : array (n,) of int
        Participant of each answer, 0 to P - 1.
    """

    padded: PaddedModel
    start: Array
    columns: Columns
    n_cuts: int
    slope: int | None
    groups: NDArray[np.int64]

    @property
    def n_groups(self) -> int:
        """Number of participants P."""
        return int(self.groups.max()) + 1


@dataclass(frozen=True, slots=True)
class CategoryDensity:
    """The log-probability of the answers between their cut points."""

    link: Link

    def __call__(self, a: Array, b: Array) -> Derivatives:
        """Return ℓ and its derivatives; padding has its cut points at ± infinity, and adds nothing."""
        return _category_density(self.link, a, b)


def ordinal_model(data: OrdinalData, link: Link) -> OrdinalModel:
    """Return the model of the answers, with what they can tell: see docs/decisions/cumulative-link-model.md.

    Without a second answer of anybody there is no participant effect, and without a participant who has two
    values of the slope's column there is no slope.
    """
    responses = np.unique(data.responses, return_inverse=True)[1].astype(np.int64)
    groups = np.unique(data.groups, return_inverse=True)[1].astype(np.int64)
    columns = estimable_columns(data.design, intercept=True)
    slope = slope_of(data.slope_column, data.design, groups, columns)
    n_cuts = int(responses.max())
    loadings = loadings_of(data.design, groups, slope)
    fitted = data.design[:, columns.fitted]
    steps = np.eye(n_cuts + 1)[responses]
    model = PaddedModel(
        a_design=padded(np.column_stack([steps[:, :-1], -fitted * (responses < n_cuts)[:, None]]), groups),
        b_design=padded(np.column_stack([steps[:, 1:], -fitted * (responses > 0)[:, None]]), groups),
        a_offset=padded(np.where(responses < n_cuts, 0.0, np.inf), groups, np.inf),
        b_offset=padded(np.where(responses > 0, 0.0, -np.inf), groups, -np.inf),
        loadings=padded(loadings, groups),
        b_loads=True,
        density=CategoryDensity(link),
    )
    return OrdinalModel(model, _start(responses, model, link), columns, n_cuts, slope, groups)


def _start(responses: NDArray[np.int64], model: PaddedModel, link: Link) -> Array:
    """Return cut points by the shares of the answers, no effects, and usual participant effects."""
    counts = np.bincount(responses).astype(np.float64)
    shares = np.cumsum(counts + 0.5)[:-1] / (counts + 0.5).sum()
    start = np.zeros(model.n_parameters)
    start[: shares.size] = 1.1 * (special.logit(shares) if link is Link.LOGIT else special.ndtri(shares))
    start[model.n_fixed :] = start_of_loadings(model.n_effects, START_SD)
    return start


class Link(enum.Enum):
    """Distribution of the latent answer: its cumulative distribution function is F."""

    LOGIT = "logit"  # logistic: effects are log-odds (McCullagh 1980)
    PROBIT = "probit"  # normal: effects are in standard deviations of an answer


def _category_density(link: Link, a: Array, b: Array) -> Derivatives:
    """Return ln(F(a) - F(b)) and its derivatives, for cut points above (a) and below (b) a category.

    Both are distances from the linear predictor, ± infinity at the ends; along the last axis it differs.
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
