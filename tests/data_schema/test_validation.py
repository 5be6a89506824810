"""`evenlight validate`: every problem is found, told with its place and line, and nothing else is."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checked_files import problems_of, results
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import evenlight
from evenlight import command as command_line
from evenlight.data_schema.checking.validation import mean_absolute_difference, validate
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import SCHEMA_VERSION, Provenance
from evenlight.data_schema.recordings.dataset_layout import behaviour_file, session_folder
from evenlight.data_schema.recordings.dataset_writing import (
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.ramp import RampTrial, Response
from evenlight.data_schema.recordings.session import (
    ComparisonDesign,
    Design,
    RatingDesign,
    SearchDesign,
    SessionManifest,
    SessionStatus,
)
from evenlight.data_schema.recordings.viewing import RatingTrial, Version
from evenlight.data_schema.storage.tables import columns_of
from evenlight.data_schema.storage.text_files import (
    Place,
    json_line_numbers,
    line_of,
    read_json_record,
    toml_line_numbers,
    write_json,
    write_json_record,
    write_toml_record,
)
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

VERSION = f'"schema_version": {SCHEMA_VERSION}'

CELLS = len(columns_of(RampTrial))


def trial(index: int, **changes: Any) -> dict[str, Any]:
    """A line of trials; the first is a catch trial."""
    rate = 0.0 if index == 0 else 2.0
    record = RampTrial(
        "01", "01", index, "white", 0.5, 50.0, 50.0 - 5 * rate, rate, 5.0, rate == 0, Response.NO, None, True
    )
    return mapping_from_record(record) | changes


def write_dataset(root: Path, manifest: SessionManifest, trials: list[dict[str, Any]]) -> Path:
    """A data set of one session, as BIDS lays it out; by hand, so that it does not depend on the writer."""
    folder = session_folder(root, "01", "01")
    table = behaviour_file(root, "01", "01", "ramp")
    table.parent.mkdir(parents=True)
    write_json(root / "dataset_description.json", {"Name": "made", "BIDSVersion": "1.10.0"})
    (root / "participants.tsv").write_text("participant_id\tsimulated\nsub-01\ttrue\n")
    write_json(root / "participants.json", {"participant_id": {"Description": "participant"}})
    write_json_record(folder / "manifest.json", manifest)
    (folder / "trials.jsonl").write_text("".join(json.dumps(line) + "\n" for line in trials))
    columns = columns_of(RampTrial)
    rows = [[cell(line[column]) for column in columns] for line in trials]
    table.write_text("".join("\t".join(cells) + "\n" for cells in [columns, *rows]))
    write_json(table.with_suffix(".json"), {column: {"Description": column} for column in columns})
    return root


def cell(value: Any) -> str:
    return "n/a" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


@pytest.fixture
def dataset(tmp_path: Path, manifest_of: Callable[..., SessionManifest]) -> Path:
    return write_dataset(tmp_path / "lab", manifest_of(), [trial(0), trial(1)])


TRIALS = "sub-01/ses-01/trials.jsonl"

MANIFEST = "sub-01/ses-01/manifest.json"

TABLE = "sub-01/ses-01/beh/sub-01_ses-01_task-ramp_beh.tsv"


def test_a_right_dataset_has_no_problem_and_every_file_is_checked(dataset: Path) -> None:
    found = {c.path.relative_to(dataset).as_posix(): c.words for c in validate(dataset)}
    assert problems_of(dataset) == []
    assert found == {
        "dataset_description.json": "description of a data set",
        MANIFEST: "session manifest",
        TRIALS: "ramp trial",
        TABLE: "exported trials",
        TABLE.replace(".tsv", ".json"): "description of columns",
        "participants.tsv": "list of participants",
        "participants.json": "description of columns",
    }


def test_the_writer_of_data_sets_and_the_checker_agree(tmp_path: Path) -> None:
    answer = CliRunner().invoke(
        command_line.app, ["simulate", "ramp", "--participants", "2", "--quiet", "--out", str(tmp_path / "d")]
    )
    assert answer.exit_code == 0
    assert problems_of(tmp_path / "d") == []


@pytest.mark.parametrize(
    ("file", "old", "new", "problem"),
    [
        (TRIALS, '"factor": 0.5', '"factor": 1.5', "line 1: factor: expected at most 1, got 1.5"),
        (TRIALS, '"factor"', '"factr"', "line 1: factr: unknown key 'factr'; did you mean 'factor'?"),
        (TRIALS, '"factor"', '"factr"', "line 1: the key 'factor' is missing"),
        (TRIALS, '"rate_cd_m2_s": 0.0', '"rate_cd_m2_s": 1.0', "only a catch trial has, got rate 1"),
        (
            TRIALS,
            '"trial_index": 1',
            '"trial_index": 0',
            "line 2: trial_index: 0 is there already, in line 1",
        ),
        (TRIALS, '"participant_id": "01"', '"participant_id": "02"', "expected '01', as in manifest.json"),
        (TRIALS, '"session_id": "01"', '"session_id": "02"', "line 1: session_id: expected '01'"),
        (TRIALS, '"simulated": true', '"simulated": false', "line 1: simulated: expected True"),
        (TRIALS, '"screen": "white"', '"screen": NaN', "line 1: not valid JSON (NaN is no number of JSON)"),
        (TRIALS, "{", "[", "line 1: not valid JSON"),
        (MANIFEST, '"gamma": 1.95', '"gamma": -1', "line 12: display.gamma: expected at least 0.5, got -1"),
        (MANIFEST, '"participant_id": "01"', '"participant_id": "07"', "expected '01', as in the folder's"),
        (MANIFEST, VERSION, '"schema_version": 9', "schema version 9, this Evenlight reads up"),
        (MANIFEST, '"black_level_cd_m2": 0.2', '"black_level_cd_m2": 200', "need black_level < peak_lum"),
        (TABLE, "\t0.5\t", "\t0.6\t", "line 2: factor: not as in line 1 of trials.jsonl"),
        (TABLE, "\tno\t", "\tmaybe\t", "line 2: response: expected one of 'yes', 'no', 'first', 'second'"),
        (TABLE, "\tn/a\t", "\t", f"line 2: expected {CELLS} cells, got {CELLS - 1}; the table is torn"),
        (TABLE, "screen\t", "sreen\t", "unknown column 'sreen'; did you mean 'screen'?"),
        ("participants.tsv", "sub-01", "sub-02", "'sub-01' has a folder and is not listed"),
        ("participants.tsv", "sub-01\ttrue", "sub-01\tfalse", "line 2: simulated: expected 'true'"),
        (
            "participants.tsv",
            "sub-01\ttrue",
            "sub-01\ttrue\nsub-01\ttrue",
            "line 3: participant_id: 'sub-01'",
        ),
        (
            "participants.tsv",
            "sub-01\t",
            "01\t",
            "line 2: participant_id: expected sub- and letters or digits",
        ),
        ("participants.tsv", "\ttrue", "", "line 2: expected 2 cells, got 1"),
        ("participants.tsv", "participant_id", "id", "line 1: expected the first column participant_id"),
        ("dataset_description.json", '"Name"', '"name"', "Name: expected text, got null"),
        ("participants.json", '"participant_id"', '"x"', "the column 'participant_id' is not described"),
    ],
)
def test_a_problem_is_told_with_its_place(file: str, old: str, new: str, problem: str, dataset: Path) -> None:
    text = (dataset / file).read_text()
    assert old in text
    (dataset / file).write_text(text.replace(old, new, 1))
    found = problems_of(dataset)
    assert any(told.startswith(file) and problem in told for told in found), found


@pytest.mark.parametrize(
    ("file", "problem"),
    [
        ("dataset_description.json", "no such file"),
        ("participants.tsv", "no such file"),
        ("participants.json", "no such file"),
        (MANIFEST, "no such file; every session has one"),
        (TRIALS, "no such file; the session is complete with 2 trials"),
        (TABLE, "no such file; trials.jsonl is to be exported there"),
        (TABLE.replace(".tsv", ".json"), "no such file"),
    ],
)
def test_a_missing_file_is_told(file: str, problem: str, dataset: Path) -> None:
    (dataset / file).unlink()
    assert any(told.startswith(f"{file}: {problem}") for told in problems_of(dataset))


@pytest.mark.parametrize("n_trials", [1, 3])
def test_a_complete_session_has_as_many_trials_as_its_manifest_says(n_trials: int, dataset: Path) -> None:
    text = (dataset / MANIFEST).read_text()
    (dataset / MANIFEST).write_text(text.replace('"n_trials": 2', f'"n_trials": {n_trials}'))
    wanted = f"expected {n_trials} usable trials, because the session is complete, got 2"
    assert problems_of(dataset) == [f"{TRIALS}: {wanted}"]


def test_a_torn_last_line_is_told_and_the_trials_before_it_count(dataset: Path) -> None:
    text = (dataset / TRIALS).read_text()
    (dataset / TRIALS).write_text(text[:-20])
    found = problems_of(dataset)
    assert found[0].startswith(f"{TRIALS}, line 2: the last line is torn")
    assert found[1] == f"{TRIALS}: expected 2 usable trials, because the session is complete, got 1"
    assert len(found) == 2


def test_a_session_that_was_cut_short_is_a_note_and_no_problem(
    tmp_path: Path, manifest_of: Callable[..., SessionManifest]
) -> None:
    manifest = manifest_of(status=SessionStatus.ABORTED, n_trials=600)
    root = write_dataset(tmp_path / "lab", manifest, [trial(0), trial(1)])
    assert problems_of(root) == []
    notes = [note for checked in validate(root) for note in checked.notes]
    assert notes == [f"{root / TRIALS}: the session is aborted, with 2 of 600 trials"]


def test_a_participant_without_sessions_is_told(dataset: Path) -> None:
    (dataset / "sub-02").mkdir()
    assert "sub-02: holds no session folder (ses-*)" in problems_of(dataset)


def test_a_participant_without_a_session_is_one_of_a_roster(dataset: Path) -> None:
    with (dataset / "participants.tsv").open("a") as stream:
        stream.write("sub-02\ttrue\n")
    found = list(validate(dataset))
    assert not any(checked.problems for checked in found)
    notes = [note for checked in found for note in checked.notes]
    assert any("line 3: 'sub-02' is listed and has no session yet" in note for note in notes)


def test_practice_and_flagged_trials_are_not_counted_among_those_of_the_design(
    tmp_path: Path, manifest_of: Callable[..., SessionManifest]
) -> None:
    lines = [trial(0, practice=True), trial(1, flag="dropped_frames"), trial(2), trial(3)]
    root = write_dataset(tmp_path / "lab", manifest_of(n_trials=2), lines)
    assert problems_of(root) == []
    root = write_dataset(tmp_path / "short", manifest_of(n_trials=4), lines)
    assert any("expected 4 usable trials" in problem for problem in problems_of(root))


def test_all_problems_of_a_file_are_told_in_one_go(dataset: Path) -> None:
    lines = [trial(0, factor=-1.0, response="?", simulated=3), trial(1, duration_s=0)]
    (dataset / TRIALS).write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert problems_of(dataset)[:4] == [
        f"{TRIALS}, line 1: factor: expected above 0, got -1",
        f"{TRIALS}, line 1: response: expected one of 'yes', 'no', 'first', 'second', got '?'",
        f"{TRIALS}, line 1: simulated: expected true or false, got 3",
        f"{TRIALS}, line 2: duration_s: expected above 0 s, got 0",
    ]


def test_a_line_separator_of_unicode_ends_no_trial(dataset: Path) -> None:
    """U+2028 may stand in a JSON text; only a line feed ends a line."""
    text = (dataset / MANIFEST).read_text().replace('"bench"', '"be\u2028nch"')
    (dataset / MANIFEST).write_text(text)
    assert problems_of(dataset) == []


def test_trials_of_a_task_without_a_record_are_not_checked(
    tmp_path: Path, manifest_of: Callable[..., SessionManifest]
) -> None:
    root = write_dataset(tmp_path / "lab", manifest_of(task="juggling"), [])
    (root / TRIALS).write_text('{"balls": 3}\n')
    assert not [told for told in problems_of(root) if told.startswith(TRIALS)]
    assert [c.words for c in validate(root) if c.path == root / TRIALS] == [""]


def test_a_file_is_known_by_its_keys_where_its_name_says_nothing(display: Display, tmp_path: Path) -> None:
    write_toml_record(tmp_path / "mine.toml", display)
    assert [c.words for c in validate(tmp_path / "mine.toml")] == ["display"]
    text = (tmp_path / "mine.toml").read_text().replace("gamma = 1.95", "gama = 1.95")
    (tmp_path / "mine.toml").write_text(text)
    line = text.splitlines().index("gama = 1.95") + 1
    assert problems_of(tmp_path / "mine.toml") == [
        ": the key 'gamma' is missing",
        f", line {line}: gama: unknown key 'gama'; did you mean 'gamma'?",
    ]


def test_the_presets_are_right() -> None:
    presets = Path(evenlight.__file__).parents[1] / "method" / "presets"
    checked = list(validate(presets))
    assert {c.path.name for c in checked} == {p.name for p in presets.iterdir()}
    assert all(c.words and not c.problems for c in checked)


def test_a_folder_of_data_sets_and_results_is_searched_through(dataset: Path, tmp_path: Path) -> None:
    results(tmp_path / "deep" / "optimized")
    shutil.copytree(dataset, tmp_path / "deep" / "second")
    found = list(validate(tmp_path))
    assert not [problem for checked in found for problem in checked.problems]
    assert sum(checked.words == "ramp trial" for checked in found) == 2
    assert sum(checked.words == "brightness track" for checked in found) == 1


@pytest.mark.parametrize("content", ["", "text", '{"a": 1}'])
def test_a_single_file_that_is_nothing_known_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text(content)
    with pytest.raises(InputError, match=r"notes\.txt: nothing that Evenlight knows; expected a data set"):
        list(validate(tmp_path / "notes.txt"))


def run(*arguments: str) -> tuple[Any, list[str]]:
    """The exit code of a command, as `main` ends with it, and the lines that it shows."""
    answer = CliRunner().invoke(command_line.app, list(arguments))
    refused = isinstance(answer.exception, InputError)
    return (2 if refused else answer.exit_code), answer.stdout.splitlines()


def test_the_command_ends_with_0_and_says_what_is_ok(dataset: Path) -> None:
    (dataset / "notes.txt").write_text("mine")
    code, lines = run("validate", str(dataset))
    assert code == 0
    assert f"ok           {dataset / TRIALS} (ramp trial)" in lines
    assert lines[-2:] == [f"not checked  {dataset / 'notes.txt'}", "no problem; 7 ok, 1 not checked"]
    assert run("validate", str(dataset), "--quiet") == (0, [])


def test_the_command_ends_with_1_if_there_is_a_problem(dataset: Path) -> None:
    (dataset / "participants.tsv").write_text("participant_id\n")
    code, lines = run("validate", str(dataset), "--quiet")
    assert code == 1
    assert lines == [f"problem      {dataset}/participants.tsv: 'sub-01' has a folder and is not listed"]


def test_the_command_ends_with_2_if_there_is_nothing_to_check(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert run("validate", str(tmp_path / "nowhere")) == (2, [])
    assert run("validate", str(tmp_path)) == (2, [])
    assert run("validate", str(tmp_path / "notes.txt")) == (2, [])


def test_a_thousand_problems_are_not_all_shown(dataset: Path) -> None:
    (dataset / TRIALS).write_text((json.dumps(trial(0, factor=2)) + "\n") * 1000)
    code, lines = run("validate", str(dataset))
    shown = [line for line in lines if TRIALS in line]
    assert code == 1
    assert len(shown) == 21
    assert shown[-1] == f"problem      {dataset / TRIALS}: and 981 problems more"  # 1000 and the count of 2
    assert lines[-1] == "1001 problems in 1 file; 6 ok, 0 not checked"


@pytest.mark.parametrize("task", ["[]", "{}", "7", "null"])
def test_a_manifest_whose_task_is_no_text_is_a_problem_and_no_crash(
    task: str, dataset: Path, command: Any, tmp_path: Path
) -> None:
    path = dataset / MANIFEST
    path.write_text(path.read_text().replace('"task": "ramp"', f'"task": {task}'))
    assert command("validate", dataset).code == 1
    refused = command("analyze", dataset, "--out", tmp_path / "out", "--quiet")
    assert (refused.code, refused.err.count("\n")) == (2, 1)


# --- validating results


def test_results_that_agree_have_no_problem(tmp_path: Path) -> None:
    (results(tmp_path) / "track.png").write_bytes(b"\x89PNG")
    assert problems_of(tmp_path) == []
    assert {c.path.name: c.words for c in validate(tmp_path)} == {
        "loss_curves.npz": "loss curves",
        "summary.json": "optimization summary",
        "track.csv": "brightness track",
        "track.json": "track header",
        "track.png": "",
    }


def test_a_summary_prints_in_one_line(tmp_path: Path) -> None:
    summary = read_json_record(OptimizationSummary, results(tmp_path) / "summary.json")
    assert repr(summary) == (
        "<OptimizationSummary 'v': 4 frames, budget 0.6 (factor), objective 0.217, baseline 0.5>"
    )


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"frames": 5}, "summary.json: frames: expected 4, the rows of track.csv, got 5"),
        ({"video": "w"}, "summary.json: video: expected 'v', as in track.json, got 'w'"),
        ({"display": "w"}, "summary.json: display: expected 'bench', as in track.json, got 'w'"),
        ({"budget": 0.5, "achieved": 0.5}, "summary.json: budget: expected 0.6, as in track.json, got 0.5"),
        ({"budget_unit": BudgetUnit.WATT}, "summary.json: budget_unit: expected 'factor', as in"),
        ({"solver": "t"}, "summary.json: solver: expected 's', as in track.json, got 't'"),
        ({"mean_factor": 0.7}, "summary.json: mean_factor: expected 0.6 to 0.6, as the track's column"),
        ({"mean_contrast_loss": 0.5}, "summary.json: mean_contrast_loss: expected 0 to 0.4"),
        ({"achieved": 0.5}, "summary.json: achieved: expected the budget 0.6, got 0.5"),
        (
            {"objective_baseline": 0.21},
            "summary.json: objective: expected at most 0.21, that of constant dimming",
        ),
        ({"max_rate_ratio": 7.0}, "summary.json: max_rate_ratio: expected 0, as in the track, got 7"),
        ({"mean_power": 0.6}, "summary.json: mean_power_w: expected 0.5 to 0.5"),
        ({"objective": 0.2}, "summary.json: objective: expected 0.216667, the mean absolute difference"),
    ],
)
def test_results_that_contradict_each_other_are_told(
    changes: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    found = problems_of(results(tmp_path, **changes))
    assert len(found) == 1
    assert found[0].startswith(problem)


def test_a_row_missing_from_a_track_is_told(tmp_path: Path) -> None:
    track = results(tmp_path) / "track.csv"
    track.write_text("".join(track.read_text().splitlines(keepends=True)[:-1]))
    assert any(
        "is not the file that track.json beside it was written with" in p for p in problems_of(tmp_path)
    )


def test_loss_curves_of_another_display_are_told(tmp_path: Path) -> None:
    text = (results(tmp_path) / "track.json").read_text()
    fingerprint = json.loads(text)["display_fingerprint"]
    (tmp_path / "track.json").write_text(text.replace(fingerprint, "0" * 16))
    assert problems_of(tmp_path) == [
        f"loss_curves.npz: display fingerprint: expected '{'0' * 16}', as in the track's header, "
        f"got {fingerprint!r}"
    ]


def test_every_wrong_cell_of_a_track_is_told(tmp_path: Path) -> None:
    track = results(tmp_path) / "track.csv"
    text = track.read_text().replace("\n1,0.04,0.6,", "\n1,0.04,1.6,").replace("\n2,0.08,", "\n2,now,")
    track.write_text(text.replace("\n3,0.12,0.6,0.4,", "\n3,0.12,0.6,-0.4,"))
    assert [told for told in problems_of(tmp_path) if told.startswith("track.csv")] == [
        "track.csv, line 3: factor: expected at most 1, got 1.6",
        "track.csv, line 4: time_s: expected a number, got 'now'",
        "track.csv, line 5: contrast_loss: expected at least 0, got -0.4",
    ]


def test_a_track_without_its_header_is_told(tmp_path: Path) -> None:
    (results(tmp_path) / "track.json").unlink()
    assert problems_of(tmp_path) == ["track.json: no such file; there is no brightness track without it"]


@pytest.mark.parametrize("values", [[], [0.3], [0.0, 1.0], [0.2, 0.2, 0.9, 0.1, 0.4]])
def test_the_mean_absolute_difference_is_the_double_sum(values: list[float]) -> None:
    pairs = [abs(x - y) for i, x in enumerate(values) for y in values[i + 1 :]]
    expected = sum(pairs) / len(pairs) if pairs else 0.0
    assert mean_absolute_difference(np.array(values)) == pytest.approx(expected, abs=1e-15)


# --- designs of tasks

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


# --- line numbers

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=12,
)


def places(content: Any, around: Place = ()) -> set[Place]:
    """Every key and list item in a content, by a plain walk."""
    items: Any = ()
    if isinstance(content, dict):
        items = content.items()
    elif isinstance(content, list):
        items = enumerate(content)
    found = set()
    for key, value in items:
        found |= {(*around, key)} | places(value, (*around, key))
    return found


@given(JSON)
def test_every_key_and_item_of_a_json_text_is_found(content: Any) -> None:
    for indent in (None, 1):
        assert set(json_line_numbers(json.dumps(content, indent=indent))) == places(content)


@given(st.lists(st.text(max_size=4), unique=True, max_size=6))
def test_with_one_key_in_each_line_the_lines_count_up(keys: list[str]) -> None:
    """json.dumps with an indent: `{` in line 1, the k-th key in line k + 1."""
    text = json.dumps(dict.fromkeys(keys, 0), indent=1)
    assert json_line_numbers(text) == {(key,): n for n, key in enumerate(keys, start=2)}


def test_brackets_and_colons_in_texts_are_texts() -> None:
    text = '{"a{[:,": "}],\\"",\n "b": ["x, y", {"c":\n 1}]}'
    assert json_line_numbers(text) == {("a{[:,",): 1, ("b",): 2, ("b", 0): 2, ("b", 1): 2, ("b", 1, "c"): 2}


def test_keys_of_toml_are_found_in_their_tables() -> None:
    text = '# a = 1\nb = 2\n"c d" = 3\n\n[t]\nb = 4\n[t.u]\nb=5\n'
    assert toml_line_numbers(text) == {
        ("b",): 2,
        ("c d",): 3,
        ("t",): 5,
        ("t", "b"): 6,
        ("t", "u"): 7,
        ("t", "u", "b"): 8,
    }


def test_a_missing_key_is_in_the_line_of_what_it_is_missing_in() -> None:
    assert line_of(("display", "gamma"), {("display",): 7}) == 7
    assert line_of(("gamma",), {("display",): 7}) is None


def test_what_is_no_kind_of_file_any_more_is_not_taken_for_another(tmp_path: Path) -> None:
    """By their keys, each of these would be a wrong file of another kind."""
    (tmp_path / "films.catalogue.csv").write_text("path,name,budget\na.mkv,a,0.5\n")
    (tmp_path / "errors.csv").write_text("name,video,why\na,a.mkv,gone\n")
    gains = ("proportional", "integral", "derivative", "gain_rate_hz")
    shared = ("target_loss", *gains, "mean_loss", "mean_factor", "provenance", "budget", "budget_unit")
    write_json(tmp_path / "control.json", dict.fromkeys((*shared, "horizon_s", "mean_power_w"), 0.1))
    shutil.copy(tmp_path / "control.json", tmp_path / "others.json")
    shutil.copy(tmp_path / "errors.csv", tmp_path / "others.csv")
    told = {checked.path.name: checked.words for checked in validate(tmp_path)}
    assert told == {
        "control.json": "",
        "errors.csv": "",
        "films.catalogue.csv": "",
        "others.csv": "catalogue row",
        "others.json": "live control",
    }
