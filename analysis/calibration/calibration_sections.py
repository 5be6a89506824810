"""The sections of the report on a calibration: who answered what, which thresholds, which rate limit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.conditions import condition_of, conditions_of
from evenlight.analysis.calibration.rate_limit_figure import level_means
from evenlight.analysis.calibration.rate_limit_fit import UNUSABLE
from evenlight.analysis.figure_style import short
from evenlight.analysis.report import Cell, Picture, Section, Table, probability
from evenlight.data_schema.ramp import Procedure
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.threshold import Threshold
from evenlight.method.rate_limit import rate_limit_at

LIMIT_ROWS = 7  # luminances at which the rate limit is listed


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
    people = len(data.participant_ids)
    who = f"{people} {'simulated ' if data.simulated else ''}participant{'s' if people != 1 else ''}"
    catches = sum(trial.is_catch for trial in data.trials)
    ramps = len(data.trials) - catches
    luminances = len({(t.screen, t.factor) for t in thresholds})
    conditions = conditions_of(thresholds)
    kinds = ", ".join(condition.words for condition in conditions)
    shown = f" ({kinds})" if len(conditions) > 1 else ""
    nothing = f" and {catches} catch trials without any change" if catches else ""
    asked = (
        "They said in which of two intervals the brightness had changed; the threshold is the rate at which "
        "75 % of the answers are right."
        if _two_interval(thresholds)
        else "They said whether the brightness had changed; the threshold is the rate that is noticed in "
        "75 % of the trials."
    )
    text = (
        f"{who} saw {ramps} ramps of luminance{shown}{nothing} on the display {data.display.name} (white "
        f"{short(data.display.peak_luminance)} cd/m², black {short(data.display.black_level)} cd/m²), from "
        f"{luminances} initial luminances. {asked} A logistic function with asymptotes for guesses and "
        "lapses was fitted to each participant's answers at each level."
    )
    caption = (
        f"Share of {'right answers' if _two_interval(thresholds) else '“yes, it changed”'} over the rate of "
        "change. Black dots: all participants' answers. Thin lines: the participants' functions; red line: "
        "their mean. Below each panel: every participant's threshold with its 95 % interval, hollow where it "
        "cannot be used; the red line is their geometric mean."
    )
    return Section(
        "Calibration",
        (text[0].upper() + text[1:],),
        (_level_table(thresholds), _participant_table(calibration)),
        (Picture(psychometric_png, caption),),
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
    found = {(condition_of(t), t.screen, t.factor, t.luminance) for t in thresholds}
    order = {condition: place for place, condition in enumerate(conditions_of(thresholds))}
    for key in sorted(found, key=lambda key: (order[key[0]], key[3], key[1])):
        condition, screen, factor, luminance = key
        own = [t for t in thresholds if (condition_of(t), t.screen, t.factor, t.luminance) == key]
        used = [t for t in own if t.flag not in UNUSABLE]
        mean, low, high = level_means(used)[0][1:] if used else (None, None, None)
        interval = None if low is None or high is None else f"{low:.3g} to {high:.3g}"
        relative = None if mean is None else 100 * mean / luminance
        row = (screen, factor, luminance, f"{len(used)} of {len(own)}", mean, interval, relative, _flags(own))
        rows.append((condition.words, *row) if several else row)
    columns = ("screen", "factor b", "luminance [cd/m²]", "used", "threshold [cd/m²/s]", "95 % interval",
               "threshold [%/s]", "flags")  # fmt: skip
    return Table(
        "Thresholds of each level: geometric mean over participants with its 95 % interval.",
        ("ramps", *columns) if several else columns,
        tuple(rows),
    )


def _flags(thresholds: Sequence[Threshold]) -> str:
    """Return how often each flag was given, in words."""
    found = [t.flag.value.replace("_", " ") for t in thresholds if t.flag.value]
    return ", ".join(f"{found.count(flag)} {flag}" for flag in dict.fromkeys(found)) or "–"


def _participant_table(calibration: Calibration) -> Table:
    """Return each participant's sensitivity, criterion, drift and flags."""
    fit, everybody = calibration.rate_limit, [fit.threshold for fit in calibration.thresholds]
    two = _two_interval(everybody)
    rows: list[tuple[Cell, ...]] = []
    for who in calibration.data.participant_ids:
        own = [t for t in everybody if t.participant_id == who]
        used = [t for t in own if t.flag not in UNUSABLE]
        ratios = [
            t.threshold / float(rate_limit_at(fit.limit, t.luminance))
            for t in used
            if fit.reference in (None, condition_of(t))
        ]
        ratio = float(np.exp(np.mean(np.log(ratios)))) if ratios else None
        any_own, fit_p = own[0], calibration.participants[who].deviance_p
        bias: tuple[Cell, ...] = (_two_places(any_own.criterion),)
        if not two:
            bias = (_percent(any_own.false_alarm_rate), *bias, _two_places(any_own.d_prime))
        rows.append(
            (
                who,
                f"{len(used)} of {len(own)}",
                ratio,
                *bias,
                _drift(any_own),
                None if fit_p is None else probability(fit_p),
                _flags(own),
            )
        )
    task = (
        "A bias above 0 leans to the first interval."
        if two
        else "False alarms are “yes” in catch trials; from them follow the criterion, in standard deviations "
        "of what is seen when nothing changes, and d′, how clearly a ramp at threshold stands out."
    )
    columns = ("bias",) if two else ("false alarms", "criterion", "d′ at threshold")
    return Table(
        "Participants. Who has a threshold of 1.2 × the limit needs a change 20 % faster than the "
        f"population's curve says. {task} Drift: threshold at the end of the session over that at its "
        "beginning, with the probability of as clear a drift by chance. Fit p: share of simulated answers of "
        "the fitted functions that lie as far from them, all levels together.",
        ("participant", "thresholds used", "threshold / limit", *columns, "drift", "fit p", "flags"),
        tuple(rows),
    )


def _drift(threshold: Threshold) -> str | None:
    """Return a participant's drift in words."""
    if threshold.drift_ratio is None or threshold.drift_p is None:
        return None
    return f"× {threshold.drift_ratio:.2f} (p {probability(threshold.drift_p)})"


def _percent(share: float | None) -> str | None:
    """Return a share in percent."""
    return None if share is None else f"{100 * share:.0f} %"


def _two_places(value: float | None) -> str | None:
    """Return a number with two decimals."""
    return None if value is None else f"{value:.2f}"


def rate_limit_section(calibration: Calibration, rate_limit_png: bytes, published: bool = True) -> Section:
    """Return the fitted rate limit, what it rests on, and what was left out.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    rate_limit_png : bytes
        Its `rate_limit_figure`.
    published : bool
        Whether the figure shows the published rate limit too.
    """
    fit = calibration.rate_limit
    low, high = fit.limit.luminance_range
    text = [
        f"{_form_in_words(fit.limit)} was fitted to {len(fit.used)} of {len(calibration.thresholds)} "
        f"thresholds between {short(low)} and {short(high)} cd/m². Below that range the relative rate is "
        "held, above it the rate. The limit holds for the display that it was measured on."
    ]
    if fit.effects and fit.reference is not None:
        text.append(f"It is the limit for {fit.reference.words}. {_effects_in_words(calibration)}")
    if fit.participant_sd is not None and fit.limit.form is not RateLimitForm.RATE:
        text.append(
            f"Participants differ: two of three lie within a factor of {np.exp(fit.participant_sd):.2f} of "
            "the population's curve."
        )
    excluded = [f"participant {who} ({why})" for who, why in calibration.excluded_participants.items()]
    if excluded:
        text.append("No threshold was used of " + ", ".join(excluded) + ".")
    told = {f"{_sentence(effect.in_words)}." for effect in fit.effects}
    caption = (
        f"Rate of luminance change that is {fit.limit.at_limit_in_words}. Small dots: participants' "
        "thresholds; large dots: means of a level with 95 % interval; line and area: the fitted limit and "
        "its 95 % band; dashed: held outside the measured range"
    )
    caption += "; dash-dotted: the published rate limit surace2025. " if published else ". "
    caption += "Grey rays: constant relative rates."
    if calibration.data.simulated:
        caption += " The simulated population's yes/no thresholds were drawn around the published limit"
        two = calibration.procedure is Procedure.TWO_INTERVAL
        caption += "; what it tells right of two intervals lies at about half of it." if two else "."
    return Section(
        "Rate limit",
        tuple(text),
        (_limit_table(fit.limit),) + ((_effect_table(calibration),) if fit.effects else ()),
        (Picture(rate_limit_png, caption),),
        tuple(note.replace("cd/m^2", "cd/m²") for note in fit.notes if note not in told),
        calibration.data.simulated,
    )


def _effects_in_words(calibration: Calibration) -> str:
    """Return how the other conditions compare, in sentences."""
    sentences = (effect.in_words.replace(" x ", " × ") for effect in calibration.rate_limit.effects)
    return " ".join(f"{_sentence(words)}." for words in sentences)


def _sentence(words: str) -> str:
    """Return words that begin with a capital letter."""
    return words[:1].upper() + words[1:]


def _effect_table(calibration: Calibration) -> Table:
    """Return the other conditions as ratios to the reference."""
    rows: list[tuple[Cell, ...]] = [
        (
            effect.condition.words,
            f"{effect.ratio:.2f}",
            f"{effect.ci_low:.2f} to {effect.ci_high:.2f}",
            "1.00",
            f"{effect.ratio_of_equal_amounts:.2f}",
        )
        for effect in calibration.rate_limit.effects
    ]
    return Table(
        "Thresholds of other ramps as a multiple of those that the limit is for.",
        ("ramps", "ratio", "95 % interval", "if the rate decides", "if the amount does"),
        tuple(rows),
    )


def _form_in_words(limit: RateLimit) -> str:
    """Return what kind of curve it is."""
    degree = len(limit.coefficients) - 1
    what = "the rate itself" if limit.form is RateLimitForm.RATE else "the logarithm of the rate"
    over = "the logarithm of the luminance" if limit.form is RateLimitForm.LOG_LOG else "luminance"
    return f"A polynomial of degree {degree} for {what} over {over}"


def _limit_table(limit: RateLimit) -> Table:
    """Return the limit at some luminances."""
    luminance = np.linspace(*limit.luminance_range, LIMIT_ROWS)
    rows: list[tuple[Cell, ...]] = []
    for L, rate in zip(luminance.tolist(), rate_limit_at(limit, luminance).tolist(), strict=True):
        band = None
        if limit.band_luminance:
            ends = (np.interp(L, limit.band_luminance, edge) for edge in (limit.band_lower, limit.band_upper))
            band = " to ".join(f"{end:.3g}" for end in ends)
        rows.append((L, rate, band, 100 * rate / L))
    return Table(
        "The rate limit at some luminances.",
        ("luminance [cd/m²]", "limit [cd/m²/s]", f"{100 * limit.band_level:g} % band", "limit [%/s]"),
        tuple(rows),
    )
