"""The online controller (Section 6): how steady it keeps contrast loss, and what a tolerated loss saves."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.figure_style import png_bytes, short
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.published import published
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.online_figure import sweep_figure, walk_figure
from evenlight.analysis.reproduction.online_run import OnlineRun, TargetSweep
from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.method.modulation import largest_rate_ratio

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
