"""Planning a calibration: trials, minutes and participants for a wanted precision of ΔL(L), by simulation.

A pool of simulated participants goes through each design once. Experiments of fewer trials are its
beginnings, experiments of N participants are draws of N from it, with replacement; each is analysed as real
data would be. The band is what an experimenter would report; the error, against the known truth, is what
they would be wrong by.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from evenlight.analysis.calibration.rate_limit.rate_limit_curve import PAPER_DEGREE, RateLimitOptions
from evenlight.analysis.plans.ramp_plan_pool import (
    DrawSettings,
    PoolMember,
    SimulateRamps,
    draw_experiments,
    participant_sd,
    participants_needed,
    pool_of,
    require_plannable,
    resampling_spread,
    true_levels,
    whole_pool_error,
    work_of,
)
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS, RampPlanRow
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign
from evenlight.method.one_blas_thread import one_blas_thread

PLANNED_MODEL = (
    "planned with a limit fitted to each participant's thresholds, which is faster than the joint model of "
    "`evenlight fit`"
)
NOT_COMPARABLE = (
    "yes/no and two intervals measure different thresholds: the first moves with the readiness to say yes, "
    "so that fewer hours do not make it the better task"
)
INTERVAL = 1.96  # standard deviations: 95 %
PAPER_SHAPE = RateLimitOptions(RateLimitForm.LN_RATE, PAPER_DEGREE)
RECOMMENDED = "recommended"  # the design that the guides run
ASSURED = 0.8  # share of experiments whose band is to be narrow enough, for the second figure
EFFORTS = {"quick": (12, 12), "default": (24, 20), "thorough": (80, 40)}  # simulated people; experiments


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """What is to be planned.

    Attributes
    ----------
    designs, display : dict of str to RampDesign, Display
        The designs that are compared, by name, and what the ramps are shown on.
    precision : float
        Half-width of the 95 % pointwise band of ΔL(L) that is wanted, as a share: 0.1 is a factor of 1.1
        either way.
    participants, trials : tuple of int
        How many participants, and ramps per level, are tried out.
    pool, draws, seed : int
        Simulated participants per design, experiments drawn from them, and the seed of all random numbers.
    options : RateLimitOptions
        How the rate limit is fitted: from individual thresholds, by the paper's shape unless they say so.
    """

    designs: dict[str, RampDesign]
    display: Display
    precision: float = 0.1
    participants: tuple[int, ...] = (5, 10, 20, 40)
    trials: tuple[int, ...] = (20, 30, 40, 60, 100)
    pool: int = EFFORTS["default"][0]
    draws: int = EFFORTS["default"][1]
    seed: int = 1
    options: RateLimitOptions = PAPER_SHAPE

    def __post_init__(self) -> None:
        if not 0 < self.precision <= 2:
            raise InputError(f"precision must lie above 0 and not above 2, got {self.precision:g}")
        for name, numbers, low, high in (
            ("participants", self.participants, 2, MOST_PARTICIPANTS),
            ("trials", self.trials, 4, 2000),
        ):
            if not numbers or not all(low <= number <= high for number in numbers):
                got = ",".join(map(str, numbers)) or "none"
                raise InputError(f"{name} must be numbers from {low} to {high}, got {got}")
        require_seed(self.seed)

    @property
    def effort(self) -> str:
        """Which of `EFFORTS` pool and draws are; "other" if none."""
        return {size: name for name, size in EFFORTS.items()}.get((self.pool, self.draws), "other")


@dataclass(frozen=True, slots=True)
class RampPlan:
    """A plan: a row for each design, number of trials and number of participants."""

    request: PlanRequest
    rows: tuple[RampPlanRow, ...]

    @property
    def best(self) -> dict[Procedure, RampPlanRow | None]:
        """Of each task the row that meets the precision with the fewest hours of all; None if none does.

        The tasks' thresholds are different quantities, so that their hours are not set off.
        """
        tasks = [task for task in Procedure if any(row.procedure == task.value for row in self.rows)]
        good = {task: [r for r in self.rows if r.meets and r.procedure == task.value] for task in tasks}
        return {
            task: min(rows, key=lambda row: (row.total_hours, row.half_width)) if rows else None
            for task, rows in good.items()
        }


@dataclass(frozen=True, slots=True)
class _Sessions:
    """A design whose sessions are so long, and who went through it."""

    request: PlanRequest
    name: str
    trials: int
    pool: list[PoolMember]


def plan_ramps(
    request: PlanRequest,
    simulate: SimulateRamps,
    mapped: Callable[..., Iterable[Any]] = map,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> RampPlan:
    """Return what the designs give, by simulation.

    Parameters
    ----------
    request, simulate : PlanRequest, function
        What is to be planned, and who answers the ramps.
    mapped : function, optional
        `map`, or one that shares the work among processes and keeps its order.
    report : function, optional
        Called with the parts of the work done and their total.

    Raises
    ------
    InputError
        If a design has too few levels for the rate limit, or cannot be planned for.
    """
    for design in request.designs.values():
        require_plannable(design, request.options)
    works = [
        work_of(design, request.display, request.trials, request.pool, request.seed)
        for design in request.designs.values()
    ]
    each, total = len(works[0]), len(works) * (len(works[0]) + len(request.trials))
    members: list[PoolMember] = []
    pools: list[list[PoolMember]] = []
    parts = mapped(partial(pool_of, simulate=simulate), itertools.chain(*works))
    for done, part in enumerate(parts, start=1):
        members += part
        if done % each == 0:
            pools.append(members)
            members = []
        report(done, total)
    sessions = [
        _Sessions(request, name, trials, pool)
        for name, pool in zip(request.designs, pools, strict=True)
        for trials in sorted(request.trials)
    ]
    rows: list[RampPlanRow] = []
    for done, own in enumerate(mapped(_rows, sessions), start=len(works) * each + 1):
        rows += own
        report(done, total)
    return RampPlan(request, tuple(rows))


@one_blas_thread
def _rows(sessions: _Sessions) -> list[RampPlanRow]:
    """Return a row for each number of participants."""
    request, trials, pool = sessions.request, sessions.trials, sessions.pool
    design = request.designs[sessions.name]
    drawing = DrawSettings(request.display, request.options, request.draws, (request.seed,))
    thresholds = [member.thresholds[trials] for member in pool]
    truth = true_levels([member.truth for member in pool])
    whole = whole_pool_error(drawing, thresholds, truth)
    found = {n: draw_experiments(drawing, thresholds, truth, n) for n in sorted(request.participants)}
    deviations = {n: drawn.errors - whole + whole.mean() for n, drawn in found.items()}
    spread = float(np.sqrt(np.mean([drawn.standard_error**2 for drawn in found.values()])))
    covered = [np.abs(deviations[n]) <= drawn.half_widths for n, drawn in found.items()]
    minutes = float(np.mean([member.minutes[trials] for member in pool]))
    resampled = found.get(len(pool)) or draw_experiments(drawing, thresholds, truth, len(pool))
    pool_error = resampling_spread(resampled)
    factor = float(np.exp(INTERVAL * pool_error))
    low, needed, high = (
        participants_needed(spread * by, request.precision) for by in (1 / factor, 1.0, factor)
    )
    spread_of_people = participant_sd([member.truth for member in pool])
    single = np.log([t.threshold / m.truth[t.luminance] for m in pool for t in m.thresholds[trials]])
    return [
        RampPlanRow(
            design=sessions.name,
            procedure=design.procedure.value,
            placement=design.placement.value,
            levels=len(pool[0].truth),
            trials_per_level=trials,
            participants=n,
            minutes=minutes,
            total_hours=n * minutes / 60,
            participant_sd_ln=spread_of_people,
            threshold_error_ln=float(np.sqrt(np.mean(single**2))),
            half_width=_share(np.mean(drawn.half_widths)),
            half_width_assured=_share(np.quantile(drawn.half_widths.mean(axis=1), ASSURED)),
            half_width_mc_error=math.hypot(
                pool_error, float(np.std(np.log(drawn.standard_errors), ddof=1)) / math.sqrt(request.draws)
            ),
            error=_share(np.sqrt(np.mean(deviations[n] ** 2))),
            bias=_share(whole.mean()),
            coverage=float(np.mean(covered)),
            meets=_share(np.mean(drawn.half_widths)) <= request.precision,
            participants_needed=needed,
            participants_needed_low=low,
            participants_needed_high=high,
            hours_needed=needed and needed * minutes / 60,
        )
        for n, drawn in found.items()
    ]


def _share(log_ratio: float | np.floating[Any]) -> float:
    """Return a difference of logarithms as a share."""
    return float(np.expm1(log_ratio))


def in_words(plan: RampPlan) -> tuple[str, ...]:
    """Return what the plan comes to, the answer first, a sentence for each task, and one if there are two."""
    found = tuple(_best_in_words(plan, procedure) for procedure in plan.best)
    return (*_recommended_in_words(plan), *found, *((NOT_COMPARABLE,) if len(found) > 1 else ()))


def _recommended_in_words(plan: RampPlan) -> Iterator[str]:
    """Yield how many participants the recommended design takes as it is run, if it was tried so."""
    design = plan.request.designs.get(RECOMMENDED)
    trials = None if design is None else design.trials_per_level
    for row in plan.rows:
        if (row.design, row.trials_per_level) == (RECOMMENDED, trials):
            yield (
                f"recommended: {row.participants_needed_in_words} participants for ΔL(L) to "
                f"{100 * plan.request.precision:g} %, each with `evenlight run ramp --design {RECOMMENDED}` "
                f"({row.trials_per_level} trials per level, {row.minutes:.0f} min)"
            )
            return


def chance_in_words(plan: RampPlan) -> str:
    """Return how far chance in the simulation moves the figures of a plan."""
    request = plan.request
    error = max(row.half_width_mc_error for row in plan.rows)
    return (
        f"Monte Carlo error (one SD), with {request.pool} simulated participants and {request.draws} "
        f"experiments per size: bands up to {error:.0%} of themselves, people needed up to {2 * error:.0%}"
    )


def _best_in_words(plan: RampPlan, procedure: Procedure) -> str:
    """Return what takes the fewest hours, for one task."""
    best, wanted = plan.best[procedure], 100 * plan.request.precision
    if best is not None:
        return (
            f"{best.participants} participants x {best.trials_per_level} trials per level ({best.design}: "
            f"{best.procedure}, {best.placement}; {best.levels} levels, {best.minutes:.0f} min each) give "
            f"ΔL(L) to {100 * best.half_width:.0f} %; {wanted:g} % takes {best.participants_needed_in_words} "
            f"participants"
        )
    own = [row for row in plan.rows if row.procedure == procedure.value]
    able = [row for row in own if row.hours_needed is not None]
    if not able:
        return f"{procedure.value}: nothing tried comes near {wanted:g} %"
    row = min(able, key=lambda row: row.hours_needed or 0.0)
    return (
        f"{procedure.value}: no number tried gives ΔL(L) to {wanted:g} %; "
        f"{row.participants_needed_in_words} "
        f"participants x {row.trials_per_level} trials per level would ({row.design}, {row.minutes:.0f} min "
        "each)"
    )
