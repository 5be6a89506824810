"""A data set as others read it: BIDS, judged by its own validator, and Psych-DS."""

import csv
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record

pytestmark = pytest.mark.slow

VALIDATOR = Path(sys.executable).with_name("bids-validator-deno")
# The file names that the specification of Psych-DS, schema 1.5.0, allows.
FILE_NAME = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
NAMES = ("name", "birth", "email", "address", "phone")
Run = Callable[..., Any]


@pytest.fixture
def lab(tmp_path: Path, command: Run) -> Path:
    """Two participants, one of them with two sessions, all files of a session."""
    design = tmp_path / "small.design.toml"
    write_toml_record(design, RampDesign(factors=(0.5,), relative_rates=(0.02, 0.05), repetitions=1))
    for participant, session in (("01", "01"), ("01", "02"), ("02", "01")):
        words = ["--participant", participant, "--session", session, "--rig", "simulated"]
        ended = command(
            "run", "ramp", *words, "--simulate", "data", "--design", design, "--out", tmp_path / "lab"
        )
        assert ended.code == 0, ended.err
    return tmp_path / "lab"


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
    assert left == {".json", ".tsv", ""}


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
    measured = {variable["name"] for variable in description["variableMeasured"]}
    tables = list((out / "data").iterdir())
    assert len(tables) == 4
    for table in tables:
        assert FILE_NAME.fullmatch(table.name), table
        with table.open(newline="") as stream:
            rows = list(csv.reader(stream))
        assert set(rows[0]) <= measured
        assert {len(row) for row in rows} == {len(rows[0])}
        assert len(rows) > 1
    assert "no person took part" in description["description"]


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
