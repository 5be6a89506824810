"""The gate: each thing that can be wrong with trials is found where it is, and not where nothing is wrong."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import clean_answers as made
import numpy as np
import pytest
from numbers_of_sets import counts_at, few_and_many

from evenlight.analysis.calibration.calibration import NoRateLimitError, calibrate
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.dataset_findings import AnalysisOptions, task_findings
from evenlight.analysis.integrity.concern import Concern, ConcernKind, noun_of
from evenlight.analysis.integrity.gate import checked
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.viewing import Version

YES_NO, TWO = made.ramp_design(), made.ramp_design(Procedure.TWO_INTERVAL)


def concerns(task: str, trials: list[Any]) -> tuple[Concern, ...]:
    return checked(made.data_of(task, trials))[1]


def of_kind(found: tuple[Concern, ...], kind: ConcernKind) -> Concern:
    """The one concern of a kind; nothing else may be found."""
    (only,) = found
    assert only.kind is kind
    return only


def ratings_in_order(place_of_ours: Callable[[int, int], int], people: int = 17) -> list[Any]:
    """Clean ratings whose versions come in an order of one's own choice."""
    trials = made.ratings(np.random.default_rng(3), people)

    def placed(trial: Any) -> Any:
        ours = place_of_ours(int(trial.participant_id), made.NAMES.index(trial.sequence))
        place = ours if trial.version is Version.OURS else 3 - ours
        return dataclasses.replace(trial, place_in_pair=place)

    return [placed(trial) for trial in trials]


# --- versions and order ------------------------------------------------------------------------------------


def test_ours_always_second_is_found_with_its_number_of_pairs() -> None:
    concern = of_kind(concerns("rating", ratings_in_order(lambda k, s: 2)), ConcernKind.VERSION_ORDER)
    assert concern.threatens
    assert "the track was shown second in all 68 pairs" in concern.words  # 17 people, 4 sequences


def test_ours_nearly_always_first_is_found() -> None:
    # Participants 00 and 01 saw ours second: in 8 of 68 pairs, which chance gives once in 1e10.
    concern = of_kind(
        concerns("rating", ratings_in_order(lambda k, s: 1 + (k < 2))), ConcernKind.VERSION_ORDER
    )
    assert "the track was shown first in 60 of 68 pairs" in concern.words


def test_three_quarters_in_one_order_can_be_told_apart() -> None:
    assert not concerns("rating", ratings_in_order(lambda k, s: 1 + (k % 4 == 0)))


def test_one_sequence_in_one_order_is_named_although_all_are_balanced() -> None:
    def place(k: int, s: int) -> int:
        return 2 if s == 0 else 1 if s == 1 else 1 + (k + s) % 2

    concern = of_kind(concerns("rating", ratings_in_order(place)), ConcernKind.VERSION_ORDER)
    assert "library, gym" in concern.words or "gym, library" in concern.words
    assert "basement" not in concern.words


def test_an_unknown_order_is_no_order() -> None:
    trials = [dataclasses.replace(t, place_in_pair=1) for t in made.ratings(np.random.default_rng(3))]
    for trial in trials:
        object.__setattr__(trial, "place_in_pair", None)  # as of an imported table without the column
    assert not concerns("rating", trials)


def test_comparisons_with_ours_always_second_are_found() -> None:
    trials = [
        made.comparison(k, name, 2, (k + s) % 2 == 0, (1, s))
        for k in range(17)
        for s, name in enumerate(made.NAMES)
    ]
    concern = of_kind(concerns("comparison", trials), ConcernKind.VERSION_ORDER)
    assert "the track was shown second in all 68 pairs" in concern.words


def test_searches_whose_second_visit_is_always_ours_are_found() -> None:
    def again(trial: Any) -> Any:
        return dataclasses.replace(trial, version=Version.OURS if trial.block == 2 else Version.BASELINE)

    trials = [again(trial) for trial in made.searches(np.random.default_rng(5))]
    concern = of_kind(concerns("search", trials), ConcernKind.VERSION_ORDER)
    assert "the track was shown second in all 204 pairs" in concern.words  # 17 people, 12 places


def test_rows_of_a_table_tell_no_order_of_visits_and_no_halves() -> None:
    trials = sorted(made.searches(np.random.default_rng(5)), key=lambda t: (t.version.value, t.search_time))
    rows = [dataclasses.replace(t, trial_index=k, block=1) for k, t in enumerate(trials)]
    assert not checked(TaskData("search", (), False, "", (), rows=tuple(rows)))[1]


# --- repeated rows ------------------------------------------------------------------------------------------


def repeated(trial: Any, index: int, session: str = "01") -> Any:
    return dataclasses.replace(trial, trial_index=index, session_id=session)


@pytest.mark.parametrize(
    ("task", "make"),
    [("rating", made.ratings), ("comparison", made.comparisons), ("search", made.searches)],
)
def test_a_row_under_another_index_is_left_out_and_said(task: str, make: Callable[..., list[Any]]) -> None:
    trials = make(np.random.default_rng(2))
    data, found = checked(made.data_of(task, [*trials, repeated(trials[2], 90)]))
    concern = next(own for own in found if own.kind is ConcernKind.REPEATED_ROWS)
    assert (
        f"1 of {len(trials) + 1} {noun_of(task)} repeats what the same participant had answered before, and "
        "is left out: 00 (1)" in concern.words
    )
    assert sorted(map(repr, data.trials)) == sorted(map(repr, trials))


def test_a_copied_comparison_with_a_repetition_of_its_own_is_found_by_its_response_time() -> None:
    answers = made.comparisons(np.random.default_rng(2))
    trials = [
        dataclasses.replace(t, simulated=False, onset=None, response_time=0.501 + 0.013 * k)
        for k, t in enumerate(answers)
    ]
    copied = dataclasses.replace(repeated(trials[5], 90), repetition=2)
    data, found = checked(made.data_of("comparison", [*trials, copied]))
    assert "1 of 69 comparisons repeats" in of_kind(found, ConcernKind.REPEATED_ROWS).words
    assert sorted(map(repr, data.trials)) == sorted(map(repr, trials))
    findings = [
        task_findings(made.data_of("comparison", own), AnalysisOptions())
        for own in (trials, [*trials, copied])
    ]
    p_values = [[row.p_value for row in own.rows] for own in findings]
    assert p_values[0] == p_values[1]
    assert findings[1].lead.startswith("Caution: 1 of 69 comparisons repeats")


def test_equal_times_of_repetitions_that_are_rounded_to_hundredths_are_no_copies() -> None:
    answers = made.comparisons(np.random.default_rng(2), repetitions=3)
    trials = [dataclasses.replace(t, simulated=False, onset=None, response_time=1.25) for t in answers]
    assert not concerns("comparison", trials)


def test_many_repetitions_in_a_random_order_are_in_no_order() -> None:
    """In a random order of 20 searches of either version, the first ones' order persists."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        trials = []
        for who in range(8):
            cells, seen = [(spot, version) for spot in range(6) for version in Version] * 20, Counter()
            for index, k in enumerate(rng.permutation(len(cells)).tolist()):
                seen[cells[k]] += 1
                own = made.search(who, *cells[k], math.exp(rng.normal(1, 0.3)), (0, index))
                trials.append(dataclasses.replace(own, repetition=seen[cells[k]]))
        kinds = {concern.kind for concern in concerns("search", trials)}
        assert ConcernKind.VERSION_ORDER not in kinds


def test_equal_times_of_many_repetitions_are_no_copies() -> None:
    """Of 30 answers to a sequence within 0.2 s, in ms, two take the same time in nine of ten."""
    rng = np.random.default_rng(2)
    trials = [
        dataclasses.replace(t, onset=None, response_time=round(0.5 + 0.2 * rng.random(), 3))
        for t in made.comparisons(rng, repetitions=30)
    ]
    assert not concerns("comparison", trials)


def test_the_first_of_two_differing_answers_is_kept() -> None:
    trials = made.ratings(np.random.default_rng(2))
    other = dataclasses.replace(repeated(trials[5], 90), rating=trials[5].rating % 5 + 1, onset=None)
    data, _ = checked(made.data_of("rating", [*trials, other]))
    assert set(data.trials) == set(trials)


def test_a_session_that_was_broken_off_and_begun_anew_counts_once() -> None:
    trials = made.ratings(np.random.default_rng(2))
    anew = [dataclasses.replace(repeated(trial, k, "02"), onset=None) for k, trial in enumerate(trials[:3])]
    data, found = checked(made.data_of("rating", [*trials, *anew]))
    assert of_kind(found, ConcernKind.REPEATED_ROWS)
    assert len(data.trials) == len(trials)


def test_a_second_sitting_is_none_of_repeats() -> None:
    trials = made.ratings(np.random.default_rng(2))
    again = [trial for trial in made.ratings(np.random.default_rng(8)) if trial.participant_id == "00"]
    sitting = [dataclasses.replace(trial, session_id="02", onset=trial.onset + 0.3) for trial in again]
    data, found = checked(made.data_of("rating", [*trials, *sitting]))
    assert not found
    assert len(data.trials) == len(trials) + 8


def test_a_copied_session_is_found_by_its_times() -> None:
    trials = made.ratings(np.random.default_rng(2))
    copy = [repeated(trial, trial.trial_index, "02") for trial in trials if trial.participant_id == "03"]
    data, found = checked(made.data_of("rating", [*trials, *copy]))
    assert "8 of 144 ratings repeat" in of_kind(found, ConcernKind.REPEATED_ROWS).words
    assert len(data.trials) == len(trials)


def test_what_the_design_repeats_and_what_was_interrupted_are_no_repeats() -> None:
    trials = made.comparisons(np.random.default_rng(2), repetitions=3)
    interrupted = [dataclasses.replace(trial, attempt=2) for trial in trials[:4]]
    data, found = checked(made.data_of("comparison", [*interrupted, *trials[4:]]))
    assert not found
    assert len(data.trials) == 17 * 4 * 3


def test_the_seventh_ramp_of_six_is_left_out() -> None:
    trials = made.ramps(np.random.default_rng(2), YES_NO)
    ramp = next(trial for trial in trials if not trial.is_catch)
    extra = dataclasses.replace(repeated(ramp, 900), onset=9999.0)
    data, found = checked(made.ramp_data_of([*trials, extra], YES_NO))
    assert of_kind(found, ConcernKind.REPEATED_ROWS)
    assert extra not in data.trials
    assert len(data.trials) == len(trials)


def test_rows_of_a_table_in_memory_are_repeats_of_what_others_answered_once() -> None:
    trials = made.ratings(np.random.default_rng(2))
    rows = TaskData("rating", (), False, "", (), rows=(*trials, repeated(trials[0], 500)))
    data, found = checked(rows)
    assert of_kind(found, ConcernKind.REPEATED_ROWS)
    assert data.rows == tuple(trials)
    twice = tuple(repeated(t, t.trial_index + 8 * k) for k in range(2) for t in trials)
    twice = tuple(dataclasses.replace(t, onset=None, response_time=None) for t in twice)
    data, found = checked(dataclasses.replace(rows, rows=twice))
    assert not any(own.kind is ConcernKind.REPEATED_ROWS for own in found)
    assert len(data.trials) == 2 * len(trials)


# --- halves -------------------------------------------------------------------------------------------------


def test_a_drift_of_all_is_said_over_all_sessions() -> None:
    def better(trial: Any) -> Any:
        return dataclasses.replace(trial, rating=min(trial.rating + (trial.trial_index >= 4), 5))

    trials = [better(trial) for trial in made.ratings(np.random.default_rng(2), 24)]
    concern = of_kind(concerns("rating", trials), ConcernKind.HALVES)
    assert "over all sessions the ratings of the later half are" in concern.words
    assert "points higher" in concern.words


def test_a_drift_of_choices_is_a_difference_of_shares_in_points() -> None:
    """Each chooses ours once in the earlier half, and twice in the later: 50 and 100 %."""
    trials = []
    for k in range(24):
        for index in range(4):  # in another order of the sequences for each
            s, ours = (index - k) % 4, index >= 2 or index == (k // 4) % 2
            trials.append(made.comparison(k, made.NAMES[s], 1 + (k + s) % 2, ours, (1, index)))
    concern = of_kind(concerns("comparison", trials), ConcernKind.HALVES)
    assert "over all sessions the track is chosen 50 points more often in the later half" in concern.words


def test_a_searcher_who_gives_up_halfway_is_named_and_practice_of_all_is_not() -> None:
    trials = made.searches(np.random.default_rng(6), places=24)
    assert not concerns("search", trials)

    def given_up(trial: Any) -> Any:
        if trial.participant_id != "02" or trial.block == 1:
            return trial
        return dataclasses.replace(trial, search_time=30.0, found=False, reported_orientation=None)

    concern = of_kind(concerns("search", [given_up(trial) for trial in trials]), ConcernKind.HALVES)
    assert "02/01" in concern.words


# --- participants -------------------------------------------------------------------------------------------


def test_who_never_found_anything_is_named() -> None:
    def lost(trial: Any) -> Any:
        if trial.participant_id != "05":
            return trial
        return dataclasses.replace(trial, search_time=30.0, found=False, reported_orientation=None)

    found = concerns("search", [lost(trial) for trial in made.searches(np.random.default_rng(6))])
    concern = next(own for own in found if own.kind is ConcernKind.NOTHING_FOUND)
    assert "participant 05 (24 searches) never found anything" in concern.words


def test_that_nobody_found_anything_threatens_the_conclusion() -> None:
    trials = [
        dataclasses.replace(t, search_time=30.0, found=False, reported_orientation=None)
        for t in made.searches(np.random.default_rng(6))
    ]
    concern = of_kind(concerns("search", trials), ConcernKind.NOTHING_FOUND)
    assert concern.threatens
    assert "nobody found anything in 408 searches" in concern.words


@pytest.mark.parametrize("answer", [Response.YES, Response.NO])
def test_who_always_says_yes_or_no_also_to_catch_trials_is_named(answer: Response) -> None:
    trials = [
        dataclasses.replace(trial, response=answer) if trial.participant_id == "07" else trial
        for trial in made.ramps(np.random.default_rng(2), YES_NO)
    ]
    concern = of_kind(checked(made.ramp_data_of(trials, YES_NO))[1], ConcernKind.ONE_ANSWER)
    assert "participant 07 (120 ramps) always gave the same answer" in concern.words  # 2 (48 + 12)


def test_who_chooses_the_first_of_40_is_named_and_of_4_is_not() -> None:
    for repetitions in (10, 1):
        trials = [
            dataclasses.replace(t, response=Response.FIRST) if t.participant_id == "03" else t
            for t in made.comparisons(np.random.default_rng(4), repetitions=repetitions)
        ]
        found = concerns("comparison", trials)
        if repetitions == 1:  # one person in eight does that by chance
            assert not found
        else:
            assert "participant 03 (40 comparisons)" in of_kind(found, ConcernKind.ONE_ANSWER).words


def test_eight_ratings_alike_are_chance_of_one_person_but_not_of_six() -> None:
    """One in a hundred people, about, rates all eight videos alike."""
    for people, expected in ((1, False), (6, True)):
        trials = [
            dataclasses.replace(t, rating=3) if int(t.participant_id) < people else t
            for t in made.ratings(np.random.default_rng(4))
        ]
        kinds = {own.kind for own in concerns("rating", trials)}
        assert (ConcernKind.ONE_ANSWER in kinds) is expected


def test_who_reports_fast_ramps_less_often_than_slow_ones_is_named() -> None:
    other = {Response.YES: Response.NO, Response.NO: Response.YES,
             Response.FIRST: Response.SECOND, Response.SECOND: Response.FIRST}  # fmt: skip
    for design, words in ((YES_NO, "reported fast ramps less often"), (TWO, "chose the wrong interval")):
        trials = [
            dataclasses.replace(t, response=other[t.response]) if t.participant_id == "06" else t
            for t in made.ramps(np.random.default_rng(2), design)
        ]
        concern = of_kind(checked(made.ramp_data_of(trials, design))[1], ConcernKind.SWAPPED)
        assert concern.threatens
        assert "participant 06" in concern.words
        assert words in concern.words


OTHER = {Response.YES: Response.NO, Response.NO: Response.YES,
         Response.FIRST: Response.SECOND, Response.SECOND: Response.FIRST}  # fmt: skip


def exchanged(trial: RampTrial, rng: np.random.Generator) -> RampTrial:
    return dataclasses.replace(trial, response=OTHER[trial.response])


def coin(trial: RampTrial, rng: np.random.Generator) -> RampTrial:
    return exchanged(trial, rng) if rng.random() < 0.5 else trial


def right_as_yes(trial: RampTrial, rng: np.random.Generator) -> RampTrial:
    """Who noted whether an answer was right, and not what it was, has yes where nothing changed."""
    return exchanged(trial, rng) if trial.is_catch else trial


def one_rate(trial: RampTrial, rng: np.random.Generator) -> RampTrial:
    rate = 0.0 if trial.is_catch else 0.03 * trial.initial_luminance
    return dataclasses.replace(trial, rate=rate, final_luminance=trial.initial_luminance - 5 * rate)


@pytest.mark.parametrize(
    ("design", "coding", "words"),
    [
        (TWO, exchanged, "(are first and second exchanged?)"),
        (YES_NO, exchanged, "(are yes and no exchanged?)"),
        (YES_NO, right_as_yes, "% of 240 trials without a change, and to"),
        (YES_NO, one_rate, "at each level all ramps have the same rate"),
        (TWO, one_rate, "at each level all ramps have the same rate"),
        (YES_NO, coin, "the answers do not depend on the rate"),
        (TWO, coin, "the answers do not depend on the rate"),
    ],
)
def test_answers_without_a_threshold_are_told_what_is_seen(
    design: RampDesign, coding: Callable[[RampTrial, np.random.Generator], RampTrial], words: str
) -> None:
    rng = np.random.default_rng(3)
    trials = [coding(trial, rng) for trial in made.ramps(rng, design)]
    with pytest.raises(NoRateLimitError) as refused:
        calibrate(made.ramp_data_of(trials, design), RateLimitOptions(model=RateLimitModel.INDIVIDUAL))
    told = str(refused.value)
    assert words in told.partition("; no rate limit can be had: ")[0]
    assert "; test" not in told  # faster or slower ramps mend nothing of that
    assert len(refused.value.fits.thresholds) == 20


def test_whose_versions_are_swapped_is_named() -> None:
    def swapped(trial: Any) -> Any:
        if trial.participant_id != "08":
            return trial
        version = Version.BASELINE if trial.version is Version.OURS else Version.OURS
        place = {"place_in_pair": 3 - trial.place_in_pair} if hasattr(trial, "place_in_pair") else {}
        return dataclasses.replace(trial, version=version, **place)

    rng = np.random.default_rng(4)
    clear = [
        made.rating(
            k, name, version, 1 + (k + s + ours) % 2, 2 + 2 * ours + int(rng.random() < 0.3), 2 * s + ours
        )
        for k in range(17)
        for s, name in enumerate(made.NAMES)
        for ours, version in enumerate((Version.BASELINE, Version.OURS))
    ]  # ours is rated about two points better, by everybody
    assert not concerns("rating", clear)
    concern = of_kind(concerns("rating", [swapped(trial) for trial in clear]), ConcernKind.SWAPPED)
    assert "participant 08 (8 ratings) answered as if the versions were swapped" in concern.words


def test_whose_choices_are_swapped_is_named_where_all_others_agree() -> None:
    trials = [
        made.comparison(
            k, name, 1 + (k + s + r) % 2, (k == 9) == (4 * r + s - 4 == k % 8), (r, 4 * r + s - 4)
        )
        for k in range(17)
        for r in (1, 2)
        for s, name in enumerate(made.NAMES)
    ]  # everybody chooses the baseline but for one answer, and participant 09 ours
    concern = of_kind(concerns("comparison", trials), ConcernKind.SWAPPED)
    assert "participant 09" in concern.words


def test_indifference_is_not_swapping() -> None:
    trials = [
        made.comparison(k, name, 1 + (k + s) % 2, s < 2 if k == 9 else s < 3 + k % 2, (1, s))
        for k in range(17)
        for s, name in enumerate(made.NAMES)
    ]
    assert not concerns("comparison", trials)


# --- sessions -----------------------------------------------------------------------------------------------


def test_a_session_with_more_trials_than_its_design_is_named() -> None:
    trials = made.comparisons(np.random.default_rng(2), repetitions=2)
    data = made.data_of("comparison", trials)
    first, *others = data.sessions
    short = dataclasses.replace(first, manifest=dataclasses.replace(first.manifest, n_trials=4))
    found = checked(dataclasses.replace(data, sessions=(short, *others)))[1]
    assert "00/01 (8 instead of 4)" in of_kind(found, ConcernKind.MORE_TRIALS).words


# --- false alarms -------------------------------------------------------------------------------------------


def alarms(make: Callable[[np.random.Generator], TaskData[Any]], sets: int) -> int:
    return sum(bool(checked(make(np.random.default_rng([11, k])))[1]) for k in range(sets))


@pytest.mark.parametrize(
    "make",
    [
        lambda rng: made.data_of("rating", made.ratings(rng)),
        lambda rng: made.data_of("rating", made.ratings(rng, 8)),
        lambda rng: made.data_of("comparison", made.comparisons(rng)),
        lambda rng: made.data_of("comparison", made.comparisons(rng, 8, 6, 0.8)),
        lambda rng: made.data_of("search", made.searches(rng, 10)),
        lambda rng: made.ramp_data_of(made.ramps(rng, YES_NO, 4), YES_NO),
        lambda rng: made.ramp_data_of(made.ramps(rng, TWO, 4), TWO),
    ],
)
@pytest.mark.parametrize("sets", few_and_many(20, 200))
def test_clean_data_raise_a_concern_in_about_one_set_of_a_hundred_at_most(
    sets: int, make: Callable[[np.random.Generator], TaskData[Any]]
) -> None:
    assert alarms(make, sets) <= sets * counts_at(0.01, sets)[1]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("task", "make"), [("rating", made.ratings), ("comparison", made.comparisons)])
def test_clean_data_raise_no_warning(task: str, make: Callable[..., list[Any]], seed: int) -> None:
    found = task_findings(made.data_of(task, make(np.random.default_rng(seed))), AnalysisOptions())
    assert not found.warnings
