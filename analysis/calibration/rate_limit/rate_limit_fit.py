"""The rate limit ΔL(L), fitted: a fourth-degree polynomial through detection thresholds (Section 3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.conditions import (
    Condition,
    ConditionEffect,
    condition_of,
    model_of_thresholds,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    PAPER_DEGREE,
    WIDEST_BAND,
    CurveBasis,
    RateLimitOptions,
    basis_for,
    curve_band,
    falling_stretches,
    luminances_needed,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.threshold import Threshold, ThresholdFlag

OUTSIDE = (ThresholdFlag.ALL_YES, ThresholdFlag.BELOW_RANGE, ThresholdFlag.ALL_NO, ThresholdFlag.ABOVE_RANGE)
ONE_PARTICIPANT = (
    "One participant, of whom the curve is: it has no band, for nothing is known of other people."
)


@dataclass(frozen=True, slots=True)
class RateLimitFit:
    """A fitted rate limit, and what has to be known to trust it."""

    limit: RateLimit  # the curve, its band and the points: the record that the other programs read
    # Points (for participants: luminance levels) minus coefficients; 0 if the curve can meet all of them
    residual_df: int
    # Of the points about the curve [ln units, or cd/m^2/s for `RATE`]; for participants it is τ, what their
    # thresholds scatter beyond their standard errors and their own factor. None without an estimate.
    residual_sd: float | None
    participant_sd: float | None  # σ_u between participants, same unit; None without several of them
    falling: tuple[tuple[float, float], ...]  # luminances [cd/m^2] between which the curve falls noticeably
    used: tuple[Threshold, ...] = ()  # thresholds that went in; none for bare points
    excluded: tuple[Threshold, ...] = ()  # those left out for their flag
    notes: tuple[str, ...] = ()  # what a reader of the curve should know, as sentences
    reference: Condition | None = None  # the ramps that the limit is for; None for bare points
    effects: tuple[ConditionEffect, ...] = ()  # how the thresholds of other ramps compare

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
    band. Luminance in cd/m^2, rates in cd/m^2/s, each (n,).

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
    band = curve_band(basis, coefficients, covariance, df, options.band_level)
    return RateLimitFit(
        limit=limit_record((name, display), basis, coefficients, band, (L, points), options),
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

    Raises
    ------
    InputError
        If most thresholds lie outside the rates tested, those that can be used lie at too few luminances, or
        a degree above the paper's leaves the curve unknown within a factor of 100 somewhere.
    """
    options = options or RateLimitOptions()
    used = tuple(t for t in thresholds if t.flag not in UNUSABLE)
    excluded = tuple(t for t in thresholds if t.flag in UNUSABLE)
    require_within_rates(thresholds)
    _require_levels(used, excluded, options)
    (basis, model, data), reference, effects = model_of_thresholds(used, options)
    own = tuple(t for t in used if condition_of(t) == reference)
    size = basis.degree + 1
    several = data.n_groups > 1
    coefficients = model.coefficients[:size]
    covariance = model.covariance[:size, :size] if several else None
    band = curve_band(basis, coefficients, covariance, data.n_groups - 1, options.band_level)
    points = np.array([t.luminance for t in own]), np.array([t.threshold for t in own])
    limit = limit_record(
        (name, display),
        basis,
        coefficients,
        band,
        points,
        options,
        procedure=used[0].procedure,
        model=RateLimitModel.INDIVIDUAL,
        **reference.of_limit,
    )
    _require_known(limit, basis.degree)
    df = len({t.luminance for t in used}) - size
    chosen = options.direction is not None or options.ramp_duration is not None
    return RateLimitFit(
        limit=limit,
        residual_df=df,
        residual_sd=model.residual_sd,
        participant_sd=model.group_sd if several else None,
        falling=falling_stretches(basis, coefficients),
        used=used,
        excluded=excluded,
        notes=_exclusion_notes(excluded, len(thresholds))
        + (() if several else (ONE_PARTICIPANT,))
        + condition_notes(reference, effects, chosen)
        + shape_notes(basis, coefficients, df),
        reference=reference,
        effects=effects,
    )


def limit_record(
    named: tuple[str, Display],
    basis: CurveBasis,
    coefficients: Array,
    band: tuple[Array, Array, Array],
    points: tuple[Array, Array],
    options: RateLimitOptions,
    **more: Any,
) -> RateLimit:
    """Return a fitted curve as a rate limit; `more`: other fields of it, which go before.

    Raises
    ------
    InputError
        If no display or eye has such rates.
    """
    (name, display), (at, lower, upper) = named, band
    fields: dict[str, Any] = {
        "condition_number": max(1.0, float(np.linalg.cond(basis.design(points[0])))),
        **more,
    }
    try:
        return RateLimit(
            name=name,
            display_name=display.name,
            display_fingerprint=display.fingerprint,
            display=display,
            form=basis.form,
            coefficients=tuple(coefficients.tolist()),
            luminance_range=basis.luminance_range,
            band_luminance=tuple(at.tolist()),
            band_lower=tuple(lower.tolist()),
            band_upper=tuple(upper.tolist()),
            band_level=options.band_level,
            point_luminance=tuple(points[0].tolist()),
            point_rate=tuple(points[1].tolist()),
            **fields,
        )
    except ValueError as error:
        raise InputError(f"the answers give no usable rate limit: {error}") from error


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
        f"({_listed(thresholds, OUTSIDE)}), which is no basis for a rate limit; test {advice} ramps"
    )


def _require_levels(
    used: Sequence[Threshold], excluded: Sequence[Threshold], options: RateLimitOptions
) -> None:
    """Refuse too few luminances where it is the thresholds left out that are missing."""
    luminances = len({t.luminance for t in used})
    _, degree = options.shape(max(luminances, 1))
    needed = luminances_needed(degree)
    if luminances >= needed or (used and not excluded):
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
        f"{upper[worst]:.2g} cd/m^2/s; choose the degree {PAPER_DEGREE} or lower"
    )


def shape_notes(basis: CurveBasis, coefficients: Array, residual_df: int) -> tuple[str, ...]:
    """Return what is to be said about the curve's shape."""
    notes = []
    if residual_df <= 0:
        notes.append(
            f"Degree {basis.degree} has as many coefficients as there are luminances: the curve can meet "
            "every level, and the data cannot tell whether its shape is right."
        )
    for low, high in falling_stretches(basis, coefficients):
        notes.append(
            f"Implausible: the limit falls from {low:.3g} to {high:.3g} cd/m^2; try "
            "`evenlight fit --monotone` (joint model)."
        )
    luminance = np.linspace(*basis.luminance_range, 201)
    if basis.form is RateLimitForm.RATE and (basis.design(luminance) @ coefficients <= 0).any():
        notes.append("The polynomial of the rate falls to 0 or below within the measured range.")
    return tuple(notes)


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
