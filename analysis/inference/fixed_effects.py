"""Effects of a fitted likelihood model: estimate, standard error, profile confidence interval, test, flag."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.inference.likelihood_search import (
    FLATTEST,
    HeldParameter,
    Maximum,
    Objective,
    Profile,
    ProfileEnd,
)
from evenlight.analysis.inference.mixed_designs import NullDistribution

FLAT = 100.0  # a standard error this large, over the range of its column, is that of an effect without bound
TOO_FEW_PEOPLE = "too few participants for a test or an interval"
NO_BOUNDS = "the data set it no bounds: it may be anything"
LOST_LOWER, LOST_UPPER, LOST_TEST = (
    f"the search for {what} did not converge"
    for what in ("the lower end of the interval", "the upper end of the interval", "the test's statistic")
)
NO_LOWER, NO_UPPER = "the interval has no lower end", "the interval has no upper end"


class FitFlag(enum.Enum):
    """What a reader of a fit must know; the value says it in words."""

    NONE = ""
    NO_VARIATION = "all answers are the same: nothing can be estimated"
    NOTHING_OBSERVED = "nothing was ever found"
    NO_SCATTER = "the times leave no scatter to judge by: nothing can be estimated"
    SEPARATED = "an effect runs to infinity: the data separate perfectly"
    APART = "participants hardly vary within themselves: their standard deviation runs to infinity"
    NOT_ESTIMABLE = "an effect cannot be told apart from the others"
    ONE_PARTICIPANT = "one participant: no participant effect, nothing said of other people"
    UNUSED_CATEGORIES = "categories that nobody used were left out"
    NOT_CONVERGED = "the search for the largest likelihood did not converge"


@dataclass(frozen=True, slots=True)
class FixedEffect:
    """One effect of a likelihood model.

    Attributes
    ----------
    name : str
        Of its column.
    estimate : float or None
        Maximum of the likelihood, in the unit of the linear predictor; None where the data do not give it.
    standard_error : float or None
        From the curvature of the likelihood; None where there is none.
    ci_low, ci_high : float or None
        95 % confidence interval of the profile likelihood with small-sample correction; None for an end
        without bound, or unknown (`flag` says so).
    p_value : float or None
        Of the likelihood-ratio test against 0, with the same correction.
    df : float or None
        Degrees of freedom of that correction.
    flag : str
        Why it should be looked at, or is missing; empty for nothing.
    """

    name: str
    estimate: float | None
    standard_error: float | None
    ci_low: float | None
    ci_high: float | None
    p_value: float | None
    df: float | None = None
    flag: str = ""


def unknown_effect(name: str, flag: FitFlag) -> FixedEffect:
    """Return an effect without numbers, and why.

    >>> unknown_effect("version", FitFlag.NO_VARIATION).flag
    'all answers are the same: nothing can be estimated'
    """
    return FixedEffect(name, None, None, None, None, None, flag=flag.value)


@dataclass(frozen=True, slots=True)
class FittedModel:
    """A likelihood model at its maximum.

    Attributes
    ----------
    objective, top : callable, Maximum
        The log-likelihood, and its maximum.
    furthest : float
        Largest effect over the range of its column that is tried; beyond, an interval has no end.
    """

    objective: Objective
    top: Maximum
    furthest: float

    def standard_error(self, held: HeldParameter) -> float:
        """Return the standard error of θ_j, or of θ_j / θ_s, by the curvature (and the delta method)."""
        parameters = self.top.parameters
        direction = np.zeros(parameters.size)
        direction[held.index] = 1.0
        if held.scale is not None:
            scale = parameters[held.scale]
            direction[held.index] = 1.0 / scale
            direction[held.scale] = -parameters[held.index] / scale**2
        curvature, axes = np.linalg.eigh(-self.top.likelihood.hessian)
        along = axes.T @ direction
        return float(np.sqrt(np.sum(along**2 / np.maximum(curvature, FLATTEST))))


@dataclass(frozen=True, slots=True)
class EffectSpec:
    """An effect to be had of a fitted model.

    Attributes
    ----------
    name, held : str, HeldParameter
        Of the effect, and which parameter it is.
    span, reference : float, NullDistribution
        Range of its column: how far the linear predictor moves by it; what its test is compared with.
    """

    name: str
    held: HeldParameter
    span: float
    reference: NullDistribution


def profiled_effect(model: FittedModel, wanted: EffectSpec, profiled: bool = True) -> FixedEffect:
    """Return an effect with its interval and test.

    Parameters
    ----------
    model, wanted : FittedModel, EffectSpec
        The model, and which effect.
    profiled : bool
        Whether interval and test are by the profile likelihood; else by the standard error and Student's t.
    """
    error = model.standard_error(wanted.held)
    estimate = wanted.held.value(model.top.parameters)
    unbounded = error * wanted.span > FLAT
    if wanted.reference.df < 1:
        flag = (FitFlag.SEPARATED.value if unbounded else "") or TOO_FEW_PEOPLE
        shown = (None, None) if unbounded else (estimate, error)
        return FixedEffect(wanted.name, shown[0], shown[1], None, None, None, flag=flag)
    if not (profiled or unbounded):
        return _by_curvature(wanted, estimate, error)
    profile = Profile(model.objective, model.top, wanted.held)
    critical, furthest = wanted.reference.critical, model.furthest / wanted.span
    first = max(abs(estimate) - furthest / 3, furthest / 10) if unbounded else np.sqrt(critical) * error
    found = [
        ProfileEnd(None)
        if unbounded and side * estimate > 0
        else profile.end(side, critical, first, furthest)
        for side in (-1, 1)
    ]
    ends = [end.value for end in found]
    ratio = profile.ratio(0.0)
    lost = [words for end, words in zip(found, (LOST_LOWER, LOST_UPPER), strict=True) if end.lost]
    lost += [LOST_TEST] if ratio is None else []
    return FixedEffect(
        wanted.name,
        None if unbounded else estimate,
        None if unbounded else error,
        ends[0],
        ends[1],
        None if ratio is None else wanted.reference.p_value(ratio),
        wanted.reference.df,
        _flag(unbounded, estimate, ends, lost),
    )


def _by_curvature(wanted: EffectSpec, estimate: float, error: float) -> FixedEffect:
    """Return an effect with interval and test by its standard error (Wald, with Student's t)."""
    reference = NullDistribution(wanted.reference.df)
    half = reference.quantile * error
    return FixedEffect(
        wanted.name,
        estimate,
        error,
        estimate - half,
        estimate + half,
        reference.p_value((estimate / error) ** 2),
        reference.df,
    )


def _flag(unbounded: bool, estimate: float, ends: list[float | None], lost: list[str]) -> str:
    """Return what to know of an effect, in words."""
    where = "plus" if estimate > 0 else "minus"
    if lost:
        return "; ".join([f"runs to {where} infinity"] * unbounded + lost)
    if unbounded and ends == [None, None]:
        return NO_BOUNDS
    if unbounded:
        return f"runs to {where} infinity: the data set no bound on that side"
    missing = [words for end, words in zip(ends, (NO_LOWER, NO_UPPER), strict=True) if end is None]
    return "; ".join(missing)


def mirrored(effect: FixedEffect) -> FixedEffect:
    """Return the effect with its sign changed: a cut point as an intercept."""

    def minus(value: float | None) -> float | None:
        return None if value is None else -value

    flag = effect.flag
    for one, other in (("plus", "minus"), ("lower", "upper")):
        flag = flag.replace(one, "\0").replace(other, one).replace("\0", other)
    return FixedEffect(
        effect.name,
        minus(effect.estimate),
        effect.standard_error,
        minus(effect.ci_high),
        minus(effect.ci_low),
        effect.p_value,
        effect.df,
        flag,
    )
