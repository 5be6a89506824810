"""Arrays that are filled again: never more of them than were in use at a time."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import ContrastModel, PixelToLuminance, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast.frame_analysis import FrameAnalysis, SpareArrays
from evenlight.method.contrast.loss_curves import brightness_factors

ROOM = Display("room", 104.4, 0.2, 1.95, pixels_per_degree=72.28, reflected_luminance=2.0)
FACTORS = brightness_factors(0.2, 3)


@given(st.lists(st.sampled_from(["take", "give back", "give another's"])))
def test_none_is_handed_out_twice_and_no_more_are_held_than_were_out_at_a_time(steps: list[str]) -> None:
    spare, out, most = SpareArrays(), [], 0
    for step in steps:
        if step == "take":
            taken = spare.take((2, 3), np.float32)
            assert all(taken is not other for other in out)
            out.append(taken)
            most = max(most, len(out))
        elif step == "give another's" and not out:
            spare.give_back(np.zeros((2, 3), np.float32))
        elif out:
            spare.give_back(out.pop(0))
        assert spare.held + len(out) == most


def test_an_array_is_of_the_shape_and_type_asked_for() -> None:
    spare = SpareArrays()
    first = spare.take((2, 3), np.float32)
    spare.give_back(first)
    for shape, kind in (((3, 2), np.float32), ((2, 3), np.uint8)):
        assert (spare.take(shape, kind).shape, spare.take(shape, kind).dtype) == (shape, kind)
    assert spare.take((2, 3), "f4") is first


def test_threads_that_take_and_give_at_once_leave_no_more_than_one_for_each() -> None:
    spare, start = SpareArrays(), threading.Barrier(4)

    def busy() -> None:
        start.wait()
        for _ in range(300):
            spare.give_back(spare.take((2, 3), np.float32))

    threads = [threading.Thread(target=busy) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert 1 <= spare.held <= 4


@pytest.mark.parametrize("order", PixelToLuminance)
@pytest.mark.parametrize("way", ["at once", "by definition"])
def test_the_analysis_of_many_frames_holds_as_much_as_that_of_one(way: str, order: PixelToLuminance) -> None:
    authors = SensitivityModel.AUTHORS if way == "by definition" else SensitivityModel.BARTEN
    model = ContrastModel(pixel_to_luminance=order, sensitivity=authors)
    analysis = FrameAnalysis((16, 16), ROOM, model, FACTORS)
    assert analysis.in_one_pass == (way != "by definition")
    frame = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    for _ in range(4):
        analysis.of(frame)
        assert analysis._spare.held == 1
