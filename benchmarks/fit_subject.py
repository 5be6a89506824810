"""How fast psychometric fits are, and how far their estimates lie from the posterior and from the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import numpy as np

from benchmarks.fit_peers import (
    most_likely_ln_threshold,
    psignifit_ln_threshold,
    regression_ln_threshold,
)
from benchmarks.measured import Approach, Chart, RunSettings, SubjectResults, claim, growth, point
from benchmarks.peak_memory import peak_memory
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from evenlight.analysis.calibration.psychometric.psychometric_fit import (
    COARSE_NODES,
    fit_psychometric,
    posterior_grid,
)
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts
from evenlight.data_schema.arrays import Array
from evenlight.method.psychometric import PsychometricFunction, yes_probability

RATES = np.geomspace(0.8, 12.0, 8)  # [cd/m^2/s] around a threshold of a bright screen
TRIALS, CATCH_TRIALS = 20, 20  # at each rate; without a ramp
REFERENCE_NODES = (108, 72, 30, 20)  # three times as dense as the default, and more
PEOPLE = 24  # simulated participants that each approach fits
TRUTH_PEOPLE = 400
YES_NO = "one participant at one level, yes/no: four parameters"
TWO_INTERVAL = "one participant at one level, two intervals: three parameters"
TO_TRUTH = "one participant at one level, yes/no: against the truth"
MANY_RATES = "one participant at one level, so many different rates"
TO_POSTERIOR = "largest distance of ln(threshold) from the mean of the fine-grid posterior"
RMS_TO_TRUTH = "RMS distance of ln(threshold) from the simulated participant's own"

Fit = Callable[[RampCounts], float]


def measure(settings: RunSettings) -> SubjectResults:
    """Return the speed and the errors of psychometric fits, of simulated participants."""
    rng = np.random.default_rng(settings.seed)
    n = 2 if settings.quick else PEOPLE
    settings.say("fits of four parameters")
    yes_no, claims = _yes_no(simulated(rng, n), settings)
    settings.say("fits of three parameters")
    two_interval = _two_interval(simulated(rng, n, guess_rate=0.5), settings)
    settings.say("fits against the truth")
    to_truth = _to_truth(rng, 20 if settings.quick else TRUTH_PEOPLE, settings)
    settings.say("fits of many rates")
    rows = _many_rates(rng, (8, 32) if settings.quick else (8, 32, 128, 512), settings)
    default = next(p for p in yes_no if p.role is Role.DEFAULT)
    memory = peak_memory("benchmarks.fit_subject:fit_once")
    yes_no = tuple(replace(p, peak_memory=memory) if p is default else p for p in yes_no)
    return SubjectResults(
        name="fit",
        title="The psychometric fit",
        lead=_lead(default, yes_no + two_interval),
        points=yes_no + two_interval + to_truth + rows,
        charts=(
            Chart("fit", f"Psychometric fit: {YES_NO}", (YES_NO,)),
            Chart("fit-two-interval", f"Psychometric fit: {TWO_INTERVAL}", (TWO_INTERVAL,)),
            Chart("fit-truth", "Psychometric fit: estimate against the truth", (TO_TRUTH,)),
        ),
        claims=claims,
        growth=(growth(rows),),
        notes=(
            f"All answers are of simulated participants: {TRIALS} at each of {len(RATES)} rates, "
            f"{CATCH_TRIALS} catch trials; the time is that of one fit.",
            "psignifit gets our priors, its own grid, and the task that both do alike (a fixed guess rate).",
        ),
        refused={} if _has_psignifit() else {"psignifit": "it is not installed (a package of the extra dev)"},
    )


def simulated(
    rng: np.random.Generator, n: int, guess_rate: float | None = None, rates: Array = RATES
) -> list[tuple[RampCounts, float]]:
    """Return the answers of simulated participants, and the ln(threshold) of each.

    Parameters
    ----------
    rng : np.random.Generator
        Draws thresholds, widths, lapses, guesses and answers.
    n : int
        How many.
    guess_rate : float, optional
        Where the task fixes it; otherwise each has their own, up to 15 %.
    rates : array, (m,)
        Rates tested [cd/m^2/s]; the trials are spread over them.
    """
    people = []
    per_rate = max(1, TRIALS * len(RATES) // len(rates))
    for _ in range(n):
        ln_threshold = float(rng.normal(math.log(3.0), 0.3))
        own_guess = float(rng.uniform(0.0, 0.15)) if guess_rate is None else guess_rate
        width, lapse = float(rng.lognormal(math.log(1.6), 0.3)), float(rng.uniform(0.0, 0.05))
        observer = PsychometricFunction(math.exp(ln_threshold), width, own_guess, lapse)
        trials = np.full(len(rates), per_rate)
        counts = RampCounts(
            rates=rates,
            n_yes=rng.binomial(trials, yes_probability(rates, observer)),
            n_trials=trials,
            catch_yes=int(rng.binomial(CATCH_TRIALS, own_guess)) if guess_rate is None else 0,
            catch_trials=CATCH_TRIALS if guess_rate is None else 0,
            guess_rate=guess_rate,
        )
        people.append((counts, ln_threshold))
    return people


def fit_once() -> None:
    """Fit one simulated participant: what the memory of a fit is measured with."""
    fit_psychometric(simulated(np.random.default_rng(1), 1)[0][0])


def _ours(counts: RampCounts) -> float:
    """Return the estimate of the default fit, made with everything that it gives."""
    return fit_psychometric(counts).ln_threshold.mean


def _on_grid(counts: RampCounts, fine: tuple[int, int, int, int]) -> float:
    """Return the posterior mean of ln(threshold) on a grid of so many nodes, found by the coarse one."""
    return posterior_grid(counts, COARSE_NODES, fine).mean_and_sd(0)[0]


def _has_psignifit() -> bool:
    """Return whether psignifit is installed."""
    return find_spec("psignifit") is not None


def _yes_no(
    people: Sequence[tuple[RampCounts, float]], settings: RunSettings
) -> tuple[tuple[BenchmarkPoint, ...], tuple[BenchmarkClaim, ...]]:
    """Return the points of four-parameter fits, and the claims about them."""
    half, double = (18, 12, 6, 4), (72, 48, 24, 16)
    approaches: dict[str, tuple[Role, Fit]] = {
        "posterior on two grids, with intervals": (Role.DEFAULT, _ours),
        f"half the nodes on each axis {half}": (Role.VARIANT, partial(_on_grid, fine=half)),
        f"twice the nodes on each axis {double}": (Role.VARIANT, partial(_on_grid, fine=double)),
        "maximum likelihood, SciPy L-BFGS-B, no interval": (Role.PEER, most_likely_ln_threshold),
        "logistic regression of two parameters, statsmodels": (Role.PEER, regression_ln_threshold),
        f"fine grid {REFERENCE_NODES}": (Role.REFERENCE, partial(_on_grid, fine=REFERENCE_NODES)),
    }
    counts = [c for c, _ in people]
    grids = [posterior_grid(c, COARSE_NODES, REFERENCE_NODES) for c in counts]
    truth, width = (np.array([grid.mean_and_sd(axis)[0] for grid in grids]) for axis in (0, 1))
    points = _points(YES_NO, approaches, counts, truth, settings)
    width_error = np.abs([fit_psychometric(c).ln_width.mean for c in counts] - width).max()
    ours = points[0]
    return points, (
        claim("a fit of four parameters with intervals", 0.05, ours.time, "s", "median wall time"),
        claim(
            "threshold: distance of the posterior mean from a fine grid's", 0.001, ours.error or 0.0, "ln",
            f"largest of {len(people)} simulated participants",
        ),
        claim(
            "width: distance of the posterior mean from a fine grid's", 0.009, float(width_error), "ln",
            f"largest of {len(people)} simulated participants",
        ),
    )  # fmt: skip


def _two_interval(
    people: Sequence[tuple[RampCounts, float]], settings: RunSettings
) -> tuple[BenchmarkPoint, ...]:
    """Return the points of three-parameter fits, psignifit's among them where it is installed."""
    approaches: dict[str, tuple[Role, Fit]] = {
        "posterior on two grids, with intervals": (Role.DEFAULT, _ours),
        "maximum likelihood, SciPy L-BFGS-B, no interval": (Role.PEER, most_likely_ln_threshold),
        f"fine grid {REFERENCE_NODES[:2]} x {REFERENCE_NODES[3]}": (
            Role.REFERENCE,
            partial(_on_grid, fine=REFERENCE_NODES),
        ),
    }
    if _has_psignifit():
        approaches["psignifit, its own grid, our priors"] = (Role.PEER, psignifit_ln_threshold)
    counts = [c for c, _ in people]
    truth = np.array([_on_grid(c, REFERENCE_NODES) for c in counts])
    return _points(TWO_INTERVAL, approaches, counts, truth, settings)


def _to_truth(rng: np.random.Generator, n: int, settings: RunSettings) -> tuple[BenchmarkPoint, ...]:
    """Return points whose error is that against the thresholds that the answers were drawn from."""
    people = simulated(rng, n)
    approaches: dict[str, tuple[Role, Fit]] = {
        "posterior mean": (Role.DEFAULT, _ours),
        "maximum likelihood, SciPy L-BFGS-B": (Role.PEER, most_likely_ln_threshold),
        "logistic regression of two parameters, statsmodels": (Role.PEER, regression_ln_threshold),
    }
    few = [c for c, _ in people[:4]]
    points = _points(TO_TRUTH, approaches, few, np.zeros(len(few)), settings)
    truth = np.array([t for _, t in people])
    errors = [np.array([fit(c) for c, _ in people]) - truth for _, fit in approaches.values()]
    return tuple(
        replace(
            p,
            error=float(np.sqrt(np.mean(e**2))),
            error_of=RMS_TO_TRUTH,
            note=f"bias {np.mean(e):+.3f}, {n} simulated participants",
        )
        for p, e in zip(points, errors, strict=True)
    )


def _many_rates(
    rng: np.random.Generator, sizes: Sequence[int], settings: RunSettings
) -> tuple[BenchmarkPoint, ...]:
    """Return points over the number of different rates, as adaptive placement makes them."""
    rows = []
    for size in sizes:
        counts = simulated(rng, 1, rates=np.geomspace(RATES[0], RATES[-1], size))[0][0]
        times = timed_in_turn({"ours": partial(fit_psychometric, counts)}, settings.repeats(5))["ours"]
        rows.append(point(Approach(MANY_RATES, "posterior on two grids", Role.DEFAULT, size, "rates"), times))
    return tuple(rows)


def _points(
    task: str,
    approaches: dict[str, tuple[Role, Fit]],
    counts: Sequence[RampCounts],
    truth: Array,
    settings: RunSettings,
) -> tuple[BenchmarkPoint, ...]:
    """Return the points of approaches that fit the same participants, one after the other."""

    def all_of(fit: Fit) -> list[float]:
        return [fit(c) for c in counts]

    times = timed_in_turn(
        {name: partial(all_of, fit) for name, (_, fit) in approaches.items()}, settings.repeats(5)
    )
    trials = int(counts[0].n_trials.sum() + counts[0].catch_trials)
    points = []
    for name, (role, fit) in approaches.items():
        error = None if role is Role.REFERENCE else float(np.abs(np.array(all_of(fit)) - truth).max())
        each = replace(
            times[name], wall=times[name].wall / len(counts), processor=times[name].processor / len(counts)
        )
        approach = Approach(task, name, role, trials, "trials")
        points.append(point(approach, each, 0.0 if error is None else error, TO_POSTERIOR))
    return tuple(points)


def _lead(ours: BenchmarkPoint, points: Sequence[BenchmarkPoint]) -> str:
    """Return what came out, from the numbers."""
    words = (
        f"A fit of four parameters with intervals takes {ours.time * 1e3:.0f} ms; its threshold lies within "
        f"{ours.error:.1g} (ln) of that of a grid three times as dense."
    )
    theirs = [p for p in points if p.approach.startswith("psignifit")]
    if theirs and theirs[0].ratio:
        words += f" psignifit takes {theirs[0].ratio:.0f} times as long as ours for three parameters."
    return words
