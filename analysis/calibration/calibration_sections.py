"""The sections of the report on a calibration: who answered what, which thresholds came out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.level_estimates import LevelEstimates, difference_in_words, mean_ratios
from evenlight.analysis.calibration.psychometric.ramp_counts import joined_luminances
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.conditions import condition_of, conditions_of
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import level_means
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import WIDEST_BAND
from evenlight.analysis.figure_style import short
from evenlight.analysis.report import Cell, Picture, Section, Table, probability
from evenlight.analysis.report_prose import prose
from evenlight.analysis.wording import sentence
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at


def calibration_section(calibration: Calibration, psychometric_png: bytes) -> Section:
    """Return who was tested, what was answered and which thresholds came out.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    psychometric_png : bytes
        Its `psychometric_figure`.
    """
    data, thresholds = calibration.data, [fit.threshold for fit in calibration.thresholds]
    catches = sum(trial.is_catch for trial in data.trials)
    two = _two_interval(thresholds)
    text = prose(
        "fit_calibration",
        data=data,
        people=len(data.participant_ids),
        ramps=len(data.trials) - catches,
        catches=catches,
        conditions=[condition.words for condition in conditions_of(thresholds)],
        luminances=len({(t.screen, t.factor) for t in thresholds}),
        two=two,
        short=short,
    )
    return Section(
        "Calibration",
        text,
        (_level_table(thresholds), _participant_table(calibration)),
        (Picture(psychometric_png, prose("fit_calibration_caption", two=two)[0]),),
        data.warnings,
        data.simulated,
    )


def _two_interval(thresholds: Sequence[Threshold]) -> bool:
    """Return whether the thresholds are those of a choice between two intervals."""
    return any(t.procedure is Procedure.TWO_INTERVAL for t in thresholds)


def _level_table(thresholds: Sequence[Threshold]) -> Table:
    """Return the thresholds of each level, over participants."""
    rows: list[tuple[Cell, ...]] = []
    several = len(conditions_of(thresholds)) > 1
    keys = [
        (condition_of(t), t.screen, t.factor, luminance)
        for t, luminance in zip(thresholds, joined_luminances(thresholds), strict=True)
    ]
    order = {condition: place for place, condition in enumerate(conditions_of(thresholds))}
    for key in sorted(set(keys), key=lambda key: (order[key[0]], key[3], key[1])):
        condition, screen, factor, luminance = key
        own = [t for t, other in zip(thresholds, keys, strict=True) if other == key]
        used = [t for t in own if t.flag not in UNUSABLE]
        mean, low, high = level_means(used)[0][1:] if used else (None, None, None)
        relative = None if mean is None else 100 * mean / luminance
        row = (screen, factor, luminance, f"{len(used)} of {len(own)}", mean, _interval(low, high), relative,
               _flags(own))  # fmt: skip
        rows.append((condition.words, *row) if several else row)
    columns = ("screen", "factor b", "luminance [cd/m²]", "used", "threshold [cd/m²/s]", "95 % CI",
               "threshold [%/s]", "flags")  # fmt: skip
    return Table(
        "Thresholds of each level: geometric mean over participants with its 95 % confidence interval (CI), "
        "of Student's t for each level by itself: another model than the curve's, and wide with few people; "
        f"none is stated beyond a ratio of {WIDEST_BAND:g}.",
        ("ramps", *columns) if several else columns,
        tuple(rows),
    )


def _interval(low: float | None, high: float | None) -> str | None:
    """Return an interval in words; None if there is none, or one that says nothing."""
    return f"{low:.3g} to {high:.3g}" if low and high and high <= WIDEST_BAND * low else None


def _flags(thresholds: Sequence[Threshold]) -> str:
    """Return how often each flag was given, in words."""
    found = [t.flag.value.replace("_", " ") for t in thresholds if t.flag.value]
    return ", ".join(f"{found.count(flag)} {flag}" for flag in dict.fromkeys(found)) or "–"


def _participant_table(calibration: Calibration) -> Table:
    """Return each participant's sensitivity, criterion, drift and flags."""
    thresholds = [fit.threshold for fit in calibration.thresholds]
    two, joint = _two_interval(thresholds), calibration.models.chosen is RateLimitModel.JOINT
    rows: list[tuple[Cell, ...]] = []
    for who in calibration.data.participant_ids:
        own = [t for t in thresholds if t.participant_id == who]
        if not own:
            continue  # a warning of the calibration names them
        used = [t for t in own if t.flag not in UNUSABLE]
        any_own, fit_p = own[0], calibration.participants[who].deviance_p
        bias: tuple[Cell, ...] = (_two_places(any_own.criterion),)
        if not two:
            alarms = any_own.false_alarm_rate
            percent = None if alarms is None else f"{100 * alarms:.0f} %"
            bias = (percent, *bias, _two_places(any_own.d_prime))
        rows.append(
            (
                who, f"{len(used)} of {len(own)}", _ratio(calibration, who), *bias, _drift(any_own),
                None if fit_p is None else probability(fit_p), _flags(own),
            )
        )  # fmt: skip
    columns = ("bias",) if two else ("false alarms", "criterion", "d′ at threshold")
    return Table(
        prose("fit_participants", two=two, joint=joint)[0],
        ("participant", "own thresholds", "threshold / limit", *columns, "drift", "fit p", "flags"),
        tuple(rows),
    )


def _ratio(calibration: Calibration, who: str) -> Cell:
    """Return a participant's thresholds as a multiple of the limit; with its interval by the joint model."""
    fit, joint = calibration.rate_limit, calibration.models.joint
    if calibration.models.chosen is RateLimitModel.JOINT and joint is not None:
        people = {person.participant_id: person for person in joint.participants}
        own = people.get(who)
        return f"{own.factor:.2f} ({own.ci_low:.2f} to {own.ci_high:.2f})" if own else None
    ratios = [
        t.threshold / float(rate_limit_at(fit.limit, t.luminance)) for t in fit.own if t.participant_id == who
    ]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else None


def _drift(threshold: Threshold) -> str | None:
    """Return a participant's drift in words."""
    if threshold.drift_ratio is None or threshold.drift_p is None:
        return None
    return f"× {threshold.drift_ratio:.2f} (p {probability(threshold.drift_p)})"


def _two_places(value: float | None) -> str | None:
    """Return a number with two decimals."""
    return None if value is None else f"{value:.2f}"


def population_section(levels: Sequence[LevelEstimates], simulated: bool) -> Section:
    """Return the three estimates of the population's threshold at each level, and why they differ.

    Parameters
    ----------
    levels : sequence of LevelEstimates
        Of all levels.
    simulated : bool
        Whether the participants were simulated.
    """
    several = len({(level.level.direction, level.level.ramp_duration) for level in levels}) > 1
    rows: list[tuple[Cell, ...]] = []
    # Falling ramps first, short ones first.
    order = sorted(levels, key=lambda e: (e.level.direction.value, e.level.ramp_duration, e.level.luminance))
    for estimates in order:
        level, random = estimates.level, estimates.random
        interval = None if random is None else _interval(random.ci_low, random.ci_high)
        spread = None if random is None else f"{np.exp(random.participant_sd):.2f}"
        row = (
            level.screen, level.factor, level.luminance, None if random is None else random.threshold,
            interval, spread, estimates.pooled, _two_places(estimates.pooled_ratio), estimates.mean_of_fits,
            _two_places(estimates.mean_ratio),
        )  # fmt: skip
        rows.append((f"{level.direction.value}, {level.ramp_duration:g}\u00a0s", *row) if several else row)
    columns = ("screen", "factor b", "luminance [cd/m²]", "population", "95 % CI", "people differ ×",
               "pooled", "ratio", "mean of fits", "ratio")  # fmt: skip
    table = Table(prose("fit_population_table")[0], ("ramps", *columns) if several else columns, tuple(rows))
    pooled = mean_ratios(levels)[0]
    text = prose(
        "fit_population",
        two=any(estimates.level.procedure is Procedure.TWO_INTERVAL for estimates in levels),
        pooled_lies_below=pooled is not None and pooled < 1,
        found=sentence(difference_in_words(levels) or ""),
    )
    return Section("The population's threshold", text, (table,), (), (), simulated)


def thresholds_section(calibration: Calibration) -> Section:
    """Return every threshold with what there is to know about it."""
    thresholds = [fit.threshold for fit in calibration.thresholds]
    several = len(conditions_of(thresholds)) > 1
    rows: list[tuple[Cell, ...]] = []
    for t in thresholds:
        row = (
            t.participant_id, t.screen, t.factor, t.luminance, t.threshold,
            f"{t.ci_low:.3g} to {t.ci_high:.3g}", t.threshold_d_prime_1, t.n_trials,
            None if t.deviance is None else f"{t.deviance:.1f}",
            None if t.deviance_p is None else probability(t.deviance_p),
            t.flag.value.replace("_", " ") or "–",
        )  # fmt: skip
        rows.append((*row[:1], condition_of(t).words, *row[1:]) if several else row)
    columns = ("participant", "screen", "b", "L [cd/m²]", "threshold [cd/m²/s]", "95 % credible interval",
               "at d′ = 1", "ramps", "deviance", "p", "flag")  # fmt: skip
    return Section(
        "Every threshold",
        prose("fit_thresholds"),
        (
            Table(
                f"The thresholds of all participants and levels, {len(thresholds)} in all.",
                columns if not several else (columns[0], "of", *columns[1:]),
                tuple(rows),
            ),
        ),
        (),
        (),
        calibration.data.simulated,
    )
