"""Log-normal accelerated-failure-time model: censored times, a normal effect of each participant.

ln t of participant p = x β + w u_p + τ ε, u_p ~ N(0, Σ), ε ~ N(0, 1); what was not found within the limit
took longer. Effects are differences of ln(time): e^β is a ratio of median times. What is tested against what:
docs/decisions/cumulative-link-model.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import special

from evenlight.analysis.inference.adaptive_quadrature import (
    Density,
    Derivatives,
    Likelihood,
    PaddedModel,
    marginal_likelihood,
    padded,
    triangle,
)
from evenlight.analysis.inference.fixed_effects import (
    FitFlag,
    FixedEffect,
    Flag,
    Maximum,
    Objective,
    Profile,
    fit_flags,
    maximum,
    profiled_effect,
    walled,
)
from evenlight.analysis.inference.mixed_designs import (
    GroupedModel,
    grouped_design,
    in_row_space,
    people_reference,
    reference_of,
    require_effects,
    start_of_loadings,
)
from evenlight.data_schema.arrays import Array, Integers, Mask

FURTHEST = 20.0  # an effect beyond it [ln s], over the range of its column, counts as infinite
LARGEST_SD = 15.0  # a participant SD beyond so many residual ones counts as infinite
SMALLEST_SCATTER = 1e-6  # of ln(time): less is none
START_SD = (0.4, 0.3)  # of intercept and slope between participants, in residual standard deviations
# With more times of each participant than this, their levels are so certain that few nodes suffice.
MANY, FEW_NODES = 50, 5
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

    times: Array
    observed: Mask
    design: Array
    names: tuple[str, ...]
    groups: Integers
    slope_column: int | None = None

    def __post_init__(self) -> None:
        n = self.times.size
        if n == 0:
            raise ValueError("need at least one time, got none")
        if not ((self.times > 0) & np.isfinite(self.times)).all():
            raise ValueError(f"times must be above 0 and finite, got {self.times.min():g} s")
        if self.observed.shape != (n,):
            raise ValueError(f"need {n} marks of found, got {self.observed.shape}")
        if not self.names:
            raise ValueError("need at least one column, the intercept; got none")
        require_effects(n, self.design, self.names, self.groups, self.slope_column)


def _density(found: Mask, sought: Mask) -> Density:
    """Return the log-density of times found, and the log-probability of longer ones where sought in vain.

    With the standardized residual a = γ ln t - x δ - w Λ z (Olsen 1978, Econometrica 46, 1211, for censored
    normal data): φ(a) γ / t where found, 1 - Φ(a) where not. b is γ; ln(1/t) is left out. Padding, (P, m, 1)
    like the rest, is neither found nor sought.
    """

    def density(a: Array, b: Array) -> Derivatives:
        ln_longer = special.log_ndtr(-a)
        hazard = np.exp(-0.5 * a**2 - LN_ROOT_2PI - ln_longer)
        with np.errstate(divide="ignore", invalid="ignore"):  # γ ≤ 0: refused by its value
            ln_scale = np.where(b > 0, np.log(b), -np.inf)
        inverse = np.where(found, 1.0 / b, 0.0)
        value = np.where(found, ln_scale - 0.5 * a**2 - LN_ROOT_2PI, 0.0)
        return Derivatives(
            value=value + np.where(sought, ln_longer, 0.0),
            a=np.where(found, -a, 0.0) - np.where(sought, hazard, 0.0),
            b=inverse,
            aa=np.where(found, -1.0, 0.0) - np.where(sought, hazard * (hazard - a), 0.0),
            ab=np.zeros_like(a),
            bb=-(inverse**2),
        )

    return density


def times_model(data: CensoredTimes) -> GroupedModel:
    """Return the model of the times, with what they can tell.

    Parameters: γ = 1/τ, δ = β/τ of the fitted columns, rows of Λ/τ.
    """
    design = grouped_design(data.design, data.groups, data.slope_column, intercept=False)
    groups, fitted, ln_times = design.groups, design.fitted, np.log(data.times)
    scale = np.zeros((groups.size, 1 + fitted.shape[1]))
    scale[:, 0] = data.observed
    found = padded(data.observed.astype(np.float64), groups)[:, :, None] > 0
    used = padded(np.ones(groups.size), groups)[:, :, None] > 0
    model = PaddedModel(
        a_design=padded(np.column_stack([ln_times, -fitted]), groups),
        b_design=padded(scale, groups),
        a_offset=padded(np.zeros(groups.size), groups),
        b_offset=padded(np.where(data.observed, 0.0, 1.0), groups, 1.0),
        loadings=padded(design.loadings, groups),
        b_loads=False,
        density=_density(found, used & ~found),
    )
    # The least-squares fit of all times as if found, and usual participant effects.
    beta = np.linalg.lstsq(fitted, ln_times, rcond=None)[0]
    gamma = 1.0 / max(float(np.std(ln_times - fitted @ beta)), 0.1)
    start = np.concatenate([[gamma], beta * gamma, start_of_loadings(model.n_effects, START_SD)])
    return GroupedModel(model, start, design)


def _leave_no_scatter(data: CensoredTimes, model: GroupedModel) -> bool:
    """Return whether design and participants' own levels and slopes explain every time found exactly.

    The likelihood then has no maximum: it grows without bound as the residual standard deviation shrinks.
    """
    people = np.eye(int(model.design.groups.max()) + 1)[model.design.groups]
    own = [people * loads[:, None] for loads in model.design.loadings.T]
    explained = np.column_stack([data.design, *own])[data.observed]
    ln_times = np.log(data.times[data.observed])
    beta, _, rank, _ = np.linalg.lstsq(explained, ln_times, rcond=None)
    left = float(np.abs(ln_times - explained @ beta).max())
    # With two times of each and slopes of their own, levels, slopes and scatter merge: no harm is done.
    return left < SMALLEST_SCATTER and (model.design.slope is None or ln_times.size > int(rank))


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
    n, n_groups : int
        Times and participants.
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
    n_groups: int
    flags: tuple[FitFlag, ...]


def fit_lognormal_times(
    data: CensoredTimes,
    contrasts: Mapping[str, Sequence[float]] | None = None,
    profiled: tuple[str, ...] | None = None,
    nodes: int | None = None,
    clustered: bool = False,
) -> TimesFit:
    """Fit the log-normal model of times by maximum likelihood.

    Parameters
    ----------
    data : CensoredTimes
        The times; hard ones (nothing found, a location nobody found, no scatter) give flags, not numbers.
    contrasts : mapping of str to sequence of float (k,), optional
        Linear combinations of effects wanted too, e.g. that of the version at one location: the weights of
        the columns of the design, by name. Each has the interval of its own profile.
    profiled : tuple of str, optional
        Names of the effects and contrasts whose interval and test are by the profile likelihood; the others'
        are by the standard error, which is quicker. None for all.
    nodes : int, optional
        Of the quadrature over participants, for each random effect; fewer are quicker.
    clustered : bool
        Whether all intervals and tests are by standard errors over participants (sandwich) and Student's t:
        for searches that each of several participants repeated, in whatever way these are alike.
    """
    n_groups = np.unique(data.groups).size
    flags = (FitFlag.ONE_PARTICIPANT,) if n_groups == 1 else ()
    clustered = clustered and n_groups > 1
    if clustered and data.times.size > MANY * n_groups:
        nodes = nodes or FEW_NODES
    names = data.names, tuple(contrasts or ())
    without = partial(times_fit_without_numbers, names, data.times.size, n_groups)
    if not data.observed.any():
        return without((FitFlag.NOTHING_OBSERVED, *flags))
    model = times_model(data)
    if _leave_no_scatter(data, model):
        return without((FitFlag.NO_SCATTER, *flags))
    objective = walled(
        partial(marginal_likelihood, model.padded, nodes=nodes), model.padded.n_fixed, LARGEST_SD
    )
    top = maximum(objective, model.start)
    k = len(data.names)
    weights = [*np.eye(k), *(contrasts or {}).values()]
    every = tuple(
        _effect(data, model, (objective, top), asked, profiled is None or asked[0] in profiled, clustered)
        for asked in zip((*names[0], *names[1]), weights, strict=True)
    )
    residual_sd = 1 / float(top.parameters[0])
    group_sd, slope_sd = _spread(model, top)
    return TimesFit(
        effects=every[:k],
        contrasts=every[k:],
        residual_sd=residual_sd,
        group_sd=group_sd,
        slope_sd=slope_sd,
        log_likelihood=top.likelihood.value - float(np.log(data.times[data.observed]).sum()),
        n=data.times.size,
        n_groups=n_groups,
        flags=(*flags, *fit_flags(every, model, top)),
    )


def _effect(
    data: CensoredTimes,
    model: GroupedModel,
    found: tuple[Objective, Maximum],
    asked: tuple[str, Sequence[float] | Array],
    profiled: bool,
    clustered: bool,
) -> FixedEffect:
    """Return a combination of effects, w β: one effect of a design that is turned so that it has it.

    X β = X M β' with β'_m = w β for a column m of weight w_m ≠ 0 and β'_l = β_l for the others.
    """
    name, weights = asked[0], np.asarray(asked[1], dtype=np.float64)
    if weights.shape != (len(data.names),) or not weights.any():
        raise ValueError(
            f"contrast {name!r} needs {len(data.names)} weights that are not all 0, got {weights}"
        )
    design = model.design
    if not (all(design.identifiable) or in_row_space(weights, data.design)):
        return FixedEffect(name, flags=(FitFlag.NOT_ESTIMABLE,))
    kept = weights[list(design.places)]
    m = int(np.argmax(np.abs(kept)))
    turn = np.eye(kept.size)
    turn[m] = -kept / kept[m]
    turn[m, m] = 1 / kept[m]
    turned = design.fitted @ turn
    slope = design.slope is not None and bool(weights[design.slope])
    reference = reference_of(turned, m, design.groups, int(data.observed.sum()), slope)
    if clustered:
        random = design.loadings @ _factor(model, found[1])
        reference = people_reference(turned, m, design.groups, random if slope else None)
    span = float(np.ptp(turned[:, m])) or float(np.abs(turned[:, m]).max())
    profile = Profile(*_turned(*found, turn), 1 + m, scale=0)
    profiled = profiled and not clustered
    return profiled_effect(name, profile, span, FURTHEST, reference, profiled, clustered=clustered)


def _turned(likelihood: Objective, top: Maximum, turn: Array) -> tuple[Objective, Maximum]:
    """Return a likelihood and its maximum in the parameters of a turned design."""
    matrix = np.eye(top.parameters.size)
    matrix[1 : 1 + turn.shape[0], 1 : 1 + turn.shape[0]] = turn

    def changed(old: Likelihood) -> Likelihood:
        scores = None if old.scores is None else old.scores @ matrix
        turned = matrix.T @ old.gradient, matrix.T @ old.hessian @ matrix
        return Likelihood(old.value, *turned, scores=scores)

    parameters = np.asarray(np.linalg.solve(matrix, top.parameters))
    new_top = Maximum(parameters, changed(top.likelihood), True)
    return lambda theta: changed(likelihood(matrix @ theta)), new_top


def _spread(model: GroupedModel, top: Maximum) -> tuple[float, float | None]:
    factor = _factor(model, top) / top.parameters[0]
    sds = np.sqrt(np.diag(factor @ factor.T)).tolist()
    return (sds or [0.0])[0], (sds[1] if len(sds) > 1 else None)


def _factor(model: GroupedModel, top: Maximum) -> Array:
    """Return Λ/τ, of the effects of participants."""
    return triangle(top.parameters[model.padded.n_fixed :], model.padded.n_effects)


def times_fit_without_numbers(
    names: tuple[Sequence[str], Sequence[str]],
    n: int,
    n_groups: int,
    flags: tuple[FitFlag, ...],
    of_effects: Flag | None = None,
) -> TimesFit:
    """Return a fit that says why there is none.

    Parameters
    ----------
    names : (sequence of str, sequence of str)
        Of the effects, and of the contrasts.
    n, n_groups : int
        Times and participants.
    flags, of_effects : tuple of FitFlag, Flag or None
        Why, for the fit; and for each effect, where the first flag does not say it.
    """
    effects, contrasts = (
        tuple(FixedEffect(name, flags=(of_effects or flags[0],)) for name in own) for own in names
    )
    return TimesFit(effects, contrasts, math.nan, math.nan, None, None, n, n_groups, flags)
