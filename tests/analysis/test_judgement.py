"""A track by several measures, and its movement by ColorVideoVDP: by hand, and what a metric is given."""

import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from example_tracks import example_track, header_of

from evenlight.analysis.judgement.judgement import (
    JudgedTrack,
    agreements_of,
    judgement_figure,
    measured_track,
)
from evenlight.analysis.judgement.modulation import (
    FLICKER,
    MOST_PIXELS,
    busiest_stretches,
    colour_video_vdp,
    judged_modulation,
)
from evenlight.analysis.report import report_html
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.judgement import Judgement
from evenlight.method.contrast.measures import COUNTED, MEASURES
from evenlight.stimuli.video.frames_in_memory import FramesInMemory

LAB = Display("lab", 100.0, 1.0, 2.0, pixels_per_degree=20.0, reflected_luminance=3.0)
ORIGIN = provenance_now()
HEADER = header_of(LAB, video="clip", provenance=ORIGIN)


def track_of(factors, rate=25.0, header=HEADER):
    return example_track(factors, rate, header)


def judged_with(factors, rate=25.0, shape=(9, 16, 3)):
    frames = [np.full(shape, 0.5) for _ in factors]
    return FramesInMemory(frames, rate), LAB, track_of(factors, rate)


def test_the_numbers_of_a_measure_by_hand():
    one = measured_track("x", np.array([0.1, 0.3, 0.2]), np.array([0.0, 0.6, 0.3]))
    assert (one.spread, one.spread_constant, one.gain) == pytest.approx((0.4 / 3, 0.4, 2 / 3))
    assert (one.mean_loss, one.mean_loss_constant) == pytest.approx((0.2, 0.3))
    assert (one.largest_loss, one.largest_loss_constant) == (0.3, 0.6)


def test_where_constant_dimming_is_even_there_is_no_gain_to_speak_of():
    assert measured_track("x", np.array([0.1, 0.3]), np.array([0.2, 0.2])).gain is None
    worse = measured_track("x", np.array([0.1, 0.4]), np.array([0.2, 0.3]))
    assert worse.gain == pytest.approx(-2.0)


def test_measures_agree_by_the_order_in_which_they_put_the_frames():
    """Spearman: 1 - 6 Σd² / (n (n² - 1)); reversed -1, one neighbouring pair of four swapped 1 - 12/60."""
    up = np.array([1.0, 2, 3, 4]) / 10
    losses = {"a": up, "b": up[::-1] ** 2, "c": up[[0, 2, 1, 3]], "d": 0 * up}
    found = {(one.first, one.second): one.correlation for one in agreements_of(losses)}
    assert found["a", "b"] == pytest.approx(-1)
    assert found["a", "c"] == pytest.approx(0.8)
    assert found["a", "d"] is None


def test_the_stretches_are_those_where_the_factor_moves_most():
    factors = np.full(60, 0.5)
    factors[10:] = 0.6
    factors[40:] = 0.9
    assert busiest_stretches(track_of(factors), 10) in {
        (begin, 30 + k) for begin in range(10) for k in range(10)
    }
    assert busiest_stretches(track_of(np.full(60, 0.5)), 10) == ()


def test_the_metric_sees_the_track_beside_even_dimming_of_the_same_mean():
    """Gray of 0.5 at gamma 2 emits 1 + 99/4 = 25.75 cd/m²; 3 are reflected."""
    given = []

    def metric(test, reference, rate, pixels_per_degree, peak):
        given.append((test, reference, rate, pixels_per_degree, peak))
        return 10 - float(np.abs(test / reference - 1).max())

    factors = np.concatenate([np.full(15, 0.4), np.full(15, 0.6)])
    (stretch,), _ = judged_modulation(*judged_with(factors), metric)
    test, reference, rate, pixels_per_degree, peak = given[0]
    assert test.shape == reference.shape == (30, 9, 16, 3)
    np.testing.assert_allclose(test[[0, 29], 4, 5, 1], 25.75 * np.array([0.4, 0.6]) + 3, rtol=1e-6)
    np.testing.assert_allclose(reference, 25.75 * 0.5 + 3, rtol=1e-6)
    assert (rate, pixels_per_degree) == pytest.approx((25.0, 20.0))
    assert peak >= test.max()
    assert stretch.jod == pytest.approx(10 - 25.75 * 0.1 / 15.875)
    assert stretch.jod_flicker == pytest.approx(10 - 25.75 * 0.5 * FLICKER / 15.875, abs=1e-6)
    flicker = given[1][0][:, 0, 0, 0]
    assert (np.diff(np.sign(flicker - flicker.mean())) != 0).sum() == pytest.approx(2 * 5 * 1.2, abs=1)


def test_where_pixels_dim_black_stays_as_light_as_it_is():
    """Black and white at 0.4: max(0.4 · 1, 1) + 3 and 0.4 · 100 + 3 cd/m²; evenly dimmed, at the mean 0.5."""
    given = []

    def metric(test, reference, *_):
        given.append((test, reference))
        return 10.0

    frame = np.zeros((8, 8, 3))
    frame[:, 4:] = 1.0
    track = track_of([0.4] * 15 + [0.6] * 15, header=replace(HEADER, actuator=Actuator.PIXELS))
    shown = FramesInMemory([frame] * 30, 25.0)
    judged_modulation(shown, LAB, track, metric)
    test, reference = given[0]
    np.testing.assert_allclose([test[0, 0, 3:5, 1], reference[0, 0, 3:5, 1]], [[4, 43], [4, 53]], rtol=1e-6)


def test_large_frames_are_averaged_to_few_pixels_of_as_many_degrees():
    sizes = []

    def metric(test, reference, rate, pixels_per_degree, peak):
        sizes.append((test.shape[2], pixels_per_degree))
        return 9.0

    judged_modulation(*judged_with(np.linspace(0.4, 0.5, 30), shape=(180, 320, 3)), metric)
    width, pixels_per_degree = sizes[0]
    assert width == (MOST_PIXELS * 16 / 9) ** 0.5 == 160
    assert width / pixels_per_degree == 320 / 20


@pytest.mark.parametrize(
    ("factors", "rate", "metric", "words"),
    [
        ([0.4, 0.6] * 10, 25.0, None, "not installed: pip install '.[judge]' in the checkout"),
        ([0.4, 0.6] * 10, 5.0, len, "5 frames a second are too few"),
        ([0.5] * 10, 25.0, len, "does not move"),
    ],
)
def test_where_movement_cannot_be_judged_the_note_says_why(factors, rate, metric, words):
    stretches, note = judged_modulation(*judged_with(factors, rate), metric)
    assert stretches == ()
    assert words in note


def test_color_video_vdp_is_told_the_light_the_geometry_and_no_ambient_light(monkeypatch):
    """A stand-in for the package: what it is given, and that rounding above 10 is no quality."""
    told = {}
    package, torch = ModuleType("pycvvdp"), ModuleType("torch")
    package.vvdp_display_photo_eotf = lambda **given: told.update(photometry=given)
    package.vvdp_display_geometry = lambda size, ppd: told.update(size=size, ppd=ppd)

    def predict(test, reference, dim_order, frames_per_second):
        told.update(order=dim_order, rate=frames_per_second, ratio=float((test / reference).mean()))
        return 10.000001, {}

    package.cvvdp = lambda **given: SimpleNamespace(predict=predict)
    torch.device, torch.set_num_threads, torch.no_grad = (
        str,
        lambda n: None,
        lambda: __import__("contextlib").nullcontext(),
    )
    monkeypatch.setitem(sys.modules, "pycvvdp", package)
    monkeypatch.setitem(sys.modules, "torch", torch)
    light = np.full((3, 9, 16, 3), 20.0, np.float32)
    assert colour_video_vdp(light / 2, light, 25.0, 20.0, 103.0) == 10.0
    photometry = told["photometry"]
    assert (photometry["Y_peak"], photometry["EOTF"], photometry["E_ambient"]) == (103.0, "linear", 0)
    assert photometry["k_refl"] == 0
    assert (told["size"], told["ppd"], told["order"], told["rate"]) == ([16, 9], 20.0, "FHWC", 25.0)
    assert told["ratio"] == 0.5


def judgement_of(losses):
    return Judgement(
        video="clip", display="lab", frames=4, mean_factor=0.5, constant_factor=0.5,
        measured=tuple(measured_track(name, *both) for name, both in losses.items()),
        agreements=agreements_of({name: evenly for name, (_, evenly) in losses.items()}),
        modulation=(), modulation_note="not asked", provenance=ORIGIN,
    )  # fmt: skip


def test_the_report_says_what_each_measure_counts_and_the_factor_where_that_of_constant_dimming_differs():
    up = np.array([0.1, 0.2, 0.3, 0.4])
    assert [*COUNTED] == [*MEASURES]
    judgement = judgement_of({"relative": (up / 2, up), "absolute": (up / 4, up)})
    page = report_html(JudgedTrack(judgement).report(b""))
    assert "as a share of all pairs, not of the visible ones" in page
    assert "Depending on the measure, frames of clip differ in loss from 75 % less (absolute) to 50" in page
    assert "brightness factor" not in page
    other = JudgedTrack(replace(judgement, constant_factor=0.52)).report(b"")
    assert "constant dimming has a brightness factor of 0.520, the track one of 0.500" in report_html(other)
    alone = JudgedTrack(judgement_of({"relative": (up / 2, up)}))
    lead = "Frames of clip differ in loss 50 % less (relative) than under constant dimming by 0.5."
    assert alone.first_lines[0] == lead  # of equal power, or with the same mean where power is not known


def test_the_report_warns_where_measures_reverse_and_where_a_track_is_worse():
    up = np.array([0.1, 0.2, 0.3, 0.4])
    losses = {
        "a": (up / 2, up),
        "b": (2 * up, up[::-1]),
        "c": (up, up[[2, 0, 1, 3]]),  # 1 - 6 · (4 + 1 + 1) / 60 = 0.4 with a, -0.4 with b
    }
    judgement = judgement_of(losses)
    result = JudgedTrack(judgement)
    page = report_html(result.report(b""))
    assert "Opposite orders of the frames (rank correlation): a and b (-1.00)." in page
    assert "By b, the track is less even than constant dimming." in page
    assert "Hardly any agreement on the order of the frames (rank correlation): b and c (-0.40)." in page
    assert "a and c" not in page
    assert "differ in loss by from" not in page
    assert "from 50 % less (a) to 100 % more (b) than under constant dimming by 0.5." in page
    assert "lowest rank correlation: -1.00 (a and b)" in result.summary()
    assert repr(result).startswith("<clip, judged by several measures>")
    assert judgement_figure(replace(judgement, measured=judgement.measured[:1], agreements=())).axes
