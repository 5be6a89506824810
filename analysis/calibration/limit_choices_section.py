"""The section of the report on the choice of the rate limit's curve."""

from __future__ import annotations

from evenlight.analysis.calibration.choice_on_clip import ClipComparison, in_words
from evenlight.analysis.calibration.limit_choices import LimitChoice, LimitChoices
from evenlight.analysis.calibration.limit_choices_files import better_log_log
from evenlight.analysis.report import Cell, Picture, Section, Table


def choices_section(choices: LimitChoices, comparison: ClipComparison | None, figure_png: bytes) -> Section:
    """Return which curves could serve as the rate limit, what speaks for each, and what hangs on it.

    Parameters
    ----------
    choices : LimitChoices
        The curves.
    comparison : ClipComparison or None
        What they do to a clip, if one was looked at.
    figure_png : bytes
        Its `limit_choices_figure`.
    """
    text = [
        "The thresholds do not say which curve runs through them. A fourth degree, as in the paper, follows "
        "them closely and may swing between them; a line or a quadratic in log-log is stiff and rarely "
        "falls. How well a kind of curve predicts a level that it was not fitted to is the best guide here, "
        "but differences of a few per cent are within its error.",
        "The safe curve is the lower edge of the band: of the bands of repeated experiments, one in forty "
        "would lie above the population's curve at a given luminance. It guards against a limit known badly, "
        "not against people who see better than the median: half of all do.",
    ]
    best = better_log_log(choices)
    if best is not None:
        text.append(f"Of the log-log curves, the {best.words.removeprefix('fitted: ')} predicts better.")
    if comparison is not None:
        text.append(in_words(choices, comparison))
    tables = [_curve_table(choices)]
    if comparison is not None:
        tables.append(_clip_table(choices, comparison))
    notes = tuple(f"Not fitted, {name}: {why}." for name, why in choices.missing.items())
    caption = (
        "Each curve as a multiple of the fitted one, with the fitted one's band and the mean threshold of "
        "each level."
    )
    if comparison is not None:
        caption += (
            f" Below: brightness tracks for {comparison.video} within each limit, and their gain over "
            "constant dimming."
        )
    return Section(
        "Which curve, and what hangs on it",
        tuple(text),
        tuple(tables),
        (Picture(figure_png, caption),),
        notes,
        choices.fitted.limit.simulated,
    )


def _curve_table(choices: LimitChoices) -> Table:
    """Return the curves beside the fitted one."""
    rows: list[tuple[Cell, ...]] = [
        (
            choice.words,
            None if choice.left_out_error is None else f"{100 * choice.left_out_error:.1f} %",
            _falls(choice),
            f"{choice.lowest_ratio:.2f} to {choice.highest_ratio:.2f}",
            f"{choice.mean_ratio:.2f}",
            f"{100 * choice.share_above:.0f} %",
        )
        for choice in choices.choices
    ]
    return Table(
        "The curves. Error: of the levels that a curve was not fitted to, the outermost two left out (root "
        "mean square). Ratios are to the fitted curve; “allows more”: the share of the measured luminances "
        "at which a curve allows a faster change than the fitted one.",
        ("curve", "error", "falls with luminance", "ratio", "mean ratio", "allows more"),
        tuple(rows),
    )


def _falls(choice: LimitChoice) -> str:
    """Return where a curve falls, in words."""
    return "; ".join(f"{low:.3g} to {high:.3g} cd/m²" for low, high in choice.falling) or "nowhere"


def _clip_table(choices: LimitChoices, comparison: ClipComparison) -> Table:
    """Return what each choice does to the clip."""
    rows: list[tuple[Cell, ...]] = [
        (
            choice.words,
            outcome.objective,
            f"{100 * outcome.gain:.1f} %",
            outcome.fastest,
            f"{100 * outcome.time_at_limit:.0f} %",
            f"{outcome.share_of_fitted:.2f}",
        )
        for choice, outcome in zip(choices.choices, comparison.outcomes, strict=True)
    ]
    return Table(
        f"What the optimizer makes of {comparison.video} at a mean factor of {comparison.budget:g}. "
        "Difference: of contrast loss, between two frames; gain: how much less than under constant dimming "
        f"({comparison.objective_baseline:.3g}); at the limit: share of the time; last: the fastest step as "
        "a multiple of the fitted limit.",
        ("curve", "difference", "gain", "fastest [cd/m²/s]", "at the limit", "step / fitted limit"),
        tuple(rows),
    )
