"""Ratings on any scale: seen from the ratings or asked for, kept with the session, and held to it."""

import json

import pytest
from foreign_tables import refusal

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.recordings.rating_scale import RatingScale, scale_of
from evenlight.data_schema.recordings.viewing import RatingTrial

TRIAL = {
    "participant_id": "1", "session_id": "01", "trial_index": 0, "sequence": "gym", "version": "ours",
    "repetition": 1, "place_in_pair": None, "mean_factor": None, "response_time_s": None, "simulated": False,
    "practice": False, "block": 0, "attempt": 1, "onset_s": None, "noise_seed": None, "rating": 4,
}  # fmt: skip


def places(*ratings: float) -> list[tuple[str, float]]:
    return [(f"row {number}", rating) for number, rating in enumerate(ratings)]


@pytest.mark.parametrize(
    ("ratings", "asked", "scale"),
    [
        ((2, 5), "", (1, 5, 1)),
        ((2, 6), "", (1, 7, 1)),
        ((1, 8), "", (1, 9, 1)),
        ((0, 4), "", (0, 10, 1)),
        ((3, 64), "", (0, 100, 1)),
        ((3, 53.7), "", (0, 100, 0.1)),
        ((0.2, 0.85), "", (0, 1, 0.05)),
        ((3, 3.5), "", (1, 5, 0.5)),
        ((3.1415926, 2), "", (1, 5, 0)),
        ((2, 5), "1..7", (1, 7, 1)),
        ((2, 5.5), "1..7", (1, 7, 0.5)),
        ((-3, 2), "-3..3", (-3, 3, 1)),
        ((2, 4), "1..5:0.25", (1, 5, 0.25)),
        ((10, 60), "0..100:10", (0, 100, 10)),
        ((2, 3), "1..5:0", (1, 5, 0)),
    ],
)
def test_the_scale_is_the_one_asked_for_or_the_smallest_usual_one(ratings, asked, scale) -> None:
    found, words = scale_of(places(*ratings), asked)
    assert found == RatingScale(*scale)
    assert words.endswith("; --scale says otherwise") == (not asked)


@pytest.mark.parametrize(
    ("ratings", "asked", "words"),
    [
        ((1, 2), "1-7", "--scale: expected LOWEST..HIGHEST or LOWEST..HIGHEST:STEP, as 1..7"),
        (
            (1, 2),
            "7..1",
            "--scale: a scale must rise from its lowest to its highest in whole steps, got 7 to 1",
        ),
        ((1, 2), "1..6:2", "in whole steps, got 1 to 6 in steps of 2"),
        ((1, 9), "1..7", "row 1: rating must be on the scale of 1 to 7 in whole points, got 9"),
        ((1, 3.5), "1..7:1", "row 1: rating must be on the scale of 1 to 7 in whole points, got 3.5"),
        (
            (4, -1),
            "",
            "row 1: rating -1: ratings from -1 to 4 are on no usual scale; say theirs with --scale, such",
        ),
        (
            (*[4] * 30, 44),
            "",
            "row 30: rating 44: 1 of 31 ratings is not from 1 to 5: a mark for no rating (--missing 44), "
            "typed wrongly (--scale 1..5), or on a longer scale (--scale says which)?",
        ),
        ((*[4] * 38, 6, 7), "", "row 38: rating 6: 2 of 40 ratings are not from 1 to 5: "),
        ((*[1, 7] * 20, 8), "", "row 40: rating 8: 1 of 41 ratings is not from 1 to 7: "),
        ((*[0, 9] * 20, 77), "", "row 40: rating 77: 1 of 41 ratings is not from 0 to 10: "),
        ((*[1, 5] * 20, 999), "", "1 of 41 ratings is not from 1 to 5: a mark for no rating (--missing 999)"),
    ],
)
def test_what_leaves_the_scale_open_is_asked_about(ratings, asked, words) -> None:
    with pytest.raises(InputError) as error:
        scale_of(places(*ratings), asked)
    assert words in str(error.value)


def test_whole_points_are_written_as_whole_numbers_and_others_as_they_are() -> None:
    for given, written in ((4, "4"), (4.0, "4"), (3.5, "3.5"), (53.7, "53.7")):
        trial = record_from_mapping(RatingTrial, TRIAL | {"rating": given}, "here")
        assert json.dumps(mapping_from_record(trial)["rating"]) == written


def test_an_imported_session_keeps_its_scale_and_is_held_to_it(importing, tmp_path, command) -> None:
    text = "participant,sequence,version,rating\n" + "".join(
        f"{who},{name},{version},{rating}\n"
        for who, more in (("1", 0), ("2", 1))
        for name, version, rating in (("gym", "ours", 5 + more), ("gym", "baseline", 3.5))
    )
    outcome, trials = importing(text, "rating", "--scale", "1..7")
    assert "scale: 1 to 7 in steps of 0.5\n" in outcome.out
    assert [trial["rating"] for trial in trials] == [5, 3.5, 6, 3.5]
    session = tmp_path / "lab" / "sub-1" / "ses-01"
    manifest = json.loads((session / "manifest.json").read_text())
    assert manifest["source"]["scale"] == {"lowest": 1, "highest": 7, "step": 0.5}
    described = json.loads((session / "beh" / "sub-1_ses-01_task-rating_beh.json").read_text())
    assert (described["rating"]["Minimum"], described["rating"]["Maximum"]) == (1, 7)

    lines = session / "trials.jsonl"
    whole = lines.read_text()
    lines.write_text(whole.replace('"rating": 5', '"rating": 9'))
    words = "rating must be on the scale of 1 to 7 in steps of 0.5, got 9"
    assert words in command("validate", tmp_path / "lab").out
    refused = command("analyze", tmp_path / "lab", "--out", tmp_path / "report")
    assert words in refusal(refused, tmp_path)

    lines.write_text(whole)
    manifest["source"]["scale"] = None  # as of a version before scales
    (session / "manifest.json").write_text(json.dumps(manifest))
    lines.write_text(whole.replace("3.5", "3"))
    refused = command("analyze", tmp_path / "lab", "--out", tmp_path / "report")
    assert "ratings on different scales, 1 to 5 in whole points (sub-1/ses-01) and 1 to 7 in" in refused.err


def test_a_scale_is_of_ratings_only(importing, tmp_path) -> None:
    text = "participant,sequence,ours_interval,response\na,gym,1,first\n"
    outcome, _ = importing(text, "comparison", "--scale", "1..7")
    assert refusal(outcome, tmp_path) == "--scale is of ratings, not of a comparison"
