"""Drift within sessions: estimated over all participants, and told with what it does to the limit."""

from __future__ import annotations

import dataclasses
import functools

import clean_answers as made
import numpy as np
import pytest

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.psychometric.session_drift import session_drift
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.integrity.concern import ConcernKind
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure

DRIFT = float(np.log(2.0))
DESIGNS = {"yes/no": made.ramp_design(), "two intervals": made.ramp_design(Procedure.TWO_INTERVAL)}


@functools.cache
def calibrated(task: str, drift: float) -> Calibration:
    design = DESIGNS[task]
    trials = made.ramps(np.random.default_rng(5), design, people=16, drift=drift)
    return calibrate(made.ramp_data_of(trials, design), RateLimitOptions(model=RateLimitModel.INDIVIDUAL))


@pytest.mark.parametrize("task", DESIGNS)
def test_a_doubling_is_estimated_and_told_with_its_effect(task: str) -> None:
    fitted = calibrated(task, DRIFT)
    assert fitted.drift is not None
    assert fitted.drift.ci_low < 2.0 < fitted.drift.ci_high < 3.5
    told = [own.words for own in fitted.concerns if own.kind is ConcernKind.HALVES]
    (words,) = [own for own in told if own.startswith("from a session's first ramp to its last")]
    lower = 100 * (1 - fitted.drift.ratio**-0.5)  # half of the way up lies the middle, which is the limit's
    assert words.endswith(f"the limit is that of the middle, and {lower:.0f} % lower at the beginning")


@pytest.mark.parametrize("task", DESIGNS)
def test_who_stays_as_they_are_is_told_nothing(task: str) -> None:
    fitted = calibrated(task, 0.0)
    assert fitted.drift is not None
    assert fitted.drift.p > 0.001
    assert fitted.drift.ci_low < 1 < fitted.drift.ci_high
    assert not any("first ramp to its last" in own.words for own in fitted.concerns)


def test_two_sessions_that_each_rise_are_not_one_that_does() -> None:
    """Over both together the rise is half as steep, and drawn back in the middle."""
    design = DESIGNS["yes/no"]
    rng = np.random.default_rng(7)
    visits = [
        [dataclasses.replace(trial, session_id=f"0{visit}") for trial in made.ramps(rng, design, 10, DRIFT)]
        for visit in (1, 2)
    ]
    trials = visits[0] + visits[1]
    found = session_drift(trials, fit_thresholds_of(trials, judge=False))
    assert found is not None
    assert found.ci_low < 2.0 < found.ci_high
    assert found.p < 0.001


def test_drifts_that_differ_between_people_widen_the_interval() -> None:
    design = DESIGNS["yes/no"]
    rng = np.random.default_rng(8)
    trials = []
    for who, drift in enumerate([1.2, -1.2] * 6):
        own = made.ramps(rng, design, people=1, drift=drift)
        trials += [dataclasses.replace(trial, participant_id=f"{who:02d}") for trial in own]
    differing = session_drift(trials, fit_thresholds_of(trials, judge=False))
    alike = calibrated("yes/no", 0.0).drift
    assert differing is not None
    assert alike is not None
    width, usual = (np.log(own.ci_high / own.ci_low) for own in (differing, alike))
    assert width > 2 * usual
    assert differing.p > 0.05


@pytest.mark.parametrize("people", [1, 2])
def test_where_an_interval_would_reach_beyond_a_factor_of_twenty_nothing_is_told(people: int) -> None:
    trials = made.ramps(np.random.default_rng(3), DESIGNS["yes/no"], people)[
        ::40
    ]  # a ramp or two of each level
    assert session_drift(trials, fit_thresholds_of(trials, judge=False)) is None
