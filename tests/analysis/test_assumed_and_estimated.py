"""What simulated participants are assumed to show stands beside what is estimated, and rules conclusions."""

import numpy as np
import pytest
from comparison_answers import NAMES, answers_of, data_of

from evenlight.analysis.assumed_effects import with_assumed
from evenlight.analysis.comparison.comparison_findings import comparison_findings
from evenlight.analysis.reproduction.published_effects import PublishedEffect, Verdict, published_effect
from evenlight.analysis.reproduction.repeated_sets import repeated_effects
from evenlight.analysis.reproduction.reproduction import ReproductionPlan
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, CHOSEN_UNMASKED, RATED, AssumedEffect
from evenlight.data_schema.recordings.viewing import RatingTrial, Version
from evenlight.method.preset_files import load_display
from evenlight.stimuli.video.viewing_geometry import field_of_view_on


def chances(value: float) -> list[AssumedEffect]:
    return [AssumedEffect(CHOSEN, name, value, "1") for name in NAMES]


@pytest.fixture(scope="module")
def alike():
    """Findings of 17 people who chose ours in every other comparison, often enough to show equivalence."""
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
    assert "nothing to see in library, gym and living room: the true chance of choosing ours is 50 %." in lead
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
    assert rows["Gym", CHOSEN][:2] == ("0.80", f"{9 / 17:.2f}")
    assert rows["Gym", CHOSEN_UNMASKED] == ("0.90", None, None)
    assert [row.value for row in found.statistics if row.table == "assumed"] == [0.8] * 4 + [0.9]


def rated(who: str, index: int, version: Version, rating: int) -> RatingTrial:
    return RatingTrial(who, "01", index, "gym", version, 1, 1 + index, 0.5, rating, None, simulated=True)


def test_estimates_of_many_data_sets_by_hand() -> None:
    """Four people who all rate ours higher by 2, or by 0: the exact p is 2 / 2^4, or 1."""
    assumed = [AssumedEffect(RATED, "gym", 0.7, "rating points")]
    higher, equal = (
        [
            rated(who, k, version, 2 + gain * (version is Version.OURS))
            for who in ("01", "02", "03", "04")
            for k, version in enumerate(Version)
        ]
        for gain in (2, 0)
    )
    pictures = [AssumedEffect(RATED, "gym", 0.1, "rating points")]
    (effect,) = repeated_effects("rating", assumed, [higher, equal, higher, higher], pictures)
    assert effect.estimates.tolist() == [2.0, 0.0, 2.0, 2.0]
    assert effect.p_values.tolist() == [0.125, 1.0, 0.125, 0.125]
    assert effect.as_picture == 0.1
    assert (effect.share_of_published_sign, effect.significant) == (0.75, 0.0)
    assert (effect.shown, effect.mean) == (2.0, 1.5)


def test_published_intervals_by_hand() -> None:
    # Gym: 3.71 - 3.23 with standard errors 0.19 and 0.26; t(16) is 2.1199. 47 % of 17 is 8.
    told = published_effect(RATED, "gym")
    half = 2.1199 * np.hypot(0.19, 0.26)
    assert told.value == pytest.approx(0.48)
    assert told.interval == pytest.approx((0.48 - half, 0.48 + half), abs=1e-4)
    chosen = published_effect(CHOSEN, "gym")
    # Clopper and Pearson, 8 of 17 (their tables: 0.230 to 0.722).
    assert chosen.interval == pytest.approx((0.230, 0.722), abs=5e-4)


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.6, "sign and size"), (0.1, "sign, 20 % of the size"), (0.04, "too small to count"),
     (-0.04, "too small to count"), (-0.2, "opposite sign"), (None, None)],
)  # fmt: skip
def test_what_is_reproduced_of_a_published_effect(value: float | None, words: str | None) -> None:
    assert PublishedEffect(0.5, (0.1, 0.9), 1).verdict_words(value, 0.0) == words
    # Where the published interval includes no effect there is no sign to agree with.
    unclear = PublishedEffect(0.5, (-0.2, 1.2), 1).verdict(value, 0.0)
    assert unclear is (None if value is None else Verdict.OPEN)


def test_of_the_published_ratings_only_the_basement_has_an_established_sign() -> None:
    # 4.29 - 3.47 = 0.82 and t(16) = 2.12 times √(0.15² + 0.18²) = 0.234; the others' intervals include 0.
    known = [name for name in NAMES if published_effect(RATED, name).is_established(0.0)]
    assert known == ["basement"]


def test_a_chance_is_near_one_half_or_not_whatever_the_interval_of_17_answers_holds() -> None:
    told = published_effect(CHOSEN, "gym")
    assert told.verdict(0.52, 0.5) is Verdict.NEAR_HALF
    assert told.verdict(0.62, 0.5) is Verdict.NOT_NEAR_HALF


def test_a_sequence_of_640_pixels_is_a_picture_of_not_nine_degrees() -> None:
    # 72.28 pixels per degree in its middle: 320 pixels are atan(320 / (72.28 · 57.2958)) = 4.4184 degrees.
    degrees = field_of_view_on(load_display("varjo-xr3"), ReproductionPlan().picture_size[0])
    assert degrees == pytest.approx(8.8369, abs=1e-3)
