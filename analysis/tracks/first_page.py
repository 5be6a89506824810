"""The first page of a track's result, in terminal, report, player and notebook alike: at most 60 words.

Whether it is worth it, what it saves and costs, and who notices it. From which numbers on a track is worth it
is a convention: docs/decisions/lower-bound.md.
"""

from __future__ import annotations

from evenlight.analysis.report import KeyFigure
from evenlight.analysis.tracks.track_words import (
    LITTLE_SPREAD,
    PUBLISHED,
    SAME_POWER,
    alike,
    compared,
    details,
    differences,
    little_to_gain,
    moved_in_words,
    nothing_lost,
    watts,
)
from evenlight.analysis.wording import percent
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.tracks.optimization_summary import ROUNDING, MeasuredTrack, OptimizationSummary
from evenlight.method.online.gain import NO_GAIN

CLEARLY = 0.05  # by which a measure finds frames to differ more, so that it is told: about 1 SD of 24 samples
HARDLY = 0.9  # of what constant dimming has: from here on a track is hardly worth it
OFTEN = 0.5  # of the periods that the median watcher notices: from here on it takes viewers who do not watch


def told(summary: OptimizationSummary) -> tuple[str, ...]:
    """Return the first page, and below it what else came out."""
    return *first_page(summary), *details(summary)


def first_page(summary: OptimizationSummary) -> tuple[str, ...]:
    """Return whether a track is worth it, what it saves and costs, who notices it: at most 60 words."""
    return verdict(summary), *(f"  {own.in_words}" for own in key_figures(summary))


def verdict(summary: OptimizationSummary) -> str:
    """Return in a line whether a track is worth it, beside constant dimming; first the video's name."""
    return f"{summary.video}: {_verdict(summary)}"


def _verdict(summary: OptimizationSummary) -> str:
    if nothing := nothing_lost(summary):
        return nothing
    if little := little_to_gain(summary):
        return little
    ours, constant = summary.objective, summary.objective_baseline
    if summary.minimized is not None:
        ours, constant = summary.minimized.value, summary.minimized.baseline
    if not constant > 0:
        return "not worth it: constant dimming already loses the same share of contrast in every frame"
    if ours > constant:
        return "not worth it: constant dimming does better"
    if ours > NO_GAIN * constant:
        return "not worth it: next to nothing is gained over constant dimming"
    worth = "hardly worth it" if ours > HARDLY * constant else "worth it"
    if less_even(summary):
        worth += " by this measure only"
    seen = summary.watched
    return f"{worth}, unless watched for changes" if seen and seen.noticed > OFTEN else worth


def key_figures(summary: OptimizationSummary) -> tuple[KeyFigure, ...]:
    """Return what a track saves and costs, how even it is, and who notices it: the figures of its page."""
    return _saved(summary), _lost(summary), _evenness(summary), _noticed(summary)


def _saved(summary: OptimizationSummary) -> KeyFigure:
    ours, constant, full = summary.mean_power, summary.baseline_power, summary.full_power
    if ours is None or constant is None or full is None:
        unknown = f"savings unknown: no power model for {summary.display}"
        return KeyFigure(percent(summary.mean_factor, 0), "mean brightness", unknown)
    panel = summary.power_model
    where = "" if panel == summary.display else f", power model {panel}"
    where = ", published panel" if panel == PUBLISHED != summary.display else where
    share, saved, other = max(1 - ours / full, 0.0), _watts(full - ours), _watts(full - constant)
    beside = f"{saved} of {watts(full)}{where}{f'; constant {other}' * (saved != other)}"
    return KeyFigure(percent(share, 0), "power saved", beside)


def _watts(saved: float) -> str:
    return watts(max(saved, 0.0)).removesuffix(" W")


def _lost(summary: OptimizationSummary) -> KeyFigure:
    ours, constant = summary.mean_contrast_loss, summary.mean_contrast_loss_baseline
    worst, other = summary.worst_contrast_loss, summary.worst_contrast_loss_baseline
    what = "of visible contrast lost"
    if worst is None or other is None:  # an older file
        mean, mean_constant = alike(ours, constant)
        return KeyFigure(f"{mean} %", what, f"constant {mean_constant} %")
    mean, largest, mean_constant, largest_constant = alike(ours, worst, constant, other)
    beside = f"worst frame {largest} %; constant {mean_constant} and {largest_constant} %"
    return KeyFigure(f"{mean} %", what, beside)


def _evenness(summary: OptimizationSummary) -> KeyFigure:
    ours, constant = summary.objective, summary.objective_baseline
    spread, spread_constant, _ = differences(summary)
    beside = f"{spread} points, constant {spread_constant}"
    worse = ", ".join(f"{one.measure} {-100 * (one.gain or 0):.0f} %" for one in less_even(summary))
    value = "none" if not constant > ROUNDING else compared(ours, constant)
    if constant > ROUNDING and max(ours, constant) < LITTLE_SPREAD:
        value = f"{spread} points"
        beside = f"constant {spread_constant}"
    others = f"; {worse} more" if worse else ""
    return KeyFigure(value, "unevenness of loss", f"{beside}{others}", bool(worse))


def less_even(summary: OptimizationSummary) -> tuple[MeasuredTrack, ...]:
    """Return the other measures by which frames differ clearly more than under constant dimming."""
    return tuple(one for one in summary.measured if one.gain is not None and one.gain <= -CLEARLY)


def _noticed(summary: OptimizationSummary) -> KeyFigure:
    seen, ratio = summary.watched, summary.max_rate_ratio
    beyond = ratio > 1 + SAME_POWER
    if seen is None or beyond:
        words = f"of the rate limit{moved_in_words(summary)}, fastest change"
        return KeyFigure(f"{100 * ratio:.0f} %", words, warns=beyond)
    # who judged two intervals did not say that they noticed anything
    two = summary.rate_limit_procedure is Procedure.TWO_INTERVAL
    found, length = "told from stillness" if two else "noticed", summary.duration / seen.periods
    beside = f"sensitive watchers {percent(seen.noticed_sensitive, 0)}"
    beside += ", assumed" * bool(seen.assumed)
    return KeyFigure(percent(seen.noticed, 0), f"of {length:.2g} s periods {found}", beside)
