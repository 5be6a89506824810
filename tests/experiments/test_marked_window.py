"""Which flips send triggers, on a window that draws nothing; what fails, and what is not sent."""

import dataclasses
from typing import Any

import pytest
from clip_windows import LAB, RIG, Renderer, Window

from evenlight.data_schema.recordings.rig import TriggerCodes
from evenlight.experiments.sessions import window_stage
from evenlight.experiments.sessions.marked_window import MarkedWindow
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import PausePressed, RampInterval
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import Fault, InstrumentError

FALL = RampInterval(80.0, 70.0, 1.0, adaptation=0.2, duration=1.0, hold=0.2, noise_seed=9)


class Output:
    """A device that takes some triggers, and breaks."""

    def __init__(self, takes: int = 1000) -> None:
        self.sent: list[tuple[int, str]] = []
        self._takes = takes

    def send(self, code: int, label: str) -> None:
        if len(self.sent) == self._takes:
            raise InstrumentError("the box is gone", Fault.DISCONNECTED)
        self.sent.append((code, label))

    def apparatus(self) -> dict[str, str]:
        return {"sends": "codes", "serial": "12"}


def marked(*outputs: Output, codes: TriggerCodes | None = None, timer: Any = lambda: 0.0) -> MarkedWindow:
    rig = dataclasses.replace(RIG, trigger_codes=codes or TriggerCodes())
    named: Any = {f"output {k}": output for k, output in enumerate(outputs)}
    return MarkedWindow(Window(), rig, named, timer)


def test_one_stimulus_upon_another_ends_the_one_and_begins_the_other_with_the_same_flip() -> None:
    window = marked(Output())
    for stimulus in ("video", "search"):
        window.mark(stimulus)
        window.flip()
    # The window's clock has 50 refreshes a second.
    sent = window.triggers_sent()
    assert [each.label for each in sent] == ["video_onset", "video_offset", "search_onset"]
    assert [each.time for each in sent] == pytest.approx([0.02, 0.04, 0.04])
    assert window.triggers_sent() == []


def test_the_delay_is_from_the_flip_until_the_last_device_has_taken_it() -> None:
    ticks = iter([10.0, 10.25])
    window = marked(Output(), Output(), timer=lambda: next(ticks))
    window.mark("ramp")
    window.flip()
    assert [each.delay for each in window.triggers_sent()] == [0.25]


def test_a_device_that_fails_gets_no_more_and_others_do() -> None:
    broken, whole = Output(takes=1), Output()
    window = marked(broken, whole)
    for stimulus in ("ramp", "", "ramp"):
        window.mark(stimulus)
        window.flip()
    assert len(broken.sent) == 1
    assert len(whole.sent) == 3
    assert [each.failures for each in window.triggers_sent()] == [(), ("the box is gone",), ()]


def test_a_code_of_0_is_not_sent_and_without_devices_nothing_is_noted() -> None:
    output = Output()
    window = marked(output, codes=TriggerCodes(ramp_offset=0, ramp_onset=200))
    silent = marked()
    for each in (window, silent):
        each.mark("ramp")
        each.flip()
        each.flip()
    assert output.sent == [(200, "ramp_onset")]
    assert silent.triggers_sent() == []


def test_what_devices_say_of_themselves_is_in_the_apparatus() -> None:
    assert marked(Output()).apparatus()["trigger output output 0"] == "sends: codes, serial: 12"


def test_a_ramp_that_is_paused_has_ended_with_the_next_flip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window_stage, "field_renderer", Renderer)
    window, output = Window(), Output()
    window.read_codes = lambda size=None: None  # type: ignore[assignment] # nothing is probed here
    monkeypatch.setattr(WindowStage, "_ground_drawn", lambda *_: 80.0)
    keyboard = SimulatedKeyboard(window.now)
    outputs: Any = {"output": output}
    stage = WindowStage(window, keyboard, RIG, LAB, 20.0, triggers=outputs)  # type: ignore[arg-type]
    keyboard.queue("escape", 0.5)
    with pytest.raises(PausePressed):
        stage.show_ramp(FALL)
    keyboard.queue("space", 0.1)
    stage.show_page("Pause", ["space"])
    onset, offset = stage.triggers_sent()
    assert (onset.label, offset.label) == ("ramp_onset", "ramp_offset")
    assert onset.time == pytest.approx(0.02 + 0.2)  # the first flip, and 0.2 s of constant luminance
    assert offset.time == pytest.approx(0.52)  # the flip after the one at 0.5 s
