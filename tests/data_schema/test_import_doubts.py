"""What a table leaves in doubt is read as what alone it can be, asked about, or left out and told."""

import itertools

import pytest
from foreign_tables import refusal

RATED = "participant,trial_index,sequence,version,rating\n"
RAMPED = "participant,trial_index,initial_luminance_cd_m2,rate_cd_m2_s,duration_s,response{more}\n"
SEARCHED = "participant,trial_index,sequence,keypoint,version,found,search_time_s,time_limit_s\n"
ON = ("--display", "desktop-lcd")


def rated(*ratings, people=10):
    """Eight ratings of each, 1 to 5, of which the first are given."""
    usual = [1 + n % 5 for n in range(8 * people)]
    given = [*ratings, *usual[len(ratings) :]]
    cells = itertools.product(range(1, people + 1), range(1, 9))
    rows = (f"P{who:02},{n},s{(n + 1) // 2},{('ours', 'baseline')[n % 2]}" for who, n in cells)
    return RATED + "".join(f"{row},{rating}\n" for row, rating in zip(rows, given, strict=True))


def ramped(times=None):
    """Limits: the same ten steps up to a yes, three times, with a time for each or none."""
    rows = [
        f"P1,{n},50,{0.5 * (1 + n % 10)},5,{'yes' if n % 10 == 9 else 'no'}"
        + (f",{times(n)}" if times else "")
        for n in range(30)
    ]
    return RAMPED.format(more=",response_time_s" if times else "") + "\n".join(rows)


@pytest.mark.parametrize(
    ("times", "copied"),
    [
        (None, False),
        (lambda n: "", False),
        (lambda n: 1 + n / 100, False),
        (lambda n: 1 + n % 10 / 100, True),
    ],
    ids=["no times", "empty times", "other times", "the same times"],
)
def test_rows_that_agree_without_a_measured_time_are_no_copies(importing, times, copied) -> None:
    outcome, trials = importing(ramped(times), "ramp", *ON)
    assert ("lines 12 to 21 are 2 to 11 again" in outcome.err) == copied
    assert len(trials) == (0 if copied else 30)


@pytest.mark.parametrize(("wrong", "left"), [(("x", "x", 9, 9), 76), (("x", "x", "x", 9, 9), 0)])
def test_a_twentieth_of_all_rows_may_be_impossible_whatever_is_wrong(importing, wrong, left) -> None:
    """Of 80 rows four may be: two words and two beyond the scale are, and one more is too many."""
    outcome, trials = importing(rated(*wrong), "rating", "--scale", "1..5")
    assert len(trials) == left
    words = "line 2, column 'rating': expected a number, got 'x' (and 4 other rows)"
    assert (words in outcome.err) == (not left)


def test_who_has_no_trial_left_is_told_and_eight_reasons_are(importing) -> None:
    outcome, trials = importing(rated(*["x"] * 8, 9, 9, people=40), "rating", "--scale", "1..5")
    assert len(trials) == 310
    assert "P01 has no trial left" in outcome.out
    assert outcome.out.count("expected a number, got 'x'") == 8
    assert "and 2 others" in outcome.out


@pytest.mark.parametrize(
    ("ids", "codes"),
    [
        (("P03", "Anna", "P01"), ("B01", "B02", "B03")),
        (("S1", "Anna", "sub-S2"), ("P01", "P02", "P03")),
        (("Anna", "p 1"), ("B01", "B02")),
    ],
)
def test_codes_are_no_ids_of_the_table(importing, ids, codes) -> None:
    text = RATED + "".join(f"{who},1,gym,ours,4\n{who},2,gym,baseline,3\n" for who in ids)
    _, trials = importing(text, "rating")
    assert tuple(dict.fromkeys(trial["participant_id"] for trial in trials)) == codes


@pytest.mark.parametrize(
    ("rating", "words"),
    [
        (6, "rating 6: 1 of 80 ratings is not from 1 to 5: typed wrongly (--scale 1..5), or on a longer"),
        (77, "rating 77: 1 of 80 ratings is not from 1 to 5: a mark for no rating"),
        (999, "rating 999: 1 of 80 ratings is not from 1 to 5: a mark for no rating (--missing 999)"),
    ],
)
def test_a_rare_rating_beyond_a_scale_is_asked_about_and_the_ways_work(
    importing, tmp_path, rating, words
) -> None:
    outcome, _ = importing(rated(rating), "rating")
    assert refusal(outcome, tmp_path).startswith(f"table.csv, line 2, column 'rating': {words}")
    assert "(--scale 1..5), or on a longer scale" in outcome.err
    way = ("--scale", "1..5") if rating == 6 else ("--missing", str(rating))
    outcome, trials = importing(rated(rating), "rating", *way, name="a.csv")
    assert len(trials) == 79
    assert "scale: 1 to 5" in outcome.out
    assert ("left out 1 of 80 rows" in outcome.out) == (rating == 6)


def test_numbers_compare_as_numbers(importing) -> None:
    """As tables with gaps write them: truths, values that are told, and rows that are asked for."""
    rows = [f"1.0,{k}.0,gym,{k}.0,{1 + k % 2}.0,{k % 2}.0,2.5,20,{k // 2}.0" for k in range(4)]
    text = SEARCHED.replace("\n", ",block_of\n") + "\n".join(rows)
    told = ("--value", "version:ours=1", "--value", "version:baseline=02", "--only", "block_of=1")
    _, trials = importing(text, "search", *told)
    found = [(t["trial_index"], t["version"], t["found"], t["search_time_s"]) for t in trials]
    assert found == [(2, "ours", False, 2.5), (3, "baseline", True, 2.5)]
