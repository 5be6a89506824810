"""What the benchmark of loss curves says: its videos, its peers, its memory, its verdicts."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import (
    curves_subject,
    decoding_points,
    frame_points,
    memory_claims,
    video_definition,
    video_points,
)
from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.curves_memory import DISPLAY, analyze_minutes, curves_size
from benchmarks.measured import Approach, RunSettings, point
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import Times
from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.method.contrast.luminance import emitted_luminance


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


def test_some_frames_are_compared_at_knots_and_between() -> None:
    frames = list(video_points.film(32, 18, 9, 1))
    found = analyze_frames(frames, "film", DISPLAY)
    changed = found.loss.copy()
    changed[2] += 0.25  # more than any loss of this frame differs from the definition
    errors = video_definition.default_errors(frames, replace(found, loss=changed), 2)
    assert errors.video == "film at 32 x 18"
    np.testing.assert_allclose(errors.at_knots[0], 0.25, atol=1e-3)  # frame 2 of 0 to 8; the other is 6
    assert errors.at_knots[1].max() < 1e-3
    middle = np.sqrt(found.factors[0] * found.factors[1])
    emitted = emitted_luminance(frames[6].pixel_values, DISPLAY)
    by_hand = np.interp(middle, found.factors, found.loss[6])
    expected = abs(by_hand - loss_curves_by_definition(emitted, [middle], DISPLAY)[0])
    assert errors.between[1, 0] == pytest.approx(expected, abs=1e-12)
    assert len(video_definition.default_errors(frames, found, 1).at_knots) == 1


@pytest.mark.parametrize(("at", "apart", "met"), [(2e-4, 9e-4, (True, True)), (2e-3, 3e-3, (False, False))])
def test_what_a_user_gets_is_held_to_the_worst_of_all_videos(
    at: float, apart: float, met: tuple[bool, bool]
) -> None:
    good = video_definition.DefaultErrors("a", np.full((2, 3), 1e-5), np.full((2, 4), 1e-5))
    between = np.array([[apart, 0.0, 0.0, 0.0]])
    bad = video_definition.DefaultErrors("b", np.array([[0.0, at]]), between)
    verdicts = video_definition.default_claims([good, bad])
    assert tuple(verdict.met for verdict in verdicts) == met
    assert tuple(verdict.measured for verdict in verdicts) == (at, apart)
    assert "2 of a, 1 of b" in verdicts[0].note
    share = "0.0%" if apart < 1e-3 else "8.3%"  # one of twelve
    assert f"median 1e-05, {share} above 0.001: single pixels" in verdicts[1].note
    assert [verdict.met for verdict in video_definition.default_claims([])] == [None, None]


def test_half_the_resolution_is_the_mean_of_four_pixels() -> None:
    frame = np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    expected = [
        [frame[y : y + 2, x : x + 2].mean(axis=(0, 1)) for x in range(0, 8, 2)] for y in range(0, 6, 2)
    ]
    assert np.abs(frame_points._half(frame) - np.array(expected)).max() <= 0.5


def test_long_ways_to_a_curve_have_few_turns_of_their_own_beside_the_usual_one() -> None:
    asked = []

    def way(name: str, long: bool = False) -> frame_points._Variant:
        return frame_points._Variant(lambda: np.zeros(len(asked.append(name) or [])), long=long)

    names = {frame_points.OURS: False, "half": False, frame_points.DOUBLE: True}
    times = frame_points._times({name: way(name, long) for name, long in names.items()}, RunSettings())
    assert [len(times[name].wall) for name in names] == [9, 9, 3]
    assert asked == [frame_points.OURS, frame_points.DOUBLE] * (3 + 1) + [frame_points.OURS, "half"] * (9 + 1)


def test_single_precision_says_how_far_from_double_it_is_and_nothing_else_does() -> None:
    curves = {frame_points.DOUBLE: np.array([0.5, 0.0]), frame_points.OURS: np.array([0.75, 0.0])}
    assert "; at most 0.2 from double" in frame_points._from_double(
        frame_points.OURS, curves
    )  # 0.25, rounded
    assert frame_points._from_double(frame_points.DOUBLE, curves) == ""


def test_the_memory_of_the_curves_is_that_of_their_arrays() -> None:
    curves = analyze_minutes("0.02")
    size = sum(getattr(curves, name).nbytes for name in ARRAY_SHAPES if name != "factors")
    assert curves_size(0.02) == pytest.approx(size / 2**20)


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


@pytest.mark.parametrize(("more", "met"), [(1.0, True), (1.5, False)])
def test_memory_is_compared_apart_from_the_curves_in_every_way(
    more: float, met: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def used(task: str, minutes: str, jobs: str, order: str) -> float:
        asked.append((float(minutes), int(jobs), PixelToLuminance(order)))
        frames = 100.0 if len(asked) % 2 else 100.0 * more  # of the shorter and of the longer video
        return frames + 2 * curves_size(float(minutes))

    monkeypatch.setattr(memory_claims, "peak_memory", used)
    verdicts = memory_claims.memory_claims(RunSettings())
    assert [verdict.met for verdict in verdicts] == [met] * 3
    assert [verdict.measured for verdict in verdicts] == pytest.approx([more] * 3)
    assert asked[:2] == [(1.0, 1, PixelToLuminance.LINEAR_FIRST), (10.0, *asked[0][1:])]
    assert {jobs for _, jobs, _ in asked} == {1, 2}
    assert {order for *_, order in asked} == set(PixelToLuminance)
    assert all("2 copies of the curves; 5% are allowed" in verdict.claim for verdict in verdicts)


def test_memory_that_the_system_does_not_tell_is_not_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_claims, "peak_memory", lambda *_: None)
    assert [verdict.met for verdict in memory_claims.memory_claims(RunSettings())] == [None] * 3


def test_a_quick_run_says_which_memory_it_leaves_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_claims, "peak_memory", lambda *_: 100.0)
    verdicts = memory_claims.memory_claims(RunSettings(quick=True))
    assert [verdict.met is None for verdict in verdicts] == [False, False, True]


def test_a_long_run_is_timed_in_processor_time_too() -> None:
    """A run that sleeps uses none: wall time passes, processor time does not."""
    _, times = frame_points._timed_once(lambda: np.asarray(threading.Event().wait(0.05), dtype=np.float64))
    assert times.wall[0] >= 0.05 > times.processor[0]


def test_the_lead_is_reckoned_from_the_points() -> None:
    videos = [
        a_point("clip", video_points.EVERY_FRAME, Role.DEFAULT, 4.0, 0.0),
        a_point("clip", "one frame in 10, linear (as the paper)", Role.PEER, 0.5, 0.03),
    ]
    lead = curves_subject._lead(FRAMES, videos)
    for words in ("50 ms", "100 times less", "3e-05", "4 s", "0.03"):
        assert words in lead


def test_a_file_is_timed_step_by_step_and_its_planes_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decoding_points, "QUICK_SIZES", ((64, 36),))
    points = decoding_points.decoding_points(RunSettings(quick=True), DISPLAY)
    by_name = {p.approach: p for p in points}
    assert all(p.size == 64 * 36 and p.time > 0 for p in points)
    assert by_name[decoding_points.OF_PLANES].error == 0
    slow = replace(by_name[decoding_points.TWO_JOBS], ratio=0.6)
    equal, jobs = decoding_points.decoding_claims([slow, by_name[decoding_points.OF_PLANES]])
    assert equal.met
    assert not jobs.met  # 1 / 0.6 is below 1.7
