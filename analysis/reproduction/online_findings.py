"""The online controller (Section 6): how steady it keeps contrast loss, and what a tolerated loss saves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    png_bytes,
    short,
    text_size,
)
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.published import published
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.online_run import OnlineRun, SweepPoint, TargetSweep
from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.method.rate_limit import largest_rate_ratio

RATIO = "SD of the controller / SD of constant dimming"
INTERVAL = (
    "delta method on the logarithm, long-run variance from the four slowest cosines, t of 4 degrees of "
    "freedom; n frames"
)


def online_findings(walk: OnlineRun, sweep: TargetSweep) -> Findings:
    """Return how steady the controller keeps contrast loss on a walk, and brightness over the target.

    Parameters
    ----------
    walk : OnlineRun
        The walk through the house.
    sweep : TargetSweep
        A sequence with several targets; the basement in the paper.
    """
    spread = spread_ratio(walk.track.contrast_loss, walk.constant_loss, walk.track.durations)
    drawings = (
        Drawing(
            "online_walk",
            png_bytes(walk_figure(walk, spread)),
            "Contrast loss over time under the online controller and under constant dimming of the same mean "
            "brightness, and the brightness factors of both.",
            walk_points(walk, spread),
        ),
        Drawing(
            "online_target",
            png_bytes(sweep_figure(sweep.name, sweep.points, walk.settings.lowest_factor, sweep.n_frames)),
            "Mean brightness factor, and mean contrast loss reached, over the target of the online "
            "controller.",
            sweep_points(sweep),
        ),
    )
    statistics = (*walk_rows(walk, spread), *sweep_rows(sweep))
    return Findings(
        "online",
        _lead(walk, spread),
        statistics,
        drawings,
        (_section(walk, spread, drawings),),
        (f"{walk.name}: {spread.flag}",) if spread.flag else (),
    )


def _lead(walk: OnlineRun, spread: SpreadRatio) -> str:
    """Return what came out."""
    (lead,) = prose(
        "reproduction/online_lead",
        seconds=walk.track.durations.sum(),
        spread=spread,
        printed_ratio=published("online.sd_ours").number / published("online.sd_baseline").number,
    )
    return lead


def _section(walk: OnlineRun, spread: SpreadRatio, drawings: tuple[Drawing, Drawing]) -> Section:
    """Return the section of the report."""
    table = Table(
        f"SD over time of contrast loss, {len(walk.times)} frames, target {short(walk.settings.target_loss)}",
        ("dimming", "SD [1]", "published [1]"),
        (
            ("online controller", spread.sd, published("online.sd_ours").text),
            ("constant dimming", spread.sd_constant, published("online.sd_baseline").text),
        ),
    )
    return section(
        "reproduction/online",
        (table,),
        [drawing.picture for drawing in drawings],
        constant_factor=walk.constant_factor,
        held=float(walk.track.time_share @ walk.track.limited),
        flag=spread.flag,
    )


def walk_rows(walk: OnlineRun, spread: SpreadRatio) -> list[Statistic]:
    """Return the statistics of the walk, and the published ones."""
    track, share, n = walk.track, walk.track.time_share, len(walk.times)
    means = [float(share @ loss) for loss in (track.contrast_loss, walk.constant_loss)]
    numbers = (
        ("SD over time of contrast loss, online controller", spread.sd, "1"),
        ("SD over time of contrast loss, constant dimming", spread.sd_constant, "1"),
        ("mean contrast loss, online controller", means[0], "1"),
        ("mean contrast loss, constant dimming", means[1], "1"),
        ("target contrast loss", walk.settings.target_loss, "1"),
        ("mean brightness factor of both", walk.constant_factor, "1"),
        ("share of the time held back by the rate limit or a bound", float(share @ track.limited), "1"),
        ("largest ratio of a rate to its limit", largest_rate_ratio(track.rate, track.rate_limit), "1"),
        ("time in which the content's loss is correlated, constant dimming", spread.correlation_time, "s"),
    )
    return [
        *(
            Statistic("steadiness", walk.name, what, value, unit, Origin.COMPUTED, n=n, method=_gains(walk))
            for what, value, unit in numbers
        ),
        Statistic(
            "steadiness", walk.name, RATIO, spread.ratio, "1", Origin.COMPUTED, ci_low=spread.ci_low,
            ci_high=spread.ci_high, interval=None if spread.ci_low is None else 0.95, n=n, method=INTERVAL,
            flag=spread.flag,
        ),
        *_published_rows(walk.name),
    ]  # fmt: skip


def _gains(walk: OnlineRun) -> str:
    """Return what the controller was set to, in words."""
    settings = walk.settings
    rate = "the video's frames" if settings.gain_rate is None else f"frames of 1/{settings.gain_rate:g} s"
    gains = f"{settings.proportional:g}, {settings.integral:g}, {settings.derivative:g}"
    return f"gains {gains} for {rate}; n frames"


def _published_rows(name: str) -> list[Statistic]:
    """Return the paper's two standard deviations, and their ratio."""
    ours, theirs = published("online.sd_ours"), published("online.sd_baseline")
    rows = [
        Statistic("steadiness", name, f"SD over time of contrast loss, {what}", printed.number, "1",
                  Origin.PUBLISHED, method=printed.place)
        for what, printed in (("online controller", ours), ("constant dimming", theirs))
    ]  # fmt: skip
    ratio = Statistic(
        "steadiness", name, RATIO, ours.number / theirs.number, "1", Origin.PUBLISHED,
        method=f"{ours.text} / {theirs.text}", flag="from rounded numbers; no interval is printed",
    )  # fmt: skip
    return [*rows, ratio]


def sweep_rows(sweep: TargetSweep) -> list[Statistic]:
    """Return the statistics of the sweep."""
    return [
        Statistic("target", sweep.name, f"{what} at a target loss of {point.target_loss:g}", value, "1",
                  Origin.COMPUTED, n=sweep.n_frames, method="mean over time; n frames")
        for point in sweep.points
        for what, value in (
            ("mean brightness factor", point.mean_factor), ("mean contrast loss", point.mean_loss)
        )
    ]  # fmt: skip


def walk_points(walk: OnlineRun, spread: SpreadRatio) -> tuple[PlottedPoint, ...]:
    """Return what is drawn of the walk: lines over time, and means with their standard deviations."""
    n, track = len(walk.times), walk.track
    constant = np.full(n, walk.constant_factor)
    lines = (
        ("contrast loss", "online controller", track.contrast_loss),
        ("contrast loss", "constant dimming", walk.constant_loss),
        ("contrast loss", "target", np.full(n, walk.settings.target_loss)),
        ("brightness factor", "online controller", track.factors),
        ("brightness factor", "constant dimming", constant),
    )
    points = [
        PlottedPoint(panel, series, "", float(x), float(y), "time", "s", panel, "1", Origin.COMPUTED, n=n)
        for panel, series, values in lines
        for x, y in zip(walk.times, values, strict=True)
    ]
    bars = (
        ("online controller", track.contrast_loss, spread.sd),
        ("constant dimming", walk.constant_loss, spread.sd_constant),
    )
    for series, loss, sd in bars:
        mean = float(track.time_share @ loss)
        points.append(
            PlottedPoint("mean and SD over time", series, series, None, mean, "", "", "contrast loss", "1",
                         Origin.COMPUTED, low=mean - sd, high=mean + sd, n=n)
        )  # fmt: skip
    return tuple(points)


def sweep_points(sweep: TargetSweep) -> tuple[PlottedPoint, ...]:
    """Return what is drawn of the sweep."""
    return tuple(
        PlottedPoint(panel, "online controller", "", point.target_loss, value, "target contrast loss", "1",
                     panel, "1", Origin.COMPUTED, n=sweep.n_frames)
        for point in sweep.points
        for panel, value in (
            ("mean brightness factor", point.mean_factor), ("mean contrast loss reached", point.mean_loss)
        )
    )  # fmt: skip


def walk_figure(run: OnlineRun, spread: SpreadRatio) -> Figure:
    """Draw contrast loss and brightness over time, under the controller and under constant dimming.

    Beside the losses stand their means and standard deviations over time.
    """
    em = PAGE.em
    with look(PAGE):
        left, width = 5.2 * em, PAGE.width - 18.5 * em
        lines, above = heading_lines(*_walk_heading(run), PAGE.width - left - em, em)
        top = above + 1.2 * em
        heights = (17 * em, 11 * em)
        figure = new_figure(PAGE, top + sum(heights) + 6.2 * em)
        lines_at(figure, left, lines)
        loss = axes_at(figure, left, top, width, heights[0])
        factor = axes_at(figure, left, top + heights[0] + 1.6 * em, width, heights[1])
        _draw_losses(loss, run)
        _draw_factors(factor, run)
        edge = float(run.times[-1] + run.track.durations[-1])
        for axes in (loss, factor):
            axes.set_xlim(0, edge)
            axes.xaxis.set_major_locator(MultipleLocator(_tick(edge)))
            axes.xaxis.set_major_formatter(FuncFormatter(_clock))
        loss.tick_params(labelbottom=False)
        factor.set_xlabel("time [min:s]")
        _draw_spreads(axes_at(figure, left + width + 0.8 * em, top, 12 * em, heights[0]), loss, run, spread)
    return figure


def _walk_heading(run: OnlineRun) -> tuple[str, str]:
    """Return title and subtitle."""
    seconds = float(run.track.durations.sum())
    return (
        f"Contrast loss on a walk through the {run.name.replace('_', ' ')}",
        f"{len(run.times)} frames, {seconds:.0f} s · brightness controlled online and constant, "
        f"both {run.constant_factor:.2f} on average · target {short(run.settings.target_loss)}",
    )


def _draw_losses(axes: Axes, run: OnlineRun) -> None:
    """Draw both losses and the target."""
    axes.axhline(run.settings.target_loss, color=INK, linestyle=(0, (1, 2)), linewidth=1.0)
    axes.plot(run.times, run.constant_loss, color=BASELINE, linewidth=1.2)
    axes.plot(run.times, run.track.contrast_loss, color=OURS, linewidth=1.5)
    axes.set_ylim(0, 1.06 * float(max(run.constant_loss.max(), run.track.contrast_loss.max(), 1e-6)))
    axes.set_ylabel("contrast loss [1]")


def _draw_factors(axes: Axes, run: OnlineRun) -> None:
    """Draw the controller's factors, and the constant one."""
    axes.axhline(run.constant_factor, color=BASELINE, linewidth=1.2)
    axes.plot(run.times, run.track.factors, color=OURS, linewidth=1.5)
    axes.set_ylim(0, 1)
    axes.set_ylabel("brightness factor [1]")


def _draw_spreads(axes: Axes, beside: Axes, run: OnlineRun, spread: SpreadRatio) -> None:
    """Draw mean and standard deviation of both losses, at the height that they have in the panel beside."""
    axes.set(ylim=beside.get_ylim(), xlim=(0, 2))
    axes.axis("off")
    share = run.track.time_share
    rows = (
        ("constant dimming", run.constant_loss, spread.sd_constant, BASELINE),
        ("online controller", run.track.contrast_loss, spread.sd, OURS),
    )
    for place, (name, loss, sd, colour) in enumerate(rows):
        mean = float(share @ loss)
        axes.errorbar(
            0.10 + 0.16 * place, mean, yerr=sd, color=colour, fmt="o", ms=0.5 * text_size(),
            capsize=0.25 * text_size(),
        )  # fmt: skip
        axes.text(
            0.22, 0.97 - 0.17 * place, f"{name}\nSD {short(sd)}", color=colour, va="top",
            transform=axes.transAxes, linespacing=1.35,
        )  # fmt: skip
    words = ["no ratio"] if spread.ratio is None else [f"ratio {spread.ratio:.2f}"]
    if spread.ci_low is not None and spread.ci_high is not None:
        words.append(f"95 %: {spread.ci_low:.2f} to {spread.ci_high:.2f}")
    axes.text(
        0.22, 0.60, "\n".join([*words, "", "bars: mean ± SD", "over time", "dotted: target"]), color=MUTED,
        va="top", transform=axes.transAxes, fontsize=0.92 * text_size(), linespacing=1.35,
    )  # fmt: skip


def _tick(seconds: float) -> float:
    """Return a round distance between ticks [s]."""
    for step in (1.0, 2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0):
        if seconds <= 8 * step:
            return step
    return 600.0


def _clock(seconds: float, _: object) -> str:
    """Return a time as minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def sweep_figure(name: str, sweep: Sequence[SweepPoint], lowest: float, n_frames: int) -> Figure:
    """Draw the mean brightness that the controller needs, and the loss that it reaches, over the target."""
    em = PAGE.em
    with look(PAGE):
        left, gap = 5.2 * em, 6.5 * em
        width = (PAGE.width - left - gap - 1.5 * em) / 2
        title = f"What tolerating a loss of contrast saves: {name.replace('_', ' ')}"
        about = f"{n_frames} frames of a rendered scene · online controller, each point a run of its own"
        lines, above = heading_lines(title, about, PAGE.width - left - em, em)
        top, height = above + 1.2 * em, 16 * em
        figure = new_figure(PAGE, top + height + 4.4 * em)
        lines_at(figure, left, lines)
        targets = np.array([point.target_loss for point in sweep])
        panels = [axes_at(figure, left + k * (width + gap), top, width, height) for k in range(2)]
        panels[0].axhline(lowest, color=MUTED, linestyle=(0, (1, 2)), linewidth=1.0)
        panels[0].text(
            targets.max(), lowest - 0.02, "lowest factor allowed", color=MUTED, va="top", ha="right"
        )
        panels[0].plot(targets, [point.mean_factor for point in sweep], "o-", color=OURS, clip_on=False)
        panels[0].set(ylim=(0, 1), ylabel="mean brightness factor [1]")
        top_loss = 1.08 * max(float(targets.max()), *(point.mean_loss for point in sweep), 1e-6)
        panels[1].plot([0, top_loss], [0, top_loss], color=FAINT)
        panels[1].text(0.93 * top_loss, 0.95 * top_loss, "as asked", color=MUTED, ha="right", va="bottom")
        panels[1].plot(targets, [point.mean_loss for point in sweep], "o-", color=OURS)
        panels[1].set(ylim=(0, top_loss), ylabel="mean contrast loss reached [1]")
        for axes in panels:
            axes.set(xlim=(0, top_loss), xlabel="target contrast loss [1]")
            axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        panels[1].yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    return figure
