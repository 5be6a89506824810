"""`evenlight simulate ramp`: the data set it writes."""

import csv
import dataclasses
import json
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.storage.text_files import read_json_record, write_toml_record
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.ramp_plan import ramp_levels
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.ramp.simulate_ramp import simulated_trials_and_thresholds
from evenlight.experiments.simulate_command import simulate
from evenlight.method.preset_files import load_display

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
    simulate("ramp", out=folder, participants=3, seed=7, design=str(design_file), quiet=True)
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
    assert set(sidecar["response"]["Levels"]) == {"yes", "no", "first", "second"}
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
    simulate("ramp", out=tmp_path / "a", participants=3, seed=7, design=str(design_file), quiet=True)
    simulate("ramp", out=tmp_path / "b", participants=3, seed=8, design=str(design_file), quiet=True)
    assert files(tmp_path / "a") == files(dataset)
    changed = "sub-01/ses-01/trials.jsonl"
    assert files(tmp_path / "b")[changed] != files(dataset)[changed]


def test_a_participant_is_the_same_however_many_there_are(
    dataset: Path, design_file: Path, tmp_path: Path
) -> None:
    simulate("ramp", out=tmp_path / "one", participants=1, seed=7, design=str(design_file), quiet=True)
    assert trials(tmp_path / "one", "01") == trials(dataset, "01")


def test_data_are_never_overwritten(dataset: Path, design_file: Path) -> None:
    before = files(dataset)
    with pytest.raises(InputError, match="never overwritten"):
        simulate("ramp", out=dataset, participants=1, seed=1, design=str(design_file), quiet=True)
    assert files(dataset) == before


def test_a_file_in_the_place_of_the_data_set_is_left_alone(design_file: Path, tmp_path: Path) -> None:
    place = tmp_path / "notes.txt"
    place.write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt: is there already"):
        simulate("ramp", out=place, participants=1, seed=1, design=str(design_file), quiet=True)
    assert place.read_text() == "mine"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"task": "jump"}, "task 'jump' cannot be simulated; there is 'ramp'"),
        ({"participants": 0}, "--participants must lie in 1 to 9999, got 0"),
        ({"seed": -1}, "seed must be 0 or more, got -1"),
        ({"design": "papper"}, "papper: no such design; did you mean 'paper'"),
        ({"display": "varjo-xr4"}, "no such display; did you mean 'varjo-xr3'"),
    ],
)
def test_unusable_options_are_named_and_nothing_is_written(
    tmp_path: Path, changed: dict[str, object], words: str
) -> None:
    options: dict[str, object] = {"task": "ramp", "out": tmp_path / "d", "participants": 1, "quiet": True}
    with pytest.raises(InputError, match=words):
        simulate(**{**options, **changed})
    assert not (tmp_path / "d").exists()


def test_a_trial_reads_back_as_it_was_written(dataset: Path) -> None:
    first = record_from_mapping(RampTrial, trials(dataset, "01")[0], "line 1")
    assert first.final_luminance == pytest.approx(first.initial_luminance - first.rate * first.duration)


def test_a_session_can_be_taken_up_with_what_its_manifest_says(dataset: Path) -> None:
    manifest = read_json_record(SessionManifest, dataset / "sub-02/ses-01/manifest.json")
    schedule = RampSchedule(manifest.design, manifest.display, manifest.provenance.seed, manifest.order_index)
    for line in trials(dataset, "02"):
        schedule.take(record_from_mapping(RampTrial, line, "line"))
    assert schedule.next_trial() is None


def test_blocks_are_counterbalanced_over_the_participants(dataset: Path) -> None:
    first = [trials(dataset, participant)[0]["screen"] for participant in ("01", "02", "03")]
    assert first == ["white", "gray", "white"]


@pytest.fixture(scope="module")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("crossed") / "dataset"
    simulate("ramp", out=folder, participants=2, seed=7, design="durations_and_directions", quiet=True)
    return folder


def test_the_truth_has_a_threshold_for_every_level_direction_and_duration(crossed: Path) -> None:
    truth = json.loads((crossed / "simulated_truth.json").read_text())["participants"][0]
    levels = {
        (level["factor"], level["direction"], level["ramp_duration_s"]): level for level in truth["levels"]
    }
    assert len(levels) == 2 * 2 * 3
    assert {level["procedure"] for level in truth["levels"]} == {"two_interval"}
    threshold = {key: level["threshold_cd_m2_s"] for key, level in levels.items()}
    # duration^-0.5 and a ratio of 1.1, in either task alike.
    assert threshold[0.6, "down", 2.5] / threshold[0.6, "down", 10.0] == pytest.approx(2.0)
    assert threshold[0.6, "up", 5.0] / threshold[0.6, "down", 5.0] == pytest.approx(1.1)


def test_answers_in_memory_are_those_of_the_data_set(crossed: Path) -> None:
    design, display = load_design("durations_and_directions"), load_display("varjo-xr3")
    in_memory, _ = simulated_trials_and_thresholds(design, display, participants=2, seed=7)
    written = [
        record_from_mapping(RampTrial, line, "line") for who in ("01", "02") for line in trials(crossed, who)
    ]
    assert in_memory == written


def test_the_thresholds_that_go_with_them_are_those_of_the_task() -> None:
    design, display = load_design("quick"), load_display("varjo-xr3")
    _, two = simulated_trials_and_thresholds(design, display, participants=1, seed=7)
    asked = dataclasses.replace(design, procedure=Procedure.YES_NO)
    _, yes_no = simulated_trials_and_thresholds(asked, display, participants=1, seed=7)
    assert set(two) == {("01", level.luminance) for level in ramp_levels(design, display)}
    assert all(two[level] < yes_no[level] for level in two)
