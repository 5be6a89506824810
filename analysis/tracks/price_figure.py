"""The price of invisibility: what a video's track gains where its limit is noticed more or less often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evenlight.analysis import figure_style as style
from evenlight.analysis.results import Drawing
from evenlight.analysis.rows import Plot
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_figure import clipped
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.detectability import share_noticed
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.optimizer.calm import calmed
from evenlight.method.optimizer.evaluate import watched_track
from evenlight.method.optimizer.optimize import joined_curves, joints, optimize, pose
from evenlight.method.optimizer.splitting import SplittingSolver

SHARES = (0.1, 0.25, 0.5, 0.75, 0.9)  # of detections at the limit
ABOUT = (
    "Gain: how much less uneven frames lose contrast than with constant dimming. Below: the "
    "share of periods, as long as the calibration's ramps, in which a viewer of a plain screen sees a change."
)


def about(summary: OptimizationSummary) -> str:
    """Return what the figure shows, and what of people is assumed for it."""
    assumed = summary.watched.assumed if summary.watched else ""
    return f"{ABOUT} Assumed: {assumed}." if assumed else ABOUT


@one_blas_thread
def price_figure(job: OptimizationJob, clips: Sequence[LossCurves], summary: OptimizationSummary) -> Drawing:
    """Draw gain and periods noticed over the share of detections at the limit, from known loss curves.

    Each track takes one search of the solver, not all that a short video is worth: gains are those of tracks
    made for these shares to 0.12 points of a percent (docs/decisions/rate-constraint.md).
    """
    whole, solver = joined_curves(clips) if len(clips) > 1 else clips[0], SplittingSolver(searches=1)
    done, found = summary.minimized, []
    for share in SHARES:
        request = replace(job.request, noticed=share)
        problem = pose(whole, request, joints(clips))
        factors = calmed(problem, optimize(problem, solver).factors, job.calm)
        ours, constant = (problem.value(loss_at(whole, b)) for b in (factors, problem.baseline()))
        found.append((share, ours, constant, watched_track(problem, request, factors)))
    own = job.request.noticed or float(share_noticed(1.0, job.request.rate_limit))
    ends = (done.value, done.baseline) if done else (summary.objective, summary.objective_baseline)
    found.append((own, *ends, summary.watched))
    gains = [(share, 1 - ours / constant if constant > 0 else 0.0) for share, ours, constant, _ in found]
    with style.look():
        title = f"The price of invisibility: {clipped(summary.video, 40)}"
        rows = [["gain"], ["periods"]]
        figure, panels = style.panels(title, about(summary), rows, [15.0, 12.0], sharex=True)
        plots = {
            name: Plot(axes, name, Origin.COMPUTED, ("noticed at the limit", "%", y, "%"))
            for (name, axes), y in zip(panels.items(), ("gain", "periods noticed"), strict=True)
        }
        _draw(plots["gain"], "gain", style.OURS, gains)
        seen = [(share, watched) for share, *_, watched in found if watched]
        _draw(plots["periods"], "by the median person", style.OURS, [(x, y.noticed) for x, y in seen])
        few = [(x, y.noticed_sensitive) for x, y in seen]
        _draw(plots["periods"], "by a sensitive one (95th percentile)", style.LIMIT, few)
        panels["gain"].axhline(0.0, color=style.FAINT, zorder=0)
        panels["gain"].set(ylabel="gain [%]", xlim=(0, 100))
        panels["periods"].set(ylabel="periods noticed [%]", ylim=(0, 100))
        panels["periods"].set_xlabel("changes at the rate limit that the median person notices [%]")
        for axes in panels.values():
            axes.axvline(100 * own, color=style.MUTED, linestyle="--", zorder=0, label="this track")
            style.legend_above(axes)
    points = (point for plot in plots.values() for point in plot.points)
    return Drawing("price", figure, about(summary), tuple(points))


def _draw(plot: Plot, name: str, colour: str, places: Sequence[tuple[float, float]]) -> None:
    """Draw a line through shares, and its last place, which is this track's, as a diamond."""
    x, y = (100 * np.array(places)).T.tolist()
    plot.line(name, x[:-1], y[:-1], color=colour, marker="o", label=name, clip_on=False)
    plot.line(f"{name}, this track", x[-1:], y[-1:], color=colour, marker="D")
