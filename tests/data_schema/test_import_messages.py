"""What `evenlight import` refuses in one line, and a data set of several files."""

import csv
import itertools
import json
import os
import shutil

import pytest
from foreign_tables import RAMP_OPTIONS, RAMPS, RATINGS, SEARCH_OPTIONS, SEARCHES, refusal


def said(importing, tmp_path, text, task, options) -> str:
    """What is said of the table, after its name."""
    outcome, _ = importing(text, task, *options)
    return refusal(outcome, tmp_path).removeprefix("table.csv")


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", (), ', line 1: no header; expected the names of the columns, each once'),
        ("a,a\n1,2\n", (),
         ", line 1: the column 'a' is there twice; expected the names of the columns, each once"),
        ("participant,rating\n", (), ': has no row; expected one for each trial'),
        (RATINGS + "a,gym\n", (), ', line 4: expected 4 cells, got 2'),
        ("id,sequence,version,rating\na,gym,ours,3\n", (),
         ': no column participant_id; name the one that it is with --column participant_id=THEIRS, '
         'or give --constant participant_id=VALUE; its columns are id, sequence, version, rating'),
        (RATINGS, ("--column", "rating=score"),
         ": no column 'score'; its columns are participant, sequence, version, rating"),
        (RATINGS, ("--column", "ratin=rating"),
         "--column ratin=rating: unknown column 'ratin'; did you mean 'rating'?"),
        (RATINGS, ("--column", "rating"), "--column: expected OURS=THEIRS, got 'rating'"),
        (RATINGS, ("--unit", "rating=points"), '--unit rating=points: expected one of 1, %'),
        (RATINGS.replace("ours", "TBM"), (),
         ", line 2, column 'version': expected one of 'ours', 'baseline', got 'TBM'; say what "
         'stands for them, as with --value version:ours=THEIRS'),
        (RATINGS.replace(",4", ",7"), ("--scale", "1..5"),
         ", line 2, column 'rating': rating must be on the scale of 1 to 5 in whole points, got 7"),
        (RATINGS.replace(",4", ",3.5"), ("--scale", "1..7:1"),
         ", line 2, column 'rating': rating must be on the scale of 1 to 7 in whole points, got 3.5"),
        (RATINGS.replace(",4", ",good"), (), ", line 2, column 'rating': expected a number, got 'good'"),
        (RATINGS.replace(",4", ",").replace(",3", ","), (), ": none of 2 rows has an answer in 'rating'"),
        (RATINGS + "a,gym,ours,4\n", (),
         ', line 4: participant_id P01, session_id 01, sequence gym, version ours is there already, '
         'in line 2; if it is a repetition, name the column that counts them (--column '
         'repetition=THEIRS) or the order of trials (--column trial_index=THEIRS), else take it out'),
        (RATINGS + "A-,gym,ours,4\n", (),
         ", line 4, column 'participant': 'A-', and 'a' of line 2, would be one participant_id; "
         'write them alike if they are, else so that letters or digits differ'),
        (RATINGS + "--,gym,ours,4\n", (),
         ", line 4, column 'participant': expected a code of letters and digits as participant_id, "
         "got '--'"),
        (RATINGS + "eve@lab.org,gym,ours,4\n", (),
         ", line 4, column 'participant': expected a code of letters and digits as participant_id, "
         "got 'eve@lab.org'"),
        (RATINGS.replace("participant", "full_name"), ("--column", "participant_id=full_name"),
         ": the column 'full_name' for participant_id looks like personal data; expected codes"),
        ("subject," + RATINGS.replace("\na", "\nb,a"), (),
         ": 'subject' and 'participant' may both be participant_id; say which with --column "
         'participant_id=THEIRS'),
        (RATINGS.replace("rating", "rating,rt").replace(",4", ",4,812").replace(",3", ",3,713"),
         ("--column", "response_time=rt"),
         ": the unit of 'rt' (response_time) is not known; give it with --unit response_time=UNIT, "
         'one of s, ms, min'),
        ("participant,sequence\na,gym\n", ("--wide", "rating={sequence}_{version}"),
         ': no column is like --wide rating={sequence}_{version}; its columns are participant, '
         'sequence'),
        ("[1, 2]", (), ', trial 1: expected names and values, got 1'),
    ],
)  # fmt: skip
def test_ratings_that_cannot_be_read_are_refused_in_one_line(importing, tmp_path, text, options, message):
    assert said(importing, tmp_path, text, "rating", options) == message


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (SEARCHES.replace("2,5", "32,5").replace("3,25", "33,25"), SEARCH_OPTIONS,
         ', line 2: search_time_s must be at most the time limit, got 33.25 of 30 s (and 1 other row)'),
        (RAMPS, RAMP_OPTIONS,
         ": ramps need --display, a preset's name or a file: a rate limit holds for the display on "
         'which its ramps were shown, and for no other'),
        (RAMPS.replace("20.9", "209").replace("52.3", "523"), (*RAMP_OPTIONS, "--display", "varjo-xr3"),
         ", line 3: initial_luminance is 523 cd/m^2, but the display 'varjo-xr3' shows 0 to 104.4; "
         'give the display of the ramps (and 1 other row)'),
    ],
)  # fmt: skip
def test_searches_and_ramps_that_cannot_be_read_are_refused_too(importing, tmp_path, text, options, message):
    assert said(importing, tmp_path, text, "search" if "search" in message else "ramp", options) == message


def test_a_first_line_that_names_the_delimiter_is_counted_and_not_read(importing, tmp_path) -> None:
    outcome, _ = importing("sep=;\nparticipant;sequence;version;rating\na;gym;ours;x\n", "rating")
    words = "table.csv, line 3, column 'rating': expected a number, got 'x'"
    assert refusal(outcome, tmp_path) == words


def test_a_trial_of_a_list_is_named_by_its_place(importing, tmp_path) -> None:
    text = json.dumps(
        [{"participant": "a", "sequence": "gym", "version": "ours", "rating": n} for n in (4, "x")]
    )
    outcome, _ = importing(text, "rating", name="data.json")
    words = "data.json, trial 2, column 'rating': expected a number, got 'x'"
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


# --- import refusals

HEADER = "participant,trial_index,sequence,version,rating,response_time_s\n"

ROWS = "a,1,gym,ours,4,2.5\na,2,gym,baseline,3,3.25\na,3,hall,ours,5,1.5\na,4,hall,baseline,2,1.75\n"


@pytest.fixture
def rated(tmp_path, command):
    def run(text: str, *options: str):
        (tmp_path / "table.csv").write_text(text)
        return command(
            "import", tmp_path / "table.csv", "--task", "rating", "--out", tmp_path / "lab", *options
        )

    return run


def trials(tmp_path, who="P01"):
    text = (tmp_path / "lab" / f"sub-{who}" / "ses-01" / "trials.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()]


def test_a_row_copied_under_a_new_index_is_refused_with_both_lines(rated, tmp_path) -> None:
    outcome = rated(HEADER + ROWS + "a,5,gym,ours,4,2.5\n")
    assert outcome.code == 2
    assert "line 6: " in outcome.err
    assert "the same item, answer and response time is there already, in line 2; a copy?" in outcome.err
    assert not (tmp_path / "lab").exists()


def test_equal_times_of_many_repetitions_are_no_copies(rated, tmp_path) -> None:
    rows = [f"a,{k + 1},gym,{('ours', 'baseline')[k % 2]},4,{2 + k % 7 / 1000}\n" for k in range(40)]
    assert rated(HEADER + "".join(rows)).code == 0
    assert max(trial["repetition"] for trial in trials(tmp_path)) == 20


def test_a_further_answer_is_numbered_only_where_most_was_answered_several_times(rated, tmp_path) -> None:
    assert rated(HEADER + ROWS + "a,5,gym,ours,3,9.5\n").code == 0
    assert [trial["repetition"] for trial in trials(tmp_path)] == [1, 1, 1, 1, 1]
    assert [trial["place_in_pair"] for trial in trials(tmp_path)] == [1, 2, 1, 2, 1]


def test_a_participant_copied_under_another_name_is_refused(rated, tmp_path) -> None:
    outcome = rated(HEADER + ROWS + ROWS.replace("a,", "b,"))
    assert outcome.code == 2
    assert "participant P02, session 01: its trials are those of sub-P01/ses-01" in outcome.err
    assert not (tmp_path / "lab").exists()


def test_simulated_rows_stay_simulated_and_do_not_mix(rated, tmp_path) -> None:
    lines = (HEADER + ROWS).splitlines()
    said = [f"{line},{'simulated' if n == 0 else 'true'}" for n, line in enumerate(lines)]
    mixed = rated("\n".join([*said[:-1], said[-1].replace("true", "false")]) + "\n")
    assert mixed.code == 2
    assert "not simulated, but others are" in mixed.err
    outcome = rated("\n".join(said) + "\n")
    assert outcome.code == 0, outcome.err
    assert "simulated: all rows say so" in outcome.out
    assert all(trial["simulated"] for trial in trials(tmp_path))


def test_a_wide_column_of_an_unknown_version_is_refused(rated) -> None:
    text = "participant,gym_TBM,gym_const\na,4,3\n"
    options = ("--wide", "rating={sequence}_{version}", "--value", "version:ours=TBM")
    outcome = rated(text, *options)
    assert outcome.code == 2
    assert "the column 'gym_const'" in outcome.err
    assert "--value version:baseline=const" in outcome.err
    assert rated(text, *options, "--value", "version:baseline=const").code == 0


@pytest.mark.parametrize("date", ["1990-01-01", "1990-01-01T00:00:00", "1.1.1990"])  # T: of a workbook
def test_a_date_is_no_identifier(rated, date) -> None:
    outcome = rated(HEADER + ROWS.replace("a,", f"{date},"))
    assert outcome.code == 2
    assert "looks like a date" in outcome.err


NAMES = ["Anna", "Müller 3", "O'Brien", "José García", "日本1", "Jose\u0301", "01"]


def test_names_become_codes_whose_key_lies_beside_the_data_set_alone(rated, tmp_path, command) -> None:
    """One of all ids without a digit, or with other letters, is enough; the order is that of the rows."""
    rows = [f"{who},{n},gym,{version},4,{n}.5\n"
            for n, (who, version) in enumerate(itertools.product(NAMES, ("ours", "baseline")))]  # fmt: skip
    outcome = rated(HEADER + "".join(rows))
    assert outcome.code == 0, outcome.err
    key, out = tmp_path / "lab.key.csv", tmp_path / "lab"
    found = list(csv.reader(key.read_text(encoding="utf-8").splitlines()))
    assert found == [["participant_id", "source_id"], *([f"P{n:02d}", who] for n, who in enumerate(NAMES, 1))]
    assert os.name == "nt" or key.stat().st_mode & 0o777 == 0o600
    assert str(key) in outcome.out
    held = "\n".join(
        [*map(str, out.rglob("*")), *(p.read_text("utf-8") for p in out.rglob("*") if p.is_file())]
    )
    assert not [who for who in NAMES[:-1] if who in held]
    assert {folder.name for folder in out.glob("sub-*")} == {f"sub-P{n:02d}" for n in range(1, 8)}
    shutil.rmtree(out)
    again = rated(HEADER + "".join(rows))
    assert again.code == 2
    assert "a key that is there is never overwritten" in again.err
    assert not out.exists()


def test_a_name_given_by_an_option_is_not_in_the_manifest(rated, tmp_path) -> None:
    rows = ROWS.replace("a,", ",")
    assert rated(HEADER + rows, "--column", "participant_id=", "--constant", "participant_id=Anna").code == 0
    assert not [p for p in (tmp_path / "lab").rglob("*") if p.is_file() and "Anna" in p.read_text()]
    assert "P01,Anna" in (tmp_path / "lab.key.csv").read_text()


def test_sequences_keep_their_letters(rated, tmp_path, command) -> None:
    named = {"gym": "Ku\u0308che (abends)", "hall": "図書館"}
    outcome = rated(HEADER + ROWS.replace("gym", named["gym"]).replace("hall", named["hall"]))
    assert outcome.code == 0, outcome.err
    assert [trial["sequence"] for trial in trials(tmp_path)] == ["Küche_abends"] * 2 + ["図書館"] * 2
    assert command("validate", tmp_path / "lab").code == 0
    report = command("analyze", tmp_path / "lab", "--out", tmp_path / "report")
    assert report.code == 0, report.err
    assert "Küche abends" in (tmp_path / "report/report.html").read_text(encoding="utf-8")


def test_a_session_keeps_its_name_or_gets_a_number(rated, tmp_path) -> None:
    text = HEADER.replace("\n", ",session\n") + "".join(f"{r},früh\n" for r in ROWS.splitlines())
    outcome = rated(text)
    assert outcome.code == 0, outcome.err
    assert "session_id: 01 for 'früh'" in outcome.out


def test_no_file_name_is_in_the_data_set(tmp_path, command) -> None:
    (tmp_path / "Anna_Meier.csv").write_text(HEADER + ROWS)
    out = tmp_path / "lab"
    assert command("import", tmp_path / "Anna_Meier.csv", "--task", "rating", "--out", out).code == 0
    assert not [path for path in out.rglob("*") if path.is_file() and "Anna" in path.read_text()]


def test_a_block_of_ramps_that_comes_again_is_refused(tmp_path, command) -> None:
    header = "participant,trial_index,factor,rate_cd_per_m2_per_s,duration_s,response,response_time_s\n"
    shown = [(0.5 + 0.05 * (n % 4), 1 + n, "yes" if n % 3 else "no") for n in range(10)]
    lines = [
        f"a,{n},{shown[n % 10][0]:g},{shown[n % 10][1]},5,{shown[n % 10][2]},{0.5 + n % 10 / 100}\n"
        for n in range(20)
    ]
    (tmp_path / "ramps.csv").write_text(header + "".join(lines))
    rate = ("--column", "rate=rate_cd_per_m2_per_s", "--unit", "rate=cd/m^2/s")
    outcome = command(
        "import", tmp_path / "ramps.csv", "--task", "ramp", "--display", "varjo-xr3", *rate,
        "--out", tmp_path / "lab",
    )  # fmt: skip
    assert outcome.code == 2
    assert "lines 12 to 21 are 2 to 11 again" in outcome.err


# --- import several files

HEADER_OF_IMPORT_SEVERAL_FILES = "participant,session,scene,condition,slider.response,date,\n"

OPTIONS = (
    "--task", "rating", "--column", "sequence=scene", "--column", "version=condition",
    "--column", "rating=slider.response", "--value", "version:ours=TBM", "--value", "version:baseline=const",
)  # fmt: skip


def rows(participant: str, *ratings: object, day: str = "1") -> str:
    shown = zip(("gym,TBM", "gym,const"), ratings, strict=True)
    routine = f"{participant},001,,,,{day},\n"
    return (
        HEADER_OF_IMPORT_SEVERAL_FILES
        + routine
        + "".join(f"{participant},001,{what},{r},{day},\n" for what, r in shown)
    )


@pytest.fixture
def imported(tmp_path, command):
    def run(files: dict[str, str], *options: str):
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        return command(
            "import", *(tmp_path / name for name in files), "--out", tmp_path / "lab", *OPTIONS, *options
        )

    return run


def test_each_file_is_a_participant_and_is_numbered_in_its_manifest(imported, tmp_path, command) -> None:
    outcome = imported({"a.csv": rows("1", 5, 2), "b.csv": rows("2", 4, 3)})
    assert outcome.code == 0, outcome.err
    assert "2 participants, 2 sessions, 4 trials" in outcome.out
    for name, participant, ratings in (("file 1 of 2", "1", [5, 2]), ("file 2 of 2", "2", [4, 3])):
        session = tmp_path / "lab" / f"sub-{participant}" / "ses-001"
        manifest = json.loads((session / "manifest.json").read_text())
        assert manifest["source"]["file"] == name
        assert list(manifest["provenance"]["inputs"]) == [name]
        trials = [json.loads(line) for line in (session / "trials.jsonl").read_text().splitlines()]
        assert [trial["rating"] for trial in trials] == ratings
    assert command("validate", tmp_path / "lab").code == 0
    assert command("analyze", tmp_path / "lab", "--out", tmp_path / "report").code == 0
    assert "imported from file 1 of 2, file 2 of 2" in (tmp_path / "report" / "report.html").read_text()


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (rows("1", 4, 3), "sequence gym, version ours is there already, in line 3 of a.csv"),
        (rows("01", 4, 3), "'01', and '1' of line 3 of a.csv, would be one participant_id"),
        (rows("2", 4, 3).replace("slider.response", "key"), "b.csv: no row of it is a trial"),
        (rows("2", "x", "x"), "b.csv, line 3, column 'slider.response': expected a number, got 'x'"),
        (rows("2", 4, 3).replace(",", ";"), "b.csv: CSV with semicolons, but"),
    ],
    ids=["same trial", "nearly the same name", "other columns", "bad value", "other kind of table"],
)  # fmt: skip
def test_files_that_do_not_go_together_are_refused(imported, tmp_path, second, words) -> None:
    outcome = imported({"a.csv": rows("1", 5, 2), "b.csv": second})
    assert outcome.code == 2
    assert words in outcome.err
    assert not (tmp_path / "lab").exists()


def test_a_session_in_two_files_is_refused_until_a_column_tells_them_apart(imported) -> None:
    files = {"a.csv": rows("1", 5, 2), "b.csv": rows("1", 4, 3, day="2").replace("gym", "library")}
    outcome = imported(files)
    assert outcome.code == 2
    assert "session 001 of participant 1 is in" in outcome.err
    outcome = imported(files, "--column", "session_id=date")
    assert outcome.code == 0, outcome.err
    assert "1 participant, 2 sessions, 4 trials" in outcome.out


def test_each_file_has_decimals_of_its_own(imported, tmp_path) -> None:
    def timed(participant: str, time: str) -> str:
        return rows(participant, 5, 2).replace(",", ";").replace("date;", "rt").replace(";1;", f";{time}")

    outcome = imported(
        {"a.csv": timed("1", "1,5"), "b.csv": timed("2", "2.5")},
        "--column", "response_time=rt", "--unit", "response_time=s",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    times = {
        json.loads(line)["response_time_s"]
        for path in (tmp_path / "lab").glob("sub-*/ses-*/trials.jsonl")
        for line in path.read_text().splitlines()
    }
    assert times == {1.5, 2.5}
