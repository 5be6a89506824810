"""What an observer gains and loses by what is shown between two intervals: d' of each gap, by simulation.

The observer has two detectors, whose evidence is independent.

- The change within an interval: ln(L) at its end against its beginning, with a late noise such that a
  change of 7 % has d' = 0.954 (75 % of two intervals) where nothing precedes it. Adaptation follows the
  luminance with a time constant of 5 s, and what steps in the gaps leave in it drifts away during the
  interval: a change that is none. A transient also raises the late noise, by 1 + 10 |step| exp(-t / 0.3 s)
  at the ramp's beginning. What the ramp itself leaves in the adaptation is not in the model.
- The step at the end of an interval: the ratio of the luminances after and before it, with a noise of 2 % and
  of 10 % of the step.

The figures are assumptions; docs/decisions/yes-no-task.md has the table that follows from them, and
`python benchmarks/studies/interval_gaps.py` prints it, with other assumptions too. d' is that of two
intervals, sqrt(2) z(correct).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from ramp_tasks import ramp_task
from scipy import signal, stats
from studies import Mapped, run_study

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import IntervalGap, Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.ramp.ramp_plan import RampCondition, RampLevel, planned_ramp
from evenlight.experiments.ramp.ramp_task import RampTask
from evenlight.experiments.sessions.task import TrialPlace

DISPLAY = Display("bench", 100.0, 0.1, 2.2, 60.0)
RIG = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0)
LEVEL, CHANGE = 50.0, 0.07
RATE = 20.0  # samples per second
THRESHOLD_D = 0.954
STEP_NOISE, STEP_SHARE = 0.02, 0.1
MASKING, MASKING_TIME = 10.0, 0.3
TRIALS = 20_000
Samples = NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """What is shown between the intervals."""

    name: str
    kind: IntervalGap | None = None  # as a session shows it; None for a return to the level's luminance


GAPS = (
    Gap("steps drawn at random", IntervalGap.RANDOM_STEPS),
    Gap("common grey, the level's luminance"),
    Gap("steady", IntervalGap.STEADY),
)


def main(mapped: Mapped = map) -> None:
    """Print the table, and how the first column depends on the time constant."""
    for adaptation in (5.0, 1.0, 20.0):
        print(f"adaptation within {adaptation:g} s")
        found = mapped(partial(sensitivities, trials=TRIALS, adaptation=adaptation), GAPS)
        for gap, (change, step) in zip(GAPS, found, strict=True):
            print(f"| {gap.name} | {change:.2f} | {step:.2f} | {np.hypot(change, step):.2f} |")


def sensitivities(gap: Gap, trials: int, adaptation: float = 5.0, seed: int = 1) -> tuple[float, float]:
    """Return d' of the change within intervals, and d' of the steps at their ends."""
    rng = np.random.default_rng(seed)
    sides = rng.permutation(1 + np.arange(trials) % 2)
    unchanged, luminances = (
        np.array([course(gap, int(side), k, change) for k, side in enumerate(sides)])
        for change in (0.0, CHANGE)
    )
    logarithms = np.log(unchanged / LEVEL)
    changes = change_evidence(sides, logarithms, response_to(logarithms, adaptation), rng)
    steps = step_evidence(luminances, rng)
    return d_prime(changes, sides), d_prime(steps, sides)


def d_prime(evidence: Samples, sides: NDArray[np.int64]) -> float:
    """Return d' of choosing the interval by the sign of its evidence, (n,): first above 0, or the reverse."""
    correct = float(np.mean(np.where(evidence >= 0, 1, 2) == sides))
    n = len(sides)
    share = np.clip(max(correct, 1 - correct), 0.5, 1 - 0.5 / n)
    return float(np.sqrt(2) * stats.norm.ppf(share))


def course(gap: Gap, side: int, index: int, change: float) -> Samples:
    """Return the luminance over a trial [cd/m^2] whose ramp makes some change, sampled at `RATE`."""
    task = TASKS[gap.kind or IntervalGap.RANDOM_STEPS]
    level = RampLevel("white", 0.5, LEVEL)
    condition = RampCondition("white", task.design.directions[0], 5.0)
    planned = planned_ramp(level, condition, change * LEVEL / 5.0, ramp_interval=side, block=1)
    intervals = task._intervals(planned, 0)
    if gap.kind is not None:
        gaps = task._gaps(planned, TrialPlace("01", "01", index, 1, True), intervals)
    else:
        gaps = [(LEVEL,)] * 3
    parts = [np.full(SAMPLES["pause"], LEVEL)]
    for number, interval in enumerate(intervals):
        parts.append(_gap(gaps[number]))
        ramp = np.linspace(interval.initial_luminance, interval.final_luminance, SAMPLES["ramp"])
        parts += [
            np.full(SAMPLES["hold"], interval.initial_luminance),
            ramp,
            np.full(SAMPLES["hold"], interval.final_luminance),
        ]
    parts.append(_gap(gaps[2]))
    return np.concatenate(parts)


def _gap(luminances: tuple[float, ...]) -> Samples:
    """Return the luminance in a gap."""
    return np.repeat(luminances, SAMPLES["gap"] // len(luminances))


def response_to(logarithms: Samples, adaptation: float) -> Samples:
    """Return ln(L) less what was adapted to with a time constant [s]."""
    step = 1 / (RATE * adaptation)
    return logarithms - signal.lfilter([step], [1, step - 1], logarithms, axis=1)


def change_evidence(
    sides: NDArray[np.int64], unchanged: Samples, response: Samples, rng: np.random.Generator
) -> Samples:
    """Return how much more the first interval seems to fall than the second, (n,): fall, drift and noise."""
    fall = -np.log(1 - CHANGE)
    seems, variance = np.where(sides == 1, fall, -fall), np.zeros(len(sides))
    for sign, begin in ((1, FIRST), (-1, SECOND)):
        end = begin + 2 * SAMPLES["hold"] + SAMPLES["ramp"] - 1
        seems = seems + sign * (response[:, begin] - response[:, end])
        before = np.abs(unchanged[:, begin] - unchanged[:, begin - 1])
        variance += (1 + MASKING * before * np.exp(-1.0 / MASKING_TIME)) ** 2 / 2
    late = fall / (THRESHOLD_D / np.sqrt(2))
    return seems + late * np.sqrt(variance) * rng.standard_normal(len(sides))


def step_evidence(luminances: Samples, rng: np.random.Generator) -> Samples:
    """Return how much higher the step up after the first interval is than after the second, (n,)."""
    seen = []
    for begin in (FIRST, SECOND):
        end = begin + 2 * SAMPLES["hold"] + SAMPLES["ramp"]
        step = np.log(luminances[:, end] / luminances[:, end - 1])
        noise = np.hypot(STEP_NOISE, STEP_SHARE * step)
        seen.append(step + noise * rng.standard_normal(len(step)))
    return seen[0] - seen[1]


SAMPLES = {"pause": 20, "hold": 20, "ramp": 100, "gap": 10}
FIRST = SAMPLES["pause"] + SAMPLES["gap"]
SECOND = FIRST + 2 * SAMPLES["hold"] + SAMPLES["ramp"] + SAMPLES["gap"]


def _task(kind: IntervalGap) -> RampTask:
    """Return a task whose intervals and gaps are those of a session."""
    design = RampDesign(
        procedure=Procedure.TWO_INTERVAL, screens=("white",), factors=(0.5,), interval_gap_kind=kind
    )
    return ramp_task(design, DISPLAY, RIG)


TASKS = {kind: _task(kind) for kind in IntervalGap}

if __name__ == "__main__":
    run_study(__file__)
