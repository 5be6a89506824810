"""What the benchmarks say of the graphics processor: measured where it can be, or why not."""

import gc

import moderngl
import pytest
from compute_shaders import own_context

from benchmarks import gpu_clock, gpu_points
from benchmarks.gpu_points import TARGETS, curve_points, online_points
from benchmarks.measured import RunSettings

QUICK = RunSettings(quick=True)
SIZE = (96, 64)


@pytest.fixture
def shaders():
    """A machine that has compute shaders."""
    own_context()


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Frames of few pixels."""
    monkeypatch.setattr(gpu_points, "QUICK_SIZE", SIZE)
    monkeypatch.setattr(gpu_points, "QUICK_SIZES", (SIZE,))
    for name in ("COPIED", "COPIED_BY_SOFTWARE"):
        monkeypatch.setattr(gpu_clock, name, 1000)
    monkeypatch.setattr(gc, "collect", int)  # which takes a second beside so many tests


def pass_for(monkeypatch, software):
    """Let the renderer, whatever it is, pass for software or for a graphics processor."""
    for module in (gpu_points, gpu_clock):
        monkeypatch.setattr(module, "is_software", lambda _: software)


def test_a_curve_has_a_point_with_the_bus_and_one_without(shaders):
    whole, alone = curve_points(QUICK)
    assert (whole.task, whole.size) == ("one frame of 96 x 64", 96 * 64)
    assert "upload" in whole.approach
    assert "alone" in alone.approach
    for point in (whole, alone):
        assert point.error is not None
        assert point.error <= 1e-3
        assert own_context().renderer in point.note


def test_software_meets_no_target_and_misses_none(shaders, monkeypatch):
    pass_for(monkeypatch, software=True)
    points, claims = online_points(QUICK)
    assert all(point.error <= 1e-3 for point in points)
    assert [claim.target for claim in claims] == list(TARGETS.values())
    assert all(
        claim.measured is None and "OpenGL runs on the processor here" in claim.note for claim in claims
    )


def test_hardware_is_held_to_the_targets_with_the_answer_waited_for(shaders, monkeypatch):
    pass_for(monkeypatch, software=False)
    monkeypatch.setattr(gpu_points, "TARGETS", {(1920, 1080): 2e-3, SIZE: 10.0})
    points, claims = online_points(QUICK)
    waited = next(p for p in points if p.approach == "GPU, from texture to factor")
    assert [p.approach for p in points if "late" in p.approach] == [
        "GPU, from texture to factor, one frame late"
    ]
    assert (claims[1].measured, claims[1].met) == (waited.time, True)
    assert claims[0].note == "not in a quick run"


def test_without_graphics_there_are_no_points_and_claims_say_why(monkeypatch):
    def broken(*_, **__):
        raise Exception("no driver")

    monkeypatch.setattr(moderngl, "create_context", broken)
    assert curve_points(QUICK) == []
    points, claims = online_points(QUICK)
    assert points == []
    assert all("no driver" in claim.note for claim in claims)
