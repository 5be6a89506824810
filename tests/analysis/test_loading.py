"""Reading a data set: what is refused, in one line that names the place, and what is only remarked upon."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from example_ramps import RAMP

from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_layout import session_folder
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampDesign
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import Stimulus

DISPLAY = Display("bench", 100.0, 0.0, 2.0, 60.0)
DESIGN = RampDesign()


def trial(index: int, participant: str = "01", **changed: Any) -> dict[str, Any]:
    record = replace(RAMP, participant_id=participant, trial_index=index, simulated=False)
    return {**mapping_from_record(record), **changed}


def write_session(
    dataset: Path,
    participant: str = "01",
    display: Display = DISPLAY,
    simulated: bool = False,
    design: RampDesign = DESIGN,
) -> Path:
    manifest = SessionManifest(
        participant, "01", "ramp", simulated, SessionStatus.COMPLETE, 3, display, design, Provenance()
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
        (
            {"procedure": "two_interval", "ramp_interval": 1, "response": "first"},
            "trial 1: procedure is 'two_interval', but 'yes_no' in the session",
        ),
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


def torn(folder: Path) -> None:
    lines = (folder / "trials.jsonl").read_text().splitlines()
    (folder / "trials.jsonl").write_text("\n".join([lines[0], lines[1][:20], lines[2]]) + "\n")


def newer(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["provenance"]["schema_version"] = 99
    (folder / "manifest.json").write_text(json.dumps(manifest))


DAMAGES = [
    (lambda folder: (folder / "manifest.json").unlink(), r"ses-01: holds trials.jsonl but no manifest.json"),
    (torn, r"trials\.jsonl, line 2: not valid JSON"),
    (newer, r"manifest\.json: written in schema version 99"),
    (lambda folder: (folder / "manifest.json").write_text("{"), r"manifest\.json: not valid JSON"),
    (lambda folder: (folder / "trials.jsonl").unlink(), "found 1 without any trial"),
    (lambda folder: write_trials(folder, [trial(0, practice=True, block=0)]), "found 1 without any trial"),
    (lambda folder: shutil.rmtree(folder), r"expected ramp sessions .* found no session"),
    (lambda folder: shutil.rmtree(folder.parents[1]), "no such folder"),
]


@pytest.mark.parametrize(("damage", "words"), DAMAGES, ids=[words for _, words in DAMAGES])
def test_what_cannot_be_read_is_refused_with_its_name(
    tmp_path: Path, damage: Callable[[Path], object], words: str
) -> None:
    damage(write_session(tmp_path / "d"))
    with pytest.raises(InputError, match=words):
        load_ramp_data(tmp_path / "d")


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"display": Display("other", 200.0, 0.0, 2.0, 60.0)}, r"participant 02 runs on .* 'other'.*'bench'"),
        ({"simulated": True}, "simulated and recorded"),
    ],
)
def test_sessions_that_do_not_go_together_are_refused(
    tmp_path: Path, other: dict[str, Any], words: str
) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", **other)
    with pytest.raises(InputError, match=words):
        load_ramp_data(tmp_path)


def test_another_resolution_is_the_same_display(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    write_session(tmp_path, "02", Display("bench", 100.0, 0.0, 2.0, 30.0))
    assert len(load_ramp_data(tmp_path).sessions) == 2


def test_other_tasks_are_passed_over(tmp_path: Path) -> None:
    write_session(tmp_path, "01")
    other = session_folder(tmp_path, "01", "02")
    other.mkdir(parents=True)
    (other / "manifest.json").write_text('{"task": "rating"}')
    assert len(load_ramp_data(tmp_path).sessions) == 1


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


@pytest.mark.parametrize(
    ("hashes", "said"), [("aa", ()), ("ab", ("differ in the video that they showed as film",))]
)
def test_sessions_that_showed_another_video_under_one_name_are_told_of(tmp_path: Path, hashes, said) -> None:
    for participant, digest in zip(("01", "02"), hashes, strict=True):
        file = write_session(tmp_path, participant) / "manifest.json"
        manifest = record_from_mapping(SessionManifest, json.loads(file.read_text()), "")
        stimulus = Stimulus("film", 64 * digest, 64 * "0", 9, 1.0, 0.5, 0.5)
        file.write_text(json.dumps(mapping_from_record(replace(manifest, stimuli=(stimulus,)))))
    assert load_ramp_data(tmp_path).warnings == tuple(f"ramp: sessions {words}" for words in said)
