"""Dithering has the luminance meant, and ramps are linear in it."""

import numpy as np
import pytest
from drawn_codes import dithered_codes
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator, Dither
from evenlight.stimuli.dithering import (
    LEVELS,
    bayer_matrix,
    hashed,
    luminance_of_codes,
    neighbouring_codes,
    thresholds_of,
)
from evenlight.stimuli.ramp import frame_count, ramp_luminance, reachable_luminances, require_reachable

LAB = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)

ROOM = Display("room", 250.0, 0.4, 2.0, pixels_per_degree=60.0, reflected_luminance=3.0)


def mean_luminance(luminance: float, dither: Dither, size: int, frame: int = 0, bits: int = 8) -> float:
    codes = dithered_codes(luminance, thresholds_of(dither, (size, size), frame, seed=7), LAB, bits)
    return float(luminance_of_codes(codes, LAB, bits).mean())


@given(st.floats(0, 1), st.sampled_from([8, 10]), st.sampled_from([LAB, ROOM]))
def test_the_mix_of_the_two_codes_has_the_luminance_meant(share, bits, display) -> None:
    ends = luminance_of_codes([0, 2**bits - 1], display, bits)
    luminance = ends[0] + share * (ends[1] - ends[0])
    lower, upper_share = neighbouring_codes(luminance, display, bits)
    below, above = luminance_of_codes([lower, lower + 1], display, bits)
    mixed = below + upper_share / LEVELS * (above - below)
    assert mixed == pytest.approx(luminance, abs=(above - below) / LEVELS + 1e-9)
    assert below - 1e-9 <= luminance <= above + 1e-9


def test_a_luminance_that_the_display_has_not_is_refused() -> None:
    for luminance in (-0.1, 100.1, float("nan")):
        with pytest.raises(ValueError, match=r"luminance must be between 0 and 100 cd/m\^2 on 'lab'"):
            neighbouring_codes(luminance, LAB, bits=8)


def test_noise_of_a_frame_is_unbiased_within_its_standard_error() -> None:
    """At 99.57 cd/m^2, half a step of 0.861 below white, n pixels give an error of 0.43 / sqrt(n)."""
    errors = [mean_luminance(99.57, Dither.NOISY_BIT, 128, frame) - 99.57 for frame in range(200)]
    standard_error = 0.861 / 2 / 128
    assert np.std(errors) == pytest.approx(standard_error, rel=0.2)  # 200 frames: 5 % each way
    assert abs(np.mean(errors)) < 4 * standard_error / np.sqrt(200)


def test_a_slow_ramp_of_noise_or_ordered_dither_keeps_within_the_limit_and_rounding_does_not() -> None:
    """0.2 cd/m^2/s from 100 cd/m^2 for 5 s; rounding misses by up to half a step of 0.86."""
    ramp = np.linspace(100.0, 99.0, 61)
    for dither, largest in ((Dither.NOISY_BIT, 0.02), (Dither.ORDERED, 0.02)):
        errors = [mean_luminance(x, dither, 128, frame) - x for frame, x in enumerate(ramp)]
        assert np.abs(errors).max() < largest
    errors = [mean_luminance(x, Dither.NONE, 8) - x for x in ramp]
    assert 0.28 < np.abs(errors).max() < 0.44


def test_rounding_takes_the_code_nearest_in_luminance() -> None:
    steps = luminance_of_codes(np.arange(256), LAB, 8)
    wanted = np.linspace(0, 100, 1001)
    codes = [dithered_codes(x, thresholds_of(Dither.NONE, (1, 1)), LAB, 8)[0, 0] for x in wanted]
    nearest = np.abs(steps[:, np.newaxis] - wanted).argmin(axis=0)
    np.testing.assert_array_equal(codes, nearest)


def test_the_bayer_matrix_is_the_published_one() -> None:
    """Bayer (1973), 8 x 8, as printed: its first two rows, and each threshold once."""
    matrix = bayer_matrix()
    assert matrix[0].tolist() == [0, 32, 8, 40, 2, 34, 10, 42]
    assert matrix[1].tolist() == [48, 16, 56, 24, 50, 18, 58, 26]
    assert sorted(matrix.ravel().tolist()) == list(range(64))


def pcg4d_as_published(x: int, y: int, z: int, w: int) -> tuple[int, int, int, int]:
    """Jarzynski & Olano (2020), supplement, transcribed in whole numbers of any size."""
    word = (1 << 32) - 1
    x, y, z, w = ((v * 1664525 + 1013904223) & word for v in (x, y, z, w))
    for last in (False, True):
        x = (x + y * w) & word
        y = (y + z * x) & word
        z = (z + x * y) & word
        w = (w + y * z) & word
        if not last:
            x, y, z, w = (v ^ (v >> 16) for v in (x, y, z, w))
    return x, y, z, w


@given(*[st.integers(0, 2**32 - 1)] * 4)
def test_the_hash_is_the_published_one(x, y, frame, seed) -> None:
    assert int(hashed(x, y, frame, seed)) == pcg4d_as_published(x, y, frame, seed)[3]


def test_the_noise_is_uniform_and_knows_nothing_of_its_neighbours_in_space_and_time() -> None:
    """Correlations of n independent pairs have a standard deviation of 1 / sqrt(n)."""
    shape = (256, 256)
    here = thresholds_of(Dither.NOISY_BIT, shape, 10, 5) / LEVELS
    others = {
        "right": np.roll(here, 1, axis=1),
        "below": np.roll(here, 1, axis=0),
        "next frame": thresholds_of(Dither.NOISY_BIT, shape, 11, 5) / LEVELS,
        "next seed": thresholds_of(Dither.NOISY_BIT, shape, 10, 6) / LEVELS,
    }
    counts = np.histogram(here, bins=64, range=(0, 1))[0]
    expected = here.size / 64
    chi_squared = ((counts - expected) ** 2 / expected).sum()
    assert abs(chi_squared - 63) < 4 * np.sqrt(2 * 63)
    for name, there in others.items():
        correlation = np.corrcoef(here.ravel(), there.ravel())[0, 1]
        assert abs(correlation) < 4 / np.sqrt(here.size), name


def test_seeds_and_frames_beyond_32_bits_are_refused() -> None:
    for frame, seed in ((0, 1 << 32), (1 << 32, 0), (0, -1)):
        with pytest.raises(ValueError, match=r"must be in \[0, 2\^32\)"):
            thresholds_of(Dither.NOISY_BIT, (2, 2), frame, seed)


# --- ramp

LAB_OF_RAMP = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0, reflected_luminance=1.0)


def test_the_papers_ramp_is_constant_then_falls_at_its_rate_then_holds() -> None:
    times = np.arange(0, 7, 1 / 60)
    luminance = ramp_luminance(times, 100.0, 99.0, adaptation=1.0, duration=5.0)
    rates = np.diff(luminance) * 60
    ramping = (times[:-1] >= 1 - 1e-9) & (times[1:] <= 6 + 1e-9)
    np.testing.assert_allclose(rates[ramping], -0.2, atol=1e-9)  # 1 cd/m^2 in 5 s
    np.testing.assert_allclose(rates[~ramping], 0.0, atol=1e-9)
    assert luminance[0] == 100.0
    assert luminance[-1] == 99.0


@given(st.floats(0, 10), st.floats(1, 100), st.floats(1, 100), st.floats(0, 3), st.floats(0.1, 6))
def test_no_luminance_lies_beyond_the_two_ends(time, initial, final, adaptation, duration) -> None:
    luminance = float(ramp_luminance(time, initial, final, adaptation, duration))
    assert min(initial, final) - 1e-9 <= luminance <= max(initial, final) + 1e-9


def test_a_ramp_of_7_s_has_420_frames_at_60_hz_and_1007_at_143_86_hz() -> None:
    assert frame_count(7.0, 60.0) == 420
    assert frame_count(7.0, 143.86) == 1007  # 1007.02


def test_pixels_reach_black_and_white_with_the_reflected_light() -> None:
    assert reachable_luminances(0.46, LAB_OF_RAMP, Actuator.PIXELS) == (1.5, 101.0)


def test_a_backlight_dims_what_the_pixels_let_through_and_not_the_reflected_light() -> None:
    emitted = 0.5**2.2 * (100.0 - 0.5) + 0.5  # Eq. 1
    darkest, brightest = reachable_luminances(0.5, LAB_OF_RAMP, Actuator.BACKLIGHT, smallest_factor=0.1)
    assert darkest == pytest.approx(0.1 * emitted + 1.0)
    assert brightest == pytest.approx(emitted + 1.0)


@pytest.mark.parametrize(
    ("initial", "final", "actuator", "says"),
    [
        (20.0, 1.4, Actuator.PIXELS, "end beyond 1.5 cd/m"),
        (20.0, -5.0, Actuator.PIXELS, "end beyond 1.5 cd/m"),
        (101.0, 106.0, Actuator.PIXELS, "end beyond 101 cd/m"),
        (120.0, 90.0, Actuator.PIXELS, "begin beyond 101 cd/m"),
        (20.0, 5.9, Actuator.BACKLIGHT, "end beyond 6 cd/m"),  # 0.05 of 100, and 1 reflected
    ],
)
def test_a_ramp_beyond_the_display_is_refused_with_its_limit(initial, final, actuator, says) -> None:
    with pytest.raises(InputError, match=says) as refused:
        require_reachable(initial, final, 1.0, LAB_OF_RAMP, actuator, smallest_factor=0.05)
    assert "'lab'" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_ramp_to_the_very_limits_is_shown() -> None:
    require_reachable(101.0, 1.5, 1.0, LAB_OF_RAMP, Actuator.PIXELS)
    require_reachable(101.0, 6.0 - 1e-12, 1.0, LAB_OF_RAMP, Actuator.BACKLIGHT, smallest_factor=0.05)
