"""A manifest's task decides what its design is; what a manifest does not hold is not compared with."""

import json
from pathlib import Path

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_writing import (
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.session import (
    ComparisonDesign,
    Design,
    RatingDesign,
    SearchDesign,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

LAB = Display("lab", peak_luminance=100.0, black_level=0.1, gamma=2.2, pixels_per_degree=60.0)


def manifest(design: Design | None = None, task: str = "rating") -> SessionManifest:
    return SessionManifest(
        "01",
        "01",
        task,
        False,
        SessionStatus.COMPLETE,
        1,
        display=LAB,
        design=design,
        provenance=Provenance(),
    )


@pytest.mark.parametrize(
    ("task", "design"),
    [("rating", RatingDesign), ("comparison", ComparisonDesign), ("search", SearchDesign)],
)
def test_a_design_of_its_sequences_alone_is_of_the_manifests_task(task, design) -> None:
    content = mapping_from_record(manifest(task=task)) | {"design": {"sequences": ["gym"]}}
    assert record_from_mapping(SessionManifest, content, "m.json").design == design(sequences=("gym",))


def test_a_key_that_only_another_tasks_design_has_is_refused() -> None:
    content = mapping_from_record(manifest()) | {"design": {"sequences": ["gym"], "ring_gap_arcmin": 5.0}}
    with pytest.raises(InputError, match=r"design: unknown key 'ring_gap_arcmin'"):
        record_from_mapping(SessionManifest, content, "m.json")


def written(tmp_path: Path, design: RatingDesign | None) -> Path:
    trial = RatingTrial("01", "01", 0, "gym", Version.OURS, 1, 1, 0.5, 4, None, False)
    write_description(tmp_path / "lab", "ratings", False, Provenance())
    write_participants(tmp_path / "lab", ["01"], simulated=False)
    write_session(tmp_path / "lab", manifest(design), [trial])
    return tmp_path / "lab"


@pytest.mark.parametrize("design", [None, RatingDesign(sequences=("gym",))])
def test_trials_of_a_manifest_without_stimuli_are_valid(tmp_path, command, design) -> None:
    checked = command("validate", written(tmp_path, design))
    assert checked.out.splitlines()[-1].startswith("no problem")


def test_they_are_compared_with_the_sequences_of_the_design(tmp_path, command) -> None:
    checked = command("validate", written(tmp_path, RatingDesign(sequences=("library", "house"))), "--quiet")
    assert "sequence: expected one of library, house, as in manifest.json, got 'gym'" in checked.out


def test_an_exported_table_that_is_no_text_is_a_problem_and_no_end(tmp_path, command) -> None:
    lab = written(tmp_path, None)
    next(lab.glob("sub-01/ses-01/beh/*_beh.tsv")).write_bytes(b"\xff\xfe\x00")
    checked = command("validate", lab, "--quiet")
    assert checked.code == 1
    assert "is not text" in checked.out


def test_exported_tables_of_before_a_column_was_there_stay_valid(tmp_path, command) -> None:
    """Practice, block and all after them have defaults: a table of an older version may lack them."""
    lab = written(tmp_path, None)
    table = next(lab.glob("sub-01/ses-01/beh/*_beh.tsv"))
    header, row = (line.split("\t") for line in table.read_text().splitlines())
    last = header.index("flag")
    table.write_text("\t".join(header[:last]) + "\n" + "\t".join(row[:last]) + "\n")
    sidecar = json.loads(table.with_suffix(".json").read_text())
    del sidecar["flag"]
    table.with_suffix(".json").write_text(json.dumps(sidecar))
    assert command("validate", lab, "--quiet").out == ""
