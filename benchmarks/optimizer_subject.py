"""The optimizer measured: against other solvers, over the number of frames, and what its savings cost."""

from __future__ import annotations

from benchmarks.measured import Chart, RunSettings, SubjectResults
from benchmarks.optimizer_lengths import (
    AUTHORS_TASK,
    LENGTH_TASK,
    WARMED,
    growth_claim,
    length_claims,
    length_points,
    rendered_point,
    search_points,
    target_points,
)
from benchmarks.optimizer_peers import family_claims, peer_points
from benchmarks.optimizer_savings import EDITS, edit_points, savings_points
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from evenlight.method.optimizer.splitting import DENSE, SHORTEST


def measure(settings: RunSettings) -> SubjectResults:
    """Return time against error of the optimizer, its growth and its claims."""
    lengths, kept = length_points(settings)
    rendered, rendered_kept = rendered_point(settings)
    targets = target_points(lengths, rendered)
    savings = savings_points(settings)
    peers, edits, searches = peer_points(settings), edit_points(settings), search_points(settings)
    points = (*peers, *savings, *edits, *searches, *lengths, *targets)
    grown, exponent = growth_claim(lengths)
    claims = (*length_claims(targets, kept, rendered_kept), *family_claims(settings), exponent)
    tasks = [p.task for p in points if p.task.endswith("2 s apart")]
    compared = max(dict.fromkeys(tasks), key=lambda task: (tasks.count(task), tasks.index(task)))
    charts = (
        Chart("optimizer-peers", f"Solvers for {compared}", (compared,)),
        Chart("optimizer-savings", f"Savings on {savings[0].task}", (savings[0].task,)),
        Chart("optimizer-length", "Time over the number of made frames", (LENGTH_TASK,), over_size=True),
    )
    return SubjectResults(
        name="optimizer",
        title="Optimizer",
        lead=_lead(points, claims),
        points=points,
        charts=charts,
        claims=claims,
        growth=grown,
        notes=_notes(points),
    )


def _lead(points: tuple[BenchmarkPoint, ...], claims: tuple[BenchmarkClaim, ...]) -> str:
    """Return what came out."""
    ours = [p for p in points if p.task == AUTHORS_TASK and p.role is not Role.CITED]
    families = [c for c in claims if "family" in c.claim]
    worst = max(c.measured or 0.0 for c in families)
    exponent = next(c for c in claims if "exponent" in c.claim)
    all_met = all(c.met for c in families)
    met = "on no problem worse" if all_met else f"worse by up to {worst:.2g} of the baseline's"
    return (
        f"Optimizer: 3000 frames with their lower bound in {ours[0].time:.2g} s (made curves) and "
        f"{ours[1].time:.2g} s (rendered), growing as the number of "
        f"frames to the {exponent.measured:.3g}; against SLSQP's best of several starts {met}."
    )


def _notes(points: tuple[BenchmarkPoint, ...]) -> tuple[str, ...]:
    """Return what a reader should know."""
    warm = [p for p in points if p.task.endswith(tuple(EDITS.values())) and p.role is Role.VARIANT]
    saved = "; ".join(f"{p.task}: {p.ratio:.2g} of the time from constant dimming" for p in warm)
    return (
        "Frames of the comparison are made: scenes with cuts, drift, flicker, stairs; where a table is of "
        "rendered ones, it says so. Of all kinds: curves that are smooth, flicker, fall in steps, or rise "
        "and fall, loose and tight limits, budgets up to the ends; one in four each with frame weights, "
        "allowances, an OLED power budget. Every answer is checked for budget, rate limit and bounds.",
        f"Up to {DENSE} frames ours includes SLSQP, as the polish of its best answer and from a few starts "
        f"more; up to {SHORTEST} from many. Above {DENSE} it is the splitting and the grid of factors alone.",
        f"Times over the number of frames, with and without the bound, are parts of the same runs; above "
        f"{WARMED} frames no first run is left out. Memory is the largest of a process that reads the "
        "curves from a file, solves and certifies, beyond one that does nothing: the curves themselves and "
        "the compiled code are part of it, making the curves is not.",
        f"A start from the earlier track: {saved}.",
        "SLSQP is left out where it would take minutes.",
    )
