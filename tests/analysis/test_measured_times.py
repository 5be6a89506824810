"""The two times that the paper states, measured here by a clock that ticks when it is read."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from evenlight.analysis.reproduction.measured_times import measured_times
from evenlight.analysis.reproduction.reproduction import Panel
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.preset_files import load_display, load_power_model


class TickingClock:
    """Each reading is half a second after the last one."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 0.5
        return self.now


@pytest.fixture
def panel(make_weber_limit: Callable[[float], RateLimit]) -> Panel:
    return Panel(load_display("varjo-xr3"), load_power_model("surace2025"), make_weber_limit(0.03))


def sequence(curves: LossCurves) -> Any:
    grain = np.random.default_rng(1).integers(0, 256, (36, 64, 3), dtype=np.uint8)
    return SimpleNamespace(curves=curves, summary=SimpleNamespace(curves_s=50.0), samples=((0, grain),))


def test_what_was_solved_is_scaled_to_the_papers_frames_and_the_controller_has_step_and_loss(
    make_curves: Callable[..., LossCurves], panel: Panel
) -> None:
    clip, walk = make_curves(np.linspace(0.1, 0.3, 100)), make_curves(np.linspace(0.1, 0.3, 50))
    solved, frame = measured_times([sequence(clip), sequence(clip)], panel, walk, TickingClock())
    # 2 x 100 frames fit 15 times into 3000; one tick of the clock, 0.5 s.
    assert (solved.value, solved.unit, solved.n) == (0.5, "s", 200)
    assert (
        "the optimizer alone, loss curves known: 200 frames, taken 15 times, optimized in 0.5 s,"
        in solved.method
    )
    # 50 s for each 100 frames.
    assert "computing the curves took another 0.5 s per frame" in solved.method
    # A tick for 50 steps, 10 ms each, and one for the loss of a frame, 500 ms.
    assert frame.value == pytest.approx(10 + 500)
    assert frame.unit == "ms"
    assert {solved.origin, frame.origin} == {Origin.MEASURED}
    assert "64 x 36 pixels" in frame.method


def test_fewer_frames_are_scaled_and_said(make_curves: Callable[..., LossCurves], panel: Panel) -> None:
    clip = make_curves(np.linspace(0.1, 0.3, 1600))
    solved, _ = measured_times([sequence(clip)], panel, clip, TickingClock())
    assert solved.value == pytest.approx(0.5 * 3000 / 1600)
    assert "1600 frames optimized in 0.5 s, scaled to 3000, on " in solved.method
