"""The course of a session: consent, pauses, stops, dropped frames, and what the log says of them."""

import dataclasses
from pathlib import Path

import pytest
from conducted_sessions import DESIGN, Stage, begun, conducted, drop_ten_frames

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign, TrialFlag
from evenlight.data_schema.recordings.session import EventKind, SessionStatus
from evenlight.experiments.sessions.session_store import SessionStore, resume_session
from evenlight.experiments.stage import PausePressed, ShownInterval
from evenlight.hardware.protocols import InstrumentError


def pause(_: ShownInterval) -> ShownInterval:
    raise PausePressed


def unplugged(_: ShownInterval) -> ShownInterval:
    raise InstrumentError("the backlight does not answer")


def kinds(store: SessionStore) -> list[EventKind]:
    return [event.kind for event in store.events]


def test_nobody_is_tested_without_consent(tmp_path: Path) -> None:
    store = begun(tmp_path / "lab")
    assert conducted(store, Stage({}), "1") is SessionStatus.DECLINED
    assert EventKind.CONSENT_DECLINED in kinds(store)
    assert EventKind.TRIAL_BEGUN not in kinds(store)
    assert store.trials == []


def test_who_declined_is_not_asked_again(tmp_path: Path) -> None:
    conducted(begun(tmp_path / "lab"), Stage({}), "1")
    with pytest.raises(InputError, match="the participant declined to take part; nothing is resumed"):
        resume_session(tmp_path / "lab", "01", "01", utc=str)


def test_a_trial_that_is_paused_is_shown_again_as_the_next_attempt(tmp_path: Path) -> None:
    store = begun(tmp_path / "lab")
    assert conducted(store, Stage({2: pause})) is SessionStatus.COMPLETE
    assert [(t.trial_index, t.attempt) for t in store.trials] == [(0, 1), (1, 1), (2, 2), (3, 1), (4, 1)]
    around = kinds(store)
    at = around.index(EventKind.TRIAL_INTERRUPTED)
    assert around[at : at + 4] == [
        EventKind.TRIAL_INTERRUPTED, EventKind.PAUSED, EventKind.PAGE_SHOWN, EventKind.CONTINUED,
    ]  # fmt: skip


@pytest.mark.parametrize("mark", [True, False])
def test_instructions_name_the_mark_where_there_is_one(tmp_path: Path, mark: bool) -> None:
    design = dataclasses.replace(DESIGN, fixation_mark=mark)
    stage = Stage({})
    conducted(begun(tmp_path / "lab", design), stage, design=design)
    (told,) = (page for page in stage.pages if page.startswith("# Your task"))
    assert ("looking at the small mark in the middle of the screen. At the end" in told) is mark
    assert ("looking at the middle of the screen. At the end" in told) is not mark


def test_the_pause_key_stops_the_session_from_the_pause_and_it_can_be_resumed(tmp_path: Path) -> None:
    """Consent, two keys and instructions are pages 1 to 4; without practice the pause is the fifth."""
    store = begun(tmp_path / "lab")
    assert conducted(store, Stage({2: pause}), "5") is SessionStatus.ABORTED
    assert kinds(store)[-1] is EventKind.STOPPED
    assert len(store.trials) == 2
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    stage = Stage({})
    assert conducted(store, stage) is SessionStatus.COMPLETE
    assert stage.shown == 3  # no trial is shown twice but the one that was paused
    assert any("Welcome back" in page for page in stage.pages)
    assert not any("voluntary" in page for page in stage.pages)
    assert [t.trial_index for t in store.trials] == [0, 1, 2, 3, 4]


def test_trials_with_dropped_frames_are_flagged_and_shown_again_at_the_end(tmp_path: Path) -> None:
    """10 dropped frames are more than the 3 that the design allows."""
    store = begun(tmp_path / "lab")
    assert conducted(store, Stage({1: drop_ten_frames})) is SessionStatus.COMPLETE
    flags = [trial.flag for trial in store.trials]
    assert flags == [TrialFlag.NONE, TrialFlag.DROPPED_FRAMES, *[TrialFlag.NONE] * 4]
    assert sum(trial.usable for trial in store.trials) == 5
    first, again = store.trials[1], store.trials[5]
    assert (first.rate, first.is_catch) == (again.rate, again.is_catch)
    assert EventKind.TRIAL_FLAGGED in kinds(store)


def test_flagged_trials_are_not_shown_again_if_the_design_says_so(tmp_path: Path) -> None:
    design = dataclasses.replace(DESIGN, repeat_flagged=False)
    store = begun(tmp_path / "lab", design)
    conducted(store, Stage({1: drop_ten_frames}), design=design)
    assert len(store.trials) == 5
    assert sum(trial.usable for trial in store.trials) == 4


def test_as_many_dropped_frames_as_the_design_allows_are_no_reason_to_flag(tmp_path: Path) -> None:
    store = begun(tmp_path / "lab")
    conducted(store, Stage({1: lambda shown: dataclasses.replace(shown, frames_dropped=3)}))
    assert all(trial.usable for trial in store.trials)
    assert store.trials[1].frames_dropped == 3


def test_a_device_that_fails_ends_the_session_with_its_reason_in_the_log(tmp_path: Path) -> None:
    store = begun(tmp_path / "lab")
    with pytest.raises(InstrumentError, match="the backlight does not answer"):
        conducted(store, Stage({3: unplugged}))
    assert store.events[-1].kind is EventKind.STOPPED
    assert "the backlight does not answer" in store.events[-1].detail
    assert store.manifest.status is SessionStatus.ABORTED
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    assert EventKind.TRIAL_INTERRUPTED in kinds(store)
    assert conducted(store, Stage({})) is SessionStatus.COMPLETE
    assert len(store.trials) == 5


def test_practice_comes_with_feedback_is_marked_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    design = RampDesign(
        procedure=Procedure.TWO_INTERVAL, placement=Placement.TARGETED, factors=(0.5,), screens=("white",),
        trials_per_level=3, practice_trials=3, ramp_durations=(0.5,),
    )  # fmt: skip
    store = begun(tmp_path / "lab", design)
    # Two ramps for each trial; the first interval of the second practice trial is interrupted and stopped.
    # Pages: consent, two keys, instructions, feedback, pause.
    assert conducted(store, Stage({2: pause}), "6", design=design) is SessionStatus.ABORTED
    assert [t.practice for t in store.trials] == [True]
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    stage = Stage({})
    assert conducted(store, stage, design=design) is SessionStatus.COMPLETE
    assert [t.practice for t in store.trials] == [True] * 3 + [False] * 3
    feedback = [page for page in stage.pages if page.startswith(("Right", "Not quite"))]
    assert len(feedback) == 2
    for trial, page in zip(store.trials[1:3], feedback, strict=True):
        assert page.startswith("Right" if trial.success else "Not quite")
        assert ("first" in page) == (trial.ramp_interval == 1)


def test_breaks_come_between_the_trials_and_never_at_the_end(tmp_path: Path) -> None:
    design = dataclasses.replace(DESIGN, trials_between_breaks=1)
    store = begun(tmp_path / "lab", design)
    stage = Stage({})
    conducted(store, stage, design=design)
    breaks = [page for page in stage.pages if "Time for a break" in page]
    assert [page.split("done ")[1].split(" of")[0] for page in breaks] == ["1", "2", "3", "4"]
