"""What the benchmark of loss curves says: its videos, its peers, its memory, its verdicts."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.benchmarks import curves_subject, frame_points, video_points
from analysis.benchmarks.curves_memory import DISPLAY, analyze_minutes, curves_size
from analysis.benchmarks.measured import Approach, Pains, point
from analysis.benchmarks.stopwatch import Times
from data_schema.benchmark import BenchmarkPoint, Role
from data_schema.loss_curves import ARRAY_SHAPES
from method.loss_curves import analyze_frames


def a_point(task: str, name: str, role: Role, time: float, error: float) -> BenchmarkPoint:
    times = Times(np.array([time]), np.array([time]), np.array([time]))  # ratios to one second
    return point(Approach(task, name, role, 100, "pixels"), times, error, "of loss")


def test_the_film_has_a_still_shot_with_grain_a_pan_a_fade_and_a_flash() -> None:
    frames = [frame.pixel_values.astype(float) for frame in video_points.film(64, 36, 40, 1)]
    assert len(frames) == 40
    assert 0 < np.abs(frames[1] - frames[0]).mean() < 10  # grain alone
    np.testing.assert_array_equal(np.roll(frames[12], 2, axis=1), frames[13])  # the pan
    assert frames[28].mean() < 0.3 * frames[20].mean()  # the fade
    assert frames[35].mean() > frames[34].mean() + 30  # the flash


def test_one_frame_in_ten_is_right_where_it_is_sampled_and_linear_in_between() -> None:
    frames = list(video_points.film(64, 36, 24, 1))
    whole = analyze_frames(frames, "film", DISPLAY).loss
    found = video_points._one_in_ten(frames, DISPLAY, np.interp)
    for k in (0, 10, 20, 23):
        np.testing.assert_array_equal(found[k], whole[k])
    np.testing.assert_allclose(found[5], (whole[0] + whole[10]) / 2, atol=1e-12)


def test_half_the_resolution_is_the_mean_of_four_pixels() -> None:
    frame = np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    expected = [
        [frame[y : y + 2, x : x + 2].mean(axis=(0, 1)) for x in range(0, 8, 2)] for y in range(0, 6, 2)
    ]
    assert np.abs(frame_points._half(frame) - np.array(expected)).max() <= 0.5


def test_the_memory_of_the_curves_is_that_of_their_arrays() -> None:
    curves = analyze_minutes("0.02", "0.001")
    size = sum(getattr(curves, name).nbytes for name in ARRAY_SHAPES if name != "factors")
    assert curves_size(0.02) == pytest.approx(size / 2**20)
    assert curves.tolerance == 0.001


FRAMES = [
    a_point("one frame of 640 x 360", "one pass", Role.DEFAULT, 0.02, 2e-5),
    a_point(curves_subject.LARGE, "one pass", Role.DEFAULT, 0.05, 3e-5),
    a_point(curves_subject.LARGE, "the definition, 9 factors", Role.REFERENCE, 5.0, 0.0),
]


@pytest.mark.parametrize(("time", "met"), [(0.05, True), (0.11, False)])
def test_a_frame_is_held_to_its_processor_time(time: float, met: bool) -> None:
    # The wall time may be long: another program may have had the core.
    large = replace(FRAMES[1], processor_time=time, time=1.0, time_high=1.0)
    of_time, of_error = curves_subject._frame_claims([FRAMES[0], large, FRAMES[2]])
    assert (of_time.measured, of_time.met) == (time, met)
    assert (of_error.measured, of_error.met) == (3e-5, True)


def test_a_size_that_was_left_out_is_not_claimed() -> None:
    of_time, _ = curves_subject._frame_claims(FRAMES[:1])
    assert of_time.met is None


def test_the_tolerance_is_held_to_the_worst_video() -> None:
    videos = [a_point(t, video_points.USUAL, Role.DEFAULT, 1.0, e) for t, e in (("a", 2e-4), ("b", 2e-3))]
    (verdict,) = curves_subject._video_claims(videos)
    assert (verdict.measured, verdict.met) == (2e-3, False)


@pytest.mark.parametrize(("long", "met"), [(100.0, True), (150.0, False)])
def test_memory_is_compared_apart_from_the_curves(
    long: float, met: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    used = {"1.0": 100.0, "10.0": long + 2 * (curves_size(10) - curves_size(1))}
    monkeypatch.setattr(curves_subject, "peak_memory", lambda task, minutes, tolerance: used[minutes])
    verdict = curves_subject._memory_claim(Pains())
    assert verdict.met is met
    monkeypatch.setattr(curves_subject, "peak_memory", lambda *_: None)
    assert curves_subject._memory_claim(Pains()).met is None


def test_the_lead_is_reckoned_from_the_points() -> None:
    videos = [
        a_point("clip", video_points.USUAL, Role.DEFAULT, 1.0, 4e-4),
        a_point("clip", video_points.EVERY_FRAME, Role.REFERENCE, 4.0, 0.0),
        a_point("clip", "one frame in 10, linear (as the paper)", Role.PEER, 0.5, 0.03),
    ]
    lead = curves_subject._lead(FRAMES, videos)
    for words in ("50 ms", "100 times less", "3e-05", "0.25 of the time", "0.0004", "0.03"):
        assert words in lead
