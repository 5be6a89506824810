"""`evenlight simulate ramp`: the data set it writes."""

import csv
import json
from pathlib import Path

import pytest

from data_schema.errors import InputError
from data_schema.mapping import record_from_mapping
from data_schema.ramp import RampDesign, RampTrial
from data_schema.session import SessionManifest
from data_schema.text_files import read_json_record, write_toml_record
from experiments.commands import simulate

DESIGN = RampDesign(
    factors=(0.4, 1.0), relative_rates=(0.02, 0.05), repetitions=2
)  # 16 ramps, 4 catch trials


@pytest.fixture(scope="module")
def design_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("design") / "small.toml"
    write_toml_record(path, DESIGN)
    return path


@pytest.fixture(scope="module")
def dataset(design_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "dataset"
    simulate("ramp", out=folder, participants=3, seed=7, design=design_file, quiet=True)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def trials(dataset: Path, participant: str) -> list[dict[str, object]]:
    path = dataset / f"sub-{participant}/ses-01/trials.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_the_layout_is_that_of_bids_and_says_simulated(dataset: Path) -> None:
    description = json.loads((dataset / "dataset_description.json").read_text())
    assert {"Name", "BIDSVersion", "DatasetType", "GeneratedBy"} <= set(description)
    assert "simulated" in description["Name"]
    rows = list(csv.reader((dataset / "participants.tsv").read_text().splitlines(), delimiter="\t"))
    assert rows == [["participant_id", "simulated"], *[[f"sub-0{k}", "true"] for k in (1, 2, 3)]]
    for k in (1, 2, 3):
        session = dataset / f"sub-0{k}/ses-01"
        for name in ("manifest.json", "trials.jsonl", f"beh/sub-0{k}_ses-01_task-ramp_beh.tsv"):
            assert (session / name).is_file()


def test_every_session_is_complete_and_marked_simulated(dataset: Path) -> None:
    manifest = read_json_record(SessionManifest, dataset / "sub-02/ses-01/manifest.json")
    assert manifest.simulated
    assert manifest.design == DESIGN
    assert manifest.provenance.seed == 7
    assert manifest.n_trials == 20 == len(trials(dataset, "02"))
    assert all(t["simulated"] for t in trials(dataset, "02"))
    assert [t["trial_index"] for t in trials(dataset, "02")] == list(range(20))


def test_the_exported_table_holds_the_trials_and_describes_each_column_with_unit_and_levels(
    dataset: Path,
) -> None:
    table = dataset / "sub-01/ses-01/beh/sub-01_ses-01_task-ramp_beh.tsv"
    rows = list(csv.DictReader(table.read_text().splitlines(), delimiter="\t"))
    sidecar = json.loads(table.with_suffix(".json").read_text())
    for row, recorded in zip(rows, trials(dataset, "01"), strict=True):
        assert float(row["rate_cd_m2_s"]) == recorded["rate_cd_m2_s"]
        assert row["response"] == recorded["response"]
        assert row["response_time_s"] == "n/a"
        assert row["is_catch"] == str(recorded["is_catch"]).lower()
    assert set(rows[0]) == set(sidecar) - {"TaskName"}
    assert sidecar["rate_cd_m2_s"]["Units"] == "cd/m^2/s"
    assert set(sidecar["response"]["Levels"]) == {"yes", "no"}
    assert sidecar["TaskName"] == "ramp"


def test_participants_differ_in_their_order_and_in_their_truth(dataset: Path) -> None:
    orders = [[t["rate_cd_m2_s"] for t in trials(dataset, k)] for k in ("01", "02", "03")]
    assert orders[0] != orders[1] != orders[2] != orders[0]
    truth = json.loads((dataset / "simulated_truth.json").read_text())
    assert truth["simulated"] is True
    assert len({p["sensitivity"] for p in truth["participants"]}) == 3
    assert [level["luminance_cd_m2"] for level in truth["participants"][0]["levels"]][:2] == pytest.approx(
        [0.4 * 104.4, 104.4]
    )


def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not(
    dataset: Path, design_file: Path, tmp_path: Path
) -> None:
    simulate("ramp", out=tmp_path / "a", participants=3, seed=7, design=design_file, quiet=True)
    simulate("ramp", out=tmp_path / "b", participants=3, seed=8, design=design_file, quiet=True)
    assert files(tmp_path / "a") == files(dataset)
    changed = "sub-01/ses-01/trials.jsonl"
    assert files(tmp_path / "b")[changed] != files(dataset)[changed]


def test_a_participant_is_the_same_however_many_there_are(
    dataset: Path, design_file: Path, tmp_path: Path
) -> None:
    simulate("ramp", out=tmp_path / "one", participants=1, seed=7, design=design_file, quiet=True)
    assert trials(tmp_path / "one", "01") == trials(dataset, "01")


def test_data_are_never_overwritten(dataset: Path, design_file: Path) -> None:
    before = files(dataset)
    with pytest.raises(InputError, match="never overwritten"):
        simulate("ramp", out=dataset, participants=1, seed=1, design=design_file, quiet=True)
    assert files(dataset) == before


def test_a_file_in_the_place_of_the_data_set_is_left_alone(design_file: Path, tmp_path: Path) -> None:
    place = tmp_path / "notes.txt"
    place.write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt: is there already"):
        simulate("ramp", out=place, participants=1, seed=1, design=design_file, quiet=True)
    assert place.read_text() == "mine"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"task": "jump"}, "task 'jump' cannot be simulated; there is 'ramp'"),
        ({"participants": 0}, "--participants must lie in 1 to 9999, got 0"),
        ({"seed": -1}, "--seed must be 0 or more, got -1"),
        ({"display": "varjo-xr4"}, "no such display; did you mean 'varjo-xr3'"),
    ],
)
def test_unusable_options_are_named_and_nothing_is_written(
    tmp_path: Path, changed: dict[str, object], words: str
) -> None:
    options: dict[str, object] = {"task": "ramp", "out": tmp_path / "d", "participants": 1, "quiet": True}
    with pytest.raises(InputError, match=words):
        simulate(**{**options, **changed})  # type: ignore[arg-type] # options of mixed types
    assert not (tmp_path / "d").exists()


def test_a_trial_reads_back_as_it_was_written(dataset: Path) -> None:
    first = record_from_mapping(RampTrial, trials(dataset, "01")[0], "line 1")
    assert first.final_luminance == pytest.approx(first.initial_luminance - first.rate * first.duration)
