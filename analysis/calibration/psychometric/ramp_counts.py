"""Trials sorted and counted: by participant, level and rate, as the fits take them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampTrial, Response
from evenlight.data_schema.threshold import Threshold

TWO_INTERVAL_GUESS_RATE = 0.5  # right by chance
SAME_LEVEL = 1.05  # a ratio of luminances that moves no threshold by more than its own error (choice)


@dataclass(frozen=True, slots=True)
class RampLevelKey:
    """A level of the experiment: what is shown, and what is asked.

    Attributes
    ----------
    screen, factor, luminance : str, float, float
        "white" or "gray", initial brightness factor b, and initial luminance [cd/m^2].
    direction, ramp_duration : Direction, float
        Which way the luminance goes, and for how long [s].
    procedure : Procedure
        What is asked.
    """

    screen: str
    factor: float
    luminance: float
    direction: Direction = Direction.DOWN
    ramp_duration: float = 5.0
    procedure: Procedure = Procedure.YES_NO


@dataclass(frozen=True, slots=True)
class RampCounts:
    """Answers of one participant at one luminance level.

    Attributes
    ----------
    rates : array (m,)
        Rates tested, rising [cd/m^2/s].
    n_yes, n_trials : array (m,)
        Successes and trials at each: answers "yes", or of two intervals the right one.
    catch_yes, catch_trials : int
        The participant's answers "yes" in catch trials, and catch trials.
    guess_rate : float or None
        The guess rate where the task fixes it, as the choice between two intervals does at 0.5; None where it
        has to be found out.
    """

    rates: NDArray[np.float64]
    n_yes: NDArray[np.int64]
    n_trials: NDArray[np.int64]
    catch_yes: int = 0
    catch_trials: int = 0
    guess_rate: float | None = None

    @property
    def false_alarm_rate(self) -> float | None:
        """Share of "yes" in catch trials; None without any."""
        return self.catch_yes / self.catch_trials if self.catch_trials else None


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


def group_by_level(trials: Iterable[RampTrial]) -> dict[RampLevelKey, list[RampTrial]]:
    """Return the trials of all participants at each level, under all calibrations of the display."""
    trials = tuple(trials)
    joined = joined_levels(level_of_trial(trial) for trial in trials)
    groups: dict[RampLevelKey, list[RampTrial]] = {}
    for trial in trials:
        groups.setdefault(joined[level_of_trial(trial)], []).append(trial)
    return groups


def joined_levels(levels: Iterable[RampLevelKey]) -> dict[RampLevelKey, RampLevelKey]:
    """Return, for each level, the level of the population that it belongs to.

    Luminances of one screen and factor, in whatever condition, within `SAME_LEVEL` of the lowest are one
    level, at their geometric mean: a display that was measured again in mid-study
    (docs/decisions/re-measured-display.md).

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


def ramp_counts(ramps: Sequence[RampTrial], catch_yes: int = 0, catch_trials: int = 0) -> RampCounts:
    """Return the answers to ramps of one level, counted by rate."""
    rates, index = np.unique([trial.rate for trial in ramps], return_inverse=True)
    success = np.array([trial.success for trial in ramps])
    two = bool(ramps) and ramps[0].procedure is Procedure.TWO_INTERVAL
    return RampCounts(
        rates=rates,
        n_yes=np.bincount(index, success, minlength=rates.size).astype(np.int64),
        n_trials=np.bincount(index, minlength=rates.size).astype(np.int64),
        catch_yes=catch_yes,
        catch_trials=catch_trials,
        guess_rate=TWO_INTERVAL_GUESS_RATE if two else None,
    )
