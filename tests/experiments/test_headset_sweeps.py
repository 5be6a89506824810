"""Sweeps in a headset: its frames go on while a meter reads; one that shows nothing is not measured."""

import json
import time

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import LuminanceSweepDesign
from evenlight.experiments.sessions.staging import Staging
from evenlight.experiments.sweeps.run_sweep import SweepRequest, run_sweep
from evenlight.experiments.sweeps.sweep_devices import SweepLevel, SweepScreen
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset

RIG = Rig(
    "lab",
    "lab",
    1.0,
    90.0,
    screen="simulated:openxr",
    full_screen=False,
    window_size=(64, 64),
    luminance_meter="simulated",
    pixels_per_degree=10.0,
)


class Codes(SimulatedHeadset):
    """A headset that keeps the codes of each frame that is handed over."""

    def __init__(self, script: HeadsetScript | None = None) -> None:
        super().__init__((32, 32), 90.0, script, real_time=True)
        self.begin(RIG.eye)
        self.codes: list[np.ndarray] = []

    def flip(self) -> float:
        self.codes.append(self.read_codes())
        return super().flip()


def screen_on(window: Codes) -> SweepScreen:
    return SweepScreen(RIG, (window.now, time.sleep), window=window)


def test_the_level_is_shown_to_both_eyes_frame_by_frame_while_it_is_waited_for_and_read() -> None:
    with Codes() as window:
        screen = screen_on(window)
        shown = screen.show(SweepLevel(0.4, None))
        screen.wait(0.05)

        def read() -> float:
            time.sleep(0.1)
            return 12.5

        before = len(window.codes)
        assert screen.while_shown(read) == 12.5
        assert len(window.codes) - before >= 3  # of 9
        assert shown.pixel_value == 102 / 255
        assert np.unique(window.codes).tolist() == [102]


def test_a_reading_of_a_headset_that_shows_nothing_is_refused() -> None:
    with Codes(HeadsetScript(invisible=[(0.0, 60.0)])) as window:
        screen = screen_on(window)
        screen.show(SweepLevel(1.0, None))
        with pytest.raises(InstrumentError, match="the headset showed nothing: cover the sensor"):
            screen.while_shown(lambda: time.sleep(0.05))


def test_a_meter_that_fails_fails_as_it_would_on_a_screen() -> None:
    def fail() -> None:
        raise InstrumentError("meter: no reply")

    with Codes() as window:
        screen = screen_on(window)
        screen.show(SweepLevel(1.0, None))
        with pytest.raises(InstrumentError, match="meter: no reply"):
            screen.while_shown(fail)


def test_a_sweep_is_rehearsed_in_a_headset(tmp_path) -> None:
    """The meter looks at a panel that is shown the same codes: 99.9 L'^2 + 0.1 cd/m^2, cold at first."""
    design = LuminanceSweepDesign(
        pixel_values=(0.0, 0.6, 1.0), factors=(0.5,), settle=0.02, warm_up=0.0, drift_pixel_values=(1.0,)
    )
    display = Display("lab", 100.0, 0.1, 2.0, pixels_per_degree=10.0)
    request = SweepRequest("luminance-sweep", tmp_path, "01", RIG, display, design, Staging("visual"))
    ran = run_sweep(request)
    assert ran.status is SessionStatus.COMPLETE
    text = (ran.folder / "readings.jsonl").read_text()
    for reading in map(json.loads, text.splitlines()):
        wanted = (99.9 * reading["pixel_value"] ** 2 + 0.1) * reading["achieved_factor"]
        assert reading["luminance_cd_m2"] == pytest.approx(wanted, rel=0.1, abs=0.02)
    manifest = json.loads((ran.folder / "sweep.json").read_text())
    assert manifest["rig"]["screen"] == "simulated:openxr"
    assert manifest["apparatus"]["eye_size"] == "64 x 64 pixels"
