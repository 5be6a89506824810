"""Claims about planning calibrations: what a plan promises is what experiments of that size give."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from machine_speed import slowness
from planned_ramps import DESIGN, LEVEL_SD, PARTICIPANT_SD, simulated
from scipy import special

from evenlight.analysis.calibration.psychometric.psychometric_fit import FINE_NODES
from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_thresholds
from evenlight.analysis.plans import ramp_plan
from evenlight.analysis.plans.plan import Plan, people_in_words
from evenlight.analysis.plans.questions import RampQuestion, whole_numbers
from evenlight.analysis.plans.ramp_plan import (
    PLANNING_NODES,
    SHAPE,
    first_trials,
    joined,
    limits_of,
    participants_needed,
    plan_ramps,
    rows_of,
    sessions_of,
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
    session_minutes,
)
from evenlight.data_schema.threshold import ThresholdFlag
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.simulate_ramp import simulated_trials_and_thresholds
from evenlight.method.preset_files import load_display

DESIGNS = {"made": DESIGN}


def question(**changes: object) -> RampQuestion:
    return RampQuestion(**({"design": ("made",), "trials": "15,60"} | changes))


@pytest.fixture(autouse=True, scope="module")
def quick_observers() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ramp_plan, "simulated_trials_and_thresholds", simulated)
        patch.setattr(ramp_plan, "load_design", lambda name: DESIGNS.get(name) or load_design(name))
        yield


@pytest.fixture(scope="module")
def plan(quick_observers: None) -> Plan:
    return plan_ramps(question(), (4, 16))


def row_of(plan: Plan, trials: int, participants: int) -> RampPlanRow:
    return next(
        row for row in plan.rows if (row.trials_per_level, row.participants) == (trials, participants)
    )


def test_the_error_falls_with_the_root_of_the_number_of_participants(plan: Plan) -> None:
    # Four times the participants: half the error. An RMS over 400 draws is known to 1/sqrt(800) =
    # 3.5 %, so their ratio to 5 %; three standard errors about 2 are 1.7 to 2.3.
    for trials in (15, 60):
        ratio = np.log1p(row_of(plan, trials, 4).error) / np.log1p(row_of(plan, trials, 16).error)
        assert 1.7 < ratio < 2.35


def test_the_band_of_few_participants_is_wider_than_the_root_says(plan: Plan) -> None:
    """Student's t: 3.18 with four participants, 2.13 with sixteen."""
    ratio = np.log1p(row_of(plan, 60, 4).half_width) / np.log1p(row_of(plan, 60, 16).half_width)
    assert ratio == pytest.approx(2 * 3.182 / 2.131, rel=0.25)


def test_the_error_is_what_participants_and_levels_scatter_by(plan: Plan) -> None:
    """With many trials only people are left: σ² = 0.25² + (their own levels, of which five coefficients of
    a quartic through five levels keep all) 0.1² + the trials' 0.1² or so, by 16 participants."""
    row = row_of(plan, 60, 16)
    expected = math.sqrt((PARTICIPANT_SD**2 + LEVEL_SD**2 + row.threshold_error_ln**2) / 16)
    assert np.log1p(row.error) == pytest.approx(expected, rel=0.35)  # the pool's SD is known to 15 %


def test_a_threshold_is_known_better_by_the_root_of_the_number_of_trials(plan: Plan) -> None:
    # Four times the trials: half the error, a little less since the prior helps where trials are few.
    ratio = row_of(plan, 15, 4).threshold_error_ln / row_of(plan, 60, 4).threshold_error_ln
    assert 1.3 < ratio < 2.3


def test_the_bands_hold_the_truth_as_often_as_they_say(plan: Plan) -> None:
    # 400 draws per row, whose levels go together: 95 % is known to 1.1 %, and the pool's own scatter adds.
    assert all(row.coverage >= 0.85 for row in plan.rows)


def test_participants_needed_are_enough_and_one_less_is_not() -> None:
    for spread, precision in ((0.3, 0.1), (0.5, 0.05), (0.2, 0.4)):
        n = participants_needed(spread, precision)
        assert n is not None
        half = [special.stdtrit(k - 1, 0.975) * spread / k**0.5 for k in (n - 1, n)]
        assert half[1] <= math.log1p(precision) < half[0]
    assert participants_needed(10.0, 0.01) is None


def test_the_same_seed_gives_the_same_plan() -> None:
    small = question(trials="15")
    assert plan_ramps(small, (3,), pool=6).rows == plan_ramps(small, (3,), pool=6).rows


def test_the_closed_form_is_the_mixed_model_of_thresholds_that_are_equally_well_known() -> None:
    """Standard errors of nought leave the scatter to the model: it is REML then, of balanced data."""
    display, rng = load_display("varjo-xr3"), np.random.default_rng(3)
    trials = simulated(with_trials_per_level(DESIGN, 15), display, 6, seed=4)[0]
    fits = [fit.threshold for fit in fit_thresholds_of(trials, judge=False)]
    luminance = np.unique([t.luminance for t in fits])
    own = 0.4 * rng.standard_normal((6, 1)) + 0.1 * rng.standard_normal((6, luminance.size))
    ln_rate = np.log(0.03 * luminance) + own
    alike = [
        dataclasses.replace(t, threshold=float(np.exp(ln_rate[int(t.participant_id) - 1, k])), ci_low=1e-9,
                            ci_high=1e9, standard_error_ln=1e-6, flag=ThresholdFlag.NONE)
        for t in fits
        for k in np.flatnonzero(luminance == t.luminance)
    ]  # fmt: skip
    limit = fit_thresholds(alike, display, SHAPE).limit
    band = np.log(
        [np.interp(luminance, limit.band_luminance, edge) for edge in (limit.band_lower, limit.band_upper)]
    )
    curve, error = limits_of(luminance, ln_rate)
    half = special.stdtrit(5, 0.975) * error
    # The band is interpolated between 97 luminances.
    np.testing.assert_allclose(band, [curve - half, curve + half], atol=2e-3)


def test_who_has_no_threshold_is_left_out_and_a_missing_one_is_as_the_persons_others() -> None:
    part = sessions_of(work_of(question(), DESIGN, 3, 1)[0])[0]
    ln_rate = np.log([[1.0, 2.0, 4.0, 8.0, 16.0]] * 3) + np.array([[0.0], [0.2], [0.4]])
    ln_rate[0], ln_rate[2, 3] = np.nan, np.nan
    filled = joined([dataclasses.replace(part, ln_rate=ln_rate)]).ln_rate
    # Of two people the first alone has the fourth level; the second has 0.1 more than the mean at the others.
    np.testing.assert_allclose(filled[1, 3], np.log(8.0) + 0.2 + 0.1 * 4 / 4, atol=1e-12)
    assert len(filled) == 2


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
        ({"precision": 0.0}, "precision must be above 0, got 0"),
        ({"precision": 2.1}, "precision must be at most 2, got 2.1"),
    ],
)
def test_what_cannot_be_planned_is_refused_by_its_option(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        question(**changes)


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
    design: RampDesign, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(DESIGNS, "bad", design)
    with pytest.raises(InputError, match=words):
        plan_ramps(question(design=("made", "bad")), (4,), mapped=lambda *_: pytest.fail("simulated"))


def test_the_interval_of_the_participants_needed_is_that_of_other_pools(plan: Plan) -> None:
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


def test_a_pool_of_equals_leaves_no_doubt_of_the_participants_needed() -> None:
    part = sessions_of(work_of(question(), DESIGN, 4, 1)[0])[0]
    # Pairs of levels that scatter alike in every draw: the chance of who is drawn is left, and no more.
    two = np.log([[1.0, 2.0, 4.0, 8.0, 16.0]] * 4) + np.array([[-0.1], [0.1], [-0.1], [0.1]])
    (row,) = rows_of(
        dataclasses.replace(part, ln_rate=two), (200,), 0.1, 1,
        design="made", procedure="yes_no", placement="constant", trials_per_level=15,
    )  # fmt: skip
    # People alone: an SD of 0.1 sqrt(4/3) gives t · 0.115 / sqrt(200) = 0.0161.
    assert math.log1p(row.half_width) == pytest.approx(1.972 * 0.1 * math.sqrt(4 / 3 / 200), rel=0.02)


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
def test_the_usual_plan_takes_less_than_a_minute_of_a_core() -> None:
    """A part of each kind, timed, of a yes/no design and one of two intervals; there are two of each."""
    designs = {name: load_design(name) for name in ("paper", "recommended")}
    usual = RampQuestion()
    seconds = 0.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ramp_plan, "simulated_trials_and_thresholds", simulated_trials_and_thresholds)
        for design in designs.values():
            works = work_of(usual, design, RampQuestion.efforts["default"], 1)
            before, begun = slowness(), time.process_time()
            sessions_of(works[0])
            seconds += 2 * len(works) * (time.process_time() - begun) / ((before + slowness()) / 2)
    assert seconds < 60


def test_the_files_say_that_they_are_simulated_and_hold_every_row(plan: Plan, tmp_path: Path) -> None:
    plan.save(tmp_path)
    assert (tmp_path / "SHA256SUMS").read_text().startswith("# evenlight plan: ")
    with (tmp_path / "plan.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(plan.rows) == 4
    content = json.loads((tmp_path / "plan.json").read_text())
    assert next(iter(content)) == "in_words"
    assert content["in_words"] == list(plan.answer)
    assert content["simulated"] is True
    assert content["rows"][0]["half_width"] == float(rows[0]["half_width"])
    assert content["provenance"]["seed"] == 1
    assert content["effort"] == "default"
    assert "24 simulated participants" in content["monte_carlo_error"]
    assert "faster than the joint model" in content["model"]
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"
    assert plan.to_frame()["participants"].tolist() == [row.participants for row in plan.rows]


def planned(rows: Iterable[RampPlanRow], designs: dict[str, RampDesign] = DESIGNS, **changes: object) -> Plan:
    """A plan of given rows."""
    return ramp_plan._plan(question(design=tuple(designs), **changes), designs, tuple(rows), 24, 1)


def test_people_needed_are_told_with_their_interval(plan: Plan) -> None:
    row = dataclasses.replace(
        plan.rows[0], participants_needed=33, participants_needed_low=26, participants_needed_high=40
    )
    assert people_in_words(row) == "33 (26 to 40)"
    far = dataclasses.replace(row, participants_needed=None, participants_needed_high=None)
    assert people_in_words(far) == "above 1000 (26 to above 1000)"
    assert people_in_words(dataclasses.replace(far, participants_needed_low=None)) == "above 1000"


def test_the_closing_words_name_the_cheapest_row_that_is_precise_enough(plan: Plan) -> None:
    loose = planned((dataclasses.replace(row, meets=True) for row in plan.rows), precision=2.0)
    cheapest = min(plan.rows, key=lambda row: row.total_hours)
    (words,) = loose.answer
    assert words.startswith(f"{cheapest.participants} participants x {cheapest.trials_per_level} trials")
    assert words.endswith(f"; 200 % takes {people_in_words(cheapest)} participants")
    none = planned(dataclasses.replace(row, meets=False) for row in plan.rows)
    assert "no number tried gives ΔL(L) to 10 %" in none.answer[0]
    beyond = [dataclasses.replace(row, meets=False, hours_needed=None) for row in plan.rows]
    assert planned(beyond).answer == ("yes_no: nothing tried comes near 10 %",)


def test_the_answer_is_the_recommended_design_as_the_guides_run_it(plan: Plan) -> None:
    """In these rows it needs 33 people with the 30 trials per level of its file, and fewer with 60."""
    design = load_design("recommended")
    assert design.trials_per_level in RampQuestion().trial_numbers
    rows = [
        dataclasses.replace(
            row, design="recommended", trials_per_level=trials, minutes=100.4, participants_needed=needed,
            participants_needed_low=needed - 7, participants_needed_high=needed + 7,
        )
        for row in plan.rows
        for trials, needed in ((60, 23), (30, 33))
    ]  # fmt: skip
    answer, *others = planned(rows, {"recommended": design}, trials="30,60").answer
    assert answer == (
        "recommended: 33 (26 to 40) participants for ΔL(L) to 10 %, each with `evenlight run ramp --design "
        "recommended` (30 trials per level, 100 min)"
    )
    other = dataclasses.replace(design, trials_per_level=31)  # not tried: no such row
    assert others == list(planned(rows, {"recommended": other}).answer)


def test_two_tasks_are_not_set_off_against_each_other(plan: Plan) -> None:
    two = [dataclasses.replace(row, procedure="two_interval") for row in plan.rows]
    words = planned([*plan.rows, *two]).answer
    assert len(words) == 3
    assert words[-1].startswith("yes/no and two intervals measure different thresholds")


def test_the_figure_draws_the_bands_and_what_is_needed(plan: Plan) -> None:
    _, upper, left, right = plan.plot("plan").axes
    drawn = {round(float(y), 9) for y in upper.lines[0].get_ydata()}
    assert drawn == {round(100 * row.half_width, 9) for row in plan.rows if row.trials_per_level == 60}
    assert upper.lines[-1].get_ydata()[0] == 10
    assert set(left.lines[0].get_ydata()) == {row.participants_needed for row in plan.rows}
    hours = sorted({row.hours_needed for row in plan.rows})
    assert sorted(right.lines[0].get_ydata()) == pytest.approx(hours)


@pytest.mark.parametrize("text", ["", "five", "5;10", "5,,10", "5.5"])
def test_numbers_that_are_none_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError, match="--trials takes whole numbers"):
        whole_numbers(text, "--trials", (4, 2000))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["ramp", "--quick", "--thorough"], "--quick and --thorough cannot be had together"),
        (["rating", "--thorough"], "--thorough goes with ramp and search, not with rating"),
        (["ramp", "--design", "papper"], "papper"),
        (["ramp", "--trials", "2"], "--trials takes numbers from 4 to 2000, got 2"),
        (["ramp", "--seed", "-1"], "seed must be 0 or more"),
        (["reading"], "task 'reading' cannot be planned; there is 'ramp', 'rating'"),
    ],
)
def test_what_cannot_be_planned_is_refused(command, tmp_path: Path, words: list[str], message: str) -> None:
    result = command("plan", *words, "--out", tmp_path / "out")
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert message in result.err
    assert not (tmp_path / "out").exists()


def test_the_command_plans_a_preset_with_processes_of_its_own(command, tmp_path: Path) -> None:
    result = command(
        "plan", "ramp", "--quick", "--design", "yes_no_targeted", "--trials", "6", "--participants", "2,4",
        "--precision", "0.5", "--out", tmp_path,
    )  # fmt: skip
    assert result.code == 0, result.err
    assert result.err == ""
    assert "yes_no_targeted" in result.out
    assert "simulated participants" in result.out
    content = json.loads((tmp_path / "plan.json").read_text())
    assert content["effort"] == "quick"
    assert result.out.splitlines()[-len(content["in_words"]) :] == content["in_words"]  # the answer, last
    assert content["monte_carlo_error"] in result.out
    assert len((tmp_path / "plan.csv").read_text().splitlines()) == 3
