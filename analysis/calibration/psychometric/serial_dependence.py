"""Serial dependence: whether answers go with the answer, or the ramp, before, whatever is seen.

Who gives the last answer again in a share ρ of the trials has E[y | last] = (1 - ρ) E[y] + ρ last. So the
residuals of the answers from the fitted functions go with the last answer, at the slope ρ within each
participant. Such answers flatten the function, and move its 75 % point to faster ramps: the unsafe side.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from evenlight.analysis.calibration.psychometric.ramp_counts import (
    Repeats,
    TrialKey,
    key_of_trial,
    level_of_trial,
)
from evenlight.analysis.calibration.psychometric.thresholds import ThresholdFit, level_of_fit
from evenlight.data_schema.arrays import Array, Integers
from evenlight.data_schema.quantities import quantity
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial, Response

CLEAR_REPEATS = 0.001  # p from which on fits leave them out: by chance in one data set of a thousand
LARGEST_SHARE = 0.5  # more is no answering
FEWEST = 100  # answers; fewer tell nothing of a share as small as 10 %
UPPER = (Response.YES, Response.FIRST)


@dataclass(frozen=True, slots=True)
class SerialDependence:
    """How answers go with what came before."""

    repeat_share: float = quantity(
        "1", "share of trials in which the last answer is given again, as estimated"
    )
    repeat_p: float = quantity("1", "how probable so high a share is by chance, without any")
    previous_ramp: float = quantity(
        "1",
        "change of the answer's probability per ln unit of the last ramp's relative rate",
    )
    previous_ramp_p: float = quantity("1", "how probable so large a change is by chance, two-sided")
    n_trials: int = quantity("1", "ramps with a trial before them")


def serial_dependence(
    trials: Sequence[RampTrial], fits: Iterable[ThresholdFit]
) -> tuple[SerialDependence | None, Repeats | None]:
    """Return how answers to ramps go with what came before, and repeats where these are clear.

    Parameters
    ----------
    trials : sequence of RampTrial
        Of one task, catch trials among them.
    fits : iterable of ThresholdFit
        The functions fitted to them.

    Returns
    -------
    SerialDependence, Repeats
        The first is None where too few trials tell; the second where answers are not clearly repeated.
    """
    functions = {(fit.threshold.participant_id, level_of_fit(fit)): fit.fit.function for fit in fits}
    before = _before(trials)
    ramps = [trial for trial in trials if not trial.is_catch and key_of_trial(trial) in before]
    if len(ramps) < FEWEST:
        return None, None
    chances = np.array(
        [float(functions[trial.participant_id, level_of_trial(trial)](trial.rate)) for trial in ramps]
    )
    # Of two intervals, the answer is "first": its chance is that of being right if the ramp is there.
    upper = np.array([t.procedure is Procedure.YES_NO or t.ramp_interval == 1 for t in ramps])
    residuals = np.where(upper, 1.0, -1.0) * (np.array([t.success for t in ramps]) - chances)
    people = np.unique([trial.participant_id for trial in ramps], return_inverse=True)[1]
    last = [before[key_of_trial(trial)] for trial in ramps]
    upward = np.array([float(own.response in UPPER) for own in last])
    (share,), (z,) = _regression(upward[:, None], residuals, chances, people)
    moved = np.array([not own.is_catch for own in last])
    rates = np.log([own.rate / own.initial_luminance for own in last if not own.is_catch])
    both = np.column_stack([upward[moved], rates])
    (_, change), (_, z_change) = _regression(both, residuals[moved], chances[moved], people[moved])
    p = float(special.ndtr(-z))
    found = SerialDependence(share, p, change, float(2 * special.ndtr(-abs(z_change))), len(ramps))
    answers = {key: trial.response for key, trial in before.items()}
    return found, Repeats(min(share, LARGEST_SHARE), answers) if p < CLEAR_REPEATS else None


def _before(trials: Iterable[RampTrial]) -> dict[TrialKey, RampTrial]:
    """Return the trial before each; none before the first of a session."""
    found: dict[TrialKey, RampTrial] = {}
    ordered = sorted(trials, key=key_of_trial)
    for last, trial in itertools.pairwise(ordered):
        if key_of_trial(last)[:2] == key_of_trial(trial)[:2]:
            found[key_of_trial(trial)] = last
    return found


def _regression(
    columns: Array, residuals: Array, chances: Array, people: Integers
) -> tuple[list[float], list[float]]:
    """Return the slopes of the residuals on columns, all within people, and over their standard errors."""
    counts = np.maximum(np.bincount(people), 1)
    own, y = (
        values - np.array([np.bincount(people, column) / counts for column in values.T])[:, people].T
        for values in (columns, residuals[:, None])
    )
    inverse = np.linalg.pinv(own.T @ own)
    slopes = inverse @ own.T @ y[:, 0]
    variances = np.diag(inverse @ (own.T * (chances * (1 - chances))) @ own @ inverse)
    errors = np.sqrt(np.maximum(variances, 0.0))
    scores = np.divide(slopes, errors, out=np.zeros_like(slopes), where=errors > 0)
    return slopes.tolist(), scores.tolist()
