"""The choice of the rate limit's curve: its files, and its section of the report."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evenlight.analysis.calibration.choices.choice_on_clip import ClipComparison, in_words
from evenlight.analysis.calibration.choices.limit_choices import (
    FITTED,
    LOG_LOG_QUADRATIC,
    POWER_LAW,
    SAFE,
    LimitChoice,
    LimitChoices,
)
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import described, quantity
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json, write_json_record

TABLE, SUMMARY, FIGURE = "limit_choices.csv", "limit_choices.json", "limit_choices.png"
SAFE_LIMIT, LOG_LOG_LIMIT = "rate_limit_safe.json", "rate_limit_log_log.json"


@dataclass(frozen=True, slots=True)
class ChoiceRow:
    """A row of `limit_choices.csv`; what a clip would tell is None without one."""

    choice: str = described("name of the curve")
    description: str = described("what it is")
    form: str = described("what the polynomial describes")
    degree: int = quantity("1", "degree of the polynomial")
    left_out_error_ln: float | None = quantity("1", "RMS of ln(predicted / mean) of levels left out")
    falling: str = described("where it falls noticeably [cd/m^2]; empty if nowhere")
    lowest_ratio: float = quantity("1", "least multiple of the fitted curve's rate")
    highest_ratio: float = quantity("1", "greatest multiple of the fitted curve's rate")
    mean_ratio: float = quantity("1", "geometric mean of these multiples over the measured range")
    more_permissive: bool = described("true if it allows more than the fitted curve somewhere")
    share_above: float = quantity("1", "share of the measured range in which it does")
    objective: float | None = quantity("1", "mean difference of contrast loss between two frames of the clip")
    objective_baseline: float | None = quantity("1", "the same at constant dimming")
    gain: float | None = quantity("1", "1 - objective / objective_baseline")
    fastest: float | None = quantity("cd/m^2/s", "fastest change of the track")
    share_of_limit: float | None = quantity("1", "greatest ratio of a step's rate to this limit")
    share_of_fitted: float | None = quantity("1", "greatest ratio of a step's rate to the fitted limit")
    time_at_limit: float | None = quantity("1", "share of the steps within 1 % of this limit")


def write_limit_choices(
    folder: Path, choices: LimitChoices, comparison: ClipComparison | None, origin: Provenance
) -> None:
    """Write the table of the choices, and the safe and the log-log limit as files for the optimizer.

    Parameters
    ----------
    folder, choices : Path, LimitChoices
        Where to, and the curves, their records marked as simulated where they are.
    comparison, origin : ClipComparison or None, Provenance
        What they do to a clip, if one was looked at; of the calibration, with the clip among its inputs.
    """
    rows = [_row(choice, comparison) for choice in choices.choices]
    write_rows(folder / TABLE, ChoiceRow, rows)
    log_log = better_log_log(choices)
    written = {SAFE_LIMIT: choices.named(SAFE), LOG_LOG_LIMIT: log_log}
    for name, choice in written.items():  # none beside a limit that is known too badly for use
        if choice is not None and not choices.fitted.limit.wide_band:
            write_json_record(folder / name, dataclasses.replace(choice.limit, provenance=origin))
    content: dict[str, Any] = {
        "simulated": choices.fitted.limit.simulated,
        "choices": [mapping_from_record(row) for row in rows],
        "missing": choices.missing,
        "log_log": log_log and log_log.name,
        "clip": None,
        "provenance": mapping_from_record(origin),
    }
    if comparison is not None:
        content["clip"] = {
            "video": comparison.video,
            "frames": len(comparison.times),
            "mean_factor": comparison.budget,
            "in_words": in_words(choices, comparison),
        }
    write_json(folder / SUMMARY, content)


def better_log_log(choices: LimitChoices) -> LimitChoice | None:
    """Return the line or the quadratic in log-log, whichever predicts levels left out better."""
    form = choices.fitted.limit.form
    own = (choices.named(name) for name in (POWER_LAW, LOG_LOG_QUADRATIC))
    found = [choice for choice in own if choice is not None]
    if form.value == "log_log":
        found.append(choices.named(FITTED) or choices.fitted)
    scored = [choice for choice in found if choice.left_out_error is not None]
    return min(scored, key=lambda choice: choice.left_out_error or 0.0) if scored else next(iter(found), None)


def _row(choice: LimitChoice, comparison: ClipComparison | None) -> ChoiceRow:
    """Return the row of a choice."""
    outcome = comparison and comparison.of(choice.name)
    clip = (
        (
            outcome.objective, comparison.objective_baseline, outcome.gain, outcome.fastest,
            outcome.share_of_limit, outcome.share_of_fitted, outcome.time_at_limit,
        )
        if comparison and outcome
        else (None,) * 7
    )  # fmt: skip
    return ChoiceRow(
        choice.name,
        choice.words,
        choice.limit.form.value,
        len(choice.limit.coefficients) - 1,
        choice.left_out_error,
        "; ".join(f"{low:.4g} to {high:.4g}" for low, high in choice.falling),
        choice.lowest_ratio,
        choice.highest_ratio,
        choice.mean_ratio,
        choice.more_permissive,
        choice.share_above,
        *clip,
    )


def choices_section(choices: LimitChoices, comparison: ClipComparison | None, figure_png: bytes) -> Section:
    """Return which curves could serve as the rate limit, and what depends on the choice.

    Parameters
    ----------
    choices, figure_png : LimitChoices, bytes
        The curves, and their `limit_choices_figure`.
    comparison : ClipComparison or None
        What they do to a clip, if one was looked at.
    """
    best = better_log_log(choices)
    text = prose(
        "fit_choices",
        band_kind=choices.named(SAFE) and choices.fitted.limit.band_kind.value,
        best=best and best.words.removeprefix("fitted: "),
        on_clip=in_words(choices, comparison) if comparison else "",
    )
    tables = [_curve_table(choices)]
    if comparison is not None:
        tables.append(_clip_table(choices, comparison))
    notes = tuple(f"Not fitted, {name}: {why}." for name, why in choices.missing.items())
    caption = prose("fit_choices_caption", comparison=comparison)[0]
    return Section(
        "Which curve, and what depends on it",
        text,
        tuple(tables),
        (Picture(figure_png, caption),),
        notes,
        choices.fitted.limit.simulated,
    )


def _curve_table(choices: LimitChoices) -> Table:
    """Return the curves beside the fitted one."""
    rows: list[tuple[Cell, ...]] = [
        (
            choice.words, None if choice.left_out_error is None else f"{100 * choice.left_out_error:.1f} %",
            "; ".join(f"{low:.3g} to {high:.3g} cd/m²" for low, high in choice.falling) or "nowhere",
            f"{choice.lowest_ratio:.2f} to {choice.highest_ratio:.2f}",
            f"{choice.mean_ratio:.2f}", f"{100 * choice.share_above:.0f} %",
        )
        for choice in choices.choices
    ]  # fmt: skip
    return Table(
        prose("fit_choices_table")[0],
        ("curve", "error", "falls with luminance", "ratio", "mean ratio", "allows more"),
        tuple(rows),
    )


def _clip_table(choices: LimitChoices, comparison: ClipComparison) -> Table:
    """Return what each choice does to the clip."""
    rows: list[tuple[Cell, ...]] = [
        (
            choice.words, outcome.objective, f"{100 * outcome.gain:.1f} %", outcome.fastest,
            f"{100 * outcome.time_at_limit:.0f} %", f"{outcome.share_of_fitted:.2f}",
        )
        for choice, outcome in zip(choices.choices, comparison.outcomes, strict=True)
    ]  # fmt: skip
    return Table(
        prose("fit_choices_clip_table", comparison=comparison)[0],
        ("curve", "difference", "gain", "fastest [cd/m²/s]", "at the limit", "step / fitted limit"),
        tuple(rows),
    )
