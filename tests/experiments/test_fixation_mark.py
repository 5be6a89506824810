"""The fixation mark: its shape, when it is there, and that nothing about it tells what the field does."""

import dataclasses

import clip_windows
import numpy as np
import pytest
from clip_windows import LAB, RIG, Renderer, staged
from ramp_tasks import ramp_task

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import IntervalGap, Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.experiments.sessions import window_stage
from evenlight.experiments.stage import RampInterval
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.stimuli.fixation_mark import fixation_mark

FALL = RampInterval(
    80.0, 40.0, 1.0, adaptation=1.0, duration=5.0, hold=1.0, noise_seed=9, label="2", mark_contrast=-0.2
)
DESIGN = RampDesign(
    procedure=Procedure.TWO_INTERVAL, screens=("white",), factors=(0.1, 1.0), relative_rates=(0.05, 0.19),
    interval_gap_kind=IntervalGap.STEADY, fixation_mark=True,
)  # fmt: skip


class Window(clip_windows.Window):
    """The same, and the ground is read back from it, rounded to a code."""

    def size(self) -> tuple[int, int]:
        return 400, 300

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        ground = Renderer.drawn[-1][0].luminance
        width, height = (min(a, b) for a, b in zip(size or self.size(), self.size(), strict=True))
        return np.full((height, width, 3), round(255 * np.sqrt(ground / 100)))


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window_stage, "field_renderer", Renderer)


def test_the_mark_covers_the_area_of_its_parts() -> None:
    """A disc of 0.6 deg less a cross of 0.2 deg, plus a disc of 0.2 deg; 100 pixels per degree.

    What the cross takes of the large disc is, with R = 0.3 and h = 0.1, two bars of
    2 (h sqrt(R² - h²) + R² asin(h / R)), less the square of 0.2 that both have.
    """
    covered = fixation_mark((200, 160), 100.0).astype(float).sum() / 255 / 100**2
    bar = 2 * (0.1 * np.sqrt(0.3**2 - 0.1**2) + 0.3**2 * np.arcsin(0.1 / 0.3))
    assert covered == pytest.approx(np.pi * 0.3**2 - (2 * bar - 0.2**2) + np.pi * 0.1**2, rel=0.02)


def test_the_mark_takes_the_place_of_the_number_and_stays_a_fixed_share_of_the_field() -> None:
    """0.7 s of the number at 50 Hz, then 315 frames of the mark, 20 % darker than the field as it falls."""
    stage, _ = staged(Window())
    stage.show_ramp(FALL)
    fields = [field for field, _, _ in Renderer.drawn]
    assert len({id(field.coverage) for field in fields[:35]}) == 1
    assert len({id(field.coverage) for field in fields[35:]}) == 1
    shares = np.array([field.ink / field.luminance for field in fields[35:]])
    np.testing.assert_allclose(shares, 0.8, rtol=1e-12)
    assert shares.size == 315


def test_without_a_contrast_there_is_no_mark() -> None:
    stage, _ = staged(Window())
    stage.show_ramp(dataclasses.replace(FALL, mark_contrast=0.0, label=""))
    assert all(field.coverage is None for field, _, _ in Renderer.drawn)


@pytest.mark.parametrize(
    ("factor", "contrast"),
    # From 10 cd/m^2 by 95 % to 0.5, where 20 % less is black (0.5) and could not be drawn; from 100 to 5.
    [(0.1, 0.25), (1.0, -0.2)],
)
def test_both_intervals_of_a_trial_have_the_same_mark_which_the_display_can_draw(
    factor: float, contrast: float
) -> None:
    display = Display("bench", 100.0, 0.5, 2.2, 60.0)
    task = ramp_task(DESIGN, display, RIG)
    planned = next(p for k in range(9) for p in task._schedule.practice(k) if p.level.factor == factor)
    assert {interval.mark_contrast for interval in task._intervals(planned, 0)} == {contrast}


def test_with_a_backlight_a_steady_gap_leaves_pixels_and_backlight_as_they_are() -> None:
    """The field of an interval is 100 cd/m^2 of pixels before a backlight at 40 %; else pixels make 40."""
    window = Window()
    lamp = SimulatedBacklight(window.now, steps=1000, time_constant=0.002, min_interval=0.01)
    rig = dataclasses.replace(RIG, actuator=Actuator.BACKLIGHT, backlight="simulated")
    stage, _ = staged(window, rig, lamp)
    stage.show_ramp(dataclasses.replace(FALL, initial_luminance=40.0, final_luminance=40.0))
    before = len(Renderer.drawn)
    stage.wait(0.5, 40.0, 1.0)
    np.testing.assert_allclose([field.luminance for field, _, _ in Renderer.drawn[before:]], 100.0)
    assert lamp.read_factor() == pytest.approx(0.4, abs=0.001)
    stage.wait(0.5, 40.0)
    assert Renderer.drawn[-1][0].luminance == pytest.approx(40.0)


def test_a_window_that_is_late_is_refused_by_a_ramp_session_before_it_begins() -> None:
    """Every tenth flip comes a refresh late: in 2 s, 100 refreshes, about nine are dropped."""
    stage, _ = staged(Window(late=dict.fromkeys(range(0, 1000, 10), 2)))
    task = ramp_task(DESIGN, LAB, RIG, simulated=False)
    with pytest.raises(InputError, match=r"drops too many frames .* of the trials would be flagged"):
        task.prepare(stage)
    on_time, _ = staged(Window())
    task.prepare(on_time)
    assert len(Renderer.drawn) == 51 + 100  # 1 s of pause, from the first flip to the last; 2 s of the ramp
