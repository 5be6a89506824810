"""What a table leaves in doubt is read as what alone it can be, asked about, or left out and told."""

import itertools

import pytest
from foreign_files import FORMATS
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


@pytest.mark.parametrize(
    ("lost", "options", "times", "words"),
    [
        (
            ("0,", "0,20"),
            (),
            [20, 20, 1.5, 2.5],
            "1 search without success has no time: taken as lasting to the",
        ),
        (("0,", "0,7"), (), [7, 1.5, 2.5], "left out 1 search without success and a time, as others ended"),
        (("0,-", "0,20"), ("--missing", "-"), [20, 1.5, 2.5], "a time, as --missing says that it is unknown"),
        (("1,", "0,20"), (), [20, 1.5, 2.5], "line 2, column 'search_time_s': found, but no search_time"),
    ],
    ids=["to the limit", "others ended early", "blanked", "found"],
)
def test_a_search_without_a_time_lasted_to_the_limit_if_nothing_else_is_known(
    importing, lost, options, times, words
) -> None:
    cells = [*lost, "1,1.5", "1,2.5"]
    rows = [f"1,{n},gym,k{n},ours,{each},20" for n, each in enumerate(cells)]
    outcome, trials = importing(SEARCHED + "\n".join(rows), "search", *options)
    assert sorted(t["search_time_s"] for t in trials) == sorted(times)
    assert words in outcome.out


@pytest.mark.parametrize("name", ["correct", "Accuracy"])
def test_the_answer_of_two_intervals_follows_from_whether_it_is_correct(importing, name) -> None:
    """The ramp is in 1, 1, 2, 2; right and wrong answers are first, second, second, first."""
    text = RAMPED.replace("response{more}", f"ramp_interval,{name}")
    rows = [f"1,{n},50,2,5,{1 + n // 2},{(1.0, 0.0)[n % 2]}" for n in range(4)]
    outcome, trials = importing(text + "\n".join(rows), "ramp", *ON)
    assert [t["response"] for t in trials] == ["first", "second", "second", "first"]
    assert {t["procedure"] for t in trials} == {"two_interval"}
    assert "response: the interval of the ramp where it is correct" in outcome.out


def test_an_answer_that_is_there_counts_and_not_whether_it_is_correct(importing) -> None:
    text = RAMPED.replace("response{more}", "ramp_interval,correct,accuracy,k,response")
    outcome, trials = importing(text + "1,1,50,2,5,2,0,0,3,second\n", "ramp", *ON)
    assert [t["response"] for t in trials] == ["second"], outcome.err


def test_the_sign_of_a_rate_is_its_direction_where_no_column_says_it(importing) -> None:
    rows = "1,1,50,-2,5,yes\n1,2,50,1,5,no\n"
    outcome, trials = importing(RAMPED.format(more="") + rows, "ramp", *ON)
    assert [(t["direction"], t["rate_cd_m2_s"]) for t in trials] == [("down", 2), ("up", 1)]
    assert [t["final_luminance_cd_m2"] for t in trials] == [40, 55]
    assert "direction: by the sign of the rate" in outcome.out


def test_a_direction_that_the_luminances_contradict_is_refused(importing, tmp_path) -> None:
    text = "participant,initial_luminance_cd_m2,final_luminance_cd_m2,duration_s,direction,response\n"
    outcome, _ = importing(text + "1,50,40,5,up,yes\n", "ramp", *ON)
    assert refusal(outcome, tmp_path) == "table.csv, line 2: direction is up, but 50 to 40 cd/m^2 is down"


def test_thousands_have_points_where_decimals_have_commas(importing, tmp_path) -> None:
    text = "participant;sequence;version;rating;response_time\n1;a;ours;3,5;1.074,1\n1;a;baseline;2,0;812,5\n"
    _, trials = importing(text, "rating", "--unit", "response_time=ms")
    assert [t["response_time_s"] for t in trials] == pytest.approx([1.0741, 0.8125])


PROPORTIONS = "participant,initial_luminance_cd_m2,rate_cd_m2_s,n,duration_s,p\n1,50,2,10,5,0.3\n"
E_PRIME = "participant\tScene\tCond\tRate.RESP\tRate.RT\n1\tgym\tTBM\t4\t812\n"
WIDE = "participant,gym_ours,gym_baseline,hall_ours,hall_baseline,gym_none\n1,4,3,5,2,3\n"
EACH = ("--wide", "rating={sequence}_{version}")
COMPARED = "participant,sequence,ours_interval,response\n1,gym,1,2\n"


@pytest.mark.parametrize(
    ("text", "task", "options", "words", "never"),
    [
        (PROPORTIONS, "ramp", ON, "its columns are participant", "--wide"),
        (E_PRIME, "rating", (), "no column sequence", "--wide"),
        (WIDE, "rating", EACH, "what 'none' means is not known; leave it out with --missing none", "line="),
        (WIDE.replace("hall_baseline", "hall_const").replace("gym_baseline", "gym_const"), "rating", EACH,
         "say it, as with --value version:baseline=const, or leave it out with --missing const", "yes"),
        (COMPARED, "comparison", (), "one of 'first', 'second', got '2'; say what", "yes"),
        (RAMPED.format(more="") + "1,1,50,1.074.1,5,yes\n", "ramp", ON, "a number, got '1.074.1'", ",1"),
        ("participant;sequence;version;rating\n1;a;ours;3,5\n1;a;baseline;1,0,5\n", "rating", (),
         "expected a number, got '1,0,5'", "1.0.5"),
    ],
)  # fmt: skip
def test_a_hint_is_of_what_the_table_is(importing, tmp_path, text, task, options, words, never) -> None:
    said = refusal(importing(text, task, *options)[0], tmp_path)
    assert words in said
    assert never not in said.removeprefix("table.csv, ")


def test_a_version_that_is_neither_may_be_left_out(importing) -> None:
    _, trials = importing(WIDE, "rating", *EACH, "--missing", "none")
    assert [t["rating"] for t in trials] == [4, 3, 5, 2]


@pytest.mark.parametrize("notes", [["Study of brightness"], ["Study of brightness", "by lab X"]])
def test_a_sheet_of_notes_names_the_others(tmp_path, command, notes) -> None:
    FORMATS["Excel.xlsx"](tmp_path / "a.xlsx", [[note] for note in notes])
    outcome = command("import", tmp_path / "a.xlsx", "--task", "rating", "--out", tmp_path / "lab")
    assert refusal(outcome, tmp_path).endswith("; other sheets are Notes (--sheet)")


def test_an_encoding_that_is_given_is_not_explained(importing, tmp_path) -> None:
    outcome, _ = importing(RATED + "1,1,gym,ours,4\n", "rating", "--encoding", "latin-1")
    assert "read as latin-1\n" in outcome.out
