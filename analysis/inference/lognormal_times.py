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
from numpy.typing import NDArray
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import (
    Derivatives,
    Likelihood,
    PaddedModel,
    marginal_likelihood,
    padded,
    triangle,
)
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
from evenlight.analysis.inference.mixed_designs import (
    Columns,
    Sample,
    estimable_columns,
    in_row_space,
    loadings_of,
    reference_of,
    require_effects,
    slope_of,
    start_of_loadings,
)
from evenlight.data_schema.arrays import Array

__all__ = ["CensoredTimes", "Contrast", "FitFlag", "FixedEffect", "TimesFit", "fit_lognormal_times"]
FURTHEST = 20.0  # an effect beyond it [ln s], over the range of its column, counts as infinite
LARGEST_SD = 15.0  # a participant SD beyond so many residual ones counts as infinite
SMALLEST_SCATTER = 1e-6  # of ln(time): less is none
START_SD = (0.4, 0.3)  # of intercept and slope between participants, in residual standard deviations
LN_ROOT_2PI = 0.5 * np.log(2 * np.pi)


@dataclass(frozen=True, slots=True)
class CensoredTimes:
    """Times until something was found, or for how long it was sought in vain.

    Attributes
    ----------
    times, observed : array (n,), array (n,) of bool
        Until found, or the time limit [s]; whether it was found.
    design, names : array (n, k), tuple of str (k,)
        Fixed effects on ln(time), with the intercept, or with one column per location; and their names.
    groups : array (n,) of int
        Which participant each time belongs to.
    slope_column : int, optional
        Column whose effect differs between participants too, correlated with their intercept.
    """

    times: NDArray[np.float64]
    observed: NDArray[np.bool_]
    design: NDArray[np.float64]
    names: tuple[str, ...]
    groups: NDArray[np.int64]
    slope_column: int | None = None

    def __post_init__(self) -> None:
        n = self.times.size
        if n == 0:
            raise ValueError("need at least one time, got none")
        if not ((self.times > 0) & np.isfinite(self.times)).all():
            raise ValueError(f"times must be above 0 and finite, got {self.times.min():g} s")
        if self.design.shape != (n, len(self.names)) or not self.groups.shape == self.observed.shape == (n,):
            raise ValueError(
                f"need a design of shape ({n}, {len(self.names)}), {n} groups and {n} marks of found, got "
                f"{self.design.shape}, {self.groups.shape} and {self.observed.shape}"
            )
        if not self.names:
            raise ValueError("need at least one column, the intercept; got none")
        require_effects(self.design, self.names, self.slope_column)


@dataclass(frozen=True, slots=True)
class TimesModel:
    """The likelihood model of censored times.

    Attributes
    ----------
    padded, start : PaddedModel, array (d,)
        Parameters: γ = 1/τ, δ = β/τ of the fitted columns, rows of Λ/τ; and where the search starts.
    columns, slope : Columns, int or None
        Which columns of the design are fitted, and the one that has a participant effect too.
    groups : array (n,) of int
        Participant of each time, 0 to P - 1.
    """

    padded: PaddedModel
    start: Array
    columns: Columns
    slope: int | None
    groups: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TimeDensity:
    """The log-density of a time found, or the log-probability of a longer one.

    With the standardized residual a = γ ln t - x δ - w Λ z (Olsen 1978, Econometrica 46, 1211, for censored
    normal data): φ(a) γ / t where found, 1 - Φ(a) where not. b is γ.

    Attributes
    ----------
    found, sought : array (P, m, 1) of bool
        Found, and sought in vain; padding is neither.
    """

    found: NDArray[np.bool_]
    sought: NDArray[np.bool_]

    def __call__(self, a: Array, b: Array) -> Derivatives:
        """Return ℓ, without ln(1/t), and its derivatives."""
        ln_longer = special.log_ndtr(-a)
        hazard = np.exp(-0.5 * a**2 - LN_ROOT_2PI - ln_longer)
        with np.errstate(divide="ignore", invalid="ignore"):  # γ ≤ 0: refused by its value
            ln_scale = np.where(b > 0, np.log(b), -np.inf)
        inverse = np.where(self.found, 1.0 / b, 0.0)
        value = np.where(self.found, ln_scale - 0.5 * a**2 - LN_ROOT_2PI, 0.0)
        return Derivatives(
            value=value + np.where(self.sought, ln_longer, 0.0),
            a=np.where(self.found, -a, 0.0) - np.where(self.sought, hazard, 0.0),
            b=inverse,
            aa=np.where(self.found, -1.0, 0.0) - np.where(self.sought, hazard * (hazard - a), 0.0),
            ab=np.zeros_like(a),
            bb=-(inverse**2),
        )


def times_model(data: CensoredTimes) -> TimesModel:
    """Return the model of the times, with what they can tell."""
    groups = np.unique(data.groups, return_inverse=True)[1].astype(np.int64)
    columns = estimable_columns(data.design, intercept=False)
    slope = slope_of(data.slope_column, data.design, groups, columns)
    fitted = data.design[:, columns.fitted]
    ln_times = np.log(data.times)
    scale = np.zeros((groups.size, 1 + fitted.shape[1]))
    scale[:, 0] = data.observed
    found = padded(data.observed.astype(np.float64), groups)[:, :, None] > 0
    used = padded(np.ones(groups.size), groups)[:, :, None] > 0
    model = PaddedModel(
        a_design=padded(np.column_stack([ln_times, -fitted]), groups),
        b_design=padded(scale, groups),
        a_offset=padded(np.zeros(groups.size), groups),
        b_offset=padded(np.where(data.observed, 0.0, 1.0), groups, 1.0),
        loadings=padded(loadings_of(data.design, groups, slope), groups),
        b_loads=False,
        density=TimeDensity(found, used & ~found),
    )
    return TimesModel(model, _start(ln_times, fitted, model), columns, slope, groups)


def leave_no_scatter(data: CensoredTimes, model: TimesModel) -> bool:
    """Return whether design and participants' own levels and slopes explain every time found exactly.

    The likelihood then has no maximum: it grows without bound as the residual standard deviation shrinks.
    """
    people = np.eye(int(model.groups.max()) + 1)[model.groups]
    loads = loadings_of(data.design, model.groups, model.slope)
    own = [people * loads[:, [k]] for k in range(loads.shape[1])]
    explained = np.column_stack([data.design, *own])[data.observed]
    ln_times = np.log(data.times[data.observed])
    beta, _, rank, _ = np.linalg.lstsq(explained, ln_times, rcond=None)
    left = float(np.abs(ln_times - explained @ beta).max())
    # With two times of each and slopes of their own, levels, slopes and scatter merge: no harm is done.
    return left < SMALLEST_SCATTER and (model.slope is None or ln_times.size > int(rank))


def _start(ln_times: Array, fitted: Array, model: PaddedModel) -> Array:
    """Return the least-squares fit of all times as if found, and usual participant effects."""
    beta = np.linalg.lstsq(fitted, ln_times, rcond=None)[0]
    scale = 1.0 / max(float(np.std(ln_times - fitted @ beta)), 0.1)
    return np.concatenate([[scale], beta * scale, start_of_loadings(model.n_effects, START_SD)])


@dataclass(frozen=True, slots=True)
class Contrast:
    """A linear combination of effects, e.g. of the version at one location.

    Attributes
    ----------
    name, weights : str, tuple of float (k,)
        What it is, and the weights of the columns of the design.
    """

    name: str
    weights: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TimesFit:
    """What the log-normal model of times found.

    Attributes
    ----------
    effects, contrasts : tuple of FixedEffect
        One per column of the design, in its order [ln s per unit of the column]; one per contrast [ln s].
    residual_sd : float
        τ, of ln(time), by maximum likelihood.
    group_sd, slope_sd : float, float or None
        Standard deviations of intercept and slope between participants [ln s]; None without a slope.
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
