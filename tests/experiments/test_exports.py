"""A data set as others read it: BIDS, judged by its own validator, and Psych-DS."""

import csv
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from evenlight import command as command_line
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record

VALIDATOR = Path(sys.executable).with_name("bids-validator-deno")
CLASSIC = shutil.which("bids-validator")  # of the specification's years before the schema; needs node
# The file names that the specification of Psych-DS, schema 1.5.0, allows.
FILE_NAME = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
TABLE = "sub-01/ses-01/beh/sub-01_ses-01_task-ramp_beh.tsv"
NAMES = ("name", "birth", "email", "address", "phone")
Run = Callable[..., Any]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two participants, one of them with two sessions, all files of a session."""
    folder = tmp_path_factory.mktemp("recorded")
    design = folder / "small.design.toml"
    write_toml_record(design, RampDesign(factors=(0.5,), relative_rates=(0.02, 0.05), repetitions=1))
    for participant, session in (("01", "01"), ("01", "02"), ("02", "01")):
        words = ["--participant", participant, "--session", session, "--rig", "simulated"]
        with pytest.raises(SystemExit) as ended:
            command_line.main(
                [
                    "run",
                    "ramp",
                    *words,
                    "--simulate",
                    "data",
                    "--design",
                    str(design),
                    "--out",
                    str(folder / "lab"),
                ]
            )
        assert not ended.value.code
    return folder / "lab"


@pytest.fixture
def lab(recorded: Path, tmp_path: Path) -> Path:
    """What was recorded, for a test that may change it."""
    return shutil.copytree(recorded, tmp_path / "lab", symlinks=True)


def errors_of(dataset: Path) -> list[str]:
    """What the validator of BIDS calls an error."""
    ended = subprocess.run(
        [str(VALIDATOR), "--format", "json", "--max-rows", "-1", str(dataset)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    issues = json.loads(ended.stdout)["issues"]["issues"]
    assert issues, "the validator always recommends something"
    return [f"{i['code']} {i.get('location')}" for i in issues if i["severity"] == "error"]


def test_the_validator_of_bids_finds_no_error_in_a_data_set_as_it_is_recorded(lab: Path) -> None:
    assert errors_of(lab) == []


def test_the_validator_of_bids_finds_no_error_in_the_export(lab: Path, tmp_path: Path, command: Run) -> None:
    ended = command("export", lab, "--to", "bids", "--out", tmp_path / "bids")
    assert (ended.code, "3 tables of trials" in ended.out) == (0, True)
    assert errors_of(tmp_path / "bids") == []
    left = {p.suffix for p in (tmp_path / "bids").rglob("*") if p.is_file()}
    assert left == {".json", ".tsv", ".jsonl", ""}


@pytest.mark.skipif(
    not CLASSIC, reason="the classic validator of BIDS (npm: bids-validator) is not installed"
)
def test_the_classic_validator_of_bids_finds_no_error_either(lab: Path, tmp_path: Path, command: Run) -> None:
    """It has rules of its own, such as TSV_EMPTY_CELL, and finds that one in the data set itself."""
    assert command("export", lab, "--to", "bids", "--out", tmp_path / "bids").code == 0
    found = {}
    for name, folder in (("lab", lab), ("bids", tmp_path / "bids")):
        words = [str(CLASSIC), "--json", str(folder)]
        ended = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
        found[name] = [error["key"] for error in json.loads(ended.stdout)["issues"]["errors"]]
    assert found == {"lab": ["TSV_EMPTY_CELL"], "bids": []}


def tables_of(export: Path, to: str) -> tuple[pd.DataFrame, pd.DataFrame, list[Path]]:
    """The participants and the trials of an export as others read them, and the files."""
    ending, separator = ("tsv", "\t") if to == "bids" else ("csv", ",")
    names = ("participants.tsv", "sub-*/ses-*/beh/*_beh.tsv")
    if to == "psych-ds":
        names = ("data/group-participants_data.csv", "data/subject-*_data.csv")
    people, trials = (sorted(export.glob(name)) for name in names)
    assert (len(people), len(trials), {path.suffix for path in people + trials}) == (1, 3, {f".{ending}"})
    both = [pd.concat(pd.read_csv(path, sep=separator) for path in paths) for paths in (people, trials)]
    return both[0], both[1], [*people, *trials]


@pytest.mark.parametrize("to", ["bids", "psych-ds"])
def test_participants_join_their_trials_and_no_cell_is_empty(
    lab: Path, tmp_path: Path, command: Run, to: str
) -> None:
    """Each of three sessions has a table; an age that the lab did not note is an empty cell of its list."""
    listed = (lab / "participants.tsv").read_text().splitlines()
    ages = ("age_band", "30-39", "")
    (lab / "participants.tsv").write_text(
        "".join(f"{line}\t{age}\n" for line, age in zip(listed, ages, strict=True))
    )
    out = tmp_path / "out"
    assert command("export", lab, "--to", to, "--out", out).code == 0
    people, trials, files = tables_of(out, to)
    assert len(trials) == sum(len(path.read_text().splitlines()) for path in lab.rglob("trials.jsonl"))
    joined = trials.merge(people, on="participant_id", how="left", indicator=True)
    assert set(joined["_merge"]) == {"both"}
    assert joined["age_band"].isna().tolist() == (trials["participant_id"] == "sub-02").tolist()
    for path in files:
        cells = [re.split("[\t,]", line) for line in path.read_text().splitlines()]
        assert all(cell.strip() for row in cells for cell in row), path
    assert command("validate", out, "--quiet").code == 0


def test_an_exported_table_can_be_imported_as_the_same_participant(
    lab: Path, tmp_path: Path, command: Run
) -> None:
    assert command("export", lab, "--to", "bids", "--out", tmp_path / "bids").code == 0
    words = ("--task", "ramp", "--display", "varjo-xr3", "--out", tmp_path / "again")
    assert command("import", tmp_path / "bids" / TABLE, *words).code == 0
    assert [path.name for path in (tmp_path / "again").glob("sub-*")] == ["sub-01"]


@pytest.mark.parametrize("column", ["participant_id", "flag"])
def test_a_changed_cell_of_an_exported_table_is_found(
    lab: Path, tmp_path: Path, command: Run, column: str
) -> None:
    assert command("export", lab, "--to", "bids", "--out", tmp_path / "bids").code == 0
    table = tmp_path / "bids" / TABLE
    header, first, *rest = [line.split("\t") for line in table.read_text().splitlines()]
    first[header.index(column)] = {"participant_id": "sub-02", "flag": "dropped_frames"}[column]
    table.write_text("".join("\t".join(cells) + "\n" for cells in (header, first, *rest)))
    ended = command("validate", tmp_path / "bids")
    assert ended.code
    assert f"{column}: not as in line 1 of trials.jsonl" in ended.out + ended.err


def test_the_validator_would_find_a_table_without_descriptions(lab: Path) -> None:
    """So that the tests above can fail."""
    table = next(lab.glob("sub-01/ses-01/beh/*.tsv"))
    table.write_text(table.read_text().replace("\n", "\tx\n", 1))
    assert errors_of(lab)


def test_psych_ds_has_every_column_described_and_every_file_named_by_the_rules(
    lab: Path, tmp_path: Path, command: Run
) -> None:
    out = tmp_path / "psychds"
    assert command("export", lab, "--out", out).code == 0
    description = json.loads((out / "dataset_description.json").read_text())
    assert {"@context", "@type", "name", "description", "variableMeasured"} <= set(description)
    assert (description["@type"], description["@context"]) == ("Dataset", "https://schema.org/")
    described = {variable["name"] for variable in description["variableMeasured"]}
    measured = set(described)
    tables = list((out / "data").iterdir())
    assert len(tables) == 4
    for table in tables:
        assert FILE_NAME.fullmatch(table.name), table
        with table.open(newline="") as stream:
            rows = list(csv.reader(stream))
        assert set(rows[0]) <= described
        assert {len(row) for row in rows} == {len(rows[0])}
        assert len(rows) > 1
        measured -= set(rows[0])
    assert not measured  # a variable that is in no table is an error, too
    assert "no person took part" in description["description"]


@pytest.mark.parametrize(
    ("licence", "named", "url"),
    [
        ("cc-by-4.0", "CC-BY-4.0", "https://spdx.org/licenses/CC-BY-4.0"),
        ("ask us first", "ask us first", "ask us first"),
    ],
)
def test_authors_licence_and_ethics_of_a_new_study_reach_both_exports(
    lab: Path, tmp_path: Path, command: Run, licence: str, named: str, url: str
) -> None:
    ethics = "Ethics board, Example University, 2026-17"
    refused = command("new", "study", lab), command("new", "study", lab)
    assert [(one.code, one.err.count("\n")) for one in refused] == [(0, 0), (2, 1)]
    text = (lab / "study.toml").read_text()
    for key, value in (("authors", ["A. Reed", "Ö. Meyer"]), ("licence", licence), ("ethics", [ethics])):
        text, filled = re.subn(rf"(?m)^{key} = .*$", f"{key} = {json.dumps(value, ensure_ascii=False)}", text)
        assert filled == 1, key
    (lab / "study.toml").write_text(text, encoding="utf-8")
    assert command("validate", lab).code == 0
    told = {}
    for to in ("bids", "psych-ds"):
        ended = command("export", lab, "--to", to, "--out", tmp_path / to)
        assert (ended.code, f"SPDX knows no licence {licence!r}" in ended.err) == (0, licence == named)
        assert command("validate", tmp_path / to, "--quiet").code == 0
        told[to] = json.loads((tmp_path / to / "dataset_description.json").read_text())
    assert errors_of(tmp_path / "bids") == errors_of(lab) == []
    keys = ("Authors", "License", "EthicsApprovals")
    assert [told["bids"][key] for key in keys] == [["A. Reed", "Ö. Meyer"], named, [ethics]]
    assert [person["name"] for person in told["psych-ds"]["author"]] == ["A. Reed", "Ö. Meyer"]
    assert told["psych-ds"]["license"] == url
    assert ethics in told["psych-ds"]["description"]


def test_what_a_study_does_not_say_is_told_and_not_made_up(lab: Path, tmp_path: Path, command: Run) -> None:
    """A data set of an earlier version has no study.toml; another has one that is not filled in."""
    without = command("export", lab, "--to", "bids", "--out", tmp_path / "without")
    assert "says no authors and no licence and no ethics, so the export has none" in without.err
    assert f"evenlight new study {lab}" in without.err
    assert command("new", "study", lab).code == 0
    blank = command("export", lab, "--out", tmp_path / "blank")
    assert "says no authors and no licence and no ethics, so the export has none" in blank.err
    for folder in ("without", "blank"):
        told = json.loads((tmp_path / folder / "dataset_description.json").read_text())
        assert not {"Authors", "License", "EthicsApprovals", "author", "license"} & set(told)
    (lab / "study.toml").write_text("authors = 3\n")
    refused = command("export", lab, "--out", tmp_path / "refused")
    assert (refused.code, refused.err.count("\n"), (tmp_path / "refused").exists()) == (2, 1, False)


def test_study_and_pre_registration_are_there_before_the_first_session(tmp_path: Path, command: Run) -> None:
    assert command("new", "study", tmp_path / "lab").code == 0
    (tmp_path / "lab" / "preregistration.md").touch()
    words = ("--participant", "01", "--session", "01", "--rig", "simulated", "--design", "quick", "--quiet")
    ran = command("run", "ramp", *words, "--simulate", "data", "--out", tmp_path / "lab")
    assert ran.code == 0, ran.err


def test_psych_ds_lists_the_files_beside_data_that_it_does_not_define(
    lab: Path, tmp_path: Path, command: Run
) -> None:
    """Its specification: files that it does not define are allowed, and belong into `.psychds-ignore`."""
    out = tmp_path / "psychds"
    assert command("export", lab, "--out", out).code == 0
    ignored = (out / ".psychds-ignore").read_text().split()
    defined = {"dataset_description.json", "README.md", "data", ".psychds-ignore"}
    others = {path.name for path in out.iterdir()} - defined
    assert "sub-01" in others
    assert all(any(fnmatchcase(name, pattern) for pattern in ignored) for name in others)
    assert len(list(out.rglob("dataset_description.json"))) == 1


def test_the_validator_of_bids_finds_no_error_in_an_export_with_an_interrupted_session_and_a_roster(
    lab: Path, tmp_path: Path, command: Run
) -> None:
    """A session that was killed has no table yet; the last on the list has not begun."""
    shutil.rmtree(lab / "sub-02/ses-01/beh")
    manifest = lab / "sub-02/ses-01/manifest.json"
    manifest.write_text(manifest.read_text().replace('"status": "complete"', '"status": "running"'))
    with (lab / "participants.tsv").open("a") as stream:
        stream.write("sub-03\ttrue\n")
    for to in ("bids", "psych-ds"):
        ended = command("export", lab, "--to", to, "--out", tmp_path / to)
        assert (ended.code, "2 tables of trials" in ended.out) == (0, True), ended.err
        assert (tmp_path / to / "sub-02/ses-01/trials.jsonl").is_file()
        assert command("validate", tmp_path / to, "--quiet").code == 0
    assert errors_of(tmp_path / "bids") == []


BAD = {
    "a torn table": (TABLE, "\tno\t", "\t", "expected", "the table is torn"),
    "no number in a table": (TABLE, "\t0.5\t", "\tNaN\t", "factor: expected a number, got 'NaN'", ""),
    "a torn line": ("sub-01/ses-01/trials.jsonl", '"}\n', "", "last line is torn", ""),
    "no number in the trials": ("sub-01/ses-01/trials.jsonl", '"factor": 0.5', '"factor": NaN', "NaN", ""),
    "another participant": ("sub-01/ses-01/manifest.json", '_id": "01"', '_id": "09"', "expected '01'", ""),
    "a task in capitals": ("sub-01/ses-01/manifest.json", '"ramp"', '"Ramp"', "expected 'ramp'", ""),
}


@pytest.mark.parametrize("to", ["bids", "psych-ds"])
@pytest.mark.parametrize("damage", BAD)
def test_a_data_set_with_a_problem_is_not_exported(
    lab: Path, tmp_path: Path, command: Run, damage: str, to: str
) -> None:
    file, old, new, *said = BAD[damage]
    text = (lab / file).read_text()
    at = text.rindex(old)
    (lab / file).write_text(text[:at] + new + text[at + len(old) :])
    ended = command("export", lab, "--to", to, "--out", tmp_path / "out")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert all(words in ended.err for words in (*said, "`evenlight validate` finds no problem")), ended.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("to", ["bids", "psych-ds"])
@pytest.mark.parametrize("place", ["README", "sub-01/ses-01/events.jsonl", "sub-02"])
def test_no_link_is_followed_out_of_the_data_set(
    lab: Path, tmp_path: Path, command: Run, place: str, to: str
) -> None:
    (lab / place).rename(tmp_path / "private")
    (lab / place).symlink_to(tmp_path / "private")
    ended = command("export", lab, "--to", to, "--out", tmp_path / "out")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert f"{lab / place}" in ended.err
    assert "leads out of the data set" in ended.err
    assert not (tmp_path / "out").exists()


def test_what_is_neither_of_bids_nor_read_stays_at_home(lab: Path, tmp_path: Path, command: Run) -> None:
    (lab / "who_is_who.txt").write_text("sub-01 is Anna")
    (lab / "sub-01/ses-01/notes.txt").write_text("Anna was tired")
    for to in ("bids", "psych-ds"):
        assert command("export", lab, "--to", to, "--out", tmp_path / to).code == 0
        assert not list((tmp_path / to).rglob("*.txt"))


def test_a_session_that_was_declined_is_not_shared(lab: Path, tmp_path: Path, command: Run) -> None:
    """As the program leaves it: a manifest and events, without trials."""
    session = lab / "sub-02/ses-01"
    shutil.rmtree(session / "beh")
    for name in ("trials.jsonl", "frames.jsonl"):
        (session / name).unlink()
    manifest = session / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"status": "complete"', '"status": "declined"'))
    for to in ("bids", "psych-ds"):
        assert command("export", lab, "--to", to, "--out", tmp_path / to).code == 0
        assert not (tmp_path / to / "sub-02").exists()
        assert command("validate", tmp_path / to, "--quiet").code == 0
    assert errors_of(tmp_path / "bids") == []


def test_an_export_is_not_exported_again_as_if_it_were_the_data_set(
    lab: Path, tmp_path: Path, command: Run
) -> None:
    assert command("export", lab, "--out", tmp_path / "p").code == 0
    ended = command("export", tmp_path / "p", "--to", "bids", "--out", tmp_path / "b")
    assert (ended.code, "export the data set itself" in ended.err) == (2, True)


def test_no_personal_data_is_in_any_file(lab: Path) -> None:
    for path in lab.rglob("*_beh.json"):
        columns = set(json.loads(path.read_text())) - {"TaskName"}
        assert not [column for column in columns if any(word in column.lower() for word in NAMES)]
    header = (lab / "participants.tsv").read_text().split("\n")[0]
    assert header.split("\t") == ["participant_id", "simulated"]


@pytest.mark.parametrize("to", ["bids", "psych-ds"])
def test_an_export_overwrites_nothing_and_needs_tables(
    lab: Path, tmp_path: Path, command: Run, to: str
) -> None:
    ended = command("export", lab, "--to", to, "--out", lab)
    assert (ended.code, "is there already; give a new folder" in ended.err) == (2, True)
    (tmp_path / "empty").mkdir()
    ended = command("export", tmp_path / "empty", "--to", to, "--out", tmp_path / "x")
    assert (ended.code, "no table to export" in ended.err) == (2, True)
    assert not (tmp_path / "x").exists()
