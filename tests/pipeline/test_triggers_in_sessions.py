"""Triggers of a whole session, received by a recorder at the other end of a serial line."""

import dataclasses
import json
import os
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.storage.text_files import read_toml_record, write_toml_record

DESIGN = RampDesign(
    procedure=Procedure.TWO_INTERVAL,
    screens=("white",),
    factors=(0.5,),
    relative_rates=(0.1, 0.4),
    repetitions=1,
    practice_trials=0,
    adaptation_duration=0.2,
    ramp_durations=(0.3,),
    hold_duration=0.1,
    interval_gap=0.1,
    pause_duration=0.1,
    max_dropped_frames=1000,  # a busy machine drops some; what is flagged for it has tests of its own
)
A_TRIAL = ["ramp_onset", "ramp_offset"] * 2 + ["question_onset", "answer"]
CODES = {"ramp_onset": 1, "ramp_offset": 2, "question_onset": 7, "answer": 8}  # docs/triggers.md


class Recorder:
    """What hangs at the other end of a serial line: it notes each byte with its time."""

    def __init__(self, unplugged_after: int | None = None) -> None:
        self._end, ours = os.openpty()
        tty.setraw(self._end)
        self.port, self._ours, self._last = os.ttyname(ours), ours, unplugged_after
        self.received: list[tuple[int, float]] = []
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while len(self.received) != self._last:
            try:
                data = os.read(self._end, 1)
            except OSError:
                return
            self.received.append((data[0], time.monotonic()))
        os.close(self._end)

    def close(self) -> None:
        os.close(self._ours)
        self._thread.join(timeout=200)


@pytest.fixture
def recorder() -> Iterator[Recorder]:
    made = Recorder()
    yield made
    made.close()


def rig_with(triggers: list[str], small_rig: Path, folder: Path) -> Path:
    path = folder / "with_triggers.rig.toml"
    write_toml_record(path, dataclasses.replace(read_toml_record(Rig, small_rig), triggers=tuple(triggers)))
    return path


@pytest.mark.real_time  # by the recorder's own clock four triggers come within 10 ms of their frames
def test_a_recorder_gets_each_trigger_once_in_order_and_when_the_frames_say(
    tmp_path: Path,
    small_rig: Path,
    recorder: Recorder,
    laboratory: Callable[..., Any],
    virtual_screen: Callable[..., str],
    command: Callable[..., Any],
) -> None:
    rig = rig_with([f"serial:{recorder.port}", "simulated"], small_rig, tmp_path)
    lab = laboratory(tmp_path, "ramp", DESIGN, virtual_screen(), "--rig", rig, "--real-time")
    assert "complete: 2 of 2" in lab.run("lab")
    sent = [event for event in lab.rows("lab", EVENTS) if event["kind"] == "trigger_sent"]
    assert [event["detail"] for event in sent] == A_TRIAL * 2
    assert [event["trial_index"] for event in sent] == [0] * 6 + [1] * 6
    assert [event["code"] for event in sent] == [CODES[event["detail"]] for event in sent]
    assert [code for code, _ in recorder.received] == [event["code"] for event in sent]
    # Both clocks count seconds, from different moments: what remains is how late each came, and a busy
    # machine wakes the recorder late: those that came soonest tell.
    apart = np.array([when for _, when in recorder.received]) - [event["time_s"] for event in sent]
    assert np.ptp(np.sort(apart)[:4]) < 0.01
    assert min(event["delay_s"] for event in sent) < 0.1
    for trial in lab.rows("lab"):
        frames = [log for log in lab.rows("lab", FRAMES) if log["trial_index"] == trial["trial_index"]]
        times = np.array(frames[0]["flip_times_s"])
        own = [event["time_s"] for event in sent if event["trial_index"] == trial["trial_index"]]
        for when in own[:2]:  # of the first ramp; which frame it is, a window that is read back tells
            assert np.abs(trial["onset_s"] + times - when).min() < 1e-6
    assert command("validate", tmp_path / "lab").code == 0
    manifest = json.loads((tmp_path / "lab/sub-01/ses-01/manifest.json").read_text())
    said = manifest["apparatus"][f"trigger output serial:{recorder.port}"]
    assert said == "sends: one byte at 115200 baud, 8N1"
    assert manifest["rig"]["trigger_codes"]["answer"] == 8


def test_a_recorder_that_is_unplugged_is_told_of_once_and_the_session_goes_on(
    tmp_path: Path,
    small_rig: Path,
    laboratory: Callable[..., Any],
    virtual_screen: Callable[..., str],
) -> None:
    recorder = Recorder(unplugged_after=2)
    rig = rig_with([f"serial:{recorder.port}"], small_rig, tmp_path)
    lab = laboratory(tmp_path, "ramp", DESIGN, virtual_screen(), "--rig", rig, "--real-time")
    out = lab.run("lab", told=f"evenlight: the trigger port at {recorder.port}: the connection broke")
    recorder.close()
    assert "complete: 2 of 2" in out
    events = [event for event in lab.rows("lab", EVENTS) if event["kind"].startswith("trigger")]
    assert [event["kind"] for event in events] == ["trigger_sent"] * 2 + ["trigger_failed"]
    assert "the connection broke" in events[-1]["detail"]


def test_a_missing_device_is_refused_before_the_session_and_a_code_of_0_is_not_sent(
    tmp_path: Path, small_rig: Path, laboratory: Callable[..., Any], virtual_screen: Callable[..., str]
) -> None:
    rig = rig_with(["serial:/dev/no_such_port"], small_rig, tmp_path)
    lab = laboratory(tmp_path, "ramp", DESIGN, virtual_screen(), "--rig", rig)
    process = lab.start("lab")
    out, err = process.communicate(timeout=200)
    assert (process.returncode, out) == (1, "")
    assert err.startswith("evenlight: the trigger port at /dev/no_such_port: cannot be opened")
    assert err.count("\n") == 1
    assert not (tmp_path / "lab").exists()
    text = rig.read_text().replace('"serial:/dev/no_such_port"', '"simulated"')
    rig.write_text(text.replace("ramp_offset = 2", "ramp_offset = 0"))
    lab.run("lab")
    sent = [event["detail"] for event in lab.rows("lab", EVENTS) if event["kind"] == "trigger_sent"]
    assert sent == [label for label in A_TRIAL if label != "ramp_offset"] * 2
