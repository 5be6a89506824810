"""A file for each participant, as programs of experiments write them, becomes one data set."""

import json

import pytest

HEADER = "participant,session,scene,condition,slider.response,date,\n"
OPTIONS = (
    "--task", "rating", "--column", "sequence=scene", "--column", "version=condition",
    "--column", "rating=slider.response", "--value", "version:ours=TBM", "--value", "version:baseline=const",
)  # fmt: skip


def rows(participant: str, *ratings: int, day: str = "1") -> str:
    shown = zip(("gym,TBM", "gym,const"), ratings, strict=True)
    routine = f"{participant},001,,,,{day},\n"
    return HEADER + routine + "".join(f"{participant},001,{what},{r},{day},\n" for what, r in shown)


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
        (rows("2", 4, 9), "b.csv, line 4, column 'slider.response': rating must be at most 5, got 9"),
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
