"""Threads that analyse frames: any number gives the same, few frames in memory, clean ends."""

import itertools
import threading
import weakref
from concurrent.futures import Future

import numpy as np
import pytest
from hard_pictures import frame_of
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    PixelToLuminance,
    SensitivityModel,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.frame_analysis import FrameAnalysis, SpareArrays, frame_losses
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)

FACTORS = brightness_factors(0.2, 9)


def curves(frames, jobs=1):
    return analyze_frames(frames, "clip", HEADSET, factors=FACTORS, effort=AnalysisEffort(jobs))


def noise(n, shape=(257, 257)):
    """Frames of noise of different strengths."""
    rng = np.random.default_rng(0)
    pictures = (0.5 + 0.02 * (k % 7) * rng.normal(size=shape) for k in range(n))
    return [Frame(0.04 * k, 0.04, frame_of(picture)) for k, picture in enumerate(pictures)]


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 18, 40])
def test_the_result_does_not_depend_on_the_number_of_threads(n):
    frames = noise(n)
    alone = curves(frames)
    assert alone.n_frames == n
    for jobs in (2, 3, 0):
        together = curves(frames, jobs)
        for name in ("times", "loss", "visible_contrast", "mean_luminance", "channel_means"):
            assert getattr(together, name).tobytes() == getattr(alone, name).tobytes()


def test_every_frame_is_as_if_it_were_alone():
    frames = noise(20)
    analysis = FrameAnalysis((257, 257), HEADSET, DEFAULT_MODEL, FACTORS)
    found = curves(frames, jobs=2)
    for k, frame in enumerate(frames):
        alone = analysis.of(frame.pixel_values)
        assert found.loss[k].tobytes() == alone.loss.tobytes()
        assert found.mean_luminance[k] == alone.mean_luminance


def test_frames_like_the_one_before_are_analysed_once(monkeypatch):
    """By their content: each is an array of its own."""
    analysed, whole = [], FrameAnalysis.of
    monkeypatch.setattr(
        FrameAnalysis, "of", lambda self, pixels: (analysed.append(pixels.copy()), whole(self, pixels))[1]
    )
    first, second = noise(2)
    shown = [first, first, first, second, second, first]
    frames = [Frame(0.1 * k, 0.1, frame.pixel_values.copy()) for k, frame in enumerate(shown)]
    found = curves(frames)
    assert [np.array_equal(pixels, first.pixel_values) for pixels in analysed] == [True, False, True]
    assert found.loss[0].tobytes() == found.loss[2].tobytes() == found.loss[5].tobytes()
    assert found.loss[3].tobytes() == found.loss[4].tobytes() != found.loss[0].tobytes()
    assert found.n_frames == 6


@pytest.fixture
def slow_analysis(monkeypatch):
    """The slowest analysis there is: of no frame before nothing more is decoded, so that all wait for it."""
    decoding, waited_for, result = threading.current_thread(), threading.Event(), Future.result

    def watched(task, *arguments):
        if threading.current_thread() is not decoding:
            return result(task, *arguments)
        waited_for.set()
        try:
            return result(task, *arguments)
        finally:
            waited_for.clear()

    monkeypatch.setattr(Future, "result", watched)
    analyse = FrameAnalysis.of
    monkeypatch.setattr(
        FrameAnalysis, "of", lambda self, pixels: (waited_for.wait(), analyse(self, pixels))[1]
    )


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 3])
@pytest.mark.usefixtures("slow_analysis")
def test_few_frames_are_in_memory_however_long_the_video(jobs, monkeypatch):
    alive: list[weakref.ref] = []
    most = [0]

    def counted_alive(contents):
        for pixels in contents:
            alive.append(weakref.ref(pixels))
            most[0] = max(most[0], len({id(one()) for one in alive if one() is not None}))
            yield pixels

    monkeypatch.setattr(
        "evenlight.method.contrast.loss_curves.frame_losses",
        lambda analysis, frames, *rest: frame_losses(analysis, counted_alive(frames), *rest),
    )
    n = 100
    curves(noise(n), jobs)
    assert 1 < most[0] <= jobs + 5 < n


@pytest.mark.usefixtures("slow_analysis")
def test_nobody_writes_to_a_frame_before_it_is_analysed(monkeypatch):
    """Arrays are filled again."""
    kept = [frame.pixel_values.tobytes() for frame in noise(12)]
    analysed, whole = [], FrameAnalysis.of

    def watched(self, pixels):
        found = whole(self, pixels)
        analysed.append(pixels.tobytes())
        return found

    monkeypatch.setattr(FrameAnalysis, "of", watched)
    curves(noise(12), jobs=2)
    assert sorted(analysed) == sorted(kept)


@pytest.mark.parametrize("error", [InputError("v.mkv is damaged at frame 9"), KeyboardInterrupt()])
def test_what_breaks_the_video_comes_through_and_leaves_no_thread(error):
    def breaking():
        yield from noise(20)[:9]
        raise error

    with pytest.raises(type(error)) as caught:
        curves(breaking(), jobs=2)
    assert caught.value is error
    assert not [t for t in threading.enumerate() if t.name.startswith("frames")]


def test_what_breaks_the_analysis_comes_through_and_leaves_no_thread(monkeypatch):
    whole, calls = FrameAnalysis.of, itertools.count()

    def broken(self, *arguments):
        if next(calls) == 7:
            raise MemoryError("no room")
        return whole(self, *arguments)

    monkeypatch.setattr(FrameAnalysis, "of", broken)
    with pytest.raises(MemoryError, match="no room"):
        curves(itertools.islice(itertools.cycle(noise(2)), 200), jobs=2)
    assert not [t for t in threading.enumerate() if t.name.startswith("frames")]


def test_frames_are_asked_for_in_the_thread_that_asked_for_the_curves():
    """What renders a frame may be tied to its thread, as graphics are."""
    threads = set()

    def noting():
        for frame in noise(5):
            threads.add(threading.current_thread())
            yield frame

    curves(noting(), jobs=2)
    assert threads == {threading.current_thread()}


def test_an_impossible_number_of_threads_is_refused():
    with pytest.raises(ValueError, match=r"jobs must be 0 .* got -1"):
        AnalysisEffort(jobs=-1)


# --- spare arrays

ROOM = Display("room", 104.4, 0.2, 1.95, pixels_per_degree=72.28, reflected_luminance=2.0)

FACTORS_OF_SPARE_ARRAYS = brightness_factors(0.2, 3)


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
    analysis = FrameAnalysis((16, 16), ROOM, model, FACTORS_OF_SPARE_ARRAYS)
    assert analysis.in_one_pass == (way != "by definition")
    frame = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    for _ in range(4):
        analysis.of(frame)
        assert analysis._spare.held == 1
