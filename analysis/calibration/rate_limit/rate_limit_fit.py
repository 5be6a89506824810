"""The rate limit ΔL(L), fitted: a fourth-degree polynomial through detection thresholds (Section 3.4)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.conditions import (
    Condition,
    ConditionEffect,
    abscissae,
    condition_of,
    model_of_thresholds,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    PAPER_DEGREE,
    CurveBasis,
    CurveEstimate,
    RateLimitOptions,
    basis_for,
    curve_band,
    falling_stretches,
    luminances_needed,
)
from evenlight.analysis.inference.mixed_model import GroupedEstimates
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.threshold import Threshold, ThresholdFlag

OUTSIDE = (ThresholdFlag.ALL_YES, ThresholdFlag.BELOW_RANGE, ThresholdFlag.ALL_NO, ThresholdFlag.ABOVE_RANGE)
ONE_PARTICIPANT = (
    "One participant, of whom the curve is: it has no band, for nothing is known of other people."
)
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
    used, excluded : tuple of Threshold
        The thresholds that went in, and those that did not, for their flag; empty for bare points.
    notes : tuple of str
        What a reader of the curve should know, as sentences.
    reference, effects : Condition or None, tuple of ConditionEffect
        The ramps that the limit is for, None for bare points; and how the thresholds of other ramps compare.
    """

    limit: RateLimit
    residual_df: int
    residual_sd: float | None
    participant_sd: float | None
    falling: tuple[tuple[float, float], ...]
    used: tuple[Threshold, ...] = ()
    excluded: tuple[Threshold, ...] = ()
    notes: tuple[str, ...] = ()
    reference: Condition | None = None
    effects: tuple[ConditionEffect, ...] = ()

    @property
    def own(self) -> tuple[Threshold, ...]:
        """Those of the ramps that the limit is for which have a value of their own: not all answers alike."""
        here = (t for t in self.used if t.flag not in UNUSABLE)
        return tuple(t for t in here if self.reference in (None, condition_of(t)))

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

    The pointwise band comes from the scatter of the points about the curve (Student's t with the residual
    degrees of freedom). With as many coefficients as points there is no scatter to estimate it from, and no
    band.

    Parameters
    ----------
    luminance, rate : array_like (n,)
        L [cd/m^2], and thresholds ΔL [cd/m^2/s].
    display, options : Display, RateLimitOptions, optional
        What they were measured on; form, degree and band.
    name : str
        What to call the limit.

    >>> from evenlight.data_schema.rate_limit import RateLimitForm
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
        notes=shape_notes(basis, coefficients, df),
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
    The band is pointwise: that of the population's curve (confidence band, Student's t with one degree of
    freedom less than there are participants). One participant tells nothing of others, and gives no band.

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
    _require_one_task(thresholds)
    require_within_rates(thresholds)
    _require_levels(used, excluded, options)
    found = model_of_thresholds(used, options)
    own = tuple(t for t in used if found.reference in (None, condition_of(t)))
    basis, model, data = found.basis, found.model, found.data
    size = basis.degree + 1
    several = data.n_groups > 1
    covariance = model.covariance[:size, :size] if several else None
    estimate = CurveEstimate(model.coefficients[:size], covariance, data.n_groups - 1.0)
    points = abscissae(own, options), np.array([t.threshold for t in own])
    limit = _record(_Named(name, display), basis, estimate, points, options)
    _require_known(limit, basis.degree)
    df = int(np.unique(found.luminance).size) - size
    chosen = options.direction is not None or options.ramp_duration is not None
    return RateLimitFit(
        limit=_of_the_task(limit, used, found.reference),
        residual_df=df,
        residual_sd=model.residual_sd,
        participant_sd=model.group_sd if several else None,
        falling=falling_stretches(basis, estimate.coefficients),
        used=used,
        excluded=excluded,
        notes=exclusion_notes(excluded, len(thresholds))
        + participant_notes(data)
        + (condition_notes(found.reference, found.effects, chosen) if found.reference else ())
        + shape_notes(basis, estimate.coefficients, df),
        reference=found.reference,
        effects=found.effects,
    )


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
            display=named.display,
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


def _of_the_task(limit: RateLimit, used: Sequence[Threshold], reference: Condition | None) -> RateLimit:
    """Return a limit that says which task and which ramps it is for."""
    if reference is None:
        return limit
    return dataclasses.replace(
        limit,
        procedure=used[0].procedure,
        direction=reference.direction,
        ramp_duration=reference.ramp_duration,
        model=RateLimitModel.INDIVIDUAL,
    )


def _require_one_task(thresholds: Sequence[Threshold]) -> None:
    """Refuse thresholds of both tasks: 75 % "yes" and 75 % right are not the same d′."""
    tasks = sorted({t.procedure.value for t in thresholds})
    if len(tasks) > 1:
        raise InputError(
            f"thresholds of {' and '.join(tasks)} do not compare (75 % of what?), and make no common rate "
            f"limit; choose the procedure {tasks[0]} or {tasks[1]}"
        )


def require_within_rates(thresholds: Sequence[Threshold]) -> None:
    """Refuse thresholds most of which lie outside the rates tested: the prior sets them."""
    below = sum(t.flag in OUTSIDE[:2] for t in thresholds)
    above = sum(t.flag in OUTSIDE[2:] for t in thresholds)
    if 2 * (below + above) <= len(thresholds):
        return
    advice = " and ".join(
        word for word, count in (("slower", below), ("faster", above)) if 4 * count > below + above
    )
    raise InputError(
        f"{below + above} of {len(thresholds)} thresholds lie outside the rates tested "
        f"({listed(thresholds, OUTSIDE)}), which is no basis for a rate limit; test {advice} ramps"
    )


def _require_levels(
    used: Sequence[Threshold], excluded: Sequence[Threshold], options: RateLimitOptions
) -> None:
    """Refuse too few luminances where it is the thresholds left out that are missing."""
    luminances = len({t.luminance for t in used})
    _, degree = options.shape(max(luminances, 1))
    needed = luminances_needed(degree)
    if not excluded or luminances >= needed:
        return
    raise InputError(
        f"a rate limit of degree {degree} needs thresholds at {needed} or more luminances, got {luminances}: "
        f"{len(excluded)} of {len(used) + len(excluded)} thresholds are left out "
        f"({listed(excluded, UNUSABLE)}); mend what these flags name, or measure more levels"
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
        f"{upper[worst]:.2g} cd/m^2/s; choose the degree {PAPER_DEGREE} or lower"
    )


def _floats(values: NDArray[np.float64]) -> tuple[float, ...]:
    """Return an array as a tuple of Python's numbers."""
    return tuple(values.tolist())


def shape_notes(basis: CurveBasis, coefficients: NDArray[np.float64], residual_df: int) -> tuple[str, ...]:
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


def participant_notes(data: GroupedEstimates) -> tuple[str, ...]:
    """Return what is to be said about a fit to one participant."""
    if data.n_groups > 1:
        return ()
    return (ONE_PARTICIPANT,)


def exclusion_notes(excluded: Sequence[Threshold], total: int) -> tuple[str, ...]:
    """Return how many thresholds were left out, and which way that draws the curve."""
    if not excluded:
        return ()
    counts = {flag: sum(t.flag is flag for t in excluded) for flag in UNUSABLE}
    words = f"{len(excluded)} of {total} thresholds are left out ({listed(excluded, UNUSABLE)})."
    if counts[ThresholdFlag.ALL_YES]:
        words += (
            " All_yes lie below the slowest rate tested: without them the limit is too high, on the unsafe "
            "side; test slower rates."
        )
    if counts[ThresholdFlag.ALL_NO]:
        words += " All_no lie above the fastest one: without them the limit is too low, on the safe side."
    return (words,)


def listed(thresholds: Sequence[Threshold], flags: Sequence[ThresholdFlag]) -> str:
    """Return how many thresholds carry each of some flags, as "3 all_yes, 1 all_no"."""
    counts = ((sum(t.flag is flag for t in thresholds), flag.value) for flag in flags)
    return ", ".join(f"{count} {name}" for count, name in counts if count)


def condition_notes(
    reference: Condition, effects: Sequence[ConditionEffect], chosen: bool
) -> tuple[str, ...]:
    """Return whose ramps the limit holds for, and how the others differ; nothing for one condition."""
    if not effects:
        return ()
    why = "as was asked for" if chosen else "whose thresholds are the lowest: the safe choice"
    return (
        f"The limit is that of {reference.words}, {why}.",
        *(f"{effect.in_words[0].upper()}{effect.in_words[1:]}." for effect in effects),
    )
