"""Fine bands taken from other frames: the tolerance holds on what is hard, and signs tell of a change."""

import numpy as np
import pytest
from hard_pictures import fractal, frame_of
from hard_videos import ODD, PICTURES, SHAPE, frames_of, hard_video
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.data_schema.contrast_model import ContrastModel, SensitivityModel
from evenlight.data_schema.display import Display
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.critical_factor import band_table
from evenlight.method.contrast.frame_analysis import (
    MANY_PIXELS,
    FrameAnalysis,
    FrameCounts,
    difference_shares,
    difference_thresholds,
)
from evenlight.method.contrast.frame_losses import settle_fine_bands
from evenlight.method.contrast.loss_curves import (
    analyze_frames,
    brightness_factors,
    loss_curves_by_definition,
)
from evenlight.method.contrast.luminance import emitted_luminance

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
FACTORS = brightness_factors(0.2, 17)


def loss_error(frames, tolerance):
    """Largest error of the loss over all frames and knots, and the share of pixels counted."""
    exact = analyze_frames(frames, "v", HEADSET, factors=FACTORS)
    thrifty = analyze_frames(frames, "v", HEADSET, factors=FACTORS, effort=AnalysisEffort(tolerance))
    # Power and rate limit rest on these, and they cost little: they are those of every frame.
    np.testing.assert_array_equal(thrifty.mean_luminance, exact.mean_luminance)
    np.testing.assert_array_equal(thrifty.channel_means, exact.channel_means)
    return np.abs(thrifty.loss - exact.loss).max(), thrifty.counted.mean()


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_the_tolerance_holds_on_hard_videos(name):
    error, _ = loss_error(list(hard_video(name)), 1e-3)
    assert error <= 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pan", "grain"])
def test_the_tolerance_and_the_one_pass_together_keep_to_the_definition(name):
    """Where they differ most from each other, at knots."""
    frames = list(hard_video(name))
    exact = analyze_frames(frames, "v", HEADSET, factors=FACTORS).loss
    found = analyze_frames(frames, "v", HEADSET, factors=FACTORS, effort=AnalysisEffort(1e-3)).loss
    worst = int(np.abs(found - exact).max(axis=1).argmax())
    assert not np.array_equal(found[worst], exact[worst])
    emitted = emitted_luminance(frames[worst].pixel_values, HEADSET)
    expected = loss_curves_by_definition(emitted, FACTORS[::4], HEADSET)
    assert np.abs(found[worst, ::4] - expected).max() <= 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flash", "odd rows", "odd columns", "odd checks", "odd blur", "odd grain"])
def test_one_odd_frame_is_found_among_steady_ones(name):
    """Its loss is more than 0.003 apart from that of its neighbours."""
    frames = list(hard_video(name))
    exact = analyze_frames(frames, "v", HEADSET, factors=FACTORS).loss
    apart = np.abs(exact[ODD] - (exact[ODD - 1] + exact[ODD + 1]) / 2).max()
    error, counted = loss_error(frames, 0.003)
    assert error < 0.003 < apart
    assert counted < 0.6


@pytest.mark.parametrize(
    ("name", "most"), [("pan", 0.5), ("cut", 0.1), ("standing still", 0.04), ("title", 0.1)]
)
def test_steady_content_is_not_counted_in_every_frame(name, most):
    _, counted = loss_error(list(hard_video(name)), 1e-3)
    assert counted < most


def film(shots, shape=SHAPE):
    """Frames of shots, each with its picture, pan, fade and grain."""
    pictures = []
    for (exponent, seed), speed, (first, last), grain, n in shots:
        picture, rng = 0.45 + 0.18 * fractal(shape, exponent, seed), np.random.default_rng(seed)
        gains = np.linspace(first, last, n)
        moved = (gains[k] * np.roll(picture, speed * k, 1) for k in range(n))
        pictures += [one + grain * rng.normal(size=one.shape) for one in moved]
    return list(frames_of(pictures))


TWO_BANDS = (520, 520)  # that large, the second band too is taken from other frames
GAINS = st.floats(0.05, 1.2)
SHOTS = st.tuples(
    st.tuples(st.floats(0.8, 1.6), st.integers(0, 99)),
    st.integers(0, 20),
    st.tuples(GAINS, GAINS),
    st.sampled_from([0.0, 0.005, 0.03]),
    st.integers(1, 24),
)


@pytest.mark.slow
def test_the_tolerance_holds_where_two_bands_are_taken_from_other_frames():
    shots = [((1.1, 1), 3, (0.9, 1.1), 0.005, 12), ((1.0, 2), 0, (0.2, 0.8), 0.03, 20)]
    error, counted = loss_error(film(shots, TWO_BANDS), 1e-3)
    assert error <= 1e-3
    assert counted < 0.9


@pytest.mark.slow
@settings(deadline=None, max_examples=8)
@given(st.lists(SHOTS, min_size=1, max_size=3), st.sampled_from([1e-3, 1e-2]))
def test_the_tolerance_holds_on_films_made_by_chance(shots, tolerance):
    error, _ = loss_error(film(shots), tolerance)
    assert error <= tolerance


class Given:
    """An analysis of frames whose finest band is known: what `settle_fine_bands` asks of `FrameAnalysis`."""

    fine_bands = range(1)

    def __init__(self, fine):
        self.fine = fine

    def count(self, counts, band):
        counts.shares[band] = self.fine[int(counts.mean_luminance)]

    def release(self, counts):
        pass


def test_shares_that_miss_in_proportion_to_what_is_seen_count_as_missed():
    """In the middle frame's loss 1 - C(b)/C(1) they cancel, in that of a frame seen otherwise they do not."""
    seen = np.array([0.5, 0.75, 1.0])
    fine = [0.2 * seen, 0.8 * seen, 0.8 * seen, 0.8 * seen, 0.2 * seen]
    coarse = [seen, np.full(3, 0.5), seen, np.full(3, 0.5), seen]
    stretch = [
        FrameCounts(
            float(k), np.zeros(3), np.array([fine[k] if k in (0, 4) else fine[k] + np.nan, coarse[k]])
        )
        for k in range(5)
    ]
    for counts in stretch:
        counts.differences = (np.zeros(5),)
    settle_fine_bands(Given(fine), stretch, 0.01)
    np.testing.assert_array_equal([counts.shares[0] for counts in stretch], fine)


def test_bands_of_few_pixels_are_counted_in_every_frame():
    noise = [np.random.default_rng(k).random((250, 250)) for k in range(9)]
    assert MANY_PIXELS > 250 * 250
    assert loss_error(list(frames_of(noise)), 0.5) == (0, 1)
    assert len(FrameAnalysis((260, 260), HEADSET, ContrastModel(), FACTORS).fine_bands) == 1
    assert len(FrameAnalysis((520, 520), HEADSET, ContrastModel(), FACTORS).fine_bands) == 2


def test_where_the_definition_is_used_no_band_is_left_out():
    room = Display("room", 100.0, 0.2, 2.2, pixels_per_degree=60.0, reflected_luminance=1.0)
    model = ContrastModel(sensitivity=SensitivityModel.AUTHORS)
    assert len(FrameAnalysis((300, 300), room, model, FACTORS).fine_bands) == 0


def test_the_finest_bands_that_can_be_seen_are_taken():
    """At 200 pixels per degree nothing can be seen in the band at 100 cpd."""
    sharp = Display("sharp", 104.4, 0.2, 1.95, pixels_per_degree=200.0)
    analysis = FrameAnalysis((600, 600), sharp, ContrastModel(), FACTORS)
    assert analysis.fine_bands == range(1, 2)
    noise = frame_of(np.random.default_rng(0).random((600, 600)))
    counts = analysis.complete(analysis.begin(noise))
    np.testing.assert_array_equal(analysis.loss_of(counts).loss, analysis.of(noise).loss)


@given(
    arrays(np.float32, (5, 7), elements=st.floats(0, 100, width=32)),
    arrays(np.float32, 3, elements=st.floats(2**-6, 8, width=32)),
)
def test_difference_shares_are_as_described(luminance, thresholds):
    above = np.zeros(3)
    for y in range(4):
        for x in range(6):
            here = luminance[y, x]
            g = abs(here - luminance[y, x + 1]) + abs(here - luminance[y + 1, x])
            above += g * g / max(here, np.float32(1e-9)) > thresholds
    # A division may round otherwise in the compiled loop: one pixel may be at the very threshold.
    np.testing.assert_allclose(difference_shares(luminance, thresholds), above / 24, atol=1.01 / 24)


def test_thresholds_of_difference_enclose_what_is_just_visible():
    """At a tenth of the peak, g/L is visible among equals where g/L * s = 3.2 (t^0.7 = 1 + t^0.2)."""
    band = band_table(16.0, 0.2, HEADSET, ContrastModel())
    luminance = 0.1 * HEADSET.peak_luminance
    log_e = np.linspace(*band.log_luminance_range, len(band.log_sensitivity))
    sensitivity = 2 ** np.interp(np.log2(luminance), log_e, band.log_sensitivity)
    just_visible = (3.2 / sensitivity * luminance) ** 2 / luminance
    assert difference_thresholds(band)[1] == pytest.approx(just_visible, rel=0.02)
