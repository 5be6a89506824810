"""Orders of rating and comparison: everything once, and nothing tied to anything over participants."""

import itertools
from collections import Counter

import pytest

from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES, ComparisonDesign, RatingDesign, Version
from evenlight.experiments.viewing.comparison_task import comparison_order, comparison_practice
from evenlight.experiments.viewing.rating_task import rating_order, rating_practice

ROUNDS = 2 * len(PAPER_SEQUENCES)  # participants after which everything is balanced


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("repetitions", [1, 2])
def test_everybody_rates_every_version_of_every_sequence_as_often_as_asked(
    together: bool, repetitions: int
) -> None:
    design = RatingDesign(versions_together=together, repetitions=repetitions)
    for participant in range(5):
        shown = Counter((trial.sequence, trial.version) for trial in rating_order(design, participant))
        assert shown == {(s, v): repetitions for s in PAPER_SEQUENCES for v in Version}


def test_the_two_versions_of_a_sequence_follow_each_other_where_they_are_to_be_together() -> None:
    order = rating_order(RatingDesign(), 3)
    for first, second in zip(order[::2], order[1::2], strict=True):
        assert first.sequence == second.sequence
        assert {first.version, second.version} == set(Version)
        assert (first.place_in_pair, second.place_in_pair) == (1, 2)


def test_ours_comes_first_in_half_of_the_sequences_of_everybody() -> None:
    for participant in range(ROUNDS):
        first = [t.version for t in rating_order(RatingDesign(), participant) if t.place_in_pair == 1]
        assert first.count(Version.OURS) == len(PAPER_SEQUENCES) / 2


def test_over_participants_each_sequence_is_seen_at_each_place_with_either_version_first_equally_often() -> (
    None
):
    seen: Counter[tuple[str, int, Version]] = Counter()
    for participant in range(ROUNDS):
        firsts = [t for t in rating_order(RatingDesign(), participant) if t.place_in_pair == 1]
        seen.update((t.sequence, place, t.version) for place, t in enumerate(firsts))
    assert seen == {(s, p, v): 1 for s in PAPER_SEQUENCES for p in range(4) for v in Version}


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_with_any_number_of_sequences_each_is_at_each_place_with_either_version_first_equally_often(
    n: int,
) -> None:
    """A Williams square repeats after n rows, after 2n if n is odd; then the versions change places."""
    names = tuple("abcde"[:n])
    everybody = 2 * n * (1 + n % 2)
    seen: Counter[tuple[str, int, int]] = Counter()
    for participant in range(everybody):
        order = comparison_order(ComparisonDesign(sequences=names), participant)
        seen.update((t.sequence, place, t.ours_interval) for place, t in enumerate(order))
    assert set(seen.values()) == {everybody // (2 * n)}
    assert len(seen) == 2 * n * n


def test_a_repetition_turns_the_order_of_the_two_versions_round() -> None:
    order = comparison_order(ComparisonDesign(repetitions=2), 0)
    intervals = {s: [t.ours_interval for t in order if t.sequence == s] for s in PAPER_SEQUENCES}
    assert all(sorted(each) == [1, 2] for each in intervals.values())


def test_each_sequence_is_compared_with_ours_first_by_half_of_the_participants() -> None:
    ours_first: Counter[str] = Counter()
    for participant in range(ROUNDS):
        order = comparison_order(ComparisonDesign(), participant)
        assert sorted(t.sequence for t in order) == sorted(PAPER_SEQUENCES)
        ours_first.update(t.sequence for t in order if t.ours_interval == 1)
    assert set(ours_first.values()) == {ROUNDS // 2}


def test_practice_is_short_both_ways_and_the_same_for_the_same_session() -> None:
    design = RatingDesign(practice_trials=6, practice_duration=3.0)
    practice = rating_practice(design, seed=5, order_index=1)
    assert practice == rating_practice(design, seed=5, order_index=1)
    assert {(t.practice, t.block, t.seconds) for t in practice} == {(True, 0, 3.0)}
    assert Counter(t.version for t in practice) == {Version.OURS: 3, Version.BASELINE: 3}
    assert len({t.sequence for t in practice[:4]}) == 4
    pairs = comparison_practice(ComparisonDesign(practice_trials=2), seed=5, order_index=1)
    assert [t.ours_interval for t in pairs] == [2, 1]


def test_practice_begins_with_ours_for_half_of_the_participants() -> None:
    first = [rating_practice(RatingDesign(), 1, p)[0].version for p in range(8)]
    assert first.count(Version.OURS) == 4
    intervals = [comparison_practice(ComparisonDesign(), 1, p)[0].ours_interval for p in range(8)]
    assert intervals.count(1) == 4


def intervals_of(participant: int, repetitions: int = 1, seed: int = 1) -> list[int]:
    design = ComparisonDesign(repetitions=repetitions, order_seed=seed)
    return [t.ours_interval for t in comparison_order(design, participant)]


@pytest.mark.parametrize("seed", [1, 2])
def test_any_ten_participants_in_a_row_are_balanced(seed: int) -> None:
    """Neighbours see opposite versions first: a window of ten leaves one out at each end, at most."""
    design = RatingDesign(order_seed=seed)
    firsts = [[t for t in rating_order(design, p) if t.place_in_pair == 1] for p in range(40)]
    for start in range(31):
        window = firsts[start : start + 10]
        ours = Counter(t.sequence for own in window for t in own if t.version is Version.OURS)
        assert all(4 <= ours[name] <= 6 for name in PAPER_SEQUENCES)
        places = Counter((t.sequence, place) for own in window for place, t in enumerate(own))
        assert all(1 <= places[name, place] <= 4 for name in PAPER_SEQUENCES for place in range(4))


def test_patterns_of_versions_are_drawn() -> None:
    patterns = Counter(tuple(intervals_of(participant)) for participant in range(40))
    assert len(patterns) == 6  # all with two of each
    assert max(patterns.values()) <= 12
    assert [intervals_of(p) for p in range(8)] != [intervals_of(p, seed=2) for p in range(8)]


def test_repetitions_come_in_other_orders_and_do_not_alternate() -> None:
    design, alternating = ComparisonDesign(repetitions=10), 0
    for participant in range(20):
        order = comparison_order(design, participant)
        blocks = {tuple(t.sequence for t in order if t.repetition == k) for k in range(1, 11)}
        assert len(blocks) > 1
        for name in PAPER_SEQUENCES:
            own = [t.ours_interval for t in order if t.sequence == name]
            assert own.count(1) == own.count(2) == 5
            alternating += all(one != other for one, other in itertools.pairwise(own))
    assert alternating <= 4  # of 80; strictly alternating ones are 2 of 252
