"""The sections of the report on a calibration: the rate limit, who answered what, every threshold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy import stats

from evenlight.analysis.calibration.calibration import Calibration, ThresholdFits
from evenlight.analysis.calibration.joint.joint_fit import JointFit
from evenlight.analysis.calibration.joint.polynomial_shape import ShapeScore
from evenlight.analysis.calibration.level_estimates import difference_in_words, mean_ratios
from evenlight.analysis.calibration.limit_models import FEW_LEVELS, LimitModels
from evenlight.analysis.calibration.psychometric.psychometric_fit import lapse_prior
from evenlight.analysis.calibration.psychometric.ramp_counts import (
    RampLevelKey,
    by_joined_level,
    level_of_threshold,
)
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.conditions import condition_of, conditions_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import CurveBasis, bounds, shape_name
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import FEWEST_FOR_INTERVALS
from evenlight.analysis.figure_style import short
from evenlight.analysis.report import Cell, Picture, Section, Table, probability
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.rows import Rows
from evenlight.analysis.wording import percent, sentence
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.method.psychometric import TWO_INTERVAL_GUESS_RATE

POPULATION, POOLED, MEAN = (
    "threshold of the population",
    "threshold, answers pooled",
    "threshold, mean of fits",
)
LIMIT = "rate limit"
COMPARED_AT = 401  # luminances at which two curves are compared


def group_of(level: RampLevelKey) -> str:
    """Return what the rows of a level are called."""
    condition = f"{level.direction.value}, {level.ramp_duration:g} s"
    return f"{level.screen}, factor {level.factor:g}, {level.luminance:.4g} cd/m^2, {condition}"


def level_words(level: RampLevelKey, several: bool) -> str:
    """Return what a level is called in a table, with its condition if there are several."""
    words = f"{level.screen}, b = {level.factor:.3g}"
    return f"{words}, {level.direction.value}, {level.ramp_duration:g} s" if several else words


def drawn_thresholds(calibration: Calibration) -> list[Threshold]:
    """Return the thresholds of the condition that the limit is for; others lie off it by their effect."""
    reference = calibration.rate_limit.reference
    thresholds = (fit.threshold for fit in calibration.thresholds)
    return [t for t in thresholds if reference in (None, condition_of(t))]


def rate_limit_section(calibration: Calibration, rows: Rows, png: bytes, published: bool = False) -> Section:
    """Return the fitted rate limit, what it rests on, and what was left out; `png` is its figure.

    `published`: whether the figure shows the published rate limit too.
    """
    fit, models = calibration.rate_limit, calibration.models
    said = {f"{sentence(effect.in_words)}." for effect in fit.effects}
    first = (f"{sentence(words)}." for words in models.first_notes)
    missing = (f"Not fitted, the {model.value} model: {why}." for model, why in models.missing.items())
    people_differ = None if fit.limit.form is RateLimitForm.RATE else fit.participant_sd
    caption = prose(
        "fit_rate_limit_caption",
        limit=fit.limit,
        people=len({t.participant_id for t in fit.own}),
        fewest=FEWEST_FOR_INTERVALS,
        crosses=models.chosen is RateLimitModel.JOINT and any(t.flag in UNUSABLE for t in fit.used),
        others=[model.value for model in models.others],
        published=published,
        simulated=calibration.data.simulated,
        two=calibration.procedure is Procedure.TWO_INTERVAL,
    )[0]
    return section(
        "fit_rate_limit",
        (_limit_table(calibration, rows), curve_table(models), *_effect_tables(calibration)),
        (Picture(png, caption),),
        simulated=calibration.data.simulated,
        fit=fit,
        model=models.chosen.value,
        joint=models.joint,
        shape=shape_name(fit.limit.form, len(fit.limit.coefficients) - 1),
        total=len(calibration.thresholds),
        few=models.levels if models.levels in FEW_LEVELS else 0,
        ends=[short(end) for end in fit.limit.luminance_range],
        people_differ=None if people_differ is None else float(np.exp(people_differ)),
        excluded=calibration.excluded_participants,
        notes=[
            note.replace("cd/m^2", "cd/m²") for note in (*first, *fit.notes, *missing) if note not in said
        ],
        exp=np.exp,
    )


def _limit_table(calibration: Calibration, rows: Rows) -> Table:
    limit, models = calibration.rate_limit.limit, calibration.models
    joint = (
        models.joint if models.chosen is RateLimitModel.JOINT and models.levels not in FEW_LEVELS else None
    )
    cells = []
    luminances = sorted({t.luminance for t in drawn_thresholds(calibration)})
    for luminance, row in zip(luminances, rows.of("rate_limit"), strict=True):
        rate = row.value or 0.0
        own: tuple[Cell, ...] = (luminance, rate, bounds(row.ci_low, row.ci_high))
        if joint:
            low, high = (
                float(np.interp(luminance, joint.band_luminance, edge))
                for edge in (joint.pointwise_lower, joint.pointwise_upper)
            )
            own = (*own, bounds(low, high))
        cells.append((*own, 100 * rate / luminance))
    pointwise = (f"{100 * limit.band_level:g} % pointwise band",) if joint else ()
    columns = ("luminance [cd/m²]", "limit [cd/m²/s]", limit.band_words, *pointwise, "limit [%/s]")
    return Table("The rate limit at the luminances measured.", columns, tuple(cells))


def _effect_tables(calibration: Calibration) -> tuple[Table, ...]:
    effects = calibration.rate_limit.effects
    rows = tuple(
        (
            effect.condition.words,
            f"{effect.ratio:.2f}",
            bounds(effect.ci_low, effect.ci_high, ".2f"),
            "1.00",
            f"{effect.ratio_of_equal_amounts:.2f}",
        )
        for effect in effects
    )
    caption = "Thresholds of other ramps as a multiple of those that the limit is for."
    names = ("ramps", "ratio", "95 % confidence interval", "if the rate decides", "if the amount does")
    return (Table(caption, names, rows),) if effects else ()


def thresholds_section(calibration: Calibration, rows: Rows, png: bytes) -> Section:
    """Return what was answered, the thresholds of levels, and the participants; `png` is its figure."""
    data, thresholds = calibration.data, [fit.threshold for fit in calibration.thresholds]
    catches = sum(trial.is_catch for trial in data.trials)
    two, pooled = _two_interval(calibration), mean_ratios(calibration.levels)[0]
    return section(
        "fit_calibration",
        (_level_table(calibration, rows), _participant_table(calibration)),
        (_answers_picture(calibration, png),),
        simulated=data.simulated,
        data=data,
        people=len(data.participant_ids),
        ramps=len(data.trials) - catches,
        catches=catches,
        conditions=[condition.words for condition in conditions_of(thresholds)],
        luminances=len({(t.screen, t.factor) for t in thresholds}),
        two=two,
        pooled_lies_below=pooled is not None and pooled < 1,
        found=sentence(difference_in_words(calibration.levels) or ""),
        short=short,
        serial=calibration.serial,
        drift=calibration.drift,
        probability=probability,
    )


def _two_interval(calibration: ThresholdFits) -> bool:
    return calibration.procedure is Procedure.TWO_INTERVAL


def _answers_picture(calibration: ThresholdFits, png: bytes) -> Picture:
    return Picture(png, prose("fit_calibration_caption", two=_two_interval(calibration))[0])


def _level_table(calibration: Calibration, rows: Rows) -> Table:
    """Return the three estimates of each level; falling ramps first, short ones first."""
    thresholds = [fit.threshold for fit in calibration.thresholds]
    of_levels = by_joined_level(thresholds, level_of_threshold)
    several = len(conditions_of(thresholds)) > 1
    cells: list[tuple[Cell, ...]] = []
    order = sorted(
        calibration.levels,
        key=lambda e: (e.level.direction.value, e.level.ramp_duration, e.level.luminance),
    )
    for estimates in order:
        level, group = estimates.level, group_of(estimates.level)
        own = of_levels[level]
        best, pooled, mean = (rows.find("thresholds", group, what) for what in (POPULATION, POOLED, MEAN))
        value = best.value if best else None
        cells.append(
            (
                level_words(level, several),
                level.luminance,
                f"{sum(t.flag not in UNUSABLE for t in own)} of {len(own)}",
                value,
                bounds(best.ci_low, best.ci_high) if best else None,
                None if value is None else 100 * value / level.luminance,
                None if estimates.random is None else f"{np.exp(estimates.random.participant_sd):.2f}",
                pooled.value if pooled else None,
                mean.value if mean else None,
                _flags(own),
            )
        )
    columns = ("level", "luminance [cd/m²]", "usable", "population", "95 % CI", "[%/s]", "people differ ×",
               "pooled", "mean of fits", "flags")  # fmt: skip
    return Table(prose("fit_population_table")[0], columns, tuple(cells))


def _flags(thresholds: Iterable[Threshold]) -> str:
    found = [t.flag.value.replace("_", " ") for t in thresholds if t.flag.value]
    return ", ".join(f"{found.count(flag)} {flag}" for flag in dict.fromkeys(found)) or "–"


def _participant_table(calibration: Calibration) -> Table:
    two, joint = _two_interval(calibration), calibration.models.chosen is RateLimitModel.JOINT
    people: dict[str, list[Threshold]] = {}
    for fit in calibration.thresholds:
        people.setdefault(fit.threshold.participant_id, []).append(fit.threshold)
    rows = tuple(_participant_row(calibration, who, own) for who, own in people.items())
    columns = ("bias",) if two else ("false alarms", "criterion", "d′ at threshold")
    return Table(
        prose("fit_participants", two=two, joint=joint, lapses=lapses_before(calibration))[0],
        ("participant", "own thresholds", "threshold / limit", *columns, "lapses", "drift", "fit p", "flags"),
        rows,
    )


def _participant_row(calibration: Calibration, who: str, own: Sequence[Threshold]) -> tuple[Cell, ...]:
    t, fit_p = own[0], calibration.participants[who].deviance_p
    bias: tuple[Cell, ...] = (_two_places(t.criterion),)
    if not _two_interval(calibration):
        alarms = None if t.false_alarm_rate is None else f"{100 * t.false_alarm_rate:.0f} %"
        bias = (alarms, *bias, _two_places(t.d_prime))
    drifts = t.drift_ratio is not None and t.drift_p is not None
    return (
        who,
        f"{sum(t.flag not in UNUSABLE for t in own)} of {len(own)}",
        _ratio_to_limit(calibration, who),
        *bias,
        _lapses(calibration, who, own),
        f"× {t.drift_ratio:.2f} (p {probability(t.drift_p or 0.0)})" if drifts else None,
        None if fit_p is None else probability(fit_p),
        _flags(own),
    )


def _ratio_to_limit(calibration: Calibration, who: str) -> Cell:
    """Return a participant's thresholds as a multiple of the limit; with its interval by the joint model."""
    fit, joint = calibration.rate_limit, calibration.models.joint
    if calibration.models.chosen is RateLimitModel.JOINT and joint is not None:
        own = next((person for person in joint.participants if person.participant_id == who), None)
        return f"{own.factor:.2f} ({bounds(own.ci_low, own.ci_high)})" if own else None
    ratios = [t.threshold / float(fit.limit(t.luminance)) for t in fit.own if t.participant_id == who]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else None


def lapses_before(calibration: ThresholdFits) -> tuple[float, float]:
    """Return mean and standard deviation of a lapse rate before the first answer: its prior's."""
    prior = stats.beta(*lapse_prior(TWO_INTERVAL_GUESS_RATE if _two_interval(calibration) else None))
    return float(prior.mean()), float(prior.std())


def _lapses(calibration: Calibration, who: str, own: Sequence[Threshold]) -> str:
    """Return a participant's lapse rate: posterior mean and standard deviation by the joint model."""
    joint = calibration.models.joint
    found = [person for person in joint.participants if person.participant_id == who] if joint else []
    if not found:
        return percent(float(np.mean([t.lapse_rate for t in own])), 1)
    return f"{100 * found[0].lapse_rate:.1f} ± {100 * found[0].lapse_sd:.1f} %"


def _two_places(value: float | None) -> str | None:
    return None if value is None else f"{value:.2f}"


def every_threshold_section(calibration: ThresholdFits, png: bytes | None = None) -> Section:
    """Return every threshold with what there is to know about it; `png`: the answers, as a figure."""
    thresholds = [fit.threshold for fit in calibration.thresholds]
    several = len(conditions_of(thresholds)) > 1
    rows: list[tuple[Cell, ...]] = [
        (
            t.participant_id,
            *((condition_of(t).words,) if several else ()),
            t.screen,
            t.factor,
            t.luminance,
            t.threshold,
            _credible(t),
            t.threshold_d_prime_1,
            t.n_trials,
            None if t.deviance is None else f"{t.deviance:.1f}",
            None if t.deviance_p is None else probability(t.deviance_p),
            t.flag.value.replace("_", " ") or "–",
        )
        for t in thresholds
    ]
    columns = ("participant", *(("of",) if several else ()), "screen", "b", "L [cd/m²]",
               "threshold [cd/m²/s]", "95 % credible interval", "at d′ = 1", "ramps", "deviance", "p",
               "flag")  # fmt: skip
    caption = f"The thresholds of all participants and levels, {len(thresholds)} in all."
    return section(
        "fit_thresholds",
        (Table(caption, columns, tuple(rows)),),
        () if png is None else (_answers_picture(calibration, png),),
        simulated=calibration.data.simulated,
    )


def _credible(t: Threshold) -> str | None:
    """Return a threshold's interval; answers that are all alike bound it on one side."""
    if t.flag is ThresholdFlag.ALL_YES:
        return f"below {t.ci_high:.3g}"
    return f"above {t.ci_low:.3g}" if t.flag is ThresholdFlag.ALL_NO else bounds(t.ci_low, t.ci_high)


def curve_table(models: LimitModels) -> Table:
    """Return the curves that the answers allow: predictive score, and largest difference from the limit."""
    joint = models.joint
    rows = [_shape_row(models, joint, shape) for shape in joint.shapes] if joint else []
    for model, fit in models.fits.items():
        if model is not RateLimitModel.JOINT:
            luminance = shared_luminances(models.fit.limit, fit.limit)
            name = f"{model.value}: {shape_name(fit.limit.form, len(fit.limit.coefficients) - 1)}"
            said = _difference(models.fit.limit, luminance, fit.limit(luminance))
            rows.append((name, None, None, "the limit" if model is models.chosen else said))
    rows.sort(key=lambda row: row[-1] != "the limit")
    return Table(
        prose("fit_curves")[0],
        ("curve", "predictive score", "standard error", "largest difference from the limit"),
        tuple(rows),
    )


def _shape_row(models: LimitModels, joint: JointFit, shape: ShapeScore) -> tuple[Cell, ...]:
    limit = models.fit.limit
    best = max((one.score for one in joint.shapes if one.score is not None), default=0.0)
    chosen = shape.chosen and models.chosen is RateLimitModel.JOINT
    luminance = shared_luminances(limit, models.fits[RateLimitModel.JOINT].limit)
    basis = CurveBasis(shape.form, shape.degree, joint.basis.luminance_range)
    rates = basis.rate(basis.design(luminance) @ np.array(shape.coefficients))
    return (
        f"joint: {shape_name(shape.form, shape.degree)}",
        None if shape.score is None else f"{shape.score - best:.1f}",
        None if shape.standard_error is None else f"{shape.standard_error:.1f}",
        "the limit" if chosen else _difference(limit, luminance, rates),
    )


def shared_luminances(limit: RateLimit, other: RateLimit, n: int = COMPARED_AT) -> Array:
    """Return n luminances at which both curves were measured [cd/m^2]."""
    low = max(limit.luminance_range[0], other.luminance_range[0])
    high = min(limit.luminance_range[1], other.luminance_range[1])
    return np.linspace(low, high, n)


def _difference(limit: RateLimit, luminance: Array, rates: Array) -> str:
    """Return how far some rates lie from the limit where they lie farthest, in words."""
    own = limit(luminance)
    there = own > 0  # a polynomial of the rate itself can fall to 0, of which nothing is a share
    share = rates[there] / own[there] - 1
    worst = int(np.argmax(np.abs(share)))
    return f"{100 * share[worst]:+.0f} % at {luminance[there][worst]:.3g} cd/m²".replace("-", "−")
