"""The rows of the online controller's results, and the numbers that are drawn in its figures."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.published import published
from evenlight.analysis.reproduction.online_run import OnlineRun, TargetSweep
from evenlight.analysis.reproduction.online_spread import SpreadRatio
from evenlight.data_schema.statistic import Origin, PlottedPoint, Statistic
from evenlight.method.modulation import largest_rate_ratio

RATIO = "SD of the controller / SD of constant dimming"
INTERVAL = (
    "delta method on the logarithm, long-run variance from the four slowest cosines, t of 4 degrees of "
    "freedom; n frames"
)


def walk_rows(walk: OnlineRun, spread: SpreadRatio, origin: Origin) -> list[Statistic]:
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
            Statistic("steadiness", walk.name, what, value, unit, origin, n=n, method=_gains(walk))
            for what, value, unit in numbers
        ),
        Statistic(
            "steadiness", walk.name, RATIO, spread.ratio, "1", origin, ci_low=spread.ci_low,
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


def sweep_rows(sweep: TargetSweep, origin: Origin) -> list[Statistic]:
    """Return the statistics of the sweep."""
    return [
        Statistic("target", sweep.name, f"{what} at a target loss of {point.target_loss:g}", value, "1",
                  origin, n=sweep.n_frames, method="mean over time; n frames")
        for point in sweep.points
        for what, value in (
            ("mean brightness factor", point.mean_factor), ("mean contrast loss", point.mean_loss)
        )
    ]  # fmt: skip


def walk_points(walk: OnlineRun, spread: SpreadRatio, origin: Origin) -> tuple[PlottedPoint, ...]:
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
        PlottedPoint(panel, series, "", float(x), float(y), "time", "s", panel, "1", origin, n=n)
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
                         origin, low=mean - sd, high=mean + sd, n=n)
        )  # fmt: skip
    return tuple(points)


def sweep_points(sweep: TargetSweep, origin: Origin) -> tuple[PlottedPoint, ...]:
    """Return what is drawn of the sweep."""
    return tuple(
        PlottedPoint(panel, "online controller", "", point.target_loss, value, "target contrast loss", "1",
                     panel, "1", origin, n=sweep.n_frames)
        for point in sweep.points
        for panel, value in (
            ("mean brightness factor", point.mean_factor), ("mean contrast loss reached", point.mean_loss)
        )
    )  # fmt: skip
