"""The online controller (Section 6): how steady it keeps contrast loss, and what a tolerated loss saves."""

from __future__ import annotations

from evenlight.analysis.figure_style import png_bytes, short
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.published import published
from evenlight.analysis.report import Section, Table
from evenlight.analysis.reproduction.online_figure import sweep_figure, walk_figure
from evenlight.analysis.reproduction.online_rows import sweep_points, sweep_rows, walk_points, walk_rows
from evenlight.analysis.reproduction.online_run import OnlineRun, TargetSweep
from evenlight.analysis.reproduction.online_spread import SpreadRatio, spread_ratio
from evenlight.data_schema.statistic import Origin


def online_findings(walk: OnlineRun, sweep: TargetSweep, origin: Origin = Origin.COMPUTED) -> Findings:
    """Return how steady the controller keeps contrast loss on a walk, and brightness over the target.

    Parameters
    ----------
    walk : OnlineRun
        The walk through the house.
    sweep : TargetSweep
        A sequence with several targets; the basement in the paper.
    origin : Origin
        Where the loss curves come from.
    """
    spread = spread_ratio(walk.track.contrast_loss, walk.constant_loss, walk.track.durations)
    drawings = (
        Drawing(
            "online_walk",
            png_bytes(walk_figure(walk, spread)),
            "Contrast loss over time under the online controller and under constant dimming of the same mean "
            "brightness, and the brightness factors of both.",
            walk_points(walk, spread, origin),
        ),
        Drawing(
            "online_target",
            png_bytes(sweep_figure(sweep.name, sweep.points, walk.settings.lowest_factor, sweep.n_frames)),
            "Mean brightness factor, and mean contrast loss reached, over the target of the online "
            "controller.",
            sweep_points(sweep, origin),
        ),
    )
    statistics = (*walk_rows(walk, spread, origin), *sweep_rows(sweep, origin))
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
    begin = f"On a walk of {walk.track.durations.sum():.0f} s the online controller"
    if spread.ratio is None:
        return f"{begin} has nothing to steady: {spread.flag}."
    interval = ""
    if spread.ci_low is not None and spread.ci_high is not None:
        interval = f" (95 % interval {spread.ci_low:.2f} to {spread.ci_high:.2f})"
    printed = published("online.sd_ours").number / published("online.sd_baseline").number
    one = "" if interval else " One such walk does not say what the next would give."
    return (
        f"{begin} has {spread.ratio:.2f} times{interval} the standard deviation of contrast loss that "
        "constant dimming of the same mean brightness has; the paper's two numbers have a ratio of "
        f"{printed:.2f}.{one}"
    )


def _section(walk: OnlineRun, spread: SpreadRatio, drawings: tuple[Drawing, Drawing]) -> Section:
    """Return the section of the report."""
    ours, theirs = published("online.sd_ours").text, published("online.sd_baseline").text
    rows = (
        ("online controller", spread.sd, ours),
        ("constant dimming", spread.sd_constant, theirs),
    )
    held = float(walk.track.time_share @ walk.track.limited)
    return Section(
        "Online controller",
        (
            "A controller that does not know the frames to come holds contrast loss near a target, within "
            "the rate limit. Beside it stands constant dimming by its own mean factor, "
            f"{walk.constant_factor:.2f}: the same mean brightness, and with a power that is linear in "
            "brightness the same energy. Standard deviations are taken over time.",
            "The losses of this model are smaller than the paper's, whose target is not printed, so that "
            "the ratio is what compares. Neighbouring frames are all but alike: the interval takes the "
            "walk for the few independent stretches that it is, and speaks of other walks as long through "
            f"content of this kind. The rate limit or a bound held the controller back in {100 * held:.0f} "
            "% of the time.",
        ),
        (
            Table(
                f"SD over time of contrast loss, {len(walk.times)} frames, target "
                f"{short(walk.settings.target_loss)}",
                ("dimming", "SD [1]", "published [1]"),
                rows,
            ),
        ),
        tuple(drawing.picture for drawing in drawings),
        (f"{spread.flag[0].upper()}{spread.flag[1:]}.",) if spread.flag else (),
    )
