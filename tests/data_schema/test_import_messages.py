"""What `evenlight import` says in one line of a table that it refuses."""

import json

import pytest
from foreign_tables import RAMP_OPTIONS, RAMPS, RATINGS, SEARCH_OPTIONS, SEARCHES, refusal


@pytest.mark.parametrize(
    ("text", "task", "options", "message"),
    [
        (
            "",
            "rating",
            (),
            "table.csv, line 1: no header; expected the names of the columns, each once",
        ),
        (
            "a,a\n1,2\n",
            "rating",
            (),
            "table.csv, line 1: the column 'a' is there twice; expected the names of the columns, each once",
        ),
        (
            "participant,rating\n",
            "rating",
            (),
            "table.csv: has no row; expected one for each trial",
        ),
        (
            RATINGS + "a,gym\n",
            "rating",
            (),
            "table.csv, line 4: expected 4 cells, got 2",
        ),
        (
            "id,sequence,version,rating\na,gym,ours,3\n",
            "rating",
            (),
            "table.csv: no column participant_id; name the one that it is with --column "
            "participant_id=THEIRS, or give --constant participant_id=VALUE; its columns are id, "
            "sequence, version, rating",
        ),
        (
            RATINGS,
            "rating",
            ("--column", "rating=score"),
            "table.csv: no column 'score'; its columns are participant, sequence, version, rating",
        ),
        (
            RATINGS,
            "rating",
            ("--column", "ratin=rating"),
            "--column ratin=rating: unknown column 'ratin'; did you mean 'rating'?",
        ),
        (
            RATINGS,
            "rating",
            ("--column", "rating"),
            "--column: expected OURS=THEIRS, got 'rating'",
        ),
        (
            RATINGS,
            "rating",
            ("--unit", "rating=points"),
            "--unit rating=points: expected one of 1, %",
        ),
        (
            RATINGS.replace("ours", "TBM"),
            "rating",
            (),
            "table.csv, line 2, column 'version': expected one of 'ours', 'baseline', got 'TBM'; say "
            "what stands for them, as with --value version:ours=THEIRS",
        ),
        (
            RATINGS.replace(",4", ",7"),
            "rating",
            (),
            "table.csv, line 2, column 'rating': rating must be at most 5, got 7",
        ),
        (
            RATINGS.replace(",4", ",3.5"),
            "rating",
            (),
            "table.csv, line 2, column 'rating': expected a whole number, got '3.5'",
        ),
        (
            RATINGS.replace(",4", ",good"),
            "rating",
            (),
            "table.csv, line 2, column 'rating': expected a number, got 'good'",
        ),
        (
            RATINGS.replace(",4", ",").replace(",3", ","),
            "rating",
            (),
            "table.csv: none of 2 rows has an answer in 'rating'",
        ),
        (
            RATINGS + "a,gym,ours,4\n",
            "rating",
            (),
            "table.csv, line 4: participant_id a, session_id 01, sequence gym, version ours is there "
            "already, in line 2; if it is a repetition, name the column that counts them (--column "
            "repetition=THEIRS) or the order of trials (--column trial_index=THEIRS), else take it "
            "out",
        ),
        (
            RATINGS + "A-,gym,ours,4\n",
            "rating",
            (),
            "table.csv, line 4, column 'participant': 'A-', and 'a' of line 2, would be one "
            "participant_id; write them alike if they are, else so that letters or digits differ",
        ),
        (
            RATINGS + "--,gym,ours,4\n",
            "rating",
            (),
            "table.csv, line 4, column 'participant': expected a code of letters and digits as "
            "participant_id, got '--'",
        ),
        (
            RATINGS + "eve@lab.org,gym,ours,4\n",
            "rating",
            (),
            "table.csv, line 4, column 'participant': expected a code of letters and digits as "
            "participant_id, got 'eve@lab.org'",
        ),
        (
            RATINGS.replace("participant", "full_name"),
            "rating",
            ("--column", "participant_id=full_name"),
            "table.csv: the column 'full_name' for participant_id looks like personal data; expected codes",
        ),
        (
            "subject," + RATINGS.replace("\na", "\nb,a"),
            "rating",
            (),
            "table.csv: 'subject' and 'participant' may both be participant_id; say which with "
            "--column participant_id=THEIRS",
        ),
        (
            RATINGS.replace("rating", "rating,rt").replace(",4", ",4,812").replace(",3", ",3,713"),
            "rating",
            ("--column", "response_time=rt"),
            "table.csv: the unit of 'rt' (response_time) is not known; give it with --unit "
            "response_time=UNIT, one of s, ms, min",
        ),
        (
            "participant,sequence\na,gym\n",
            "rating",
            ("--wide", "rating={sequence}_{version}"),
            "table.csv: no column is like --wide rating={sequence}_{version}; its columns are "
            "participant, sequence",
        ),
        (
            SEARCHES.replace("nein;30", "nein;12"),
            "search",
            SEARCH_OPTIONS,
            "table.csv, line 5, column 'zeit': expected nothing, or the time limit of 30 s, where "
            "nothing was found, got 12 s",
        ),
        (
            RAMPS,
            "ramp",
            RAMP_OPTIONS,
            "table.csv: ramps need --display, a preset's name or a file: a rate limit holds for the "
            "display on which its ramps were shown, and for no other",
        ),
        (
            RAMPS.replace("20.9", "209"),
            "ramp",
            (*RAMP_OPTIONS, "--display", "varjo-xr3"),
            "table.csv, line 5: initial_luminance is 209 cd/m^2, but the display 'varjo-xr3' shows 0 "
            "to 104.4; give that of the ramps with --display",
        ),
        (
            "[1, 2]",
            "rating",
            (),
            "table.csv, trial 1: expected names and values, got 1",
        ),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(
    importing, tmp_path, text, task, options, message
) -> None:
    outcome, _ = importing(text, task, *options)
    assert refusal(outcome, tmp_path) == message


def test_a_first_line_that_names_the_delimiter_is_counted_and_not_read(importing, tmp_path) -> None:
    outcome, _ = importing("sep=;\nparticipant;sequence;version;rating\na;gym;ours;9\n", "rating")
    words = "table.csv, line 3, column 'rating': rating must be at most 5, got 9"
    assert refusal(outcome, tmp_path) == words


def test_a_trial_of_a_list_is_named_by_its_place(importing, tmp_path) -> None:
    text = json.dumps(
        [{"participant": "a", "sequence": "gym", "version": "ours", "rating": n} for n in (4, 0)]
    )
    outcome, _ = importing(text, "rating", name="data.json")
    words = "data.json, trial 2, column 'rating': rating must be at least 1, got 0"
    assert refusal(outcome, tmp_path) == words


def test_a_data_set_that_is_there_is_not_overwritten(importing, tmp_path, command) -> None:
    importing(RATINGS, "rating")
    again = command("import", tmp_path / "table.csv", "--task", "rating", "--out", tmp_path / "lab")
    assert "is there already and data are never overwritten" in refusal(again, tmp_path)


def test_an_imported_session_cannot_be_resumed(importing, tmp_path, command) -> None:
    importing(RATINGS.replace("a,", "1,"), "rating")
    resumed = command(
        "run", "rating", "--participant", "1", "--session", "01", "--rig", "simulated", "--simulate", "data",
        "--resume", "--out", tmp_path / "lab", "--stimuli", tmp_path,
    )  # fmt: skip
    assert "imported" in refusal(resumed, tmp_path)
