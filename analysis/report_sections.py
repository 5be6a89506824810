"""The sections of the report, made from the records that they tell about."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analysis.calibration import Calibration
from analysis.figure_style import short
from analysis.rate_limit_figure import level_means
from analysis.rate_limit_fit import UNUSABLE
from analysis.report import Cell, Picture, Section, Table
from data_schema.brightness_track import BudgetUnit, OptimizationSummary
from data_schema.provenance import Provenance
from data_schema.rate_limit import RateLimit, RateLimitForm
from data_schema.threshold import Threshold
from method.rate_limit import rate_limit_at

LIMIT_ROWS = 7  # luminances at which the rate limit is listed


def introduction_section() -> Section:
    """Return what Evenlight does, in a paragraph for a newcomer."""
    return Section(
        "What was done",
        (
            "A dimmed display needs less power, but the eye sees less contrast in the dark: fine detail "
            "is lost, more of it in some scenes than in others. Evenlight dims a video over time so that "
            "a power budget is met, every frame loses about the same share of its visible contrast, and "
            "the brightness moves slowly enough to be hard to notice. For that it needs to know how fast "
            "a change is noticed on a display. Participants watch plain screens that darken "
            "slowly, and say whether they saw a change; from their answers follows the rate limit, the "
            "change that people who watch for it notice in 75 % of the trials. Within that limit an "
            "optimizer looks for the brightness of each frame.",
        ),
    )


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
    levels = len({(t.screen, t.factor) for t in thresholds})
    text = (
        f"{who} saw {len(data.trials) - catches} ramps of luminance and {catches} catch trials without any "
        f"change on the display {data.display.name} (white {short(data.display.peak_luminance)} cd/m², black "
        f"{short(data.display.black_level)} cd/m²), from {levels} initial luminances. A logistic function "
        "with asymptotes for guesses and lapses was fitted to each participant's answers at each level; the "
        "threshold is the rate that is noticed in 75 % of the trials."
    )
    caption = (
        "Share of “yes, it changed” over the rate of change. Black dots: all participants' answers. Thin "
        "lines: the participants' functions; red line: their mean. Below each panel: every participant's "
        "threshold with its 95 % interval, hollow where it cannot be used; the red line is their "
        "geometric mean."
    )
    return Section(
        "Calibration",
        (text[0].upper() + text[1:],),
        (_level_table(thresholds), _participant_table(calibration)),
        (Picture(psychometric_png, caption),),
        data.warnings,
        data.simulated,
    )


def _level_table(thresholds: list[Threshold]) -> Table:
    """Return the thresholds of each level, over participants."""
    rows: list[tuple[Cell, ...]] = []
    keys = sorted({(t.screen, t.factor, t.luminance) for t in thresholds}, key=lambda key: key[2])
    for screen, factor, luminance in keys:
        own = [t for t in thresholds if (t.screen, t.factor, t.luminance) == (screen, factor, luminance)]
        used = [t for t in own if t.flag not in UNUSABLE]
        mean, low, high = level_means(used)[0][1:] if used else (None, None, None)
        interval = None if low is None or high is None else f"{low:.3g} to {high:.3g}"
        relative = None if mean is None else 100 * mean / luminance
        rows.append(
            (screen, factor, luminance, f"{len(used)} of {len(own)}", mean, interval, relative, _flags(own))
        )
    return Table(
        "Thresholds of each level: geometric mean over participants with its 95 % interval.",
        ("screen", "factor b", "luminance [cd/m²]", "used", "threshold [cd/m²/s]", "95 % interval",
         "threshold [%/s]", "flags"),
        tuple(rows),
    )  # fmt: skip


def _flags(thresholds: list[Threshold]) -> str:
    """Return how often each flag was given, in words."""
    found = [t.flag.value.replace("_", " ") for t in thresholds if t.flag.value]
    return ", ".join(f"{found.count(flag)} {flag}" for flag in dict.fromkeys(found)) or "–"


def _participant_table(calibration: Calibration) -> Table:
    """Return each participant's sensitivity, false alarms and flags."""
    limit = calibration.rate_limit.limit
    rows: list[tuple[Cell, ...]] = []
    for who in calibration.data.participant_ids:
        own = [fit.threshold for fit in calibration.thresholds if fit.threshold.participant_id == who]
        used = [t for t in own if t.flag not in UNUSABLE]
        ratios = [t.threshold / float(rate_limit_at(limit, t.luminance)) for t in used]
        ratio = float(np.exp(np.mean(np.log(ratios)))) if ratios else None
        criterion = calibration.criteria.get(who)
        alarms = None if criterion is None else f"{100 * criterion.false_alarm_rate:.0f} %"
        d_prime = None if criterion is None else criterion.d_prime_at_threshold
        rows.append((who, f"{len(used)} of {len(own)}", ratio, alarms, d_prime, _flags(own)))
    return Table(
        "Participants. Who has a threshold of 1.2 × the limit needs a change 20 % faster to notice it than "
        "the population's curve says; false alarms are “yes” in catch trials.",
        ("participant", "thresholds used", "threshold / limit", "false alarms", "d′ at threshold", "flags"),
        tuple(rows),
    )


def rate_limit_section(calibration: Calibration, rate_limit_png: bytes) -> Section:
    """Return the fitted rate limit, what it rests on, and what was left out.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    rate_limit_png : bytes
        Its `rate_limit_figure`.
    """
    fit = calibration.rate_limit
    low, high = fit.limit.luminance_range
    text = [
        f"{_form_in_words(fit.limit)} was fitted to {len(fit.used)} of {len(calibration.thresholds)} "
        f"thresholds between {short(low)} and {short(high)} cd/m². Below that range the relative rate is "
        "held, above it the rate. The limit holds for the display that it was measured on."
    ]
    if fit.participant_sd is not None and fit.limit.form is not RateLimitForm.RATE:
        text.append(
            f"Participants differ: two of three lie within a factor of {np.exp(fit.participant_sd):.2f} of "
            "the population's curve."
        )
    excluded = [f"participant {who} ({why})" for who, why in calibration.excluded_participants.items()]
    if excluded:
        text.append("No threshold was used of " + ", ".join(excluded) + ".")
    caption = (
        "Rate of luminance change that is noticed in 75 % of the trials. Small dots: participants' "
        "thresholds; large dots: means of a level with 95 % interval; line and area: the fitted limit and "
        "its 95 % band; dashed: held outside the measured range; dash-dotted: the published rate limit "
        "surace2025. Grey rays: constant relative rates."
    )
    if calibration.data.simulated:
        caption += " The simulated population was drawn around the published limit."
    return Section(
        "Rate limit",
        tuple(text),
        (_limit_table(fit.limit),),
        (Picture(rate_limit_png, caption),),
        tuple(note.replace("cd/m^2", "cd/m²") for note in fit.notes),
        calibration.data.simulated,
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


def track_section(summary: OptimizationSummary, track_png: bytes, simulated: bool = False) -> Section:
    """Return what the optimizer made of a video.

    Parameters
    ----------
    summary : OptimizationSummary
        Its figures.
    track_png : bytes
        Its `track_figure`.
    simulated : bool
        Whether the rate limit rests on simulated participants.
    """
    caption = (
        "Brightness factor, contrast loss and rate of change over time, for the track (blue) and for "
        "constant dimming at the same power (orange). The rate, above 0 where the modulation brightens, "
        "must stay out of the red areas. Below: frames at the marked times, at full "
        "brightness and as they are shown."
    )
    notes: tuple[str, ...] = ()
    if summary.frames_without_contrast:
        notes = (
            f"{summary.frames_without_contrast} of {summary.frames} frames show nothing visible even at full "
            "brightness; they have nothing to lose, and count as a loss of 0.",
        )
    return Section(
        f"Brightness track of {summary.video}",
        (meaning_of(summary),),
        (_summary_table(summary),),
        (Picture(track_png, caption),),
        notes,
        simulated,
    )


def meaning_of(summary: OptimizationSummary) -> str:
    """Return what the figures of a summary mean, in words."""
    ours, constant = summary.objective, summary.objective_baseline
    saved = 100 * (1 - summary.mean_power / summary.full_power) if summary.full_power > 0 else 0.0
    words = (
        f"The track needs {short(summary.mean_power)} W on average, {saved:.0f} % less than at full "
        f"brightness and as much as constant dimming to {100 * summary.baseline_factor:.0f} %. "
    )
    if summary.frames_without_contrast == summary.frames:
        words += "Nothing is visible in any frame, so there is no contrast to lose. "
    elif constant > 0:
        words += (
            "It spreads the lost contrast more evenly: two frames picked at random differ by "
            f"{short(ours)} in the share of visible contrast that they lose, "
            f"{100 * (1 - ours / constant):.0f} % less than under constant dimming ({short(constant)}). No "
            f"track within the limits gets below {short(summary.lower_bound)}. "
        )
    else:
        words += "Constant dimming already loses the same share of contrast in every frame. "
    kept = "stays within" if summary.max_rate_ratio <= 1 + 1e-6 else "goes beyond"
    return words + (
        f"The fastest change reaches {100 * summary.max_rate_ratio:.0f} % of the rate limit and {kept} "
        "what the calibration allows."
    )


def _summary_table(summary: OptimizationSummary) -> Table:
    """Return the figures of a summary with names and units."""
    unit = {
        BudgetUnit.FACTOR: "mean brightness factor",
        BudgetUnit.POWER: "share of full power",
        BudgetUnit.WATT: "W, mean power",
    }[summary.budget_unit]
    solver = f"time for the solver ({summary.solver}, {summary.iterations} iterations)"
    return Table(
        f"{summary.video} on {summary.display}, with the power model {summary.power_model} and the rate "
        f"limit {summary.rate_limit}.",
        ("quantity", "track", "constant dimming", "unit"),
        (
            ("budget asked", summary.budget, summary.budget, unit),
            ("budget used", summary.achieved, summary.budget, unit),
            ("mean brightness factor", summary.mean_factor, summary.baseline_factor, "1"),
            ("mean power", summary.mean_power, summary.baseline_power, "W"),
            ("power at full brightness", summary.full_power, summary.full_power, "W"),
            ("mean contrast loss", summary.mean_contrast_loss, summary.mean_contrast_loss_baseline, "1"),
            ("mean difference of contrast loss between two frames", summary.objective,
             summary.objective_baseline, "1"),
            ("lower bound of that difference", summary.lower_bound, None, "1"),
            ("fastest change, share of the rate limit", summary.max_rate_ratio, 0.0, "1"),
            ("length", summary.duration, summary.duration, "s"),
            ("frames", summary.frames, summary.frames, "1"),
            ("time for loss curves", summary.curves_s, None, "s"),
            (solver, summary.solve_s, None, "s"),
        ),
    )  # fmt: skip


def contrast_map_section(contrast_map_png: bytes, simulated: bool = False) -> Section:
    """Return where contrast is lost in one frame; the picture is its `contrast_map_figure`."""
    text = (
        "Dimming loses detail where contrast was just visible. The map shows one frame at the finest spatial "
        "frequency with visible contrast: white stays visible, red is lost."
    )
    caption = (
        "A frame, and its visible and lost contrast under the track's factor and under constant dimming."
    )
    return Section("Lost contrast", (text,), (), (Picture(contrast_map_png, caption),), (), simulated)


def provenance_section(origins: Mapping[str, Provenance]) -> Section:
    """Return software, seeds and inputs of some results.

    Parameters
    ----------
    origins : mapping of str to Provenance
        Where each result comes from, by its name.
    """
    software: list[tuple[Cell, ...]] = []
    inputs: list[tuple[Cell, ...]] = []
    for name, origin in origins.items():
        packages = ", ".join(f"{package} {version}" for package, version in origin.versions.items())
        software.append((name, origin.software_version, origin.software_revision, origin.seed, packages))
        inputs += [(name, what, digest) for what, digest in origin.inputs.items()]
    tables = (
        Table(
            "Software and seeds.", ("result", "Evenlight", "revision", "seed", "packages"), tuple(software)
        ),
        Table("Inputs.", ("result", "input", "SHA-256"), tuple(inputs)),
    )
    return Section("Where it comes from", (), tables[: 2 if inputs else 1])


def files_section(files: Mapping[str, str]) -> Section:
    """Return the files that were written, by name, with what they hold."""
    return Section("Files", (), (Table("Beside this report.", ("file", "holds"), tuple(files.items())),))
