"""Trials sorted and counted: by participant, level and rate, as the fits take them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampTrial, Response
from evenlight.data_schema.threshold import Threshold

TWO_INTERVAL_GUESS_RATE = 0.5  # right by chance
T = TypeVar("T")
Rate = TypeVar("Rate", float, Array)
SAME_LEVEL = 1.05  # a ratio of luminances that moves no threshold by more than its own error (choice)


@dataclass(frozen=True, slots=True)
class RampLevelKey:
    """A level of the experiment: what is shown, and what is asked."""

    screen: str  # "white" or "gray"
    factor: float  # initial brightness factor b
    luminance: float  # initial [cd/m^2]
    direction: Direction = Direction.DOWN
    ramp_duration: float = 5.0  # [s]
    procedure: Procedure = Procedure.YES_NO


TrialKey = tuple[str, str, int]  # participant, session, trial


@dataclass(frozen=True, slots=True)
class Repeats:
    """That the last answer is given again, whatever is seen, in a share of the trials."""

    share: float
    last: Mapping[TrialKey, Response]  # the answer before each trial; none before a session's first

    def succeed(self, trials: Iterable[RampTrial]) -> Mask:
        """Return in which trials the last answer again would be a success: "yes", or the right interval."""
        last = ((trial, self.last.get(key_of_trial(trial))) for trial in trials)
        found = [answer is not None and replace(trial, response=answer).success for trial, answer in last]
        return np.array(found, dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class RepeatCounts:
    """Of the answers at a level, those in trials in which the last answer again would be a success."""

    share: float  # of the trials in which it is given again
    n_yes: Integers
    n_trials: Integers


@dataclass(frozen=True, slots=True)
class RampCounts:
    """Answers of one participant at one luminance level."""

    rates: Array  # tested, rising, (m,) [cd/m^2/s]
    n_yes: Integers  # successes at each: answers "yes", or of two intervals the right one
    n_trials: Integers
    catch_yes: int = 0  # the participant's answers "yes" in catch trials
    catch_trials: int = 0
    # Where the task fixes it, as the choice between two intervals does at 0.5; None: to be found out.
    guess_rate: float | None = None
    repeats: RepeatCounts | None = None

    def parts(self, guess: Rate, lapse: Rate) -> list[tuple[Integers, Integers, Rate, Rate]]:
        """Return successes and trials with their guess and lapse rate; two parts if answers are repeated.

        With probability ρ the last answer is given again: P(success) = (1 - ρ) ψ, or (1 - ρ) ψ + ρ.
        """
        if self.repeats is None:
            return [(self.n_yes, self.n_trials, guess, lapse)]
        kept, again = 1 - self.repeats.share, self.repeats
        return [
            (self.n_yes - again.n_yes, self.n_trials - again.n_trials, kept * guess, 1 - kept * (1 - lapse)),
            (again.n_yes, again.n_trials, 1 - kept * (1 - guess), kept * lapse),
        ]

    @property
    def false_alarm_rate(self) -> float | None:
        """Share of "yes" in catch trials; None without any."""
        return self.catch_yes / self.catch_trials if self.catch_trials else None


def key_of_trial(trial: RampTrial) -> TrialKey:
    """Return what tells a trial from all others."""
    return trial.participant_id, trial.session_id, trial.trial_index


def level_of_trial(trial: RampTrial) -> RampLevelKey:
    """Return the level that a trial belongs to."""
    return RampLevelKey(
        trial.screen, trial.factor, trial.initial_luminance, trial.direction, trial.duration, trial.procedure
    )


def level_of_threshold(t: Threshold) -> RampLevelKey:
    """Return the level that a threshold belongs to."""
    return RampLevelKey(t.screen, t.factor, t.luminance, t.direction, t.ramp_duration, t.procedure)


def level_order(level: RampLevelKey) -> tuple[object, ...]:
    """Return what levels are sorted by: task and condition, then white before gray, then bright before dark.

    >>> bright, dark = RampLevelKey("white", 1.0, 100.0), RampLevelKey("white", 0.2, 20.0)
    >>> sorted([dark, RampLevelKey("gray", 1.0, 50.0), bright], key=level_order)[0] is bright
    True
    """
    screens = {"white": 0, "gray": 1}
    condition = (level.procedure.value != "yes_no", level.direction.value, level.ramp_duration)
    return (*condition, screens.get(level.screen, 2), -level.factor, level.luminance)


def group_by_participant_and_level(
    trials: Iterable[RampTrial],
) -> dict[tuple[str, RampLevelKey], list[RampTrial]]:
    """Return the trials of each participant at each level, in order of participant, screen and factor."""
    groups: dict[tuple[str, RampLevelKey], list[RampTrial]] = {}
    for trial in trials:
        groups.setdefault((trial.participant_id, level_of_trial(trial)), []).append(trial)
    return dict(sorted(groups.items(), key=lambda item: (item[0][0], level_order(item[0][1]))))


def by_joined_level(items: Iterable[T], level_of: Callable[[T], RampLevelKey]) -> dict[RampLevelKey, list[T]]:
    """Return what belongs to each level of the population, under all calibrations of the display."""
    items = tuple(items)
    joined = joined_levels(map(level_of, items))
    groups: dict[RampLevelKey, list[T]] = {}
    for item in items:
        groups.setdefault(joined[level_of(item)], []).append(item)
    return groups


def joined_levels(levels: Iterable[RampLevelKey]) -> dict[RampLevelKey, RampLevelKey]:
    """Return, for each level, the level of the population that it belongs to.

    Luminances of one screen and factor, in whatever condition, within `SAME_LEVEL` of the lowest are one
    level, at their geometric mean: a display that was measured again in mid-study
    (docs/decisions/a-result-knows-its-display.md).

    >>> levels = [RampLevelKey("white", factor, L) for factor, L in ((1, 100.0), (1, 96.04), (0.2, 20.0))]
    >>> joined = joined_levels(levels)
    >>> [round(joined[level].luminance, 6) for level in levels]
    [98.0, 98.0, 20.0]
    """
    groups: dict[tuple[str, float], list[list[RampLevelKey]]] = {}
    for level in sorted(set(levels), key=lambda level: level.luminance):
        own = groups.setdefault((level.screen, level.factor), [])
        if not own or level.luminance > SAME_LEVEL * own[-1][0].luminance:
            own.append([])
        own[-1].append(level)
    joined = {}
    for group in (group for own in groups.values() for group in own):
        luminance = np.unique([level.luminance for level in group])
        mean = float(np.exp(np.mean(np.log(luminance))))
        for level in group:
            joined[level] = replace(level, luminance=mean) if luminance.size > 1 else level
    return joined


def joined_luminances(thresholds: Sequence[Threshold]) -> list[float]:
    """Return, for each threshold, the luminance of the population's level that it belongs to [cd/m^2]."""
    joined = joined_levels(map(level_of_threshold, thresholds))
    return [joined[level_of_threshold(t)].luminance for t in thresholds]


def catch_counts(trials: Iterable[RampTrial]) -> dict[str, tuple[int, int]]:
    """Return, for each participant, the answers "yes" in catch trials and the catch trials."""
    counts: dict[str, tuple[int, int]] = {}
    for trial in trials:
        if trial.is_catch:
            yes, total = counts.get(trial.participant_id, (0, 0))
            counts[trial.participant_id] = (yes + (trial.response is Response.YES), total + 1)
    return counts


def pooled_counts(participants: Sequence[RampCounts]) -> RampCounts:
    """Return all participants' answers pooled, catch trials left out."""
    rates, index = np.unique(np.concatenate([c.rates for c in participants]), return_inverse=True)

    def summed(counts: Sequence[RampCounts | RepeatCounts]) -> tuple[Integers, Integers]:
        n_yes, n_trials = np.zeros((2, rates.size), dtype=np.int64)
        np.add.at(n_yes, index, np.concatenate([c.n_yes for c in counts]))
        np.add.at(n_trials, index, np.concatenate([c.n_trials for c in counts]))
        return n_yes, n_trials

    again = [c.repeats for c in participants if c.repeats]
    repeats = RepeatCounts(again[0].share, *summed(again)) if again else None
    guess_rate = participants[0].guess_rate
    return RampCounts(rates, *summed(participants), guess_rate=guess_rate, repeats=repeats)


def counts_by_participant_and_level(
    trials: Iterable[RampTrial], repeats: Repeats | None = None
) -> dict[tuple[str, RampLevelKey], RampCounts]:
    """Return the answers to ramps by participant and level; in yes/no with all their catch trials."""
    trials = tuple(trials)
    catches = catch_counts(trials)
    groups = group_by_participant_and_level(trial for trial in trials if not trial.is_catch)
    return {
        (who, level): ramp_counts(
            group,
            *(catches.get(who, (0, 0)) if level.procedure is Procedure.YES_NO else (0, 0)),
            repeats=repeats,
        )
        for (who, level), group in groups.items()
    }


def ramp_counts(
    ramps: Sequence[RampTrial], catch_yes: int = 0, catch_trials: int = 0, repeats: Repeats | None = None
) -> RampCounts:
    """Return the answers to ramps of one level, counted by rate."""
    rates, index = np.unique([trial.rate for trial in ramps], return_inverse=True)
    success = np.array([trial.success for trial in ramps])

    def counted(weights: Mask | None = None) -> Integers:
        return np.bincount(index, weights, minlength=rates.size).astype(np.int64)

    again = None
    if repeats is not None:
        own = repeats.succeed(ramps)
        again = RepeatCounts(repeats.share, counted(own & success), counted(own))
    two = bool(ramps) and ramps[0].procedure is Procedure.TWO_INTERVAL
    return RampCounts(
        rates=rates,
        n_yes=counted(success),
        n_trials=counted(),
        catch_yes=catch_yes,
        catch_trials=catch_trials,
        guess_rate=TWO_INTERVAL_GUESS_RATE if two else None,
        repeats=again,
    )
