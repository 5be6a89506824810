"""Claims about planning: what a plan promises is what experiments of that size give."""

from __future__ import annotations

import dataclasses
import math
import time
from collections import Counter

import numpy as np
import pytest
from machine_speed import slowness
from planned_ramps import DESIGN, LEVEL_SD, PARTICIPANT_SD, simulated
from scipy import special

from evenlight.analysis.calibration.psychometric.psychometric_fit import FINE_NODES
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.plan_command import STANDARD_DESIGNS
from evenlight.analysis.plans.ramp_plan import (
    PlanRequest,
    RampPlan,
    _rows,
    _Sessions,
    plan_ramps,
)
from evenlight.analysis.plans.ramp_plan_pool import (
    PLANNING_NODES,
    Experiments,
    first_trials,
    participants_needed,
    pool_of,
    resampling_spread,
    with_trials_per_level,
    work_of,
)
from evenlight.data_schema.analysis_results import RampPlanRow
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import (
    BREAK_TIME,
    INSTRUCTION_TIME,
    Direction,
    Placement,
    RampDesign,
    RampTrial,
    session_minutes,
)
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.simulate_ramp import simulated_trials_and_thresholds
from evenlight.method.preset_files import load_display

pytestmark = pytest.mark.slow


def request(**changes: object) -> PlanRequest:
    small = {"participants": (4, 16), "trials": (15, 60), "pool": 24, "draws": 40}
    return PlanRequest({"made": DESIGN}, load_display("varjo-xr3"), **(small | changes))


@pytest.fixture(scope="module")
def plan() -> RampPlan:
    return plan_ramps(request(), simulated)


def row_of(plan: RampPlan, trials: int, participants: int) -> RampPlanRow:
    return next(
        row for row in plan.rows if (row.trials_per_level, row.participants) == (trials, participants)
    )


def test_the_error_falls_with_the_root_of_the_number_of_participants(plan: RampPlan) -> None:
    # Four times the participants: half the error. An RMS over 40 draws is known to 1/sqrt(80) = 11 %, so
    # their ratio to 16 %; three standard errors about 2 are 1.2 to 3.2.
    for trials in (15, 60):
        ratio = np.log1p(row_of(plan, trials, 4).error) / np.log1p(row_of(plan, trials, 16).error)
        assert 1.2 < ratio < 3.2


def test_the_band_of_few_participants_is_wider_than_the_root_says(plan: RampPlan) -> None:
    """Student's t: 3.18 with four participants, 2.13 with sixteen."""
    ratio = np.log1p(row_of(plan, 60, 4).half_width) / np.log1p(row_of(plan, 60, 16).half_width)
    assert ratio == pytest.approx(2 * 3.182 / 2.131, rel=0.25)


def test_the_error_is_what_participants_and_levels_scatter_by(plan: RampPlan) -> None:
    """With many trials only people are left: σ² = 0.25² + (their own levels, of which five coefficients of
    a quartic through five levels keep all) 0.1² + the trials' 0.1² or so, by 16 participants."""
    row = row_of(plan, 60, 16)
    expected = math.sqrt((PARTICIPANT_SD**2 + LEVEL_SD**2 + row.threshold_error_ln**2) / 16)
    assert np.log1p(row.error) == pytest.approx(expected, rel=0.35)  # the pool's SD is known to 15 %


def test_a_threshold_is_known_better_by_the_root_of_the_number_of_trials(plan: RampPlan) -> None:
    # Four times the trials: half the error, a little less since the prior helps where trials are few.
    ratio = row_of(plan, 15, 4).threshold_error_ln / row_of(plan, 60, 4).threshold_error_ln
    assert 1.3 < ratio < 2.3


def test_the_bands_hold_the_truth_as_often_as_they_say(plan: RampPlan) -> None:
    # 80 draws per row, whose levels go together: 95 % is known to 2.4 %, and the pool's own scatter adds.
    assert all(row.coverage >= 0.85 for row in plan.rows)


def test_participants_needed_are_enough_and_one_less_is_not() -> None:
    for spread, precision in ((0.3, 0.1), (0.5, 0.05), (0.2, 0.4)):
        n = participants_needed(spread, precision)
        assert n is not None
        half = [special.stdtrit(k - 1, 0.975) * spread / k**0.5 for k in (n - 1, n)]
        assert half[1] <= math.log1p(precision) < half[0]
    assert participants_needed(10.0, 0.01) is None


def test_the_same_seed_gives_the_same_plan_in_any_order_of_the_work() -> None:
    small = request(participants=(3,), trials=(15,), pool=6, draws=4)
    assert plan_ramps(small, simulated).rows == plan_ramps(small, simulated).rows


def test_a_shorter_session_is_the_beginning_of_a_longer_one() -> None:
    design = with_trials_per_level(DESIGN, 60)
    trials = simulated(design, load_display("varjo-xr3"), 1, seed=2)[0]
    short, long = first_trials(trials, 10), first_trials(trials, 30)
    counts = Counter(trial.factor for trial in short if not trial.is_catch)
    assert set(counts.values()) == {10}
    assert len(counts) == 5
    assert {trial.trial_index for trial in short} <= {trial.trial_index for trial in long}
    assert sum(trial.is_catch for trial in short) == round(10 / 60 * sum(t.is_catch for t in trials))
    assert first_trials(trials, 60) == trials


def test_a_session_lasts_as_long_as_its_parts_together() -> None:
    design = dataclasses.replace(DESIGN, trials_between_breaks=40, practice_trials=5)
    trials = first_trials(
        simulated(with_trials_per_level(DESIGN, 15), load_display("varjo-xr3"), 1, 1)[0], 15
    )
    # 75 ramps and 20 catch trials (a quarter of 15 ramps is 4 a level) of 1 + 5 + 1 + 1.5 + 1 = 9.5 s, five
    # of practice, two breaks between 95 trials in parts of 40, and the instructions.
    assert len(trials) == 95
    seconds = 100 * 9.5 + 2 * BREAK_TIME + INSTRUCTION_TIME
    assert session_minutes(design, len(trials)) == pytest.approx(seconds / 60)


def test_adaptive_designs_are_lengthened_by_their_trials_per_level() -> None:
    design = RampDesign(placement=Placement.TARGETED, relative_rates=(0.01, 0.1))
    assert with_trials_per_level(design, 70).trials_per_level == 70


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"precision": 0.0}, "precision must lie above 0 and not above 2, got 0"),
        ({"precision": -0.1}, "precision must lie above 0"),
        ({"participants": (1, 5)}, "participants must be numbers from 2 to 1000, got 1,5"),
        ({"participants": ()}, "participants must be numbers from 2 to 1000, got none"),
        ({"trials": (2,)}, "trials must be numbers from 4 to 2000, got 2"),
        ({"seed": -1}, "seed must be 0 or more"),
    ],
)
def test_what_cannot_be_planned_is_refused_by_its_option(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        request(**changes)


@pytest.mark.parametrize(
    ("design", "words"),
    [
        (
            dataclasses.replace(DESIGN, factors=(0.5, 1.0)),
            "degree 4 needs 5 or more levels, the design has 2",
        ),
        (
            dataclasses.replace(DESIGN, directions=(Direction.DOWN, Direction.UP)),
            "one direction and one duration",
        ),
        (dataclasses.replace(DESIGN, ramp_durations=(5.0, 10.0)), "one direction and one duration"),
    ],
)
def test_designs_without_a_curve_to_plan_for_are_refused_before_anybody_is_simulated(
    design: RampDesign, words: str
) -> None:
    def nobody(*_: object) -> tuple[list[RampTrial], dict[tuple[str, float], float]]:
        raise AssertionError("somebody was simulated")

    with pytest.raises(InputError, match=words):
        plan_ramps(dataclasses.replace(request(), designs={"bad": design}), nobody)


def test_the_interval_of_the_participants_needed_is_that_of_other_pools(plan: RampPlan) -> None:
    """ln of the standard error scatters by 1/sqrt(2 · 23) = 15 % between pools of 24 people, of whom it is
    the standard deviation; less as far as their trials make it, and known from 40 draws to 11 % of itself."""
    for row in plan.rows:
        low, high = row.participants_needed_low, row.participants_needed_high
        assert low is not None
        assert high is not None
        assert row.participants_needed is not None
        assert low < row.participants_needed < high
        # The number goes with the square of the standard error: ln(high / low) = 4 · 1.96 SD.
        assert 0.05 < math.log(high / low) / (4 * 1.96) < 0.25


def test_a_pool_of_equals_leaves_no_doubt_and_one_of_unequals_does() -> None:
    half_widths = np.full((8, 5), 0.1)
    assert resampling_spread(Experiments(half_widths, half_widths, 10)) == pytest.approx(0.0, abs=1e-12)
    # Draws whose bands are e times as wide as the others', half and half: SD of {0, 1} is sqrt(8/7) / 2.
    half_widths[:4] *= np.e
    spread = resampling_spread(Experiments(half_widths, half_widths, 10))
    assert spread == pytest.approx(math.sqrt(8 / 7) / 2)


def test_the_monte_carlo_error_is_that_of_another_pool_and_other_draws(plan: RampPlan) -> None:
    """The SD of 24 people is known to 1/sqrt(46) = 15 %; 16 of them, drawn 40 times, add 1/sqrt(30) /
    sqrt(40) = 3 %, and 4 of them 1/sqrt(6) / sqrt(40) = 6 %. Less as far as trials make the band."""
    for row in plan.rows:
        assert 0.05 < row.half_width_mc_error < 0.25
    few, many = row_of(plan, 60, 4), row_of(plan, 60, 16)
    assert few.half_width_mc_error > many.half_width_mc_error


def test_planning_fits_on_a_coarser_grid_give_the_thresholds_of_the_fit() -> None:
    trials = simulated(DESIGN, load_display("varjo-xr3"), 3, seed=4)[0]
    fine, coarse = (
        [fit.threshold for fit in fit_thresholds_of(trials, judge=False, fine=nodes)]
        for nodes in (FINE_NODES, PLANNING_NODES)
    )
    for exact, quick in zip(fine, coarse, strict=True):
        off = math.log(quick.threshold / exact.threshold) / exact.standard_error_ln
        assert abs(off) < 0.05
        assert quick.standard_error_ln == pytest.approx(exact.standard_error_ln, rel=0.05)


@pytest.mark.real_time
def test_the_usual_plan_takes_less_than_a_minute_on_two_cores() -> None:
    """A part of each kind, timed, of a yes/no design and one of two intervals; there are two of each.

    45 s leave room; they are those of a machine without other work.
    """
    display = load_display("varjo-xr3")
    designs = {name: load_design(name) for name in ("paper", "recommended")}
    usual = PlanRequest(designs, display, seed=1)
    seconds, members = 0.0, []
    for design in designs.values():
        works = work_of(design, display, usual.trials, usual.pool, usual.seed)
        before, begun = slowness(), time.process_time()
        members = pool_of(works[0], simulated_trials_and_thresholds)
        seconds += 2 * len(works) * (time.process_time() - begun) / ((before + slowness()) / 2)
    pool = members * (usual.pool // len(members))
    before, begun = slowness(), time.process_time()
    _rows(_Sessions(usual, "recommended", 40, pool))
    taken = (time.process_time() - begun) / ((before + slowness()) / 2)
    seconds += len(STANDARD_DESIGNS) * len(usual.trials) * taken
    assert seconds / 2 < 45
