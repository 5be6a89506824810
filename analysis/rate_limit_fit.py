"""The rate limit ΔL(L), fitted: a fourth-degree polynomial through detection thresholds (Section 3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.mixed_model import GroupedEstimates, fit_mixed_model
from analysis.rate_limit_curve import (
    PAPER_DEGREE,
    CurveBasis,
    CurveEstimate,
    LuminanceAbscissa,
    RateLimitOptions,
    basis_for,
    curve_band,
    falling_stretches,
    luminances_needed,
)
from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.rate_limit import RateLimit, RateLimitForm
from data_schema.threshold import Threshold, ThresholdFlag

UNUSABLE = (ThresholdFlag.ALL_YES, ThresholdFlag.ALL_NO, ThresholdFlag.FALSE_ALARMS)
OUTSIDE = (ThresholdFlag.ALL_YES, ThresholdFlag.BELOW_RANGE, ThresholdFlag.ALL_NO, ThresholdFlag.ABOVE_RANGE)
WIDEST_BAND = 100.0  # upper over lower end; beyond it a curve says nothing


@dataclass(frozen=True, slots=True)
class RateLimitFit:
    """A fitted rate limit, and what has to be known to trust it.

    Attributes
    ----------
    limit : RateLimit
        The curve, its band and the points: the record that the other programs read.
    residual_df : int
        Points (for participants: luminance levels) minus coefficients; 0 if the curve can meet all of them.
    residual_sd : float or None
        Of the points about the curve [ln units, or cd/m^2/s for `RATE`]; for participants it is τ, what their
        thresholds scatter beyond their standard errors and their own factor. None without an estimate.
    participant_sd : float or None
        σ_u, between participants, same unit; None without several participants.
    falling : tuple of (float, float)
        Luminances [cd/m^2] between which the curve falls noticeably; empty if none.
    used : tuple of Threshold
        The thresholds that went in; empty for bare points.
    excluded : tuple of Threshold
        The thresholds that did not, for their flag.
    notes : tuple of str
        What a reader of the curve should know, as sentences.
    """

    limit: RateLimit
    residual_df: int
    residual_sd: float | None
    participant_sd: float | None
    falling: tuple[tuple[float, float], ...]
    used: tuple[Threshold, ...] = ()
    excluded: tuple[Threshold, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def monotone(self) -> bool:
        """Whether the limit falls nowhere in the measured range by an amount to speak of."""
        return not self.falling


def fit_points(
    luminance: ArrayLike,
    rate: ArrayLike,
    display: Display,
    options: RateLimitOptions | None = None,
    name: str = "rate limit",
) -> RateLimitFit:
    """Fit ΔL(L) to points of equal weight by ordinary least squares, as the authors did.

    The band comes from the scatter of the points about the curve (Student's t with the residual degrees of
    freedom). With as many coefficients as points there is no scatter to estimate it from, and no band.

    Parameters
    ----------
    luminance : array_like (n,)
        L [cd/m^2].
    rate : array_like (n,)
        Thresholds ΔL [cd/m^2/s].
    display : Display
        What they were measured on.
    options : RateLimitOptions, optional
        Form, degree and band.
    name : str
        What to call the limit.

    >>> display = Display("d", 100.0, 0.0, 2.2, 30.0)
    >>> line = RateLimitOptions(RateLimitForm.RATE, degree=1)
    >>> limit = fit_points([10, 50, 90], [0.3, 1.5, 2.7], display, line).limit
    >>> [round(c, 6) for c in limit.coefficients]  # at the middle, and half the rise
    [1.5, 1.2]
    """
    options = options or RateLimitOptions()
    L = np.asarray(luminance, dtype=np.float64)
    points = np.asarray(rate, dtype=np.float64)
    basis = basis_for(L, options)
    design = basis.design(L)
    target = basis.ordinate(points)
    coefficients = np.asarray(np.linalg.lstsq(design, target, rcond=None)[0], dtype=np.float64)
    df = L.size - design.shape[1]
    variance = float(np.sum((target - design @ coefficients) ** 2)) / df if df else None
    covariance = None if variance is None else variance * np.linalg.inv(design.T @ design)
    estimate = CurveEstimate(coefficients, covariance, float(df))
    return RateLimitFit(
        limit=_record(_Named(name, display), basis, estimate, (L, points), options),
        residual_df=df,
        residual_sd=None if variance is None else variance**0.5,
        participant_sd=None,
        falling=falling_stretches(basis, coefficients),
        notes=_shape_notes(basis, coefficients, df),
    )


def fit_thresholds(
    thresholds: Sequence[Threshold],
    display: Display,
    options: RateLimitOptions | None = None,
    name: str = "rate limit",
) -> RateLimitFit:
    """Fit ΔL(L) to the thresholds of one or several participants by a mixed model: the population's curve.

    ln ΔL_pl = polynomial(L_l) + u_p + e_pl: each participant p has a factor of their own, each threshold its
    standard error se_pl and what it scatters beyond that (τ). Thresholds flagged `all_yes`, `all_no` or
    `false_alarms` are left out, because their value is the prior's or the criterion's, not the eye's.
    The band is that of the population's curve (Student's t with one degree of freedom less than there are
    participants); of one participant it is that participant's curve, known as well as the thresholds are.

    Parameters
    ----------
    thresholds : sequence of Threshold
        One per participant and level.
    display, options, name
        As in `fit_points`.

    Raises
    ------
    InputError
        If most thresholds lie outside the rates tested, those that can be used lie at too few luminances, or
        a degree above the paper's leaves the curve unknown within a factor of 100 somewhere.
    """
    options = options or RateLimitOptions()
    used = tuple(t for t in thresholds if t.flag not in UNUSABLE)
    excluded = tuple(t for t in thresholds if t.flag in UNUSABLE)
    _require_within_rates(thresholds)
    _require_levels(used, excluded, options.degree)
    L = _abscissae(used, options)
    basis = basis_for(L, options)
    data = _grouped(used, L, basis)
    model = fit_mixed_model(data)
    df = int(np.unique(L).size) - data.design.shape[1]
    estimate = CurveEstimate(model.coefficients, model.covariance, _band_df(data))
    rates = np.array([t.threshold for t in used])
    several = data.n_groups > 1
    limit = _record(_Named(name, display), basis, estimate, (L, rates), options)
    _require_known(limit, options.degree)
    return RateLimitFit(
        limit=limit,
        residual_df=df,
        residual_sd=model.residual_sd,
        participant_sd=model.group_sd if several else None,
        falling=falling_stretches(basis, model.coefficients),
        used=used,
        excluded=excluded,
        notes=_exclusion_notes(excluded, len(thresholds))
        + _participant_notes(data)
        + _shape_notes(basis, model.coefficients, df),
    )


def _abscissae(thresholds: Sequence[Threshold], options: RateLimitOptions) -> NDArray[np.float64]:
    """Return the luminance at which each threshold is entered [cd/m^2].

    Mean and final luminance depend on the threshold itself. To keep its error off the abscissa, they are
    taken for each level at the geometric mean of the participants' thresholds there.
    """
    initial = np.array([t.luminance for t in thresholds])
    share = {LuminanceAbscissa.INITIAL: 0.0, LuminanceAbscissa.MEAN: 0.5, LuminanceAbscissa.FINAL: 1.0}
    if not initial.size or options.abscissa is LuminanceAbscissa.INITIAL:
        return initial
    _, level = np.unique(initial, return_inverse=True)
    ln_rates = np.log([t.threshold for t in thresholds])
    typical = np.exp(np.bincount(level, ln_rates) / np.bincount(level))[level]
    return initial - share[options.abscissa] * options.ramp_duration * typical


def _grouped(
    thresholds: Sequence[Threshold], luminance: NDArray[np.float64], basis: CurveBasis
) -> GroupedEstimates:
    """Return the thresholds as the mixed model takes them."""
    rates = np.array([t.threshold for t in thresholds])
    errors = np.array([t.standard_error_ln for t in thresholds])
    if basis.form is RateLimitForm.RATE:
        errors = errors * rates  # first order: d(rate) = rate d(ln rate)
    _, groups = np.unique([t.participant_id for t in thresholds], return_inverse=True)
    return GroupedEstimates(basis.ordinate(rates), errors, basis.design(luminance), groups.astype(np.int64))


def _band_df(data: GroupedEstimates) -> float:
    """Return the degrees of freedom of the band: of the participants, or of one participant's scatter.

    The curve's height is a mean over participants, so its variance is known from P values only.
    """
    if data.n_groups > 1:
        return float(data.n_groups - 1)
    df = data.values.size - data.design.shape[1]
    return float(df) if df > 0 else float("inf")


@dataclass(frozen=True, slots=True)
class _Named:
    """What a limit is called and which display it holds for."""

    name: str
    display: Display


def _record(
    named: _Named,
    basis: CurveBasis,
    estimate: CurveEstimate,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    options: RateLimitOptions,
) -> RateLimit:
    """Return the record of a fitted curve."""
    band = curve_band(basis, estimate, options.band_level)
    try:
        return RateLimit(
            name=named.name,
            display_name=named.display.name,
            display_fingerprint=named.display.fingerprint,
            form=basis.form,
            coefficients=_floats(estimate.coefficients),
            luminance_range=basis.luminance_range,
            band_luminance=_floats(band[0]),
            band_lower=_floats(band[1]),
            band_upper=_floats(band[2]),
            band_level=options.band_level,
            point_luminance=_floats(points[0]),
            point_rate=_floats(points[1]),
            condition_number=max(1.0, float(np.linalg.cond(basis.design(points[0])))),
        )
    except ValueError as error:  # the record's limits: no display or eye has such rates
        raise InputError(f"the thresholds give no usable rate limit: {error}") from error


def _require_within_rates(thresholds: Sequence[Threshold]) -> None:
    """Refuse thresholds most of which lie outside the rates tested: they are the prior's word."""
    below = sum(t.flag in OUTSIDE[:2] for t in thresholds)
    above = sum(t.flag in OUTSIDE[2:] for t in thresholds)
    if 2 * (below + above) <= len(thresholds):
        return
    advice = " and ".join(
        word for word, count in (("slower", below), ("faster", above)) if 4 * count > below + above
    )
    raise InputError(
        f"{below + above} of {len(thresholds)} thresholds lie outside the rates tested "
        f"({_listed(thresholds, OUTSIDE)}), which is no basis for a rate limit; test {advice} ramps"
    )


def _require_levels(used: Sequence[Threshold], excluded: Sequence[Threshold], degree: int) -> None:
    """Refuse too few luminances where it is the thresholds left out that are missing."""
    luminances, needed = len({t.luminance for t in used}), luminances_needed(degree)
    if not excluded or luminances >= needed:
        return
    raise InputError(
        f"a rate limit of degree {degree} needs thresholds at {needed} or more luminances, got {luminances}: "
        f"{len(excluded)} of {len(used) + len(excluded)} thresholds are left out "
        f"({_listed(excluded, UNUSABLE)}); mend what these flags name, or measure more levels"
    )


def _require_known(limit: RateLimit, degree: int) -> None:
    """Refuse a degree above the paper's that the thresholds do not tie down."""
    lower, upper = np.array(limit.band_lower), np.array(limit.band_upper)
    loose = np.flatnonzero(upper > WIDEST_BAND * lower)
    if degree <= PAPER_DEGREE or not loose.size:
        return
    worst = loose[int(np.argmax((upper - lower)[loose]))]
    raise InputError(
        f"a rate limit of degree {degree} is not known from these thresholds: at "
        f"{limit.band_luminance[worst]:.3g} cd/m^2 its band reaches from {lower[worst]:.2g} to "
        f"{upper[worst]:.2g} cd/m^2/s; give --degree {PAPER_DEGREE} or lower"
    )


def _floats(values: NDArray[np.float64]) -> tuple[float, ...]:
    """Return an array as a tuple of Python's numbers."""
    return tuple(values.tolist())


def _shape_notes(basis: CurveBasis, coefficients: NDArray[np.float64], residual_df: int) -> tuple[str, ...]:
    """Return what is to be said about the curve's shape."""
    notes = []
    if residual_df <= 0:
        notes.append(
            f"Degree {basis.degree} has as many coefficients as there are luminances: the curve can meet "
            "every level, and the data cannot tell whether its shape is right."
        )
    for low, high in falling_stretches(basis, coefficients):
        notes.append(
            f"The limit falls with luminance from {low:.4g} to {high:.4g} cd/m^2, within the measured range."
        )
    luminance = np.linspace(*basis.luminance_range, 201)
    if basis.form is RateLimitForm.RATE and (basis.design(luminance) @ coefficients <= 0).any():
        notes.append("The polynomial of the rate falls to 0 or below within the measured range.")
    return tuple(notes)


def _participant_notes(data: GroupedEstimates) -> tuple[str, ...]:
    """Return what is to be said about a fit to one participant."""
    if data.n_groups > 1:
        return ()
    return ("One participant: the band is this participant's, and says nothing about others.",)


def _exclusion_notes(excluded: Sequence[Threshold], total: int) -> tuple[str, ...]:
    """Return how many thresholds were left out, and which way that draws the curve."""
    if not excluded:
        return ()
    counts = {flag: sum(t.flag is flag for t in excluded) for flag in UNUSABLE}
    words = f"{len(excluded)} of {total} thresholds are left out ({_listed(excluded, UNUSABLE)})."
    if counts[ThresholdFlag.ALL_YES]:
        words += (
            " All_yes lie below the slowest rate tested: without them the limit is too high, on the unsafe "
            "side; test slower rates."
        )
    if counts[ThresholdFlag.ALL_NO]:
        words += " All_no lie above the fastest one: without them the limit is too low, on the safe side."
    return (words,)


def _listed(thresholds: Sequence[Threshold], flags: Sequence[ThresholdFlag]) -> str:
    """Return how many thresholds carry each of some flags, as "3 all_yes, 1 all_no"."""
    counts = ((sum(t.flag is flag for t in thresholds), flag.value) for flag in flags)
    return ", ".join(f"{count} {name}" for count, name in counts if count)
