"""What a design with participant effects can tell, and what its effects are tested against.

Which columns can be fitted, which of them may differ between participants, and what the likelihood ratio of
an effect is compared with: with few participants Student's t in place of the normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from evenlight.analysis.inference.adaptive_quadrature import PaddedModel
from evenlight.data_schema.arrays import Array, Integers

LEVEL = 0.95  # of every confidence interval


@dataclass(frozen=True, slots=True)
class GroupedDesign:
    """What a design with participant effects can tell.

    Attributes
    ----------
    places, fitted : tuple of int, array (n, k)
        Largest set of columns without one that is a combination of earlier ones, and these columns.
    identifiable : tuple of bool
        Of each column: whether no combination of the others gives it, so that its effect means something.
    groups : array (n,) of int
        Participant of each observation, 0 to P - 1.
    slope : int or None
        Column whose effect differs between participants too.
    loadings : array (n, q)
        What the q participant effects are multiplied with.
    """

    places: tuple[int, ...]
    fitted: Array
    identifiable: tuple[bool, ...]
    groups: Integers
    slope: int | None
    loadings: Array


@dataclass(frozen=True, slots=True)
class GroupedModel:
    """A likelihood model of observations by participant.

    Attributes
    ----------
    padded, start : PaddedModel, array (d,)
        The observations, and where the search starts.
    design : GroupedDesign
        What their design can tell.
    n_cuts : int
        Cut points among the parameters; the first of them.
    """

    padded: PaddedModel
    start: Array
    design: GroupedDesign
    n_cuts: int = 0


def require_effects(
    n: int, design: Array, names: tuple[str, ...], groups: Integers, slope_column: int | None
) -> None:
    """Raise `ValueError` unless a design (n, k) is finite, with its names, n groups and that slope column."""
    if design.shape != (n, len(names)) or groups.shape != (n,):
        raise ValueError(
            f"need a design of shape ({n}, {len(names)}) and {n} groups, got {design.shape} and "
            f"{groups.shape}"
        )
    if not np.isfinite(design).all():
        raise ValueError("the design must be finite, got nan or infinity")
    if slope_column is not None and not 0 <= slope_column < len(names):
        raise ValueError(f"slope_column must be one of {len(names)} columns, got {slope_column}")


def grouped_design(
    design: Array, groups: Integers, slope_column: int | None, intercept: bool
) -> GroupedDesign:
    """Return what a design (n, k) with participant effects can tell, beside an intercept or without one.

    No participant effect with one participant, or with one observation of each: it could not be told from
    chance. No slope where everybody has one value of its column only.

    >>> grouped_design(np.zeros((3, 0)), np.array([5, 5, 7]), None, intercept=True).loadings.tolist()
    [[1.0], [1.0], [1.0]]
    """
    people = np.unique(groups, return_inverse=True)[1].astype(np.int64)
    places, identifiable = _estimable_columns(design, intercept)
    alone, slope = int(people.max()) == 0, None
    if slope_column in places and not alone:
        own = [np.ptp(design[people == person, slope_column]) for person in range(people.max() + 1)]
        slope = slope_column if any(own) else None
    loadings = np.ones((people.size, 1))
    if alone or np.bincount(people).max() == 1:
        loadings = loadings[:, :0]
    elif slope is not None:
        loadings = np.column_stack([loadings, design[:, slope]])
    return GroupedDesign(places, design[:, places], identifiable, people, slope, loadings)


def _estimable_columns(design: Array, intercept: bool) -> tuple[tuple[int, ...], tuple[bool, ...]]:
    """Return `places` and `identifiable` of a `GroupedDesign`."""
    scale = np.maximum(np.abs(design).max(axis=0, initial=0.0), 1e-300)
    scaled: Array = design / scale
    if intercept:
        scaled = np.column_stack([np.ones(design.shape[0]), scaled])
    first = int(intercept)
    corner = np.asarray(np.linalg.qr(scaled, mode="r"))  # of the same rank, column by column, but small

    def rank(columns: list[int]) -> int:
        return int(np.linalg.matrix_rank(corner[:, columns], tol=1e-8)) if columns else 0

    kept = list(range(first))
    for j in range(first, scaled.shape[1]):
        if rank([*kept, j]) > len(kept):
            kept.append(j)
    every = list(range(scaled.shape[1]))
    apart = [rank([i for i in every if i != j]) < len(kept) for j in every]
    return tuple(j - first for j in kept[first:]), tuple(apart[first:])


def in_row_space(weights: Array, design: Array) -> bool:
    """Return whether the combination w β of a design's effects is determined: w is a mixture of its rows.

    >>> in_row_space(np.array([1.0, -1.0]), np.array([[1.0, 1.0], [2.0, 2.0]]))
    False
    """
    scale = np.maximum(np.abs(design).max(axis=0), 1e-300)
    rows, wanted = np.asarray(np.linalg.qr(design / scale, mode="r")), weights / scale
    rest = wanted - rows.T @ np.linalg.lstsq(rows.T, wanted, rcond=None)[0]
    return bool(np.abs(rest).max() <= 1e-8 * np.abs(wanted).max())


def start_of_loadings(n_effects: int, usual: tuple[float, float]) -> list[float]:
    """Return where a search begins for the rows of Λ of q effects: the usual SDs, and no correlation.

    >>> start_of_loadings(2, (0.4, 0.3))
    [0.4, 0.0, 0.3]
    """
    return {0: [], 1: [usual[0]], 2: [usual[0], 0.0, usual[1]]}[n_effects]


@dataclass(frozen=True, slots=True)
class NullDistribution:
    """What a likelihood ratio statistic is compared with.

    In a normal model of m independent units with d degrees of freedom, whose variance is estimated by maximum
    likelihood, the statistic is an increasing function of Student's t: LR = m ln(1 + t² / d), exactly (e.g.
    Cox & Hinkley 1974, Theoretical Statistics, section 9.3). Units are participants for an effect that is
    tested against the differences between participants. `units` None takes t² = LR: a model without an
    estimated variance of its answers.

    Attributes
    ----------
    df : float
        d.
    units : float or None
        m.
    """

    df: float
    units: float | None = None

    @property
    def critical(self) -> float:
        """Statistic beyond which a two-sided test at 5 % rejects."""
        t_squared = float(scipy.special.stdtrit(self.df, (1 + LEVEL) / 2)) ** 2
        return t_squared if self.units is None else float(self.units * np.log1p(t_squared / self.df))

    def p_value(self, ratio: float) -> float:
        """Return the two-sided p value of a likelihood ratio statistic.

        >>> reference = NullDistribution(df=16, units=17)
        >>> round(reference.p_value(reference.critical), 12)
        0.05
        """
        t_squared = ratio if self.units is None else self.df * np.expm1(min(ratio / self.units, 500.0))
        return float(2 * scipy.special.stdtr(self.df, -np.sqrt(t_squared)))

    @property
    def quantile(self) -> float:
        """Standard errors from the estimate to the end of a 95 % confidence interval by curvature."""
        return float(scipy.special.stdtrit(self.df, (1 + LEVEL) / 2))


def reference_of(
    design: Array,
    index: int,
    groups: Integers,
    timed: int | None = None,
    varies: bool = False,
) -> NullDistribution:
    """Return what the test of one column of a design is compared with.

    An effect that differs between participants, or that depends on who took part, is tested against the
    differences between participants: Student's t with the participants' degrees of freedom. One that is seen
    within everybody: with those of the observations that are left. One participant says nothing of others,
    and is described by the observations alone.

    Parameters
    ----------
    design : array (n, k)
        All columns, with one of ones if the model has an intercept of its own.
    index : int
        The column tested.
    groups : array (n,) of int
        Participant of each observation, 0 to P - 1.
    timed : int, optional
        Of times, how many are not censored: the scatter of single ones is estimated. That of answers follows
        from the model.
    varies : bool
        Whether the effect itself differs between participants.
    """
    n_groups, k = int(groups.max()) + 1, design.shape[1]
    informative = groups.size if timed is None else timed
    if n_groups == 1:
        return NullDistribution(informative - k, timed)
    if varies:
        return NullDistribution(n_groups - 1, n_groups)
    between = between_directions(design, groups)
    if weight_of_people(design, index, groups) > 0.5:
        return NullDistribution(n_groups - between, n_groups)
    units = informative - n_groups
    return NullDistribution(units - (k - between), None if timed is None else units)


def weight_of_people(design: Array, index: int, groups: Integers) -> float:
    """Return by how much the differences between participants enter the variance of an effect.

    Var = (σ² + λ σ_u²) / Σ x̃² with what the other columns do not explain of the column, x̃, and
    λ = Σ_p (Σ x̃ of p)² / Σ x̃². 0: the effect is seen within everybody, and who they are cancels.

    >>> design = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    >>> round(weight_of_people(design, 1, np.array([0, 0, 1, 1])), 12)
    0.0
    >>> round(weight_of_people(design, 1, np.array([0, 1, 0, 1])), 12)
    2.0
    """
    own = design @ np.linalg.inv(design.T @ design)[:, index]
    return float(np.sum(np.bincount(groups, weights=own) ** 2) / (own @ own))


def people_reference(
    design: Array, index: int, groups: Integers, random: Array | None = None
) -> NullDistribution:
    """Return what an effect with the sandwich over participants is compared with.

    Its units are how many participants it rests on, P = 1 / Σ s_p² with the share s_p of each in its variance
    (Kish 1965, Survey Sampling): the sandwich's expectation is the variance times 1 - 1/P. Its degrees of
    freedom are those of the sandwich (Satterthwaite; as Bell & McCaffrey 2002, Survey Methodology 28, 169),
    (1 - S₂)² / (S₂ - 2 S₃ + S₂²) with S_k = Σ s_p^k: P - 1 where people weigh the same, and where the model
    does not know how they differ, so that the shares are not quite known.

    Parameters
    ----------
    design, index : array (n, k), int
        Fixed effects, and which of them.
    groups : array (n,) of int
        Participant of each observation, 0 to P - 1.
    random : array (n, q), optional
        W Λ/τ: what standard normal participant effects add, in residual standard deviations. People who
        differ weigh nearly the same, however many observations each has. None if the model has no such
        effect on this one: all observations then weigh the same.

    >>> design, groups = np.array([[1.0, 0.0], [1.0, 1.0]] * 4), np.array([0, 0, 1, 1, 1, 1, 1, 1])
    >>> [people_reference(design, 1, groups, sd * design).units for sd in (0, 9)]
    [1.6, 2.0]
    """
    loadings = np.zeros((design.shape[0], 0)) if random is None else random
    information = np.zeros((groups.max() + 1, design.shape[1], design.shape[1]))
    for person in range(groups.max() + 1):
        x, w = design[groups == person], loadings[groups == person]
        across = w.T @ x
        information[person] = x.T @ x - across.T @ np.linalg.solve(np.eye(w.shape[1]) + w.T @ w, across)
    influence = np.linalg.inv(information.sum(axis=0))[:, index]
    shares = influence @ information @ influence
    shares = shares / shares.sum()
    second, third = float(np.sum(shares**2)), float(np.sum(shares**3))
    people = round(1 / second, 1)  # about 2 are 2, for a t of 1 degree
    if people < 2 or random is None:
        return NullDistribution(people - 1, people)
    return NullDistribution(round((1 - second) ** 2 / (second - 2 * third + second**2), 1), people)


def between_directions(design: Array, groups: Integers) -> int:
    """Return how many combinations of a design's columns compare participants rather than their answers.

    >>> design = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    >>> between_directions(design, np.array([0, 0, 1, 1])), between_directions(design, np.array([0, 1, 0, 1]))
    (1, 2)
    """
    sums = np.stack([np.bincount(groups, weights=column) for column in design.T], axis=1)
    means = sums / np.sqrt(np.bincount(groups))[:, None]
    shares = scipy.linalg.eigh(means.T @ means, design.T @ design, eigvals_only=True)
    return int(np.sum(shares > 0.5))
