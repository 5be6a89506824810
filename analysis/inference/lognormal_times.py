"""Log-normal accelerated-failure-time model: censored times, a normal effect of each participant.

ln t of participant p = x β + w u_p + τ ε, u_p ~ N(0, Σ), ε ~ N(0, 1); what was not found within the limit
took longer. Effects are differences of ln(time): e^β is a ratio of median times. What is tested against what:
docs/decisions/censored-search-times.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from evenlight.analysis.inference.adaptive_quadrature import Likelihood, marginal_likelihood, triangle
from evenlight.analysis.inference.fixed_effects import (
    EffectSpec,
    FitFlag,
    FittedModel,
    FixedEffect,
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
from evenlight.analysis.inference.lognormal_times_model import (
    CensoredTimes,
    TimesModel,
    leave_no_scatter,
    times_model,
)
from evenlight.analysis.inference.mixed_designs import Sample, in_row_space, reference_of
from evenlight.data_schema.arrays import Array

__all__ = ["CensoredTimes", "Contrast", "FitFlag", "FixedEffect", "TimesFit", "fit_lognormal_times"]

FURTHEST = 20.0  # an effect beyond it [ln s], over the range of its column, counts as infinite
LARGEST_SD = 15.0  # a participant SD beyond so many residual ones counts as infinite


@dataclass(frozen=True, slots=True)
class Contrast:
    """A linear combination of effects, e.g. of the version at one location.

    Attributes
    ----------
    name : str
        What it is.
    weights : tuple of float (k,)
        Of the columns of the design.
    """

    name: str
    weights: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TimesFit:
    """What the log-normal model of times found.

    Attributes
    ----------
    effects : tuple of FixedEffect
        One per column of the design, in its order [ln s per unit of the column].
    contrasts : tuple of FixedEffect
        One per contrast asked for [ln s].
    residual_sd : float
        τ, of ln(time), by maximum likelihood.
    group_sd : float
        Standard deviation of the intercept between participants [ln s].
    slope_sd : float or None
        Of the slope; None without one.
    log_likelihood : float or None
        At the maximum, of the times in seconds.
    n, n_observed, n_groups : int
        Times, those found, and participants.
    flags : tuple of FitFlag
        What to know; empty for nothing.
    """

    effects: tuple[FixedEffect, ...]
    contrasts: tuple[FixedEffect, ...]
    residual_sd: float
    group_sd: float
    slope_sd: float | None
    log_likelihood: float | None
    n: int
    n_observed: int
    n_groups: int
    flags: tuple[FitFlag, ...]


def fit_lognormal_times(
    data: CensoredTimes, contrasts: tuple[Contrast, ...] = (), profiled: tuple[str, ...] | None = None
) -> TimesFit:
    """Fit the log-normal model of times by maximum likelihood.

    Parameters
    ----------
    data : CensoredTimes
        The times; hard ones (nothing found, a location nobody found, no scatter) give flags, not numbers.
    contrasts : tuple of Contrast
        Linear combinations of effects wanted too, each with the interval of its own profile.
    profiled : tuple of str, optional
        Names of the effects and contrasts whose interval and test are by the profile likelihood; the others'
        are by the standard error, which is quicker. None for all.
    """
    n_groups = np.unique(data.groups).size
    flags = (FitFlag.ONE_PARTICIPANT,) if n_groups == 1 else ()
    if not data.observed.any():
        return _without_numbers(data, contrasts, (FitFlag.NOTHING_OBSERVED, *flags))
    model = times_model(data)
    if leave_no_scatter(data, model):
        return _without_numbers(data, contrasts, (FitFlag.NO_SCATTER, *flags))
    objective = WalledLikelihood(partial(marginal_likelihood, model.padded), model.padded.n_fixed, LARGEST_SD)
    top = maximum(objective, model.start)
    found = _Fit(data, model, objective, top)
    units = [
        Contrast(name, tuple(row)) for name, row in zip(data.names, np.eye(len(data.names)), strict=True)
    ]
    every = tuple(
        _effect(found, asked, profiled is None or asked.name in profiled) for asked in (*units, *contrasts)
    )
    residual_sd = 1 / float(top.parameters[0])
    group_sd, slope_sd = _spread(model, top)
    return TimesFit(
        effects=every[: len(units)],
        contrasts=every[len(units) :],
        residual_sd=residual_sd,
        group_sd=group_sd,
        slope_sd=slope_sd,
        log_likelihood=top.likelihood.value - float(np.log(data.times[data.observed]).sum()),
        n=data.times.size,
        n_observed=int(data.observed.sum()),
        n_groups=n_groups,
        flags=(*flags, *_flags(every, model, top)),
    )


@dataclass(frozen=True, slots=True)
class _Fit:
    """The data, their model, and where its likelihood is largest."""

    data: CensoredTimes
    model: TimesModel
    objective: Objective
    top: Maximum


def _effect(found: _Fit, asked: Contrast, profiled: bool) -> FixedEffect:
    """Return a combination of effects, w β: one effect of a design that is turned so that it has it.

    X β = X M β' with β'_m = w β for a column m of weight w_m ≠ 0 and β'_l = β_l for the others.
    """
    data, model = found.data, found.model
    weights = np.asarray(asked.weights, dtype=np.float64)
    if weights.shape != (len(data.names),) or not weights.any():
        raise ValueError(
            f"contrast {asked.name!r} needs {len(data.names)} weights that are not all 0, got {weights}"
        )
    if not in_row_space(weights, data.design):
        return unknown_effect(asked.name, FitFlag.NOT_ESTIMABLE)
    kept = weights[list(model.columns.fitted)]
    m = int(np.argmax(np.abs(kept)))
    turn = np.eye(kept.size)
    turn[m] = -kept / kept[m]
    turn[m, m] = 1 / kept[m]
    design = data.design[:, model.columns.fitted] @ turn
    slope = model.slope is not None and bool(weights[model.slope])
    sample = Sample(model.groups, int(data.observed.sum()), own_variance=True)
    reference = reference_of(design, m, sample, slope)
    span = float(np.ptp(design[:, m])) or float(np.abs(design[:, m]).max())
    wanted = EffectSpec(asked.name, HeldParameter(1 + m, scale=0), span, reference)
    return profiled_effect(_turned(found, turn), wanted, profiled)


def _turned(found: _Fit, turn: Array) -> FittedModel:
    """Return the fitted model in the parameters of a turned design."""
    matrix = np.eye(found.top.parameters.size)
    matrix[1 : 1 + turn.shape[0], 1 : 1 + turn.shape[0]] = turn

    def objective(parameters: Array) -> Likelihood:
        return changed(found.objective(matrix @ parameters))

    def changed(old: Likelihood) -> Likelihood:
        return Likelihood(old.value, matrix.T @ old.gradient, matrix.T @ old.hessian @ matrix)

    top = Maximum(
        np.asarray(np.linalg.solve(matrix, found.top.parameters)), changed(found.top.likelihood), True
    )
    return FittedModel(objective, top, FURTHEST)


def _spread(model: TimesModel, top: Maximum) -> tuple[float, float | None]:
    """Return the standard deviations of the participants' intercepts and slopes [ln s]."""
    padded = model.padded
    factor = triangle(top.parameters[padded.n_fixed :], padded.n_effects) / top.parameters[0]
    sds = np.sqrt(np.diag(factor @ factor.T)).tolist()
    return (sds or [0.0])[0], (sds[1] if len(sds) > 1 else None)


def _flags(effects: tuple[FixedEffect, ...], model: TimesModel, top: Maximum) -> list[FitFlag]:
    """Return what to know of a fit as a whole."""
    found = {
        FitFlag.NOT_ESTIMABLE: not all(model.columns.identifiable),
        FitFlag.SEPARATED: any("infinity" in effect.flag for effect in effects),
        FitFlag.NOT_CONVERGED: not top.converged,
    }
    return [flag for flag, holds in found.items() if holds]


def _without_numbers(
    data: CensoredTimes, contrasts: tuple[Contrast, ...], flags: tuple[FitFlag, ...]
) -> TimesFit:
    """Return a fit that says why there is none."""
    return TimesFit(
        effects=tuple(unknown_effect(name, flags[0]) for name in data.names),
        contrasts=tuple(unknown_effect(contrast.name, flags[0]) for contrast in contrasts),
        residual_sd=math.nan,
        group_sd=math.nan,
        slope_sd=None,
        log_likelihood=None,
        n=data.times.size,
        n_observed=int(data.observed.sum()),
        n_groups=np.unique(data.groups).size,
        flags=flags,
    )
