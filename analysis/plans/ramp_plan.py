"""Planning a calibration: participants, trials and minutes for a wanted precision of ΔL(L).

Simulated participants go through each design once; their first ramps are a shorter session. Experiments of N
participants are draws of N of them, with replacement. Thresholds are those of `evenlight fit`, on a coarser
grid; the limit is that of its individual model with all standard errors alike, which has a closed form. The
band is what an experimenter would report; the error, against the truth, what they would be wrong by.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy import special

from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE, fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import (
    PAPER_DEGREE,
    RateLimitOptions,
    basis_for,
)
from evenlight.analysis.figure_style import look
from evenlight.analysis.plans.plan import (
    Panel,
    Plan,
    frame_of,
    people_in_words,
    plain_logarithmic,
    plan_figure,
)
from evenlight.analysis.plans.questions import RampQuestion
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS, RampPlanRow
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Placement, RampDesign, RampTrial, session_minutes
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.simulate_ramp import simulated_trials_and_thresholds
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.preset_files import load_display

TITLE = "How many participants, and how long of each"
SHAPE = RateLimitOptions(RateLimitForm.LN_RATE, PAPER_DEGREE)
RECOMMENDED = "recommended"  # the design that the guides run
ASSURED = 0.8  # share of experiments whose band is to be narrow enough, for the second figure
DRAWS = 400  # experiments of each size
# Of the fits: a third of the time of a fit of real data; thresholds move by at most 0.03 of their SD.
PLANNING_NODES = (28, 16, 8, 5)
CHUNK = 4  # participants that are simulated and fitted at once: the unit of work and of progress
SHARES = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200)  # [%]
COUNTS = (2, 3, 5, 7, 10, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500, 1000)


Work = tuple[RampDesign, Display, tuple[int, ...], int, int]  # ramps per level; people, and their seed


@dataclass(frozen=True, slots=True)
class Sessions:
    """Simulated participants, and what sessions of so many ramps per level tell of them."""

    minutes: Array  # length of a session, (people,)
    luminance: Array  # initial luminances [cd/m^2], (levels,)
    ln_rate: Array  # ln of fitted thresholds [cd/m^2/s], (people, levels); NaN where none can be used
    ln_truth: Array  # ln of the true ones


def plan_ramps(
    question: RampQuestion,
    participants: Sequence[int],
    pool: int = RampQuestion.efforts["default"],
    seed: int = 1,
    mapped: Callable[..., Iterable[Any]] = map,
) -> Plan:
    """Return what the designs give, by simulation of a pool of people who go through each.

    `mapped` is a `map` over a list, whose calls may run at once.
    """
    designs = {name: _checked(load_design(name)) for name in question.design}
    works = [work for design in designs.values() for work in work_of(question, design, pool, seed)]
    found: list[list[Sessions]] = list(mapped(sessions_of, works))
    each, rows = len(works) // len(designs), list[RampPlanRow]()
    for k, (name, design) in enumerate(designs.items()):
        parts = zip(*found[k * each : (k + 1) * each], strict=True)
        for count, some in zip(question.trial_numbers, parts, strict=True):
            about = {"design": name, "procedure": design.procedure.value, "placement": design.placement.value}
            rows += rows_of(
                joined(some), participants, question.precision, seed, trials_per_level=count, **about
            )
    return _plan(question, designs, tuple(rows), pool, seed)


def _checked(design: RampDesign) -> RampDesign:
    levels, least = len(design.screens) * len(design.factors), PAPER_DEGREE + 1
    if levels < least:
        raise InputError(
            f"a rate limit of degree {PAPER_DEGREE} needs {least} or more levels, the design has {levels}; "
            "add factors or a screen to it"
        )
    directions, durations = len(design.directions), len(design.ramp_durations)
    if directions > 1 or durations > 1:
        raise InputError(
            "a plan is made for one direction and one duration of the ramps, got "
            f"{directions} and {durations}; plan each alone"
        )
    return design


def work_of(question: RampQuestion, design: RampDesign, pool: int, seed: int) -> list[Work]:
    """Return the work that the people of a design take, in parts: the same people, whatever the design."""
    sizes = [min(CHUNK, pool - begin) for begin in range(0, pool, CHUNK)]
    seeds = np.random.SeedSequence(seed).generate_state(len(sizes)).tolist()
    longest = with_trials_per_level(design, question.trial_numbers[-1])
    shown = longest, load_display(question.display), question.trial_numbers
    return [(*shown, *part) for part in zip(sizes, seeds, strict=True)]


def with_trials_per_level(design: RampDesign, trials: int) -> RampDesign:
    """Return a design with at least so many ramps per level.

    >>> with_trials_per_level(RampDesign(), 20).repetitions  # of eight rates
    3
    """
    if design.placement is Placement.CONSTANT:
        return dataclasses.replace(design, repetitions=math.ceil(trials / len(design.relative_rates)))
    return dataclasses.replace(design, trials_per_level=trials)


@one_blas_thread
def sessions_of(work: Work) -> list[Sessions]:
    """Simulate participants, and fit their thresholds after each number of ramps per level."""
    design, display, counts, participants, seed = work
    trials, truth = simulated_trials_and_thresholds(design, display, participants, seed)
    people, luminances = (sorted(set(names)) for names in zip(*truth, strict=True))
    ln_truth = np.log([[truth[who, L] for L in luminances] for who in people])
    own = [[trial for trial in trials if trial.participant_id == who and trial.usable] for who in people]
    sessions = []
    for count in counts:
        ln_rate = np.full(ln_truth.shape, np.nan)
        shorter = [first_trials(every, count) for every in own]
        for row, some in zip(ln_rate, shorter, strict=True):
            for fit in fit_thresholds_of(some, judge=False, fine=PLANNING_NODES):
                if fit.threshold.flag not in UNUSABLE:
                    row[luminances.index(fit.threshold.luminance)] = fit.fit.ln_threshold.mean
        minutes = np.array([session_minutes(design, len(some)) for some in shorter])
        sessions.append(Sessions(minutes, np.array(luminances), ln_rate, ln_truth))
    return sessions


def first_trials(trials: Iterable[RampTrial], per_level: int) -> list[RampTrial]:
    """Return one participant's trials as far as a shorter session would have gone.

    Of every level the first so many ramps, and the same share of the catch trials: an adaptive placement
    knows nothing of the trials to come, and constant stimuli come in passes of all rates.
    """
    ordered = sorted(trials, key=lambda trial: trial.trial_index)
    seen: Counter[tuple[str, float]] = Counter()
    kept, catches = [], [trial for trial in ordered if trial.is_catch]
    for trial in ordered:
        if not trial.is_catch:
            seen[trial.screen, trial.factor] += 1
            if seen[trial.screen, trial.factor] <= per_level:
                kept.append(trial)
    share = len(kept) / max(seen.total(), 1)
    return sorted(kept + catches[: round(share * len(catches))], key=lambda trial: trial.trial_index)


def joined(parts: Sequence[Sessions]) -> Sessions:
    """Return the sessions of all people but those without a threshold.

    A missing threshold is that of the mean person, times what the person's others are of it.
    """
    minutes, ln_rate, ln_truth = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("minutes", "ln_rate", "ln_truth")
    )
    some = np.isfinite(ln_rate).any(axis=1)
    ln_rate = ln_rate[some]
    middle = np.nanmean(ln_rate, axis=0)
    own = np.nanmean(ln_rate - middle, axis=1, keepdims=True)
    filled = np.where(np.isnan(ln_rate), middle + own, ln_rate)
    return Sessions(minutes, parts[0].luminance, filled, ln_truth[some])


def limits_of(luminance: Array, ln_rate: Array) -> tuple[Array, Array]:
    """Return the population's curve at each level, and its standard error, (..., levels), in ln(rate).

    ln ΔL_pl = polynomial(L_l) + u_p + e_pl of thresholds ln ΔL, (..., people, levels). Where everybody was
    shown every level, and all e are alike, REML is least squares, and two sums of squares: between people,
    and of the rest.
    """
    people, levels = ln_rate.shape[-2:]
    design = basis_for(luminance, SHAPE).design(luminance)
    hat = design @ np.linalg.pinv(design)
    own, mean = ln_rate.mean(axis=-1, keepdims=True), ln_rate.mean(axis=-2, keepdims=True)
    rest = ln_rate - own - mean + own.mean(axis=-2, keepdims=True)
    scatter = np.sum(rest**2, axis=(-2, -1)) / ((people - 1) * (levels - 1))
    between = np.maximum(own.var(axis=(-2, -1), ddof=1), scatter / levels)  # no less than the rest gives
    variance = between[..., None] + scatter[..., None] * (np.diag(hat) - 1 / levels)
    return mean[..., 0, :] @ hat.T, np.sqrt(variance / people)


def rows_of(
    sessions: Sessions, participants: Sequence[int], precision: float, seed: int, **about: Any
) -> list[RampPlanRow]:
    """Return a row for each number of participants of a design with so many ramps per level."""
    people, minutes = len(sessions.ln_rate), float(np.mean(sessions.minutes))
    curve, error = limits_of(sessions.luminance, sessions.ln_rate)
    bias = float(np.mean(curve - sessions.ln_truth.mean(axis=0)))
    # Draws with replacement scatter less than people do, by the root of (n - 1) / n.
    apart = curve + (sessions.ln_rate - curve) * math.sqrt(people / (people - 1))

    def drawn(n: int) -> tuple[Array, Array]:
        chosen = np.random.default_rng([seed, n]).integers(people, size=(DRAWS, n))
        return limits_of(sessions.luminance, apart[chosen])

    # Who happened to be simulated decides how much people differ: the bootstrap says how well that is known.
    pool_error = _scatter(drawn(people)[1])
    single = float(_rms(error)) * math.sqrt(people)
    low, needed, high = (
        participants_needed(single * math.exp(sign * 1.96 * pool_error), precision) for sign in (-1, 0, 1)
    )
    rows = []
    for n in sorted(participants):
        curves, errors = drawn(n)
        half = special.stdtrit(n - 1, 0.975) * errors
        off = curves - curve + bias  # all draws share the chance in the pool's own answers
        width = math.expm1(np.mean(half))
        rows.append(
            RampPlanRow(
                levels=sessions.luminance.size,
                participants=n,
                minutes=minutes,
                total_hours=n * minutes / 60,
                participant_sd_ln=float(_rms(np.std(sessions.ln_truth, axis=0, ddof=1))),
                threshold_error_ln=float(_rms((sessions.ln_rate - sessions.ln_truth).ravel())),
                half_width=width,
                half_width_mc_error=math.hypot(pool_error, _scatter(errors) / math.sqrt(DRAWS)),
                half_width_assured=math.expm1(np.quantile(np.mean(half, axis=1), ASSURED)),
                error=math.expm1(_rms(off.ravel())),
                bias=math.expm1(bias),
                coverage=float(np.mean(np.abs(off) <= half)),
                meets=width <= precision,
                participants_needed=needed,
                participants_needed_low=low,
                participants_needed_high=high,
                hours_needed=needed and needed * minutes / 60,
                **about,
            )
        )
    return rows


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))


def _scatter(errors: Array) -> float:
    """Return by which share of itself the standard error of a limit differs between draws, one SD."""
    sizes = _rms(errors)
    return float(np.std(sizes, ddof=1) / np.mean(sizes))


def participants_needed(standard_error: float, precision: float) -> int | None:
    """Return how many participants give a band of a half-width, or None if more than 1000 do not.

    Half-width = t(N - 1) · standard error of one participant / sqrt(N) in ln(rate), t Student's at 97.5 %.

    >>> participants_needed(0.3, 0.1)  # ln 1.1 = 0.0953; 2.02 · 0.3 / sqrt(41) = 0.0947, of 40: 0.0959
    41
    """
    n = np.arange(2, MOST_PARTICIPANTS + 1)
    half = special.stdtrit(n - 1, 0.975) * standard_error / np.sqrt(n)
    enough = np.flatnonzero(half <= np.log1p(precision))
    return int(n[enough[0]]) if enough.size else None


def _plan(
    question: RampQuestion,
    designs: Mapping[str, RampDesign],
    rows: tuple[RampPlanRow, ...],
    pool: int,
    seed: int,
) -> Plan:
    """Return rows with their answer in words, and drawn.

    Of each task the best has the precision with the fewest hours of all; different tasks measure different
    thresholds, so that their hours are not set off.
    """
    cheapest = {
        task: min((row for row in rows if row.procedure == task), key=_cost)
        for task in sorted({row.procedure for row in rows}, reverse=True)  # yes/no first
    }
    best = {task: row if row.meets else None for task, row in cheapest.items()}
    usual = designs[RECOMMENDED].trials_per_level if RECOMMENDED in designs else 0
    told = [row for row in rows if (row.design, row.trials_per_level) == (RECOMMENDED, usual)][:1]
    wanted = f"{100 * question.precision:g}"
    answer = prose("plan_ramp", usual=told, tasks=cheapest, wanted=wanted, people=people_in_words)
    error = max(row.half_width_mc_error for row in rows)
    rests_on = model, monte_carlo = prose("plan_ramp_rests", pool=pool, error=error)
    about = {
        "effort": {size: name for name, size in question.efforts.items()}.get(pool, "other"),
        "monte_carlo_error": monte_carlo,
        "model": model,
        "precision": question.precision,
        "pool": pool,
        "draws": DRAWS,
        "best": {task: row and mapping_from_record(row) for task, row in best.items()},
        "designs": {name: mapping_from_record(design) for name, design in designs.items()},
    }
    inputs = {f"design {name}": sha256_of_record(design) for name, design in designs.items()}
    made = provenance_now(seed, inputs | {"display": sha256_of_record(load_display(question.display))})
    words = f"participants for {wanted} %"
    cards = tuple(
        KeyFigure(people_in_words(row), words, f"{row.design}, {row.minutes:.0f} min each")
        for row in (*told, *filter(None, best.values()))
    )
    said = (*rests_on, *answer[1:], answer[0])
    return Plan(TITLE, rows, answer, said, cards, about, made, _figure(question, rows, pool))


def _cost(row: RampPlanRow) -> tuple[bool, float, float]:
    """Return what a row costs: hours of those that are precise, and of so many as would be."""
    hours = row.total_hours if row.meets else row.hours_needed
    return not row.meets, hours or math.inf, row.half_width


def _figure(question: RampQuestion, rows: Sequence[RampPlanRow], pool: int) -> Figure:
    """Draw the band's half-width over participants, and what the wanted precision takes over minutes."""
    wanted, trials = 100 * question.precision, question.trial_numbers
    middle = trials[len(trials) // 2]
    (subtitle,) = prose("plan_ramp_figure", pool=pool, middle=middle, wanted=wanted, trials=trials)
    frame = frame_of(rows)
    frame["half_width"] = (100 * frame.half_width).where(frame.trials_per_level == middle)
    doubt = np.exp(1.96 * frame["half_width_mc_error"])
    frame["half_width_low"], frame["half_width_high"] = frame.half_width / doubt, frame.half_width * doubt
    for end in ("", "_low", "_high"):
        frame[f"hours_needed{end}"] = frame[f"participants_needed{end}"].astype(float) * frame.minutes / 60
    panels = [
        [Panel("participants", "half_width", "half-width of the band [%]", wanted)],
        [
            Panel("minutes", "participants_needed", "participants needed"),
            Panel("minutes", "hours_needed", "hours needed, of all"),
        ],
    ]
    with look():
        lines = {name: frame[frame.design == name] for name in question.design}
        figure, axes = plan_figure(TITLE, subtitle, lines, panels, [15.0, 15.0])
        plain_logarithmic(axes["half_width"], "y", SHARES)
        for name in ("participants_needed", "hours_needed"):
            plain_logarithmic(axes[name], "y", COUNTS)
            axes[name].set_xlim(0, None)
    return figure
