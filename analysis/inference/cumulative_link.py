"""The cumulative-link mixed model: ordered answers, fixed effects, a normal effect of each participant.

P(answer of participant p ≤ k) = F(θ_k - x β - w u_p), F logistic, u_p ~ N(0, Σ): McCullagh (1980, J. R. Stat.
Soc. B 42, 109) with participant effects as in Tutz & Hennevogl (1996, Comput. Stat. Data Anal. 22, 537). Two
categories make it the mixed logistic regression. What is tested against what:
docs/decisions/cumulative-link-model.md.

Where everybody always gives the same answer the likelihood rises with the participants' standard deviation
without end. What the search then leaves at its bound comes from that bound, not from the data: such a fit is
shown without numbers (`shown_effect`, `shown_spread`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import (
    FINE_NODES,
    Derivatives,
    PaddedModel,
    marginal_likelihood,
    padded,
    triangle,
)
from evenlight.analysis.inference.fixed_effects import (
    FitFlag,
    FixedEffect,
    Maximum,
    Objective,
    Profile,
    fit_flags,
    flags_in_words,
    maximum,
    profiled_effect,
    walled,
)
from evenlight.analysis.inference.lognormal_times import TimesFit
from evenlight.analysis.inference.mixed_designs import (
    GroupedModel,
    grouped_design,
    reference_of,
    require_effects,
    start_of_loadings,
)
from evenlight.data_schema.arrays import Array, Integers

START_SD = (0.7, 0.4)  # of intercept and slope, between participants [log-odds]
WIDE_SD = 2.0  # a participant SD beyond it [log-odds] makes steep posteriors, which take more nodes
LARGEST_SD = 6.0  # a participant SD beyond it counts as infinite: odds 400 times those of the next [log-odds]
FURTHEST = 30.0  # an effect beyond it [log-odds], over the range of its column, counts as infinite
WITHOUT_NUMBERS = (FitFlag.NO_VARIATION, FitFlag.NOT_CONVERGED)
NO_RATIO = (*WITHOUT_NUMBERS, FitFlag.SEPARATED)  # nor has the likelihood a maximum to be compared
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

    responses: Integers
    n_categories: int
    design: Array
    names: tuple[str, ...]
    groups: Integers
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
        require_effects(n, self.design, self.names, self.groups, self.slope_column)


def ordinal_model(data: OrdinalData) -> GroupedModel:
    """Return the model of the answers, with what they can tell: see docs/decisions/cumulative-link-model.md.

    Parameters: cut points between the categories used, effects of the fitted columns, rows of Λ.
    """
    responses = np.unique(data.responses, return_inverse=True)[1].astype(np.int64)
    design = grouped_design(data.design, data.groups, data.slope_column, intercept=True)
    n_cuts, groups = int(responses.max()), design.groups
    above, below = responses < n_cuts, responses > 0
    steps = np.eye(n_cuts + 1)[responses]
    model = PaddedModel(
        a_design=padded(np.column_stack([steps[:, :-1], -design.fitted * above[:, None]]), groups),
        b_design=padded(np.column_stack([steps[:, 1:], -design.fitted * below[:, None]]), groups),
        a_offset=padded(np.where(above, 0.0, np.inf), groups, np.inf),
        b_offset=padded(np.where(below, 0.0, -np.inf), groups, -np.inf),
        loadings=padded(design.loadings, groups),
        b_loads=True,
        density=_logistic,
    )
    # Cut points by the shares of the answers, no effects, and usual participant effects.
    counts = np.bincount(responses).astype(np.float64)
    shares = np.cumsum(counts + 0.5)[:-1] / (counts + 0.5).sum()
    start = np.zeros(model.n_parameters)
    start[:n_cuts] = 1.1 * special.logit(shares)
    start[model.n_fixed :] = start_of_loadings(model.n_effects, START_SD)
    return GroupedModel(model, start, design, n_cuts)


# ln(F(a) - F(b)) and its derivatives, for cut points above (a) and below (b) a category. Both are distances
# from the linear predictor, which differs along the last axis; ± infinity at the ends, and in padding.


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


@dataclass(frozen=True, slots=True)
class OrdinalFit:
    """What the cumulative-link mixed model found.

    Attributes
    ----------
    effects : tuple of FixedEffect
        One per column of the design, in its order: log-odds of a higher category per unit of the column.
    cut_points : tuple of float
        θ between the categories that were used.
    group_sd : float
        Standard deviation of the intercept between participants.
    slope_sd : float or None
        Of the slope; None without one.
    intercept : FixedEffect or None
        With two categories: log-odds of the upper one where all columns are 0; else None.
    log_likelihood : float or None
        At the maximum, or what it tends to where an effect runs to infinity.
    n, n_groups : int
        Answers and participants.
    flags : tuple of FitFlag
        What to know; empty for nothing.
    """

    effects: tuple[FixedEffect, ...]
    cut_points: tuple[float, ...]
    group_sd: float
    slope_sd: float | None
    intercept: FixedEffect | None
    log_likelihood: float | None
    n: int
    n_groups: int
    flags: tuple[FitFlag, ...]


def fit_ordinal(data: OrdinalData, profiled: tuple[str, ...] | None = None) -> OrdinalFit:
    """Fit the cumulative-link mixed model by maximum likelihood, with profile intervals and tests.

    Parameters
    ----------
    data : OrdinalData
        The answers; hard ones (all alike, separated, missing cells) give flags in place of numbers.
    profiled : tuple of str, optional
        Names of the effects whose interval and test are by the profile likelihood ("intercept" among them);
        the others' are by the standard error, which is quicker. None for all.
    """
    used, n_groups = np.unique(data.responses).size, np.unique(data.groups).size
    flags = [FitFlag.UNUSED_CATEGORIES] if 1 < used < data.n_categories else []
    flags += [FitFlag.ONE_PARTICIPANT] if n_groups == 1 else []
    if used < 2:
        return _without_numbers(data, n_groups, (FitFlag.NO_VARIATION, *flags))
    model = ordinal_model(data)
    objective, top = _maximum(model)
    effects, intercept = _effects(data, model, (objective, top), profiled)
    group_sd, slope_sd = _spread(model, top)
    every = (*effects, *([intercept] if intercept else []))
    flags += fit_flags(every, model, top, apart=math.inf in (group_sd, slope_sd))
    return OrdinalFit(
        effects=effects,
        cut_points=tuple(top.parameters[: model.n_cuts].tolist()),
        group_sd=group_sd,
        slope_sd=slope_sd,
        intercept=intercept,
        log_likelihood=top.likelihood.value,
        n=data.responses.size,
        n_groups=n_groups,
        flags=tuple(flags),
    )


def _maximum(model: GroupedModel) -> tuple[Objective, Maximum]:
    """Return the likelihood and where it is largest, with as many nodes as the participants take."""
    padded = model.padded
    objective = walled(partial(marginal_likelihood, padded), padded.n_fixed, LARGEST_SD)
    top = maximum(objective, model.start)
    if np.abs(top.parameters[padded.n_fixed :]).max(initial=0.0) <= WIDE_SD:
        return objective, top
    fine = partial(marginal_likelihood, padded, nodes=FINE_NODES[padded.n_effects])
    objective = walled(fine, padded.n_fixed, LARGEST_SD)
    return objective, maximum(objective, top.parameters)


def _effects(
    data: OrdinalData,
    model: GroupedModel,
    found: tuple[Objective, Maximum],
    profiled: tuple[str, ...] | None,
) -> tuple[tuple[FixedEffect, ...], FixedEffect | None]:
    """Return the effects of all columns, and with two categories the intercept: minus the cut point."""
    design = np.column_stack([np.ones(data.responses.size), model.design.fitted])  # ones: the cut points

    def effect(name: str, column: int, index: int, slope: bool = False, sign: int = 1) -> FixedEffect:
        reference = reference_of(design, column, model.design.groups, varies=slope)
        span = float(np.ptp(design[:, column])) if column else 1.0
        wanted = profiled is None or name in profiled
        return profiled_effect(name, Profile(*found, index), span, FURTHEST, reference, wanted, sign)

    effects = [FixedEffect(name, flags=(FitFlag.NOT_ESTIMABLE,)) for name in data.names]
    for place, j in enumerate(model.design.places):
        if model.design.identifiable[j]:
            effects[j] = effect(data.names[j], 1 + place, model.n_cuts + place, j == model.design.slope)
    return tuple(effects), effect("intercept", 0, 0, sign=-1) if data.n_categories == 2 else None


def _spread(model: GroupedModel, top: Maximum) -> tuple[float, float | None]:
    padded = model.padded
    factor = triangle(top.parameters[padded.n_fixed :], padded.n_effects)
    sds = [math.inf if sd > 0.99 * LARGEST_SD else float(sd) for sd in np.sqrt(np.diag(factor @ factor.T))]
    return (sds or [0.0])[0], (sds[1] if len(sds) > 1 else None)


def _without_numbers(data: OrdinalData, n_groups: int, flags: tuple[FitFlag, ...]) -> OrdinalFit:
    effects = tuple(FixedEffect(name, flags=flags[:1]) for name in data.names)
    intercept = FixedEffect("intercept", flags=flags[:1]) if data.n_categories == 2 else None
    return OrdinalFit(effects, (), math.nan, None, intercept, None, data.responses.size, n_groups, flags)


def no_ratio(fit: OrdinalFit | TimesFit) -> str:
    """Return why the likelihood of a fit cannot be tested against another's; empty if it can."""
    return flags_in_words(flag for flag in fit.flags if flag in NO_RATIO)


def shown_effect(fit: OrdinalFit | TimesFit, effect: FixedEffect) -> FixedEffect:
    """Return an effect of a fit as it may be shown: without numbers where the fit has none."""
    why = _without(fit)
    return FixedEffect(effect.name, flags=why) if why else effect


def _without(fit: OrdinalFit | TimesFit) -> tuple[FitFlag, ...]:
    return tuple(flag for flag in fit.flags if flag in WITHOUT_NUMBERS)


def shown_spread(fit: OrdinalFit | TimesFit, spread: float | None) -> tuple[float | None, str]:
    """Return a fit's SD of level or slope between participants, and its flag: the reason if there is none."""
    why = _without(fit)
    if not why and FitFlag.ONE_PARTICIPANT in fit.flags:
        why = (FitFlag.ONE_PARTICIPANT,)
    if not why and spread is None:
        why = (FitFlag.NOT_ESTIMABLE,)
    return (None, flags_in_words(why)) if why else (spread, "")
