"""What a calibration found: numbers as rows, figures, first lines, and the sections that show them."""

from __future__ import annotations

import dataclasses

from evenlight.analysis.calibration.calibration import (
    Calibration,
    NoRateLimitError,
    ThresholdFits,
)
from evenlight.analysis.calibration.calibration_sections import (
    LIMIT,
    MEAN,
    POOLED,
    POPULATION,
    drawn_thresholds,
    every_threshold_section,
    group_of,
    rate_limit_section,
    thresholds_section,
)
from evenlight.analysis.calibration.level_estimates import LevelEstimates
from evenlight.analysis.calibration.psychometric.psychometric_figure import psychometric_figure
from evenlight.analysis.calibration.psychometric.ramp_counts import catch_counts
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import band_at, rate_limit_figure
from evenlight.analysis.figure_style import short
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.integrity.concern import cautious
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.report_prose import prose
from evenlight.analysis.results import Analysis, Drawing
from evenlight.analysis.rows import Rows
from evenlight.analysis.wording import sentence
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.rate_limit import RateLimit, RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure

UNIT = "cd/m^2/s"
WAYS = {
    POPULATION: (
        "of the median participant: all participants' answers, a random threshold for each participant"
    ),
    POOLED: "75 % point of all participants' answers pooled, as if of one person (a reading of the paper)",
    MEAN: "geometric mean of the participants' own usable thresholds",
}


def ramp_findings(calibration: Calibration, compared: RateLimit | None = None) -> Analysis:
    """Return what a calibration found; another rate limit may be drawn beside its own."""
    rows = Rows(Origin.SIMULATED if calibration.data.simulated else Origin.RECORDED)
    for level in calibration.levels:
        _add_level(rows, level)
    _add_limit(rows, calibration)
    drawings = calibration_drawings(calibration, compared)
    answers, limit = (drawing.png for drawing in drawings)
    lead, key_figures = first_lines(calibration)
    return Analysis(
        name="ramp",
        lead=lead,
        rows=tuple(rows),
        drawings=drawings,
        sections=(
            rate_limit_section(calibration, rows, limit, published=compared is not None),
            thresholds_section(calibration, rows, answers),
            every_threshold_section(calibration),
        ),
        warnings=calibration.warnings,
        concerns=calibration.concerns,
        key_figures=key_figures,
    )


def findings_without_limit(refused: NoRateLimitError) -> Analysis:
    """Return what is left where no rate limit can be had: why, the answers, every threshold."""
    fits = refused.fits
    answers = _answers_drawing(fits)
    return Analysis(
        name="ramp",
        lead=f"{sentence(str(refused))}.",
        rows=(),
        drawings=(answers,),
        sections=(every_threshold_section(fits, answers.png),),
        warnings=fits.warnings,
        concerns=fits.concerns,
    )


def _add_level(rows: Rows, level: LevelEstimates) -> None:
    random, group, n = level.random, group_of(level.level), level.n_participants
    best = Effect(random.threshold, random.ci_low, random.ci_high) if random else None
    people, why = (random.n_participants, "") if random else (n, level.in_words)
    rows.add("thresholds", group, POPULATION, UNIT, WAYS[POPULATION], best, people, flag=why)
    for what, value, missing in (
        (POOLED, level.pooled, "all answers are alike"),
        (MEAN, level.mean_of_fits, "no usable threshold"),
    ):
        rows.add("thresholds", group, what, UNIT, WAYS[what], value, n, flag="" if value else missing)


def _add_limit(rows: Rows, calibration: Calibration) -> None:
    limit = calibration.rate_limit.limit
    n = len({fit.threshold.participant_id for fit in calibration.thresholds})
    how = (
        f"degree {len(limit.coefficients) - 1}, {limit.form.value}; {limit.band_words}; {limit.task_in_words}"
    )
    for luminance in sorted({t.luminance for t in drawn_thresholds(calibration)}):
        own = Effect(float(limit(luminance)), *band_at(limit, luminance))
        group = f"{luminance:.4g} cd/m^2"
        rows.add("rate_limit", group, LIMIT, UNIT, how, own, n, level=limit.band_level)


def calibration_drawings(
    calibration: Calibration, compared: RateLimit | None = None
) -> tuple[Drawing, Drawing]:
    """Return the figures of answers and rate limit, another limit beside it where one is given."""
    simulated = calibration.data.simulated
    limit = dataclasses.replace(calibration.rate_limit.limit, simulated=simulated)
    beside = {f"{model.value} model": fit.limit for model, fit in calibration.models.others.items()}
    curve, points = rate_limit_figure(limit, drawn_thresholds(calibration), compared, beside=beside)
    caption = "The rate limit with its band, and the thresholds behind it."
    return _answers_drawing(calibration), Drawing("rate_limit", curve, caption, points)


def _answers_drawing(fits: ThresholdFits) -> Drawing:
    answers, shares = psychometric_figure(fits.thresholds, fits.data.simulated)
    return Drawing("psychometric", answers, "Answers and fitted psychometric functions.", shares)


def first_lines(calibration: Calibration) -> tuple[str, tuple[KeyFigure, ...]]:
    """Return what came out, after what is wrong with the trials; and the key figures."""
    limit, falling = calibration.rate_limit.limit, calibration.rate_limit.falling
    lead = prose(
        "fit_lead",
        limit=limit,
        ends=[(short(float(limit(L))), short(L)) for L in sorted({*limit.luminance_range})],
        simulated=calibration.data.simulated,
        falls=[short(end) for end in falling[0]] if falling else (),
        remedy=_remedy(calibration),
    )[0]
    figures = (_limit_figure(limit), _people_figure(calibration), *_false_alarms(calibration))
    return cautious(calibration.concerns, lead), (*figures, *_what_is_wrong(calibration))


def _limit_figure(limit: RateLimit) -> KeyFigure:
    """Return the limit in the middle of the luminances measured, with its band."""
    middle = sum(limit.luminance_range) / 2
    low, high = band_at(limit, middle)
    beside = "no band" if low is None or high is None else f"{limit.band_words}: {low:.3g} to {high:.3g}"
    what = f"rate limit at {short(middle)} cd/m²"
    return KeyFigure(f"{float(limit(middle)):.3g} cd/m²/s", what, beside, warns=bool(limit.wide_band))


def _people_figure(calibration: Calibration) -> KeyFigure:
    people, n = len(calibration.data.participant_ids), len(calibration.thresholds)
    left_out = len(calibration.rate_limit.excluded)
    who = f"{'simulated ' * calibration.data.simulated}participant{'s' * (people > 1)}"
    return KeyFigure(f"{people}", who, f"{n} thresholds" + (f", {left_out} left out" if left_out else ""))


def _false_alarms(calibration: Calibration) -> tuple[KeyFigure, ...]:
    """Return how often participants noticed a change in catch trials; nothing of two intervals."""
    counts = catch_counts(trial for trial in calibration.data.trials if trial.procedure is Procedure.YES_NO)
    yes, n = (sum(column) for column in zip(*counts.values(), strict=True)) if counts else (0, 0)
    if calibration.procedure is not Procedure.YES_NO or not n:
        return ()
    return (KeyFigure(f"{100 * yes / n:.0f} %", "false alarms", f"{yes} of {n} trials without a change"),)


def _what_is_wrong(calibration: Calibration) -> tuple[KeyFigure, ...]:
    """Return the gravest that is wrong with the curve, or how many warnings there are."""
    falling = calibration.rate_limit.falling
    if falling:
        low, high = falling[0]
        what = f"the limit falls from {short(low)} to {short(high)} cd/m²"
        return (KeyFigure("Implausible", what, f"try {_remedy(calibration)}", warns=True),)
    limit, n = calibration.rate_limit.limit, len(calibration.warnings)
    if limit.wide_band and limit.widest_band:
        at, low, high = limit.widest_band
        where = f"{low:.3g} to {high:.3g} cd/m²/s at {short(at)} cd/m²"
        return (KeyFigure("Not for use", "the band is too wide", where, warns=True),)
    return (KeyFigure(f"{n}", "warnings" if n > 1 else "warning", warns=True),) if n else ()


def _remedy(calibration: Calibration) -> str:
    """Return what keeps the curve from falling, which the joint model alone can."""
    joint = calibration.models.chosen is RateLimitModel.JOINT
    return "`evenlight fit --monotone`" if joint else "`evenlight fit --model joint --monotone`"
