"""Reading a data set: what is refused, in one line that names the place, and what is only remarked upon."""

import json
from pathlib import Path
from typing import Any

import pytest

from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_layout import session_folder
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus

DISPLAY = Display("bench", 100.0, 0.0, 2.0, 60.0)
DESIGN = RampDesign()


def trial(index: int, participant: str = "01", **changed: Any) -> dict[str, Any]:
    record = RampTrial(
        participant_id=participant,
        session_id="01",
        trial_index=index,
        screen="white",
        factor=1.0,
        initial_luminance=100.0,
        final_luminance=90.0,
        rate=2.0,
        duration=5.0,
        is_catch=False,
        response=Response.YES,
        response_time=0.7,
        simulated=False,
    )
    return {**mapping_from_record(record), **changed}


def write_session(
    dataset: Path,
    participant: str = "01",
    display: Display = DISPLAY,
    simulated: bool = False,
    design: RampDesign = DESIGN,
) -> Path:
    manifest = SessionManifest(
        participant_id=participant,
        session_id="01",
        task="ramp",
        simulated=simulated,
        status=SessionStatus.COMPLETE,
        n_trials=3,
        display=display,
        design=design,
        provenance=Provenance(),
    )
    folder = session_folder(dataset, participant, "01")
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text(json.dumps(mapping_from_record(manifest)))
    write_trials(folder, [trial(i, participant, simulated=simulated) for i in range(3)])
    return folder


def write_trials(folder: Path, trials: list[dict[str, Any]]) -> None:
    (folder / "trials.jsonl").write_text("".join(json.dumps(t) + "\n" for t in trials))


def test_a_sound_data_set_is_read_whole(tmp_path: Path) -> None:
    for participant in ("02", "01"):
        write_session(tmp_path, participant)
    data = load_ramp_data(tmp_path)
    assert data.participant_ids == ("01", "02")
    assert [t.trial_index for t in data.trials] == [0, 1, 2, 0, 1, 2]
    assert data.display == DISPLAY
    assert not data.simulated
    assert data.warnings == ()


def test_trials_without_a_manifest_are_not_passed_over(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    bare = write_session(tmp_path, "02")
    (bare / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"sub-02/ses-01: holds trials.jsonl but no manifest.json"):
        load_ramp_data(tmp_path)


def test_the_hash_follows_every_byte_of_the_trials(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    before = load_ramp_data(tmp_path).sha256
    assert load_ramp_data(tmp_path).sha256 == before
    write_trials(folder, [trial(0), trial(1), trial(2, response="no")])
    assert load_ramp_data(tmp_path).sha256 != before


def test_a_torn_last_line_is_left_out_with_a_warning(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    with (folder / "trials.jsonl").open("a") as stream:
        stream.write('{"participant_id": "01", "sess')
    data = load_ramp_data(tmp_path)
    assert len(data.trials) == 3
    assert len(data.warnings) == 1
    assert "trials.jsonl, line 4: the last line is torn" in data.warnings[0]


def test_a_torn_line_in_the_middle_is_refused(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    lines = (folder / "trials.jsonl").read_text().splitlines()
    (folder / "trials.jsonl").write_text("\n".join([lines[0], lines[1][:20], lines[2]]) + "\n")
    with pytest.raises(InputError, match=r"trials\.jsonl, line 2: not valid JSON"):
        load_ramp_data(tmp_path)


def test_a_session_that_was_cut_short_is_used_and_remarked_upon(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    write_trials(folder, [trial(0), trial(1)])
    data = load_ramp_data(tmp_path)
    assert len(data.trials) == 2
    assert "2 of 3 trials" in data.warnings[0]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"rate_cd_m2_s": -1.0}, r"line 2: rate_cd_m2_s must be at least 0 cd/m\^2/s, got -1"),
        ({"factor": 1.5}, "line 2: factor must be at most 1, got 1.5"),
        (
            {"response": "maybe"},
            "line 2: response: expected one of 'yes', 'no', 'first', 'second', got 'maybe'",
        ),
        ({"rate_cd_m2_s": 0.0}, "line 2: a catch trial has rate 0"),
        ({"factr": 1.0}, "line 2: unknown key 'factr'.*did you mean 'factor'"),
        (
            {"participant_id": "09"},
            "trial 1: participant_id is '09', but '01' in the session's manifest.json",
        ),
        ({"simulated": True}, "trial 1: simulated is True, but False in the session's manifest.json"),
        ({"trial_index": 0}, "trial 0 is there twice"),
    ],
)
def test_a_trial_that_is_not_as_it_should_be_is_named(
    tmp_path: Path, changed: dict[str, Any], words: str
) -> None:
    folder = write_session(tmp_path)
    write_trials(folder, [trial(0), trial(1, **changed), trial(2)])
    with pytest.raises(InputError, match=words) as caught:
        load_ramp_data(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_newer_schema_is_refused(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["provenance"]["schema_version"] = 99
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"manifest\.json: written in schema version 99"):
        load_ramp_data(tmp_path)


def test_a_broken_manifest_is_named(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    (folder / "manifest.json").write_text("{")
    with pytest.raises(InputError, match=r"manifest\.json: not valid JSON"):
        load_ramp_data(tmp_path)


def test_two_displays_are_refused(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", Display("other", 200.0, 0.0, 2.0, 60.0))
    with pytest.raises(InputError, match=r"participant 02 runs on the display 'other'.*'bench'"):
        load_ramp_data(tmp_path)


def test_another_resolution_is_the_same_display(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", Display("bench", 100.0, 0.0, 2.0, 30.0))
    assert len(load_ramp_data(tmp_path).sessions) == 2


def test_simulated_and_recorded_sessions_are_not_mixed(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", simulated=True)
    with pytest.raises(InputError, match="simulated and recorded"):
        load_ramp_data(tmp_path)


def test_other_tasks_are_passed_over(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    other = session_folder(tmp_path, "01", "02")
    other.mkdir(parents=True)
    (other / "manifest.json").write_text('{"task": "rating"}')
    assert len(load_ramp_data(tmp_path).sessions) == 1


def test_a_data_set_without_ramps_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected ramp sessions .* found no session"):
        load_ramp_data(tmp_path)
    folder = write_session(tmp_path)
    (folder / "trials.jsonl").unlink()
    with pytest.raises(InputError, match="found 1 without any trial"):
        load_ramp_data(tmp_path)


def test_no_folder_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        load_ramp_data(tmp_path / "nowhere")


def test_practice_and_flagged_trials_are_left_out_and_counted(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    write_trials(
        folder,
        [
            trial(0, practice=True, block=0),
            trial(1),
            trial(2, flag="dropped_frames"),
            trial(3),
            trial(4),
        ],
    )
    data = load_ramp_data(tmp_path)
    assert [t.trial_index for t in data.trials] == [1, 3, 4]
    assert (data.sessions[0].n_practice, data.sessions[0].n_flagged) == (1, 1)
    assert data.warnings == (f"{folder}: trials left out: 1 flagged (dropped frames)",)


def test_a_session_of_practice_alone_has_no_trial(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    write_trials(folder, [trial(0, practice=True, block=0)])
    with pytest.raises(InputError, match="found 1 without any trial"):
        load_ramp_data(tmp_path)


def test_trials_written_before_there_were_directions_and_tasks_are_read(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    known = set(list(trial(0))[: list(trial(0)).index("simulated") + 1])
    write_trials(folder, [{key: value for key, value in trial(k).items() if key in known} for k in range(3)])
    data = load_ramp_data(tmp_path)
    assert {(t.procedure, t.direction, t.practice) for t in data.trials} == {
        (Procedure.YES_NO, Direction.DOWN, False)
    }
    assert data.warnings == ()


def test_sessions_of_several_designs_are_read_together(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", design=RampDesign(ramp_durations=(2.0,), relative_rates=(0.02, 0.1)))
    assert len(load_ramp_data(tmp_path).sessions) == 2


def test_a_trial_of_another_task_than_its_session_is_refused(tmp_path: Path) -> None:
    folder = write_session(tmp_path)
    other = trial(1, procedure="two_interval", ramp_interval=1, response="first")
    write_trials(folder, [trial(0), other, trial(2)])
    with pytest.raises(InputError, match="trial 1: procedure is 'two_interval', but 'yes_no' in the session"):
        load_ramp_data(tmp_path)
