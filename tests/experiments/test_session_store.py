"""The files of a session: nothing is lost, nothing is overwritten, one program at a time."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, TRIALS
from evenlight.data_schema.recordings.dataset_writing import enrol
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.session import EventKind, SessionManifest, SessionStatus
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.sessions.session_store import SessionStore, begin_session, resume_session


def manifest(participant: str = "01", session: str = "01") -> SessionManifest:
    return SessionManifest(
        participant_id=participant,
        session_id=session,
        task="ramp",
        simulated=True,
        status=SessionStatus.RUNNING,
        n_trials=4,
        display=Display("bench", 100.0, 0.1, 2.2, 60.0),
        design=RampDesign(),
        provenance=Provenance(seed=1),
    )


def trial(index: int) -> RampTrial:
    return RampTrial("01", "01", index, "white", 0.5, 50.0, 40.0, 2.0, 5.0, False, Response.NO, 0.7, True)


def frames(index: int) -> FrameLog:
    return FrameLog(index, 1, 1, (0.0, 0.5), (50.0, 45.0))


def begun(dataset: Path) -> SessionStore:
    enrol(dataset, "01", simulated=True, provenance=Provenance())
    return begin_session(dataset, manifest(), utc=str)


def answer(store: SessionStore, index: int) -> None:
    store.note(EventKind.TRIAL_BEGUN, trial_index=index, attempt=store.attempt_at(index))
    store.write_trial(trial(index), [frames(index)])


@pytest.fixture
def interrupted(tmp_path: Path) -> Path:
    """A data set whose only session ended in its third trial, as after a power cut."""
    with begun(tmp_path / "lab") as store:
        answer(store, 0)
        answer(store, 1)
        store.note(EventKind.TRIAL_BEGUN, trial_index=2, attempt=1)
    return tmp_path / "lab"


def test_the_manifest_is_there_before_the_first_trial(tmp_path: Path) -> None:
    with begun(tmp_path / "lab") as store:
        assert read_json_record(SessionManifest, store.folder / MANIFEST).status is SessionStatus.RUNNING
        assert (store.folder / TRIALS).read_text() == ""


def test_a_trial_is_in_the_file_when_the_call_returns(tmp_path: Path) -> None:
    with begun(tmp_path / "lab") as store:
        answer(store, 0)
        lines = (store.folder / TRIALS).read_text().splitlines()
        assert [json.loads(line)["trial_index"] for line in lines] == [0]


def test_a_resumed_session_has_its_trials_and_marks_the_one_that_broke(interrupted: Path) -> None:
    with resume_session(interrupted, "01", "01", utc=str) as store:
        assert [t.trial_index for t in store.trials] == [0, 1]
        broken = [event for event in store.events if event.kind is EventKind.TRIAL_INTERRUPTED]
        assert [(event.trial_index, event.attempt) for event in broken] == [(2, 1)]
        assert store.attempt_at(2) == 2
    with resume_session(interrupted, "01", "01", utc=str) as store:  # it is marked once, not at every resume
        kinds = [event.kind for event in store.events]
        assert kinds.count(EventKind.TRIAL_INTERRUPTED) == 1
        assert kinds.count(EventKind.RESUMED) == 2


def test_what_was_torn_off_is_kept_in_the_log_of_events(interrupted: Path) -> None:
    path = interrupted / "sub-01/ses-01" / TRIALS
    with path.open("a") as stream:
        stream.write('{"participant_id": "01", "session')
    with resume_session(interrupted, "01", "01", utc=str) as store:
        assert len(store.trials) == 2
        torn = [event.detail for event in store.events if event.kind is EventKind.LINE_TORN]
        assert torn == ['trials.jsonl: {"participant_id": "01", "session']
    assert path.read_text().endswith("}\n")


def test_a_trial_that_lacks_only_the_end_of_its_line_is_complete(interrupted: Path) -> None:
    path = interrupted / "sub-01/ses-01" / TRIALS
    path.write_text(path.read_text()[:-1])
    with resume_session(interrupted, "01", "01", utc=str) as store:
        assert [t.trial_index for t in store.trials] == [0, 1]
        assert all(event.kind is not EventKind.LINE_TORN for event in store.events)


def test_a_line_in_the_middle_that_cannot_be_read_is_named_and_nothing_is_changed(interrupted: Path) -> None:
    path = interrupted / "sub-01/ses-01" / TRIALS
    path.write_text(path.read_text().replace('"screen": "white"', '"screen": "whte"', 1))
    before = path.read_text()
    with pytest.raises(InputError, match=r"trials\.jsonl, line 1: screen must be one of white, gray"):
        resume_session(interrupted, "01", "01", utc=str)
    assert path.read_text() == before


def test_trials_of_a_newer_evenlight_are_refused_in_one_line(interrupted: Path) -> None:
    path = interrupted / "sub-01/ses-01" / MANIFEST
    path.write_text(path.read_text().replace('"schema_version": 2', '"schema_version": 3'))
    with pytest.raises(InputError, match="schema version 3, this Evenlight reads up to 2; update"):
        resume_session(interrupted, "01", "01", utc=str)


def test_a_session_that_is_there_is_never_begun_again(interrupted: Path) -> None:
    before = (interrupted / "sub-01/ses-01" / TRIALS).read_bytes()
    with pytest.raises(InputError, match="is there already and data are never overwritten; go on with it"):
        begin_session(interrupted, manifest(), utc=str)
    assert (interrupted / "sub-01/ses-01" / TRIALS).read_bytes() == before


def test_a_complete_session_is_not_resumed(tmp_path: Path) -> None:
    with begun(tmp_path / "lab") as store:
        store.finish(SessionStatus.COMPLETE)
    with pytest.raises(InputError, match="this session is complete; give another --session"):
        resume_session(tmp_path / "lab", "01", "01", utc=str)


def test_an_unknown_participant_is_named_with_the_sessions_that_there_are(interrupted: Path) -> None:
    with pytest.raises(InputError, match=r"no session to resume; .* has \(participant/session\) 01/01"):
        resume_session(interrupted, "07", "01", utc=str)
    assert not (interrupted / "sub-07").exists()


def test_a_second_program_cannot_write_the_same_session(interrupted: Path) -> None:
    """The lock is the system's: another process asks, not another object in this one."""
    program = (
        "import sys; from pathlib import Path\n"
        "from evenlight.experiments.sessions.session_store import resume_session\n"
        "try: resume_session(Path(sys.argv[1]), '01', '01')\n"
        "except ValueError as error: sys.exit(str(error))"
    )
    with resume_session(interrupted, "01", "01", utc=str):
        second = subprocess.run(
            [sys.executable, "-c", program, str(interrupted)],
            capture_output=True, text=True, timeout=200, check=False,
        )  # fmt: skip
    assert second.returncode == 1
    assert "another program is writing this session" in second.stderr


def test_times_of_a_resumed_session_go_on_where_they_ended(interrupted: Path) -> None:
    with resume_session(interrupted, "01", "01", utc=str) as store:
        clock = iter([100.0, 107.5, 108.0])
        store.use_clock(lambda: next(clock))
        store.note(EventKind.PAUSED)
        before = store.last_time
        assert before == 7.5
        assert store.since_beginning(108.0) == 8.0


def enrolled(dataset: Path, *participants: str, simulated: bool = True) -> list[int]:
    return [enrol(dataset, who, simulated, Provenance()) for who in participants]


def test_participants_keep_their_place_on_the_list(tmp_path: Path) -> None:
    dataset = tmp_path / "lab"
    places = []
    for who in ("05", "02", "05", "09"):
        places += enrolled(dataset, who)
        (dataset / f"sub-{who}").mkdir(exist_ok=True)
    assert places == [0, 1, 0, 2]
    assert (dataset / "participants.tsv").read_text().split() == [
        "participant_id", "simulated", "sub-05", "true", "sub-02", "true", "sub-09", "true",
    ]  # fmt: skip


def test_columns_that_a_lab_added_to_the_list_stay(tmp_path: Path) -> None:
    enrolled(tmp_path, "01")
    (tmp_path / "sub-01").mkdir()
    (tmp_path / "participants.tsv").write_text("participant_id\tage_band\tsimulated\nsub-01\t30-39\ttrue\n")
    enrolled(tmp_path, "02")
    assert (tmp_path / "participants.tsv").read_text().splitlines()[2] == "sub-02\tn/a\ttrue"


def test_who_is_not_on_a_roster_is_refused(tmp_path: Path) -> None:
    enrolled(tmp_path, "01")
    with pytest.raises(
        InputError, match=r"participant '10' is not on the list .*; waiting for a session are sub-01"
    ):
        enrolled(tmp_path, "10")
    assert enrolled(tmp_path, "01") == [0]


@pytest.mark.parametrize("who", ["1", "001"])
def test_a_participant_who_differs_in_zeros_alone_is_a_likely_slip(tmp_path: Path, who: str) -> None:
    enrolled(tmp_path, "01")
    (tmp_path / "sub-01").mkdir()
    with pytest.raises(InputError, match=f"participant '{who}' is new in .*, and '01' is there"):
        enrolled(tmp_path, who)


def test_a_lost_list_is_not_begun_anew(tmp_path: Path) -> None:
    enrolled(tmp_path, "01")
    (tmp_path / "sub-01").mkdir()
    (tmp_path / "participants.tsv").unlink()
    with pytest.raises(InputError, match=r"participants\.tsv: no such file, though there is sub-01; restore"):
        enrolled(tmp_path, "02")


def test_a_line_of_the_list_that_names_nobody_is_told_by_its_number(tmp_path: Path) -> None:
    enrolled(tmp_path, "01")
    with (tmp_path / "participants.tsv").open("a") as stream:
        stream.write("02\ttrue\n")
    with pytest.raises(InputError, match="line 3: expected a participant such as sub-02, got '02'"):
        enrolled(tmp_path, "02")


def test_recorded_and_simulated_sessions_are_not_mixed(tmp_path: Path) -> None:
    enrolled(tmp_path, "01")
    with pytest.raises(InputError, match="holds simulated sessions, this one is recorded"):
        enrolled(tmp_path, "02", simulated=False)


def test_a_folder_with_other_things_is_no_place_for_a_data_set(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(InputError, match="holds other things than a data set"):
        enrolled(tmp_path, "01")


def test_the_store_is_what_the_events_file_says(interrupted: Path) -> None:
    def lines() -> int:
        return len((interrupted / "sub-01/ses-01" / EVENTS).read_text().splitlines())

    before = lines()
    with resume_session(interrupted, "01", "01", utc=str) as store:
        assert len(store.events) == lines() == before + 2
