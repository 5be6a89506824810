"""Answers that repeat the last one are found, taken out of the thresholds, and told."""

from __future__ import annotations

import dataclasses
import functools

import clean_answers as made
import numpy as np
import pytest

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.psychometric.ramp_counts import RampCounts, RepeatCounts
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.integrity.concern import ConcernKind
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial

SHARE = 0.2
DESIGNS = {
    "yes/no": made.ramp_design(),
    "two intervals": made.ramp_design(Procedure.TWO_INTERVAL),
}


def repeated(trials: list[RampTrial], share: float, rng: np.random.Generator) -> list[RampTrial]:
    """The trials of each person, in some of which the last answer is given again."""
    found: list[RampTrial] = []
    for trial in trials:
        same = found and found[-1].participant_id == trial.participant_id and rng.random() < share
        found.append(dataclasses.replace(trial, response=found[-1].response) if same else trial)
    return found


@functools.cache
def calibrated(task: str, share: float) -> Calibration:
    design: RampDesign = DESIGNS[task]
    rng = np.random.default_rng(8)
    trials = repeated(made.ramps(rng, design, people=14), share, rng)
    return calibrate(made.ramp_data_of(trials, design), RateLimitOptions(model=RateLimitModel.INDIVIDUAL))


def mean_ln_threshold(fitted: Calibration) -> float:
    return float(np.mean([np.log(fit.threshold.threshold) for fit in fitted.thresholds]))


@pytest.mark.parametrize("task", DESIGNS)
def test_the_share_of_repeated_answers_is_found_and_told(task: str) -> None:
    fitted = calibrated(task, SHARE)
    assert fitted.serial is not None
    standard_error = 1 / np.sqrt(fitted.serial.n_trials)  # of a slope on a binary answer, at most about that
    assert abs(fitted.serial.repeat_share - SHARE) < 4 * standard_error
    (concern,) = [own for own in fitted.concerns if own.kind is ConcernKind.SERIAL]
    assert "the last answer is given again" in concern.words
    assert fitted.serial.previous_ramp_p > 0.001  # the answer before tells all that the ramp before does


@pytest.mark.parametrize("task", DESIGNS)
def test_honest_answers_are_left_as_they_are(task: str) -> None:
    fitted = calibrated(task, 0.0)
    assert fitted.serial is not None
    assert fitted.serial.repeat_p > 0.001
    assert not [own for own in fitted.concerns if own.kind is ConcernKind.SERIAL]
    assert all(fit.fit.counts.repeats is None for fit in fitted.thresholds)


@pytest.mark.parametrize("task", DESIGNS)
def test_thresholds_are_those_of_what_is_left(task: str) -> None:
    """The same people without repeats are the truth; a fit that takes repeats for answers lies above it."""
    truth, fitted = (mean_ln_threshold(calibrated(task, share)) for share in (0.0, SHARE))
    taken = fit_thresholds_of(calibrated(task, SHARE).data.trials, judge=False)
    as_answers = float(np.mean([np.log(fit.threshold.threshold) for fit in taken]))
    assert as_answers - truth > 0.1
    assert abs(fitted - truth) < 0.05


def test_either_answer_before_has_a_function_of_its_own() -> None:
    again = RepeatCounts(0.5, np.array([1, 2]), np.array([2, 2]))
    counts = RampCounts(np.array([1.0, 2.0]), np.array([1, 3]), np.array([4, 4]), repeats=again)
    other, same = counts.parts(0.1, 0.02)
    assert [part.tolist() for part in (*other[:2], *same[:2])] == [[0, 1], [2, 2], [1, 2], [2, 2]]
    # P(success) at no rate and at the fastest: half of the answers are the last one again.
    assert [*other[2:]] == pytest.approx([0.05, 0.51])
    assert [*same[2:]] == pytest.approx([0.55, 0.01])
