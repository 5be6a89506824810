"""The online controller (Section 6): how steady it keeps contrast loss, and what a tolerated loss saves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator

from evenlight.analysis import figure_style as style
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.published import published
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.published_beside import SD, SD_RATIO, beside_table, marked
from evenlight.analysis.results import Analysis, Drawing
from evenlight.analysis.rows import Plot, Rows
from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.online.control_curves import ControlledTrack, control_curves
from evenlight.method.online.controller import Controller
from evenlight.method.rate_limit import largest_rate_ratio

INTERVAL = (
    "delta method on the logarithm, long-run variance from the four slowest cosines, t of 4 degrees of "
    "freedom; n frames"
)
CONTROLLED, CONSTANT = "online controller", "constant dimming"
PRINTED = {CONTROLLED: "ours", CONSTANT: "baseline"}
MEAN_FACTOR, MEAN_LOSS = "mean brightness factor", "mean contrast loss"
OverTime = dict[str, dict[str, Array]]  # of each quantity, under the controller and constant, (N,)
STYLES: dict[str, dict[str, Any]] = {
    CONTROLLED: {"color": style.OURS, "lw": 1.5, "zorder": 2.2},
    CONSTANT: {"color": style.BASELINE, "lw": 1.2},
}


def online_findings(
    walk: LossCurves,
    swept: LossCurves,
    controller: Controller,
    targets: Sequence[float],
    *,
    drawn: bool = True,
) -> Analysis:
    """Return how steady a controller keeps contrast loss on a walk, and brightness over the target.

    Parameters
    ----------
    walk, swept : LossCurves
        The walk through the house; a sequence with several targets, the basement in the paper.
    controller : Controller
        Target on the walk, gains, bounds and rate limit.
    targets : sequence of float
        c_r of the other sequence, two or more, rising.
    drawn : bool
        Whether the rate limit is that of participants drawn around the published one.
    """
    track = control_curves(walk, controller)
    factor = min(track.mean_factor, 1.0)  # rounding may add 1e-16
    factors = np.full(walk.n_frames, factor)
    over_time = {
        "contrast loss": {CONTROLLED: track.contrast_loss, CONSTANT: loss_at(walk, factors)},
        "brightness factor": {CONTROLLED: track.factors, CONSTANT: factors},
    }
    losses = over_time["contrast loss"]
    spread = spread_ratio(losses[CONTROLLED], losses[CONSTANT], track.durations)
    rows = Rows(Origin.COMPUTED)
    _add_walk(rows, walk.video, track, over_time, controller, spread, drawn=drawn)
    for target in targets:
        aimed = replace(controller, settings=replace(controller.settings, target_loss=target))
        own = control_curves(swept, aimed)
        numbers = {MEAN_FACTOR: own.mean_factor, MEAN_LOSS: float(own.time_share @ own.contrast_loss)}
        for name, value in numbers.items():
            what = f"{name} at a target loss of {target:g}"
            rows.add("target", swept.video, what, "1", "mean over time; n frames", value, swept.n_frames)
    target_loss = controller.settings.target_loss
    drawings = (
        _walk_drawing(walk, track, over_time, target_loss, spread),
        _target_drawing(rows, swept, targets, controller.settings.lowest_factor),
    )
    caption = f"Contrast loss over time, {walk.n_frames} frames, target {100 * target_loss:.2g} %"
    table = beside_table(caption, rows, drawn=drawn)
    about = section(
        "reproduction/online",
        (table,),
        [drawing.picture for drawing in drawings],
        seconds=track.durations.sum(),
        spread=spread,
        printed_ratio=_published_ratio(),
        constant_factor=factor,
        held=float(track.time_share @ track.limited),
        flag=spread.flag,
    )
    warnings = (f"{walk.video}: {spread.flag}",) if spread.flag else ()
    return Analysis("online", about.paragraphs[0], tuple(rows), drawings, (about,), warnings)


def _published_ratio() -> float:
    return published("online.sd_ours").number / published("online.sd_baseline").number


def _add_walk(
    rows: Rows,
    video: str,
    track: ControlledTrack,
    over_time: OverTime,
    controller: Controller,
    spread: SpreadRatio,
    *,
    drawn: bool,
) -> None:
    """Add the numbers of the walk, and the published ones."""
    share, settings, n = track.time_share, controller.settings, len(track.factors)
    gains = ", ".join(f"{own:g}" for own in (settings.proportional, settings.integral, settings.derivative))
    rate = "the video's frames" if settings.gain_rate is None else f"frames of 1/{settings.gain_rate:g} s"
    method = f"gains {gains} for {rate}; n frames"
    losses, factors = over_time.values()
    for what, value, unit in (
        (f"{SD}, {CONTROLLED}", spread.sd, "1"),
        (f"{SD}, {CONSTANT}", spread.sd_constant, "1"),
        (f"{MEAN_LOSS}, {CONTROLLED}", float(share @ losses[CONTROLLED]), "1"),
        (f"{MEAN_LOSS}, {CONSTANT}", float(share @ losses[CONSTANT]), "1"),
        ("target contrast loss", settings.target_loss, "1"),
        (f"{MEAN_FACTOR} of both", float(factors[CONSTANT][0]), "1"),
        ("share of the time held back by the rate limit or a bound", float(share @ track.limited), "1"),
        ("largest ratio of a rate to its limit", largest_rate_ratio(track.rate, track.rate_limit), "1"),
        ("time in which the content's loss is correlated, constant dimming", spread.correlation_time, "s"),
    ):
        rows.add("steadiness", video, what, unit, method, value, n)
    ratio = Effect(spread.ratio, spread.ci_low, spread.ci_high, spread.flag)
    rows.add("steadiness", video, SD_RATIO, "1", INTERVAL, ratio, n)
    rows[-1] = marked(rows[-1], drawn=drawn)
    both = {name: published(f"online.sd_{key}") for name, key in PRINTED.items()}
    rows.origin = Origin.PUBLISHED
    for name, printed in both.items():
        rows.add("steadiness", video, f"{SD}, {name}", "1", printed.place, printed.number)
    method = " / ".join(own.text for own in both.values())
    flag = "from rounded numbers; no interval is printed"
    rows.add("steadiness", video, SD_RATIO, "1", method, _published_ratio(), flag=flag)
    rows.origin = Origin.COMPUTED


def _walk_drawing(
    walk: LossCurves, track: ControlledTrack, over_time: OverTime, target: float, spread: SpreadRatio
) -> Drawing:
    """Draw contrast loss and brightness over time, under the controller and under constant dimming."""
    times, n = walk.times.tolist(), walk.n_frames
    deviations = {CONTROLLED: spread.sd, CONSTANT: spread.sd_constant}
    with style.look():
        title = f"Contrast loss on a walk through the {walk.video.replace('_', ' ')}"
        about = (
            f"{n} frames, {float(track.durations.sum()):.0f} s · brightness controlled online and constant, "
            f"both {over_time['brightness factor'][CONSTANT][0]:.2f} on average · SD: standard deviation "
            "over time"
        )
        figure, axes = style.panels(title, about, [[what] for what in over_time], [17, 11], sharex=True)
        plots = {
            what: Plot(axes[what], what, Origin.COMPUTED, ("time", "s", what, "1")) for what in over_time
        }
        for what, series in over_time.items():
            for name, values in series.items():
                label = f"{name}, SD {style.short(100 * deviations[name])} %"
                plots[what].line(name, times, values.tolist(), label=label, **STYLES[name])
            axes[what].set_ylabel(what)
        loss, factors = axes.values()
        plots["contrast loss"].line(
            "target", times, [target] * n, color=style.INK, ls=":", lw=1.0, label="target"
        )
        loss.set_ylim(0, 1.06 * max(1e-6, *(float(own.max()) for own in over_time["contrast loss"].values())))
        loss.yaxis.set_major_formatter(style.PERCENT)
        style.legend_above(loss)
        factors.set(ylim=(0, 1), xlim=(0, float(walk.times[-1] + track.durations[-1])), xlabel="time [min:s]")
        factors.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 3, 6, 10]))
        factors.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{int(t) // 60}:{int(t) % 60:02d}"))
    (caption,) = prose("reproduction/online_walk_caption")
    points = [replace(point, n=n) for plot in plots.values() for point in plot.points]
    return Drawing("online_walk", figure, caption, tuple(points))


def _target_drawing(rows: Rows, swept: LossCurves, targets: Sequence[float], lowest: float) -> Drawing:
    names = {MEAN_FACTOR: MEAN_FACTOR, "mean contrast loss reached": MEAN_LOSS}
    points = []
    with style.look():
        title = f"What tolerating a loss of contrast saves: {swept.video.replace('_', ' ')}"
        about = (
            f"{swept.n_frames} frames of a rendered scene · online controller, each point a run of its own"
        )
        figure, axes = style.panels(title, about, [list(names)], [16])
        for name, what in names.items():
            plot = Plot(axes[name], name, Origin.COMPUTED, ("target contrast loss", "1", name, "1"))
            reached = [row.value or 0.0 for row in rows.of("target", f"{what} at")]
            plot.line(CONTROLLED, list(targets), reached, marker="o", color=style.OURS, clip_on=False)
            points += [replace(point, n=swept.n_frames) for point in plot.points]
            axes[name].set(ylabel=name, xlabel="target contrast loss", ylim=(0, 1))
            axes[name].xaxis.set_major_formatter(style.PERCENT)
        factor, loss = axes.values()
        factor.axhline(lowest, color=style.MUTED, ls=":", lw=1.0)
        factor.text(
            max(targets), lowest - 0.02, "lowest factor allowed", color=style.MUTED, va="top", ha="right"
        )
        end = 1.08 * max(*targets, *reached, 1e-6)
        loss.plot([0, end], [0, end], color=style.FAINT)
        loss.text(0.93 * end, 0.95 * end, "as asked", color=style.MUTED, ha="right", va="bottom")
        loss.set(xlim=(0, end), ylim=(0, end))
        loss.yaxis.set_major_formatter(style.PERCENT)
        factor.set_xlim(0, end)
    caption = "Mean brightness factor, and mean contrast loss reached, over the online controller's target."
    return Drawing("online_target", figure, caption, tuple(points))
