"""A session with a person: nobody simulates, and the keys come from the computer's keyboard in real time."""

import json
import os
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from warm_evenlight import Run

from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, TRIALS

A_WHILE = 0.25  # [s] within which a busy machine wakes a thread, and shows the question


class Session:
    """What a session left behind, and what was pressed in it."""

    def __init__(self, folder: Path, told: dict[str, Any]) -> None:
        own = folder / "sub-01/ses-01"
        self.told = told
        self.trials, self.events = _lines(own / TRIALS), _lines(own / EVENTS)
        self.manifest = json.loads((own / MANIFEST).read_text())

    def times_of(self, kind: str) -> list[float]:
        return [event["time_s"] for event in self.events if event["kind"] == kind]


def _lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def session(virtual_screen: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> Session:
    script = Path(__file__).with_name("person_at_the_keys.py")
    folder = tmp_path_factory.mktemp("person") / "dataset"
    run = Run([str(folder)], os.environ | {"DISPLAY": virtual_screen()}, script)
    out, err = run.communicate(timeout=200)
    assert (run.returncode, err) == (0, "")
    return Session(folder, json.loads(out.splitlines()[-1]))


def test_the_answers_are_the_keys_that_were_pressed(session: Session) -> None:
    assert session.told["status"] == "complete"
    answers = {"y": "yes", "n": "no"}
    pressed = {index: answers[key] for index, key, _ in session.told["pressed"]}
    assert {trial["trial_index"]: trial["response"] for trial in session.trials} == pressed
    assert set(pressed.values()) == {"yes", "no"}
    assert [trial["practice"] for trial in session.trials] == [True, False, False, False, False]


@pytest.mark.real_time  # the keyboard's driver is woken, and the question shown, within a while
def test_response_times_are_those_of_the_keys(session: Session) -> None:
    """From the question, which is shown a moment after the ramp is over, from when the delay counts."""
    for (_, _, delay), trial in zip(session.told["pressed"], session.trials, strict=True):
        assert trial["response_time_s"] == pytest.approx(delay, abs=A_WHILE)
    longest = max(session.told["pressed"], key=lambda press: press[2])[0]
    assert max(session.trials, key=lambda trial: trial["response_time_s"])["trial_index"] == longest


def test_the_pause_key_interrupts_a_ramp_which_is_shown_again(session: Session) -> None:
    assert [trial["attempt"] for trial in session.trials] == [1, 1, 1, 1, 2]
    kinds = [event["kind"] for event in session.events if event["kind"] != "page_shown"]
    broken = kinds.index("trial_interrupted")
    assert kinds[broken - 1 : broken + 4] == [
        "trial_begun", "trial_interrupted", "paused", "continued", "trial_begun",
    ]  # fmt: skip
    (paused,), (went_on,) = session.times_of("paused"), session.times_of("continued")
    again = session.trials[-1]
    assert paused < went_on < again["onset_s"]
    assert [e["detail"] for e in session.events if e["kind"] == "page_shown"].count("break") == 1


def test_nothing_says_that_it_was_simulated(session: Session) -> None:
    assert session.manifest["simulated"] is False
    assert not any(trial["simulated"] for trial in session.trials)


def test_every_event_has_a_time_of_day_that_goes_with_the_sessions_clock(session: Session) -> None:
    # A busy machine may put the process aside between its two looks at a clock.
    times = [datetime.fromisoformat(event["utc"]) for event in session.events]
    assert times == sorted(times)
    assert datetime.now(UTC) - times[0] < timedelta(minutes=10)
    for event, time in zip(session.events, times, strict=True):
        since = (time - times[0]).total_seconds()
        assert since == pytest.approx(event["time_s"] - session.events[0]["time_s"], abs=1.0)
    assert datetime.fromisoformat(session.manifest["started"]) <= times[0]


def test_the_refresh_rate_was_measured_and_the_clock_is_the_computers(session: Session) -> None:
    apparatus = session.manifest["apparatus"]
    assert float(apparatus["measured_refresh_rate_hz"]) > 1
    assert apparatus["clock"] == "computer"
    assert apparatus["keyboard"].startswith("psychopy.hardware.keyboard")


def test_a_ramp_takes_its_time_however_fast_the_window_flips(session: Session) -> None:
    """0.6 s of interval and the delay of the answer lie between the onsets of two trials at least."""
    onsets = [trial["onset_s"] for trial in session.trials]
    for k, (_, _, delay) in enumerate(session.told["pressed"][:-1]):
        assert onsets[k + 1] - onsets[k] > 0.58 + delay
    # A rehearsal would count refreshes instead; here as much time passed as the events say.
    assert session.events[-1]["time_s"] > 6 * 0.58


def test_the_data_set_holds_what_a_data_set_has_to(session: Session, tmp_path: Path, command) -> None:
    folder = Path(session.told["dataset"])
    assert command("validate", folder).code == 0
