"""A pool of simulated participants, and experiments drawn from it: their bands and errors."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy import special

from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, luminances_needed
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_thresholds
from evenlight.data_schema.analysis_results import MOST_PARTICIPANTS
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import Placement, RampDesign, RampTrial, session_minutes
from evenlight.data_schema.threshold import Threshold
from evenlight.method.one_blas_thread import one_blas_thread
from evenlight.method.rate_limit import rate_limit_at

# Of the fits: a third of the time of a fit of real data; thresholds move by at most 0.03 of their SD.
PLANNING_NODES = (28, 16, 8, 5)
CHUNK = 4  # participants that are simulated and fitted at once: the unit of work and of progress
TrueThresholds = Mapping[tuple[str, float], float]  # by participant and initial luminance [cd/m^2/s]


@dataclass(frozen=True, slots=True)
class DrawSettings:
    """How experiments are drawn and analysed.

    Attributes
    ----------
    display, options : Display, RateLimitOptions
        What the ramps were shown on, and how the rate limit is fitted.
    draws, seed : int, tuple of int
        Experiments, and the seed of who is drawn.
    """

    display: Display
    options: RateLimitOptions
    draws: int
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class TrueLevels:
    """The pool's levels: initial luminances [cd/m^2], and the mean of ln(true threshold) at each."""

    luminance: Array
    ln_rate: Array


@dataclass(frozen=True, slots=True)
class Experiments:
    """Experiments as their analysis sees them and as they are.

    Attributes
    ----------
    half_widths, errors : array (draws, levels)
        Of the bands, in ln(rate), and ln(fitted / true rate).
    participants : int
        In each.
    """

    half_widths: Array
    errors: Array
    participants: int

    @property
    def standard_errors(self) -> Array:
        """Of each draw's band, as for one participant: half-width · sqrt(N) / t, RMS [ln], (draws,)."""
        quantile = float(special.stdtrit(self.participants - 1, 0.975))
        return np.asarray(np.sqrt(np.mean(self.half_widths**2, axis=1) * self.participants) / quantile)

    @property
    def standard_error(self) -> float:
        """The RMS of the standard errors [ln]."""
        return float(np.sqrt(np.mean(self.standard_errors**2)))


def true_levels(truths: Sequence[Mapping[float, float]]) -> TrueLevels:
    """Return the truth of a pool from that of its participants, thresholds [cd/m^2/s] by luminance.

    >>> levels = true_levels([{10.0: 1.0, 20.0: 2.0}, {10.0: 4.0, 20.0: 2.0}])
    >>> np.exp(levels.ln_rate).round(9).tolist()
    [2.0, 2.0]
    """
    luminance = sorted(truths[0])
    ln_rate = np.mean([[np.log(truth[L]) for L in luminance] for truth in truths], axis=0)
    return TrueLevels(np.array(luminance), np.asarray(ln_rate, dtype=np.float64))


def participant_sd(truths: Sequence[Mapping[float, float]]) -> float:
    """Return the standard deviation of ln(true threshold) between participants, over the levels.

    >>> round(participant_sd([{10.0: 1.0, 20.0: 2.0}, {10.0: np.e, 20.0: 2 * np.e}]), 9)  # sqrt(1/2)
    0.707106781
    """
    logs = np.log([[truth[L] for L in sorted(truths[0])] for truth in truths])
    return float(np.sqrt(np.mean(np.var(logs, axis=0, ddof=1))))


def whole_pool_error(drawing: DrawSettings, pool: Sequence[Sequence[Threshold]], truth: TrueLevels) -> Array:
    """Return ln(fitted / true rate) at each level if all of a pool take part once, (levels,).

    It is common to all draws. Its mean over the levels is the bias of the analysis; the rest is chance in the
    pool's own answers, which an experiment with other participants would not share.
    """
    limit = _fitted(drawing, pool, range(len(pool)))
    return np.asarray(np.log(rate_limit_at(limit, truth.luminance)) - truth.ln_rate, dtype=np.float64)


def draw_experiments(
    drawing: DrawSettings, pool: Sequence[Sequence[Threshold]], truth: TrueLevels, participants: int
) -> Experiments:
    """Return experiments with so many participants, drawn from a pool with replacement.

    Parameters
    ----------
    drawing, participants : DrawSettings, int
        How experiments are drawn, and how many participants.
    pool, truth : sequence of sequences of Threshold, TrueLevels
        The thresholds of each who can be drawn, and what is true of the pool.
    """
    rng = np.random.default_rng([*drawing.seed, participants])
    half_widths, errors = [], []
    for _ in range(drawing.draws):
        limit = _fitted(drawing, pool, rng.integers(len(pool), size=participants).tolist())
        half_widths.append(_half_width(limit, truth.luminance))
        errors.append(np.log(rate_limit_at(limit, truth.luminance)) - truth.ln_rate)
    return Experiments(np.array(half_widths), np.array(errors), participants)


def _fitted(drawing: DrawSettings, pool: Sequence[Sequence[Threshold]], chosen: Iterable[int]) -> RateLimit:
    """Return the rate limit of some of a pool, each another participant even if drawn twice."""
    times: Counter[int] = Counter()
    thresholds: list[Threshold] = []
    for k in chosen:
        thresholds += _as_another(tuple(pool[k]), f"{k:04d}x{times[k]}")
        times[k] += 1
    return fit_thresholds(thresholds, drawing.display, drawing.options).limit


@lru_cache(maxsize=4096)
def _as_another(thresholds: tuple[Threshold, ...], participant_id: str) -> tuple[Threshold, ...]:
    """Return thresholds under another name; making checked records takes as long as fitting them."""
    return tuple(dataclasses.replace(t, participant_id=participant_id) for t in thresholds)


def _half_width(limit: RateLimit, luminance: Array) -> Array:
    """Return the half-width of a limit's band at luminances [cd/m^2], in ln(rate)."""
    lower, upper = (
        np.interp(luminance, limit.band_luminance, np.log(edge))
        for edge in (limit.band_lower, limit.band_upper)
    )
    return np.asarray((upper - lower) / 2, dtype=np.float64)


def resampling_spread(resampled: Experiments) -> float:
    """Return how well a pool tells the standard error of its bands: the SD of its logarithm.

    Who happened to be in the pool decides how much its people differ. Draws of as many participants as there
    are in the pool, with replacement, show what other pools would have given (the bootstrap).

    Parameters
    ----------
    resampled : Experiments
        With as many participants as the pool has.
    """
    return float(np.std(np.log(resampled.standard_errors), ddof=1))


def participants_needed(standard_error: float, precision: float) -> int | None:
    """Return how many participants give a band of a half-width, or None if more than 1000 do not.

    Half-width = t(N - 1) · standard error / sqrt(N) in ln(rate), t the 97.5 % point of Student's t.

    Parameters
    ----------
    standard_error : float
        As for one participant [ln].
    precision : float
        Half-width wanted, as a share.

    >>> participants_needed(0.3, 0.1)  # ln 1.1 = 0.0953; 2.02 · 0.3 / sqrt(41) = 0.0947, of 40: 0.0959
    41
    """
    n = np.arange(2, MOST_PARTICIPANTS + 1)
    half = special.stdtrit(n - 1, 0.975) * standard_error / np.sqrt(n)
    enough = np.flatnonzero(half <= np.log1p(precision))
    return int(n[enough[0]]) if enough.size else None


class LoadRampDesign(Protocol):
    """Reads designs of the ramp experiment."""

    def __call__(self, name_or_path: str, /) -> RampDesign:
        """Return the design of a preset's name or of a file."""


class SimulateRamps(Protocol):
    """Simulated participants of the ramp experiment, and what is true of them."""

    def __call__(
        self, design: RampDesign, display: Display, participants: int, seed: int
    ) -> tuple[Sequence[RampTrial], TrueThresholds]:
        """Return all trials, and the thresholds that a perfect fit would find."""


@dataclass(frozen=True, slots=True)
class SimulationTask:
    """A few participants of a design: what is simulated and fitted at once.

    Attributes
    ----------
    design, display : RampDesign, Display
        With as many trials as the longest session has, and what the ramps are shown on.
    trials_per_level : tuple of int
        After how many ramps per level thresholds are fitted.
    participants, seed : int
        How many are simulated, from which seed.
    """

    design: RampDesign
    display: Display
    trials_per_level: tuple[int, ...]
    participants: int
    seed: int


@dataclass(frozen=True, slots=True)
class PoolMember:
    """A simulated participant.

    Attributes
    ----------
    thresholds, minutes : dict of int to tuple of Threshold, dict of int to float
        What was fitted, and the length of the session [min], both by the ramps per level.
    truth : dict of float to float
        True thresholds [cd/m^2/s] by initial luminance [cd/m^2].
    """

    thresholds: dict[int, tuple[Threshold, ...]]
    minutes: dict[int, float]
    truth: dict[float, float]


def work_of(
    design: RampDesign, display: Display, trials: Sequence[int], participants: int, seed: int
) -> list[SimulationTask]:
    """Return the work that a pool of participants takes, in parts.

    Parts differ in their seed, designs do not: the same participants are met by every design.
    """
    longest = with_trials_per_level(design, max(trials))
    seeds = np.random.SeedSequence(seed).generate_state(math.ceil(participants / CHUNK))
    sizes = [min(CHUNK, participants - start) for start in range(0, participants, CHUNK)]
    return [
        SimulationTask(longest, display, tuple(sorted(trials)), size, int(part))
        for size, part in zip(sizes, seeds, strict=True)
    ]


def require_plannable(design: RampDesign, options: RateLimitOptions) -> None:
    """Refuse a design whose limit cannot be planned for, before anyone is simulated.

    The effects of several durations or directions would have to be planned for too.
    """
    levels = len(design.screens) * len(design.factors)
    _, degree = options.shape(levels)
    needed = luminances_needed(degree)
    if levels < needed:
        raise InputError(
            f"a rate limit of degree {degree} needs {needed} or more levels, the design has {levels}; add "
            "factors or a screen to it"
        )
    if len(design.directions) > 1 or len(design.ramp_durations) > 1:
        raise InputError(
            f"a plan is made for one direction and one duration of the ramps, got "
            f"{len(design.directions)} and {len(design.ramp_durations)}; plan each alone"
        )


def with_trials_per_level(design: RampDesign, trials: int) -> RampDesign:
    """Return a design with at least so many ramps per level.

    >>> with_trials_per_level(RampDesign(), 20).repetitions  # of eight rates
    3
    """
    repetitions = math.ceil(trials / len(design.relative_rates))
    if design.placement is Placement.CONSTANT:
        return dataclasses.replace(design, repetitions=repetitions)
    return dataclasses.replace(design, trials_per_level=trials)


@one_blas_thread
def pool_of(work: SimulationTask, simulate: SimulateRamps) -> list[PoolMember]:
    """Simulate participants, and fit their thresholds after each number of trials.

    Parameters
    ----------
    work : SimulationTask
        Who and what.
    simulate : function
        Who answers.
    """
    trials, truth = simulate(work.design, work.display, work.participants, work.seed)
    members = []
    for who in sorted({trial.participant_id for trial in trials}):
        own = [trial for trial in trials if trial.participant_id == who and trial.usable]
        first = {count: first_trials(own, count) for count in work.trials_per_level}
        members.append(
            PoolMember(
                {
                    n: tuple(
                        fit.threshold for fit in fit_thresholds_of(part, judge=False, fine=PLANNING_NODES)
                    )
                    for n, part in first.items()
                },
                {n: session_minutes(work.design, len(part)) for n, part in first.items()},
                {luminance: rate for (person, luminance), rate in truth.items() if person == who},
            )
        )
    return members


def first_trials(trials: Iterable[RampTrial], per_level: int) -> list[RampTrial]:
    """Return one participant's trials as far as a shorter session would have gone.

    Of every level the first so many ramps, and the same share of the catch trials: an adaptive placement
    knows nothing of the trials to come, and constant stimuli come in passes of all rates.
    """
    ordered = sorted(trials, key=lambda trial: trial.trial_index)
    ramps = [trial for trial in ordered if not trial.is_catch]
    catches = [trial for trial in ordered if trial.is_catch]
    seen: dict[tuple[str, float], int] = {}
    kept = []
    for trial in ramps:
        level = (trial.screen, trial.factor)
        seen[level] = seen.get(level, 0) + 1
        if seen[level] <= per_level:
            kept.append(trial)
    share = len(kept) / max(len(ramps), 1)
    return sorted(kept + catches[: round(share * len(catches))], key=lambda trial: trial.trial_index)
