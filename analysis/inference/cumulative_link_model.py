"""Ordered answers as a likelihood model: what can be fitted of them, and where the search starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import Derivatives, PaddedModel, padded
from evenlight.analysis.inference.cumulative_link_density import Link, category_density
from evenlight.analysis.inference.random_columns import (
    Columns,
    estimable_columns,
    loadings_of,
    require_effects,
    slope_of,
    start_of_loadings,
)
from evenlight.data_schema.arrays import Array

START_SD = (0.7, 0.4)  # of intercept and slope, between participants [log-odds]


@dataclass(frozen=True, slots=True)
class OrdinalData:
    """Ordered answers of several participants.

    Attributes
    ----------
    responses : array (n,) of int
        Category of each answer, 0 to n_categories - 1.
    n_categories : int
        K, at least 2.
    design : array (n, k)
        Fixed effects, without an intercept (the cut points are it); k may be 0.
    names : tuple of str (k,)
        Of the columns.
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
    padded : PaddedModel
        Parameters: cut points between the categories used, effects of the fitted columns, rows of Λ.
    start : array (d,)
        Where the search starts.
    columns : Columns
        Which columns of the design are fitted.
    n_cuts : int
        Cut points.
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
        return category_density(self.link, a, b)


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
