"""Which curve to draw through the thresholds, and what speaks for and against each (Section 3.4).

The paper's curve is of the fourth degree. Others follow the same thresholds; where they part, the data do
not decide, and the operator of a display should know what depends on it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.level_estimates import PooledFit
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    CurveBasis,
    RateLimitOptions,
    falling_stretches,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit, fit_points, fit_thresholds
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.threshold import Threshold
from evenlight.method.choices import LimitCurve
from evenlight.method.rate_limit import rate_limit_at

Predict = Callable[[float], RateLimit]  # the limit that is fitted without the luminance given
FITTED, SAFE = "fitted", "fitted_safe"
JOINT, INDIVIDUAL, POOLED = (model.value for model in RateLimitModel)
MODELS = {
    RateLimitModel.JOINT: "joint model",
    RateLimitModel.INDIVIDUAL: "individual fits, then a curve",
    RateLimitModel.POOLED: "all answers pooled (paper)",
}
POWER_LAW, LOG_LOG_QUADRATIC = "log_log_1", "log_log_2"
ALTERNATIVES = {  # beside the form and degree that were asked for
    "ln_rate_4": (RateLimitForm.LN_RATE, 4, "fourth degree of ln(rate)"),
    POWER_LAW: (RateLimitForm.LOG_LOG, 1, "power law (line in log-log)"),
    LOG_LOG_QUADRATIC: (RateLimitForm.LOG_LOG, 2, "quadratic in log-log"),
    "rate_4": (RateLimitForm.RATE, 4, "fourth degree of the rate itself"),
}
COMPARED_AT = 401  # luminances at which two curves are compared
SAME = 1e-6  # relative, of two rates
SAFE_DEGREE = 12  # the edge is a polynomial less the root of one: this degree meets it to about 0.3 %
EDGE_SAMPLES = 2001  # luminances


@dataclass(frozen=True, slots=True)
class LimitChoice:
    """One curve that could serve as the rate limit, beside the fitted one.

    Attributes
    ----------
    name, words : str
        What it is called in files, and what it is.
    limit : RateLimit
        The curve.
    falling : tuple of (float, float)
        Luminances between which it falls noticeably [cd/m^2].
    left_out_error : float or None
        Root mean square of ln(predicted / mean threshold) over the inner levels, each predicted by the curve
        fitted without it; None where too few levels remain.
    lowest_ratio, highest_ratio, mean_ratio : float
        Its rate as a multiple of the fitted curve's, over the measured range.
    share_above : float
        Share of the measured range in which it allows more than the fitted curve.
    """

    name: str
    words: str
    limit: RateLimit
    falling: tuple[tuple[float, float], ...]
    left_out_error: float | None
    lowest_ratio: float
    highest_ratio: float
    mean_ratio: float
    share_above: float

    @property
    def more_permissive(self) -> bool:
        """Whether it allows a faster change than the fitted curve anywhere in the measured range."""
        return self.share_above > 0


@dataclass(frozen=True, slots=True)
class LimitChoices:
    """The curves that can be chosen from, the fitted one first, and why others are missing."""

    choices: tuple[LimitChoice, ...]
    missing: dict[str, str]

    @property
    def fitted(self) -> LimitChoice:
        """The curve that was asked for: what the others are compared with."""
        return self.choices[0]

    def named(self, name: str) -> LimitChoice | None:
        """Return the choice of a name, or None."""
        return next((choice for choice in self.choices if choice.name == name), None)


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A curve, and how it is fitted without one level."""

    name: str
    words: str
    fit: RateLimitFit
    without: Predict | None = None


def limit_choices(calibration: Calibration, options: RateLimitOptions | None = None) -> LimitChoices:
    """Return the curves that the thresholds of a calibration allow, compared with the fitted one.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    options : RateLimitOptions, optional
        With which it was.
    """
    fitted = calibration.rate_limit
    options = _for_the_same_ramps(options or RateLimitOptions(), fitted)
    candidates, missing = _candidates(calibration, options)
    compared = [_compared(candidate, fitted) for candidate in candidates]
    safe = None if fitted.limit.wide_band else safe_limit(fitted.limit)
    if safe is None:
        missing[SAFE] = fitted.limit.wide_band or "the fitted curve has no band, or one that reaches 0"
    else:
        edge = dataclasses.replace(fitted, limit=safe, falling=_falls(safe))
        words = f"safe: lower edge of the {fitted.limit.band_words}"
        compared.insert(1, _compared(_Candidate(SAFE, words, edge), fitted))
    who = f"{len(calibration.data.participant_ids)} {'simulated ' * calibration.data.simulated}participants"
    return LimitChoices(tuple(_with_origin(choice, calibration, who) for choice in compared), missing)


def _for_the_same_ramps(options: RateLimitOptions, fitted: RateLimitFit) -> RateLimitOptions:
    """Return the options that fit other curves to the direction and duration of ramps of the fitted one."""
    if fitted.reference is None:
        return options
    reference = fitted.reference
    return dataclasses.replace(options, direction=reference.direction, ramp_duration=reference.ramp_duration)


def _with_origin(choice: LimitChoice, calibration: Calibration, who: str) -> LimitChoice:
    """Return a choice whose record says where it comes from, and whether that was simulated."""
    fitted = calibration.rate_limit.limit
    limit = dataclasses.replace(
        choice.limit,
        simulated=calibration.data.simulated,
        source=f"{choice.words}; ramp calibration with {who}: {fitted.task_in_words}",
        procedure=fitted.procedure,
        direction=fitted.direction,
        ramp_duration=fitted.ramp_duration,
        display_fingerprints=calibration.data.display_fingerprints,
    )
    return dataclasses.replace(choice, limit=limit)


def _falls(limit: RateLimit) -> tuple[tuple[float, float], ...]:
    """Return where a curve falls [cd/m^2]."""
    basis = CurveBasis(limit.form, len(limit.coefficients) - 1, limit.luminance_range)
    return falling_stretches(basis, np.array(limit.coefficients))


def _candidates(
    calibration: Calibration, options: RateLimitOptions
) -> tuple[list[_Candidate], dict[str, str]]:
    """Return the fitted curve, the other models', and others through the thresholds; and why some miss."""
    models, display = calibration.models, calibration.data.display
    chosen = models.chosen
    words = "" if chosen is RateLimitModel.INDIVIDUAL else f"{MODELS[chosen]}, "
    found = [_of_model(chosen, calibration, options, f"fitted: {words}{_shape_words(models.fit.limit)}")]
    pooled: list[_Candidate] = []
    for model in models.others:
        own = pooled if model is RateLimitModel.POOLED else found
        own.append(_of_model(model, calibration, options, MODELS[model]))
    missing = {model.value: why for model, why in models.missing.items()}
    individual = models.fits.get(RateLimitModel.INDIVIDUAL)
    shown = None if individual is None else _shape(individual.limit)
    for name, (form, degree, what) in ALTERNATIVES.items():
        if (form, degree) == shown:
            continue
        changed = dataclasses.replace(options, form=form, degree=degree)
        try:
            fit = fit_thresholds(models.fit.used, display, changed, name)
        except InputError as error:
            missing[name] = str(error)
            continue
        found.append(_Candidate(name, what, fit, _refit(models.fit.used, display, changed)))
    return found + pooled, missing


def _shape(limit: RateLimit) -> tuple[RateLimitForm, int]:
    """Return form and degree of a curve."""
    return limit.form, len(limit.coefficients) - 1


def _shape_words(limit: RateLimit) -> str:
    """Return form and degree of a curve in words."""
    words = next((w for f, d, w in ALTERNATIVES.values() if (f, d) == _shape(limit)), "")
    return words or f"degree {_shape(limit)[1]} of {limit.form.value.replace('_', ' ')}"


def _of_model(
    model: RateLimitModel, calibration: Calibration, options: RateLimitOptions, words: str
) -> _Candidate:
    """Return a model's curve; the joint model has predictive scores of its own."""
    models, display = calibration.models, calibration.data.display
    fit, name = models.fits[model], FITTED if model is models.chosen else model.value
    without = None
    if model is RateLimitModel.INDIVIDUAL:
        without = _refit(fit.used, display, _as(options, fit))
    elif model is RateLimitModel.POOLED and models.pooled is not None:
        without = _repool(models.pooled, display, _as(options, fit))
    return _Candidate(name, words, fit, without)


def _usable(fit: RateLimitFit) -> list[Threshold]:
    """Return the thresholds behind a fit that have a value of their own."""
    return [t for t in fit.used if t.flag not in UNUSABLE]


def _as(options: RateLimitOptions, fit: RateLimitFit) -> RateLimitOptions:
    """Return the options with which a curve was fitted."""
    return dataclasses.replace(options, form=fit.limit.form, degree=len(fit.limit.coefficients) - 1)


def _refit(thresholds: Sequence[Threshold], display: Display, options: RateLimitOptions) -> Predict:
    """Return how to fit the participants' thresholds without one level."""
    return lambda level: (
        fit_thresholds([t for t in thresholds if t.luminance != level], display, options).limit
    )


def _repool(pooled: PooledFit, display: Display, options: RateLimitOptions) -> Predict:
    """Return how to fit the pooled thresholds without one level."""

    def without(level: float) -> RateLimit:
        kept = pooled.luminance != level
        return fit_points(pooled.luminance[kept], pooled.threshold[kept], display, options).limit

    return without


def _compared(candidate: _Candidate, fitted: RateLimitFit) -> LimitChoice:
    """Return a choice beside the fitted curve, over the luminances that both were measured at."""
    limit = candidate.fit.limit
    low = max(fitted.limit.luminance_range[0], limit.luminance_range[0])
    high = min(fitted.limit.luminance_range[1], limit.luminance_range[1])
    luminance = np.linspace(low, high, COMPARED_AT)
    reference = rate_limit_at(fitted.limit, luminance)
    there = reference > 0  # a polynomial of the rate can fall to 0, of which nothing is a multiple
    ratio = rate_limit_at(limit, luminance[there]) / reference[there]
    return LimitChoice(
        name=candidate.name,
        words=candidate.words,
        limit=limit,
        falling=candidate.fit.falling,
        left_out_error=candidate.without and left_out_error(_usable(fitted), candidate.without),
        lowest_ratio=float(ratio.min()),
        highest_ratio=float(ratio.max()),
        mean_ratio=float(np.exp(np.mean(np.log(ratio)))) if ratio.min() > 0 else 0.0,
        share_above=float(np.mean(ratio > 1 + SAME)),
    )


def left_out_error(thresholds: Sequence[Threshold], without: Predict) -> float | None:
    """Return how well a kind of curve predicts the level that it was not fitted to, in ln(rate).

    The outermost luminances are left out of the score: no curve is meant to be used beyond them. Who was
    measured at a level does not matter: each participant's own factor is taken from their other levels.

    Parameters
    ----------
    thresholds : sequence of Threshold
        Those that the curves are fitted to.
    without : function
        The curve that is fitted without the luminance given [cd/m^2].

    Returns
    -------
    float or None
        Root mean square over the inner levels; None if a curve cannot be fitted without one of them.
    """
    luminances = sorted({t.luminance for t in thresholds})
    if len(luminances) < 3:
        return None
    try:
        errors = [_error_at(level, thresholds, without(level)) for level in luminances[1:-1]]
    except InputError:
        return None
    return float(np.sqrt(np.mean(np.square(errors)))) if np.isfinite(errors).all() else None


def _error_at(level: float, thresholds: Sequence[Threshold], limit: RateLimit) -> float:
    """Return the mean of ln(threshold / predicted) at one luminance [cd/m^2]."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a limit of 0 predicts nothing: no score
        rates = np.log(rate_limit_at(limit, [t.luminance for t in thresholds]))
    if not np.isfinite(rates).all():
        return float("nan")
    residual = np.log([t.threshold for t in thresholds]) - rates
    here = np.array([t.luminance == level for t in thresholds])
    # A participant under one condition has a factor of their own, as in the mixed model.
    _, own = np.unique([_series(t) for t in thresholds], return_inverse=True)
    elsewhere = np.bincount(own, ~here)
    factor = np.bincount(own, residual * ~here) / np.maximum(elsewhere, 1)
    return float(np.mean((residual - factor[own])[here]))


def _series(threshold: Threshold) -> str:
    """Return what names the thresholds that one participant has under one condition."""
    t = threshold
    return f"{t.participant_id} {t.procedure.value} {t.direction.value} {t.ramp_duration!r}"


def safe_limit(limit: RateLimit) -> RateLimit | None:
    """Return the lower edge of a limit's band as a rate limit; None where there is none above 0.

    Of the 95 % bands of repeated experiments, one in forty lies above the population's curve: a pointwise one
    at a given luminance, a simultaneous one anywhere. The edge is no polynomial but nearly one; the curve
    returned is lowered until it is nowhere above the edge, and so errs to the slow side.

    Parameters
    ----------
    limit : RateLimit
        With a band.

    >>> from evenlight.data_schema.rate_limit import RateLimitForm
    >>> band = dict(band_luminance=(1.0, 9.0), band_lower=(0.5, 0.5), band_upper=(2.0, 2.0))
    >>> flat = RateLimit("r", "d", "", RateLimitForm.LN_RATE, (0.0,), (1.0, 9.0), **band)
    >>> rate_limit_at(safe_limit(flat), [1.0, 4.0, 9.0]).round(9).tolist()
    [0.5, 0.5, 0.5]
    """
    if not limit.band_luminance or min(limit.band_lower) <= 0:  # a band of the rate itself can reach 0
        return None
    low, high = limit.luminance_range
    basis = CurveBasis(limit.form, SAFE_DEGREE if low < high else 0, limit.luminance_range)
    luminance = (low + high - (high - low) * np.cos(np.linspace(0.0, np.pi, EDGE_SAMPLES))) / 2
    design = basis.design(luminance)
    edge = basis.ordinate(rate_limit_at(limit, luminance, LimitCurve.SAFE))
    coefficients = np.linalg.lstsq(design, edge, rcond=None)[0]
    coefficients[0] -= max(0.0, float(np.max(design @ coefficients - edge)))
    return dataclasses.replace(
        limit,
        name=f"{limit.name}, lower edge",
        coefficients=tuple(coefficients.tolist()),
        band_luminance=(),
        band_lower=(),
        band_upper=(),
        point_luminance=(),  # it was not fitted to thresholds, and lies below them
        point_rate=(),
        condition_number=None,
        model=None,  # not fitted, but the edge of what was
        source=f"lower edge of the {limit.band_words} of: {limit.source or limit.name}",
    )
