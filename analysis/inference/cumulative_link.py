"""The cumulative-link mixed model: ordered answers, fixed effects, a normal effect of each participant.

P(answer of participant p ≤ k) = F(θ_k - x β - w u_p), u_p ~ N(0, Σ): McCullagh (1980, J. R. Stat. Soc. B 42,
109) with participant effects as in Tutz & Hennevogl (1996, Comput. Stat. Data Anal. 22, 537). Two categories
make it the mixed logistic regression. What is tested against what: docs/decisions/cumulative-link-model.md.

Where everybody always gives the same answer the likelihood rises with the participants' standard deviation
without end. What the search then leaves at its bound comes from that bound, not from the data: such a fit is
shown without numbers (`shown_effect`, `shown_spread`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from evenlight.analysis.inference.adaptive_quadrature import FINE_NODES, marginal_likelihood, triangle
from evenlight.analysis.inference.cumulative_link_model import Link, OrdinalData, OrdinalModel, ordinal_model
from evenlight.analysis.inference.fixed_effects import (
    EffectSpec,
    FitFlag,
    FittedModel,
    FixedEffect,
    mirrored,
    profiled_effect,
    unknown_effect,
)
from evenlight.analysis.inference.likelihood_search import (
    HeldParameter,
    Maximum,
    Objective,
    WalledLikelihood,
    maximum,
)
from evenlight.analysis.inference.mixed_designs import Sample, reference_of
from evenlight.data_schema.arrays import Array

__all__ = ["FitFlag", "FixedEffect", "Link", "OrdinalData", "OrdinalFit", "fit_ordinal"]
WIDE_SD = 2.0  # a participant SD beyond it [log-odds] makes steep posteriors, which take more nodes
LARGEST_SD = 6.0  # a participant SD beyond it counts as infinite: odds 400 times those of the next [log-odds]
FURTHEST = 30.0  # an effect beyond it [log-odds], over the range of its column, counts as infinite
WITHOUT_NUMBERS = (FitFlag.NO_VARIATION, FitFlag.APART, FitFlag.NOT_CONVERGED)
NO_RATIO = (*WITHOUT_NUMBERS, FitFlag.SEPARATED)  # nor has the likelihood a maximum to be compared


@dataclass(frozen=True, slots=True)
class OrdinalFit:
    """What the cumulative-link mixed model found.

    Attributes
    ----------
    effects : tuple of FixedEffect
        One per column of the design, in its order: log-odds of a higher category per unit of the column
        (probit: standard deviations of an answer).
    cut_points : tuple of float
        θ between the categories that were used.
    group_sd : float
        Standard deviation of the intercept between participants.
    slope_sd : float or None
        Of the slope; None without one.
    correlation : float or None
        Between intercept and slope; None without a slope, or where one of them does not vary.
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
    correlation: float | None
    intercept: FixedEffect | None
    log_likelihood: float | None
    n: int
    n_groups: int
    flags: tuple[FitFlag, ...]


def fit_ordinal(
    data: OrdinalData, link: Link = Link.LOGIT, profiled: tuple[str, ...] | None = None
) -> OrdinalFit:
    """Fit the cumulative-link mixed model by maximum likelihood, with profile intervals and tests.

    Parameters
    ----------
    data : OrdinalData
        The answers; hard ones (all alike, separated, missing cells) give flags in place of numbers.
    link : Link
        Logit by default.
    profiled : tuple of str, optional
        Names of the effects whose interval and test are by the profile likelihood ("intercept" among them);
        the others' are by the standard error, which is quicker. None for all.
    """
    used, n_groups = np.unique(data.responses).size, np.unique(data.groups).size
    flags = [FitFlag.UNUSED_CATEGORIES] if 1 < used < data.n_categories else []
    flags += [FitFlag.ONE_PARTICIPANT] if n_groups == 1 else []
    if used < 2:
        return _without_numbers(data, n_groups, (FitFlag.NO_VARIATION, *flags))
    model = ordinal_model(data, link)
    objective, top = _maximum(model)
    found = _Fit(data, model, FittedModel(objective, top, FURTHEST), profiled)
    effects = tuple(_effect(found, j) for j in range(len(data.names)))
    intercept = _intercept(found) if data.n_categories == 2 else None
    flags += _flags((*effects, *([intercept] if intercept else [])), model, top)
    group_sd, slope_sd, correlation = _spread(model, top)
    return OrdinalFit(
        effects=effects,
        cut_points=tuple(top.parameters[: model.n_cuts].tolist()),
        group_sd=group_sd,
        slope_sd=slope_sd,
        correlation=correlation,
        intercept=intercept,
        log_likelihood=top.likelihood.value,
        n=data.responses.size,
        n_groups=n_groups,
        flags=tuple(flags),
    )


def _maximum(model: OrdinalModel) -> tuple[Objective, Maximum]:
    """Return the likelihood and where it is largest, with as many nodes as the participants take."""
    padded = model.padded
    objective = WalledLikelihood(partial(marginal_likelihood, padded), padded.n_fixed, LARGEST_SD)
    top = maximum(objective, model.start)
    if np.abs(top.parameters[padded.n_fixed :]).max(initial=0.0) <= WIDE_SD:
        return objective, top
    fine = partial(marginal_likelihood, padded, nodes=FINE_NODES[padded.n_effects])
    objective = WalledLikelihood(fine, padded.n_fixed, LARGEST_SD)
    return objective, maximum(objective, top.parameters)


@dataclass(frozen=True, slots=True)
class _Fit:
    """The data, their model where its likelihood is largest, and the effects that are to be profiled."""

    data: OrdinalData
    model: OrdinalModel
    fitted: FittedModel
    profiled: tuple[str, ...] | None

    def effect(self, wanted: EffectSpec) -> FixedEffect:
        """Return an effect, profiled if it is to be."""
        return profiled_effect(self.fitted, wanted, self.profiled is None or wanted.name in self.profiled)


def _effect(found: _Fit, j: int) -> FixedEffect:
    """Return the effect of a column, with interval and test."""
    data, model = found.data, found.model
    if not model.columns.identifiable[j]:
        return unknown_effect(data.names[j], FitFlag.NOT_ESTIMABLE)
    place = model.columns.fitted.index(j)
    reference = reference_of(_with_ones(data, model), 1 + place, _sample(model), j == model.slope)
    span = float(np.ptp(data.design[:, j]))
    return found.effect(EffectSpec(data.names[j], HeldParameter(model.n_cuts + place), span, reference))


def _intercept(found: _Fit) -> FixedEffect:
    """Return the log-odds of the upper of two categories where all columns are 0: minus the cut point."""
    reference = reference_of(_with_ones(found.data, found.model), 0, _sample(found.model))
    return mirrored(found.effect(EffectSpec("intercept", HeldParameter(0), 1.0, reference)))


def _with_ones(data: OrdinalData, model: OrdinalModel) -> Array:
    """Return the fitted columns after one of ones, which the cut points stand for."""
    return np.column_stack([np.ones(data.responses.size), data.design[:, model.columns.fitted]])


def _sample(model: OrdinalModel) -> Sample:
    """Return what the effects are tested against."""
    return Sample(model.groups, model.groups.size, own_variance=False)


def _spread(model: OrdinalModel, top: Maximum) -> tuple[float, float | None, float | None]:
    """Return the participants' standard deviation, that of their slopes, and the correlation of both."""
    padded = model.padded
    factor = triangle(top.parameters[padded.n_fixed :], padded.n_effects)
    covariance = factor @ factor.T
    sds = [math.inf if sd > 0.99 * LARGEST_SD else float(sd) for sd in np.sqrt(np.diag(covariance))]
    if padded.n_effects < 2:
        return (sds or [0.0])[0], None, None
    product = sds[0] * sds[1]
    correlation = float(covariance[0, 1]) / product if 1e-6 < product < math.inf else None
    return sds[0], sds[1], correlation


def _flags(effects: tuple[FixedEffect, ...], model: OrdinalModel, top: Maximum) -> list[FitFlag]:
    """Return what to know of a fit as a whole."""
    group_sd, slope_sd, _ = _spread(model, top)
    found = {
        FitFlag.NOT_ESTIMABLE: not all(model.columns.identifiable),
        FitFlag.SEPARATED: any("infinity" in effect.flag for effect in effects),
        FitFlag.APART: math.inf in (group_sd, slope_sd),
        FitFlag.NOT_CONVERGED: not top.converged,
    }
    return [flag for flag, holds in found.items() if holds]


def _without_numbers(data: OrdinalData, n_groups: int, flags: tuple[FitFlag, ...]) -> OrdinalFit:
    """Return a fit that says why there is none."""
    return OrdinalFit(
        effects=tuple(unknown_effect(name, flags[0]) for name in data.names),
        cut_points=(),
        group_sd=math.nan,
        slope_sd=None,
        correlation=None,
        intercept=unknown_effect("intercept", flags[0]) if data.n_categories == 2 else None,
        log_likelihood=None,
        n=data.responses.size,
        n_groups=n_groups,
        flags=flags,
    )


def _cause(fit: OrdinalFit) -> str:
    """Return why a fit has no numbers; empty if it has."""
    return _words(fit, WITHOUT_NUMBERS)


def no_ratio(fit: OrdinalFit) -> str:
    """Return why the likelihood of a fit cannot be tested against another's; empty if it can."""
    return _words(fit, NO_RATIO)


def _words(fit: OrdinalFit, flags: tuple[FitFlag, ...]) -> str:
    """Return which of some flags a fit has, in words."""
    return "; ".join(flag.value for flag in fit.flags if flag in flags)


def shown_effect(fit: OrdinalFit, effect: FixedEffect) -> FixedEffect:
    """Return an effect of a fit as it may be shown: without numbers where the fit has none.

    Parameters
    ----------
    fit : OrdinalFit
        The model.
    effect : FixedEffect
        One of its effects.
    """
    why = _cause(fit)
    if not why:
        return effect
    return FixedEffect(effect.name, None, None, None, None, None, flag=why)


def shown_spread(fit: OrdinalFit, spread: float | None) -> tuple[float | None, str]:
    """Return a standard deviation between participants and its flag: the reason if there is none.

    Parameters
    ----------
    fit : OrdinalFit
        The model.
    spread : float or None
        Its standard deviation of the level, or of the slope.
    """
    alone = FitFlag.ONE_PARTICIPANT.value if FitFlag.ONE_PARTICIPANT in fit.flags else ""
    why = _cause(fit) or alone
    if not why and spread is None:
        why = FitFlag.NOT_ESTIMABLE.value
    return (None, why) if why else (spread, "")
