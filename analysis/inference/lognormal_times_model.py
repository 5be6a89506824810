"""Censored log-normal times as a likelihood model that is concave in its parameters."""

from __future__ import annotations

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

SMALLEST_SCATTER = 1e-6  # of ln(time): less is none
START_SD = (0.4, 0.3)  # of intercept and slope between participants, in residual standard deviations
LN_ROOT_2PI = 0.5 * np.log(2 * np.pi)


@dataclass(frozen=True, slots=True)
class CensoredTimes:
    """Times until something was found, or for how long it was sought in vain.

    Attributes
    ----------
    times : array (n,)
        Until found, or the time limit [s].
    observed : array (n,) of bool
        Whether it was found.
    design : array (n, k)
        Fixed effects on ln(time), with the intercept, or with one column per location.
    names : tuple of str (k,)
        Of the columns.
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
    padded : PaddedModel
        Parameters: γ = 1/τ, δ = β/τ of the fitted columns, rows of Λ/τ.
    start : array (d,)
        Where the search starts.
    columns : Columns
        Which columns of the design are fitted.
    slope : int or None
        Column that has a participant effect too.
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
