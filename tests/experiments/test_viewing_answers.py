"""The answers of simulated observers in a session: the keys that they press, and when."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import Version
from evenlight.experiments.sessions.search_stage import RingPicture
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing import ring_views
from evenlight.experiments.viewing.ring_views import ring_alone, search_viewing
from evenlight.experiments.viewing.search_observer import SearchAnswer
from evenlight.experiments.viewing.search_schedule import SearchPoint, search_order, search_practice
from evenlight.experiments.viewing.simulated_viewers import SimulatedViewer, ViewingAnswers, viewing_answers
from evenlight.hardware.rig_files import load_rig
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import KeypointRings
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.scene import Vector

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=24.0)
DESIGN = SearchDesign(sequences=("library",), practice_trials=3)
POINTS = tuple(
    SearchPoint(
        "library", keypoint, "school", Camera((float(k), 0.0, 1.65), 10.0),
        KeypointRings(keypoint, (-20.0, 15.0), (0.0, 5.0), (9.0, 9.0), -5.0, 12.0, 9.5),
        {Version.OURS: 0.8, Version.BASELINE: 0.5},
    )
    for k, keypoint in enumerate(("stacks", "lockers", "desk"))
)  # fmt: skip


class Says:
    """A viewer who always answers the same."""

    def __init__(self, answer: Any) -> None:
        self._answer = answer

    def answer(self, planned: object, trial_index: int) -> Any:
        return self._answer


def key_of(answer: Any, keys: Keys) -> str:
    return ViewingAnswers(Says(answer), keys).key(None, 0)


def test_each_answer_has_the_key_that_the_rig_gives_it() -> None:
    keys = Keys(ratings=("a", "b", "c", "d", "e"), first="f", second="s")
    assert [key_of(rating, keys) for rating in range(1, 6)] == ["a", "b", "c", "d", "e"]
    assert [key_of(response, keys) for response in (Response.FIRST, Response.SECOND)] == ["f", "s"]
    told = [key_of(SearchAnswer(3.0, orientation), keys) for orientation in ORIENTATIONS]
    assert tuple(told) == keys.orientations


def test_a_ring_that_is_not_found_is_never_pressed_for() -> None:
    answers = ViewingAnswers(Says(SearchAnswer(None, None)), Keys())
    assert answers.search_time(None, 0) is None
    answers = ViewingAnswers(Says(SearchAnswer(4.5, 90)), Keys())
    assert answers.search_time(None, 0) == 4.5


class ClosingPainter:
    """Paints until it is closed."""

    closed = False

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        assert not self.closed, "a ring was looked at after the painter was closed"
        return RingPicture(ring_alone(ring, 20.0, 64, LAB), 20.0)


@contextmanager
def closing(display: Display, side: int) -> Iterator[ClosingPainter]:
    painter = ClosingPainter()
    yield painter
    painter.closed = True


@pytest.fixture
def answers_of(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(ring_views, "OffscreenPainter", closing)
    monkeypatch.setattr(ring_views, "search_points", lambda design, stimuli, display, actuator: POINTS)
    manifest = SessionManifest(
        "01", "01", "search", True, SessionStatus.RUNNING, 6, LAB, DESIGN, Provenance()
    )
    setting = SessionSetting(manifest, load_rig("simulated")[0])
    return viewing_answers(search_viewing, setting, np.random.default_rng(1))


def test_whatever_a_session_shows_was_looked_at_before_its_window_opened(answers_of: Any) -> None:
    for order_index in range(5):
        answers = answers_of((11, order_index))
        for shown in (search_practice, search_order):
            for trial in shown(DESIGN, POINTS, 11, order_index):
                answers.search_time(trial, 0)  # would fail in the painter


def test_a_search_and_the_question_after_it_belong_together_and_are_repeatable(answers_of: Any) -> None:
    once, again = answers_of((11, 0)), answers_of((11, 0))
    trials = search_order(DESIGN, POINTS, 11, 0)
    times = [once.search_time(trial, k) for k, trial in enumerate(trials)]
    assert times == [again.search_time(trial, k) for k, trial in enumerate(trials)]
    assert len(set(times)) > 1
    assert [once.key(trial, k) for k, trial in enumerate(trials)] == [
        again.key(trial, k) for k, trial in enumerate(trials)
    ]


def test_a_person_drawn_elsewhere_answers_as_that_person(answers_of: Any) -> None:
    viewing = answers_of((11, 0))._viewer.viewing
    person = viewing.draw(np.random.default_rng(9))
    trial = search_order(DESIGN, POINTS, 11, 0)[0]
    own, other = SimulatedViewer(viewing, (11, 0), person), SimulatedViewer(viewing, (11, 0))
    assert own.person == person != other.person
    assert own.answer(trial, 0) == SimulatedViewer(viewing, (11, 0), person).answer(trial, 0)
