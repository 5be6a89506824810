"""Drift within sessions: whether all participants' thresholds move from the first ramp to the last."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from evenlight.analysis.calibration.psychometric.ramp_counts import TrialKey, key_of_trial, level_of_trial
from evenlight.analysis.calibration.psychometric.thresholds import (
    LARGEST_LN_RATIO,
    ThresholdFit,
    drift_score,
    level_of_fit,
    timed_answers,
)
from evenlight.data_schema.quantities import quantity
from evenlight.data_schema.recordings.ramp import RampTrial


@dataclass(frozen=True, slots=True)
class SessionDrift:
    """How thresholds move within a session, over all participants."""

    ratio: float = quantity("1", "threshold at a session's last ramp over that at its first")
    ci_low: float = quantity("1", "lower end of its 95 % confidence interval")
    ci_high: float = quantity("1", "upper end of its 95 % confidence interval")
    p: float = quantity("1", "how probable so large a change is by chance, two-sided")

    @property
    def lowest(self) -> float:
        """Threshold at the end of a session where it is lower, over that of the whole session."""
        return float(np.exp(-abs(np.log(self.ratio)) / 2))


def session_drift(trials: Sequence[RampTrial], fits: Iterable[ThresholdFit]) -> SessionDrift | None:
    """Return the drift within sessions, to first order; None where it is not known to a factor of 20.

    Participants' own drifts are averaged with their information as weights. Where they scatter more than
    their answers explain, the scatter makes the error, and Student's t the interval.

    Parameters
    ----------
    trials : sequence of RampTrial
        Of one task, catch trials among them.
    fits : iterable of ThresholdFit
        The functions fitted to them.
    """
    functions = {(fit.threshold.participant_id, level_of_fit(fit)): fit.fit.function for fit in fits}
    ramps: dict[object, list[RampTrial]] = {}
    for trial in trials:
        if not trial.is_catch:
            ramps.setdefault((trial.participant_id, level_of_trial(trial)), []).append(trial)
    times, people = _places(trials), dict[str, list[tuple[float, float]]]()
    for key, function in functions.items():
        people.setdefault(key[0], []).append(drift_score(*timed_answers(function, ramps[key], times)))
    score, known = np.array([np.sum(own, axis=0) for own in people.values()]).T
    score, known = score[known > 0], known[known > 0]
    if not known.size:
        return None
    change, df = float(score.sum() / known.sum()), known.size - 1
    scatter = float(known @ (score / known - change) ** 2) / max(df, 1)
    error = float(np.sqrt(max(scatter, 1.0) / known.sum()))
    chance = stats.t(df) if scatter > 1 else stats.norm()
    reach = error * float(chance.ppf(0.975))
    if reach > LARGEST_LN_RATIO:
        return None
    low, high = float(np.exp(change - reach)), float(np.exp(change + reach))
    return SessionDrift(float(np.exp(change)), low, high, float(2 * chance.sf(abs(change) / error)))


def _places(trials: Iterable[RampTrial]) -> dict[TrialKey, float]:
    """Return the place of each trial in its session, from 0 (first) to 1 (last)."""
    sessions: dict[tuple[str, str], list[TrialKey]] = {}
    for key in sorted(map(key_of_trial, trials)):
        sessions.setdefault(key[:2], []).append(key)
    return {key: place / max(len(own) - 1, 1) for own in sessions.values() for place, key in enumerate(own)}
