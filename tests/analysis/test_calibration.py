"""The calibration: one task, everybody's consistency, three estimates of each level."""

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_ramps import answer_of, ramp_of

from evenlight.analysis.calibration.calibration import Calibration, calibrate, trials_of_one_task
from evenlight.analysis.calibration.fit_report import summary_of
from evenlight.analysis.calibration.level_estimates import difference_in_words, estimate_levels
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.ramp_loading import RampData
from evenlight.analysis.session_loading import Session
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.threshold import ThresholdFlag
from evenlight.method.psychometric import PsychometricFunction, yes_probability

DISPLAY = Display("bench", 104.4, 0.2, 1.95, 72.28)
RELATIVE = np.array([0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12])
LEVELS = tuple(10.0 * k for k in range(1, 11))
LINE = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1)


def session(
    who: str,
    rng: np.random.Generator,
    levels: tuple[float, ...] = LEVELS,
    two: bool = False,
    sensitivity: float = 1.0,
    ln_drift: float = 0.0,
    duration: float = 5.0,
) -> list[RampTrial]:
    """A session in a random order: six ramps per rate and, in yes/no, one catch trial in five."""
    rates = [(L, r) for L in levels for r in RELATIVE for _ in range(6)]
    rates += [] if two else [(L, 0.0) for L in levels for _ in range(12)]
    trials = []
    for index, place in enumerate(rng.permutation(len(rates))):
        L, relative = rates[place]
        own = 0.031 * L * sensitivity * math.exp(ln_drift * (index / len(rates) - 0.5))
        function = PsychometricFunction(own, 1.6, 0.5 if two else 0.05, 0.02)
        success = rng.random() < float(yes_probability(relative * L, function))
        ramp = int(rng.integers(1, 3)) if two else None
        task = Procedure.TWO_INTERVAL if two else Procedure.YES_NO
        trials.append(
            ramp_of(
                L, relative * L, participant_id=who, trial_index=index, duration=duration, procedure=task,
                ramp_interval=ramp, response=answer_of(task, success, ramp),
            )
        )  # fmt: skip
    return trials


def data(trials: list[RampTrial]) -> RampData:
    """The trials as if they had been read."""
    sessions = []
    for who, own in itertools.groupby(trials, key=lambda trial: trial.participant_id):
        manifest = SessionManifest(
            who, "01", "ramp", True, SessionStatus.COMPLETE, 0, DISPLAY, RampDesign(), Provenance()
        )
        sessions.append(Session(Path(), manifest, tuple(own)))
    return RampData("ramp", tuple(sessions), True, "0" * 64, (), display=DISPLAY)


def people(n: int, rng: np.random.Generator, **options: Any) -> list[RampTrial]:
    return [
        trial
        for k in range(n)
        for trial in session(f"{k:02d}", rng, sensitivity=math.exp(0.3 * rng.standard_normal()), **options)
    ]


@pytest.fixture(scope="module")
def six() -> list[RampTrial]:
    return people(6, np.random.default_rng(1), levels=LEVELS[:4])


@pytest.fixture(scope="module")
def calibration(six: list[RampTrial]) -> Calibration:
    return calibrate(data(six), LINE)


def test_each_level_has_three_estimates_and_the_pooled_one_is_the_highest(calibration: Calibration) -> None:
    assert all(fit.goodness is not None for fit in calibration.thresholds)
    assert [level.level.luminance for level in calibration.levels] == [40.0, 30.0, 20.0, 10.0]
    for level in calibration.levels:
        assert level.n_participants == 6
        assert level.random is not None
        assert level.mean_ratio == pytest.approx(1.0, abs=0.1)
        assert "the pooled fit lies" in level.in_words
    ratios = [level.pooled_ratio for level in calibration.levels if level.pooled_ratio]
    assert np.mean(ratios) > 1.03
    words = difference_in_words(calibration.levels)
    assert words is not None
    assert words.startswith("on average over 4 levels, the pooled fit lies ")


def test_the_summary_holds_what_a_report_needs_and_is_plain_json(calibration: Calibration) -> None:
    assert repr(calibration) == "<Calibration of 6 participants: 24 thresholds, yes_no>"
    summary = json.loads(json.dumps(summary_of(calibration, Provenance())))
    assert len(summary["levels"]) == 4
    entry = summary["levels"][0]
    assert entry["random_threshold"]["ci_low_cd_m2_s"] < entry["random_threshold"]["threshold_cd_m2_s"]
    assert entry["direction"] == "down"
    assert summary["condition_effects"] == []
    assert summary["reference"] == {"direction": "down", "ramp_duration_s": 5.0}
    assert summary["procedure"] == "yes_no"
    assert set(summary["participants"]) == {f"{k:02d}" for k in range(6)}


def test_a_participant_who_tires_is_named_with_the_drift() -> None:
    rng = np.random.default_rng(2)
    trials = session("01", rng, LEVELS[:5], ln_drift=math.log(3.0)) + session("02", rng, LEVELS[:5])
    calibration = calibrate(data(trials), LINE)
    drifts = [words for words in calibration.warnings if "at the end of the trials are" in words]
    assert len(drifts) == 1
    assert drifts[0].startswith("participant 01: thresholds at the end of the trials are")
    ratio = calibration.participants["01"].drift_ratio
    assert ratio is not None
    assert 2.0 < ratio < 5.0


def test_durations_are_compared_in_one_fit() -> None:
    # A limit on the rate alone: ten seconds make no difference, and the interval says so.
    rng = np.random.default_rng(3)
    trials = []
    for k in range(5):
        own = math.exp(0.3 * rng.standard_normal())
        trials += session(f"{k:02d}", rng, LEVELS[:3], sensitivity=own)
        later = session(f"{k:02d}", rng, LEVELS[:3], sensitivity=own, duration=8.0)
        trials += later
    fit = calibrate(data(trials), LINE).rate_limit
    assert len(fit.effects) == 1
    assert fit.effects[0].ci_low < 1.0 < fit.effects[0].ci_high


def test_two_tasks_are_fitted_apart(six: list[RampTrial]) -> None:
    two = people(2, np.random.default_rng(4), levels=LEVELS[:3], two=True)
    with pytest.raises(
        InputError, match=r"trials of two_interval and yes_no.*choose the procedure two_interval or"
    ):
        trials_of_one_task(six + two, None)
    chosen, task = trials_of_one_task(six + two, Procedure.TWO_INTERVAL)
    assert (len(chosen), task) == (len(two), Procedure.TWO_INTERVAL)
    with pytest.raises(InputError, match="holds no trials of two_interval; it holds yes_no"):
        trials_of_one_task(six, Procedure.TWO_INTERVAL)


def test_two_intervals_have_biases_and_no_warning_of_missing_catch_trials() -> None:
    trials = people(3, np.random.default_rng(5), levels=LEVELS[:3], two=True)
    calibration = calibrate(data(trials), LINE)
    assert set(calibration.interval_biases) == {"00", "01", "02"}
    assert calibration.criteria == {}
    assert not any("catch" in words for words in calibration.warnings)


def test_who_says_yes_to_nothing_is_kept_out_of_the_random_threshold(six: list[RampTrial]) -> None:
    eager = [
        trial
        for trial in session("99", np.random.default_rng(6), LEVELS[:4])
        if not trial.is_catch or trial.response is Response.YES
    ]
    fits = fit_thresholds_of(six + eager, judge=False)
    assert all(
        fit.threshold.flag is ThresholdFlag.FALSE_ALARMS
        for fit in fits
        if fit.threshold.participant_id == "99"
    )
    for level in estimate_levels(fits):
        assert level.random is not None
        assert level.random.n_participants == 6
        assert level.n_participants == 7
