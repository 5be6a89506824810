"""One screen and factor under several calibrations of a display: one level of the population, or several."""

import dataclasses

import pytest

from evenlight.analysis.calibration.level_estimates import estimate_levels, fit_pooled
from evenlight.analysis.calibration.psychometric.psychometric_figure import by_level
from evenlight.analysis.calibration.psychometric.ramp_counts import RampLevelKey, joined_levels
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.data_schema.display import Display
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.data_schema.recordings.ramp import Direction, RampDesign
from evenlight.experiments.ramp.simulate_ramp import simulated_trials_and_thresholds

BEFORE = Display("desk", 100.0, 0.0, 2.2, 38.0)
AFTER = Display("desk", 96.0, 0.0, 2.2, 38.0)
DESIGN = RampDesign(screens=("white",), factors=(0.25, 1.0))


def test_luminances_within_five_percent_are_one_level_at_their_geometric_mean() -> None:
    levels = [RampLevelKey("white", 1.0, luminance) for luminance in (100.0, 104.0, 110.0)]
    joined = [joined_levels(levels)[level].luminance for level in levels]
    assert joined == pytest.approx([10400**0.5, 10400**0.5, 110.0])
    assert joined[2] == 110.0  # alone it stays as it is, to the last digit


def test_a_slow_drift_does_not_run_into_one_level() -> None:
    """100, 104 and 108: the last is within 5 % of the middle one, not of the first."""
    levels = [RampLevelKey("white", 1.0, luminance) for luminance in (100.0, 104.0, 108.0)]
    assert joined_levels(levels)[levels[2]].luminance == 108.0


def test_levels_of_another_screen_or_factor_stay_apart() -> None:
    first = RampLevelKey("white", 1.0, 100.0)
    levels = [
        first,
        *(
            dataclasses.replace(first, **own, luminance=98.0)
            for own in ({"screen": "gray"}, {"factor": 0.96})
        ),
    ]
    assert joined_levels(levels) == {level: level for level in levels}


def test_conditions_under_two_calibrations_have_one_luminance_but_stay_two_levels() -> None:
    first = RampLevelKey("white", 1.0, 100.0)
    other = dataclasses.replace(first, direction=Direction.UP, ramp_duration=2.0, luminance=96.04)
    joined = joined_levels([first, other])
    assert [level.luminance for level in joined.values()] == pytest.approx([98.0, 98.0])
    assert joined[first] != joined[other]


def test_a_participant_under_both_calibrations_has_two_thresholds_and_counts_once() -> None:
    trials, _ = simulated_trials_and_thresholds(DESIGN, BEFORE, 2, seed=3)
    again, _ = simulated_trials_and_thresholds(DESIGN, AFTER, 1, seed=4)
    trials += [dataclasses.replace(trial, session_id="02") for trial in again]
    fits = fit_thresholds_of(trials)
    own = [(f.threshold.participant_id, f.threshold.luminance) for f in fits if f.threshold.factor == 1]
    assert sorted(own) == [("01", 96.0), ("01", 100.0), ("02", 100.0)]
    bright, dark = estimate_levels(fits)
    assert (bright.n_participants, dark.n_participants) == (2, 2)
    assert bright.random is not None
    assert bright.random.n_participants == 2
    # White at full brightness: sqrt(100 x 96); at a quarter sqrt(25 x 24).
    panels = sorted((level.luminance, len(group)) for level, group in by_level(fits).items())
    assert [panel[0] for panel in panels] == pytest.approx([600**0.5, 9600**0.5])
    assert [panel[1] for panel in panels] == [3, 3]
    line = RateLimitOptions(form=RateLimitForm.LOG_LOG, degree=1)
    assert sorted(fit_pooled(trials, AFTER, line).limit.point_luminance) == pytest.approx(
        [600**0.5, 9600**0.5]
    )
