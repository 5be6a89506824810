"""What simulated participants are assumed to show stands beside what is estimated, and rules conclusions."""

import numpy as np
import pytest
from comparison_answers import NAMES, answers_of, data_of

from evenlight.analysis.assumed_effects import with_assumed
from evenlight.analysis.comparison.comparison_findings import comparison_findings
from evenlight.analysis.reproduction.paper_tables import published_effect
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, CHOSEN_UNMASKED, RATED, AssumedEffect


def chances(value: float) -> list[AssumedEffect]:
    return [AssumedEffect(CHOSEN, name, value, "1") for name in NAMES]


@pytest.fixture(scope="module")
def alike():
    """Analysis of 17 people who chose ours in every other comparison, often enough to show equivalence."""
    data = data_of(answers_of(lambda who, s: (who + s // 2) % 2 == 0, repetitions=6))
    return comparison_findings(data)


def test_where_there_is_nothing_to_see_no_equivalence_is_concluded(alike) -> None:
    found = with_assumed(alike, chances(0.51))
    assert found.lead.startswith(
        "By the assumed observer there is nothing to see: the true chance of choosing"
    )
    assert "coin flips and show only that the analysis runs" in found.lead
    assert "excluded" not in found.lead
    assert ["coin flips" in " ".join(own.notes) for own in found.sections[:2]] == [True, False]


def test_where_one_sequence_can_be_told_the_others_are_named(alike) -> None:
    assumed = [*chances(0.5)[:3], AssumedEffect(CHOSEN, "basement", 0.8, "1")]
    lead = with_assumed(alike, assumed).lead
    assert (
        "nothing to see in library, gym and living room: the true chance of choosing the track is 50 %."
        in lead
    )
    # Of the basement (s = 3) those with an odd number: 8 of 17.
    assert "In basement the true chance is 80 %, the share found 47 % (95 % confidence interval 2" in lead


def test_an_effect_that_can_be_seen_and_recorded_answers_leave_the_conclusion(alike) -> None:
    assert with_assumed(alike, chances(0.8)).lead == alike.lead
    assert with_assumed(alike, ()) is alike


def test_assumed_stands_beside_estimated(alike) -> None:
    found = with_assumed(alike, [*chances(0.8), AssumedEffect(CHOSEN_UNMASKED, "gym", 0.9, "1")])
    (table,) = found.sections[-1].tables
    # Of the gym (s = 1) those with an even number: 9 of 17.
    rows = {(row[0], row[1]): row[2:] for row in table.rows}
    assert rows["Gym", "chance of choosing the track"][:2] == ("0.80", f"{9 / 17:.2f}")
    assert rows["Gym", "chance of choosing the track, if the content's changes hid nothing"] == (
        "0.90",
        None,
        None,
    )
    assert [row.value for row in found.rows if row.table == "assumed"] == [0.8] * 4 + [0.9]


def test_published_intervals_by_hand() -> None:
    # Gym: 3.71 - 3.23 with standard errors 0.19 and 0.26; t(16) is 2.1199. 47 % of 17 is 8.
    told = published_effect(RATED, "gym")
    half = 2.1199 * np.hypot(0.19, 0.26)
    assert told.value == pytest.approx(0.48)
    assert (told.ci_low, told.ci_high) == pytest.approx((0.48 - half, 0.48 + half), abs=1e-4)
    chosen = published_effect(CHOSEN, "gym")
    # Clopper and Pearson, 8 of 17 (their tables: 0.230 to 0.722).
    assert (chosen.ci_low, chosen.ci_high) == pytest.approx((0.230, 0.722), abs=5e-4)


def test_of_the_published_ratings_only_the_basement_has_an_established_sign() -> None:
    # 4.29 - 3.47 = 0.82 and t(16) = 2.12 times √(0.15² + 0.18²) = 0.234; the others' intervals include 0.
    known = [name for name in NAMES if published_effect(RATED, name).ci_low > 0]
    assert known == ["basement"]
