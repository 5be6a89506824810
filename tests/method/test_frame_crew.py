"""Threads that analyse frames: the same result for any number of them, few frames in memory, clean ends."""

import itertools
import threading
import weakref
from concurrent.futures import Future

import numpy as np
import pytest
from hard_videos import frames_of

from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast import frame_losses
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
FACTORS = brightness_factors(0.2, 9)
BOTH = pytest.mark.parametrize("tolerance", [0.0, 1e-3])


def curves(frames, tolerance=0.0, jobs=1):
    return analyze_frames(frames, "clip", HEADSET, factors=FACTORS, effort=AnalysisEffort(tolerance, jobs))


def noise(n, shape=(257, 257)):
    """Frames of noise of different strengths."""
    rng = np.random.default_rng(0)
    return list(frames_of(0.5 + 0.02 * (k % 7) * rng.normal(size=shape) for k in range(n)))


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("n", [1, 2, 16, 17, 18, 40])
def test_the_result_does_not_depend_on_the_number_of_threads(n, tolerance):
    frames = noise(n)
    alone = curves(frames, tolerance)
    assert alone.n_frames == n
    for jobs in (2, 3, 0):
        together = curves(frames, tolerance, jobs)
        for name in ("times", "loss", "visible_contrast", "mean_luminance", "channel_means", "counted"):
            assert getattr(together, name).tobytes() == getattr(alone, name).tobytes()


def test_with_no_tolerance_every_frame_is_as_if_it_were_alone():
    frames = noise(20)
    analysis = FrameAnalysis((257, 257), HEADSET, DEFAULT_MODEL, FACTORS)
    found = curves(frames, 0.0, jobs=2)
    for k, frame in enumerate(frames):
        alone = analysis.of(frame.pixel_values)
        assert found.loss[k].tobytes() == alone.loss.tobytes()
        assert found.mean_luminance[k] == alone.mean_luminance
    assert (found.counted == 1).all()
    assert found.tolerance == 0


@BOTH
def test_frames_like_the_one_before_cost_nothing(tolerance):
    first, second = noise(2)
    shown = [first, first, first, second, second, first]
    frames = [Frame(0.1 * k, 0.1, frame.pixel_values) for k, frame in enumerate(shown)]
    found = curves(frames, tolerance)
    assert (found.counted == 0).tolist() == [False, True, True, False, True, False]
    assert found.loss[0].tobytes() == found.loss[2].tobytes() == found.loss[5].tobytes()


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
    for name in ("of", "begin"):
        analyse = getattr(FrameAnalysis, name)
        monkeypatch.setattr(
            FrameAnalysis, name, lambda self, pixels, run=analyse: (waited_for.wait(), run(self, pixels))[1]
        )


@BOTH
@pytest.mark.parametrize("jobs", [1, 3])
@pytest.mark.usefixtures("slow_analysis")
def test_few_frames_are_in_memory_however_long_the_video(tolerance, jobs, monkeypatch):
    alive: list[weakref.ref] = []
    most = [0]

    def counted_alive(contents):
        for pixels in contents:
            alive.append(weakref.ref(pixels))
            most[0] = max(most[0], len({id(one()) for one in alive if one() is not None}))
            yield pixels

    crew = frame_losses.frame_losses
    monkeypatch.setattr(
        "evenlight.method.contrast.loss_curves.frame_losses",
        lambda analysis, frames, effort, spare: crew(analysis, counted_alive(frames), effort, spare),
    )
    n = 100
    curves(noise(n), tolerance, jobs)
    held = jobs + 3 if tolerance == 0 else (jobs + 1) * frame_losses.LONGEST_STRETCH
    assert 1 < most[0] <= held + 2 < n


@BOTH
@pytest.mark.usefixtures("slow_analysis")
def test_nobody_writes_to_a_frame_before_it_is_analysed(tolerance, monkeypatch):
    """Arrays are filled again."""
    kept = [frame.pixel_values.tobytes() for frame in noise(12)]
    analysed = []
    for name in ("of", "begin"):
        whole = getattr(FrameAnalysis, name)

        def watched(self, pixels, whole=whole):
            found = whole(self, pixels)
            analysed.append(pixels.tobytes())
            return found

        monkeypatch.setattr(FrameAnalysis, name, watched)
    curves(noise(12), tolerance, jobs=2)
    assert sorted(analysed) == sorted(kept)


@BOTH
@pytest.mark.parametrize("error", [InputError("v.mkv is damaged at frame 9"), KeyboardInterrupt()])
def test_what_breaks_the_video_comes_through_and_leaves_no_thread(tolerance, error):
    def breaking():
        yield from noise(20)[:9]
        raise error

    with pytest.raises(type(error)) as caught:
        curves(breaking(), tolerance, jobs=2)
    assert caught.value is error
    assert not [t for t in threading.enumerate() if t.name.startswith("frames")]


@pytest.mark.parametrize(("tolerance", "where"), [(0.0, "of"), (1e-3, "begin"), (1e-3, "count")])
def test_what_breaks_the_analysis_comes_through_and_leaves_no_thread(tolerance, where, monkeypatch):
    whole, calls = getattr(FrameAnalysis, where), itertools.count()

    def broken(self, *arguments):
        if next(calls) == 7:
            raise MemoryError("no room")
        return whole(self, *arguments)

    monkeypatch.setattr(FrameAnalysis, where, broken)
    with pytest.raises(MemoryError, match="no room"):
        curves(itertools.islice(itertools.cycle(noise(2)), 200), tolerance, jobs=2)
    assert not [t for t in threading.enumerate() if t.name.startswith("frames")]


def test_frames_are_asked_for_in_the_thread_that_asked_for_the_curves():
    """What renders a frame may be tied to its thread, as graphics are."""
    threads = set()

    def noting():
        for frame in noise(5):
            threads.add(threading.current_thread())
            yield frame

    curves(noting(), 1e-3, jobs=2)
    assert threads == {threading.current_thread()}


@pytest.mark.parametrize(("bytes_held", "length"), [(0, 16), (20_000_000, 16), (40_000_000, 8), (10**9, 4)])
def test_stretches_of_large_frames_are_shorter(bytes_held, length):
    class Large:
        held_bytes = bytes_held

    assert frame_losses.stretch_length(Large()) == length


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tolerance": -1e-9}, "tolerance must lie in 0 to below 1, got -1e-09"),
        ({"tolerance": float("nan")}, "tolerance must lie in 0 to below 1, got nan"),
        ({"tolerance": 1.0}, "got 1"),
        ({"jobs": -1}, "jobs must be 0 .* got -1"),
    ],
)
def test_impossible_effort_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        AnalysisEffort(**wrong)
