"""The test of the keys: each key of the task is pressed once before practice, and others are named."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import conducted_sessions as course
import pytest
from ramp_tasks import ramp_task

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_writing import enrol
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.data_schema.recordings.session import EventKind, SessionManifest, SessionStatus
from evenlight.experiments.ramp.ramp_task import RampTask
from evenlight.experiments.sessions.conduct_session import SessionParts, conduct_session
from evenlight.experiments.sessions.key_test import try_keys
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.session_store import SessionStore, begin_session, resume_session
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.sessions.task import Participant
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock

DISPLAY = Display("bench", 100.0, 0.1, 2.2, 60.0)
KEYS = Keys(yes="y", no="n")
DESIGN = RampDesign(
    screens=("white",), factors=(0.5,), relative_rates=(0.02,), repetitions=2, catch_share=0.0,
    practice_trials=0, trials_between_breaks=0, ramp_durations=(0.5,),
)  # fmt: skip


class Stage(BlindStage):
    """A stage that keeps the pages shown on it, and whose person presses a given key for each."""

    def __init__(self, rig: Rig, *presses: str) -> None:
        clock = RefreshClock(rig.refresh_rate)
        keyboard = SimulatedKeyboard(clock.now)
        super().__init__(rig, clock, keyboard)
        self.keyboard, self._presses, self.pages = keyboard, list(presses), []

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> Any:
        self.pages.append(text)
        self.keyboard.queue(self._presses.pop(0), 0.1)
        return super().show_page(text, keys, footer)


def begun(folder: Path, design: RampDesign, rig: Rig) -> tuple[SessionStore, RampTask]:
    task = ramp_task(design, DISPLAY, rig)
    enrol(folder, "01", simulated=False, provenance=Provenance())
    manifest = SessionManifest(
        "01", "01", "ramp", False, SessionStatus.RUNNING, task.n_trials, DISPLAY, design, Provenance(seed=1)
    )
    return begin_session(folder, manifest, utc=str), task


def tried(
    folder: Path, *presses: str, keys: Keys = KEYS, language: str = "en", design: RampDesign = DESIGN
) -> tuple[list[str], SessionStore, SessionStatus]:
    """Conduct a session that is stopped at the instructions; return its pages."""
    rig = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0, keys=keys)
    store, task = begun(folder / "lab", design, rig)
    stage = Stage(rig, "space", *presses, "escape", "escape")  # consent first; then stopped from the pause
    with store:
        status = conduct_session(store, SessionParts(task, stage, Participant(), load_pages(language), keys))
    return stage.pages, store, status


def noted(store: SessionStore) -> list[dict[str, list[str]]]:
    return [json.loads(event.detail) for event in store.events if event.kind is EventKind.KEYS_TRIED]


def test_each_key_is_pressed_once_in_turn_before_the_instructions(tmp_path: Path) -> None:
    pages, store, _ = tried(tmp_path, "y", "n")
    assert [page.splitlines()[0] for page in pages[:4]] == [
        "# Welcome", "# Try the keys", "# Try the keys", "# Your task",
    ]  # fmt: skip
    assert "Press **Y** once" in pages[1]
    assert "With this key you answer: yes." in pages[1]
    assert "Press **N** once" in pages[2]
    assert noted(store) == [{"y": [], "n": []}]


def test_keys_are_tried_again_where_a_session_goes_on_among_its_trials(tmp_path: Path) -> None:
    """It stops at the fifth of five trials, for dropped frames."""
    stage = course.Stage(dict.fromkeys(range(5), course.drop_ten_frames))
    assert course.conducted(course.begun(tmp_path / "lab"), stage) is SessionStatus.ABORTED
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    assert course.conducted(store, course.Stage({})) is SessionStatus.COMPLETE
    assert noted(store) == [{"y": [], "n": []}] * 2


def test_another_key_is_named_and_the_right_one_is_waited_for(tmp_path: Path) -> None:
    """As on a keyboard whose Y is called z, or where the participant took the wrong key."""
    pages, store, _ = tried(tmp_path, "z", "space", "y", "n")
    assert 'You pressed Z. The key for "yes" is **Y**.' in pages[2]
    assert "You pressed the space bar." in pages[3]
    assert "Press **N** once" in pages[4]
    assert noted(store) == [{"y": ["z", "space"], "n": []}]


def test_the_page_is_in_the_language_of_the_session(tmp_path: Path) -> None:
    pages, _, _ = tried(tmp_path, "ä", "j", "n", keys=Keys(yes="j"), language="de")
    assert "Drücken Sie einmal **J**" in pages[1]
    assert "Sie haben Ä gedrückt. Die Taste für „Ja“ ist **J**." in pages[2]


def test_the_pause_key_pauses_the_test_and_can_stop_the_session_from_there(tmp_path: Path) -> None:
    pages, store, status = tried(tmp_path, "y", "escape", "space", "n")
    assert [page.splitlines()[0] for page in pages[2:6]] == [
        "# Try the keys", "# Paused", "# Try the keys", "# Your task",
    ]  # fmt: skip
    assert noted(store) == [{"y": [], "n": []}]
    assert status is SessionStatus.ABORTED
    assert noted(tried(tmp_path / "stopped", "y", "escape", "escape")[1]) == []


def test_keys_of_two_intervals_are_those_of_their_answers(tmp_path: Path) -> None:
    design = dataclasses.replace(DESIGN, procedure=Procedure.TWO_INTERVAL)
    pages, store, _ = tried(tmp_path, "left", "right", design=design)
    assert "Press **←** once.\n\nWith this key you answer: the first." in pages[1]
    assert noted(store) == [{"left": [], "right": []}]


class Answered:
    """A task with some answers."""

    def __init__(self, answers: dict[str, object]) -> None:
        self._answers = answers

    def key_answers(self) -> dict[str, object]:
        return self._answers


@pytest.mark.parametrize(
    ("answer", "means"),
    [(4, "4"), (135, "on the upper left"), ("found", "ring found")],
)
def test_ratings_and_directions_are_called_what_they_are(answer: object, means: str) -> None:
    rig = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0)
    stage = Stage(rig, "num_7")
    task: Any = Answered({"num_7": answer})
    parts = SessionParts(task, stage, Participant(), load_pages("en"), Keys())
    try_keys(parts, lambda kind, detail: None, lambda: None)
    start = "# Try the keys\n\nPress **7 on the numeric pad** once.\n\n"
    assert stage.pages == [f"{start}With this key you answer: {means}."]


def test_a_task_that_does_not_say_its_keys_is_begun_without_the_test() -> None:
    task: Any = Answered({})
    parts = SessionParts(task, Stage(Rig("b", "b.toml", 0.6, 60.0)), Participant(), load_pages("en"), Keys())
    try_keys(parts, lambda kind, detail: pytest.fail("nothing is tried"), lambda: None)
