"""Claims about the display model that is fitted to a luminance sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from made_sweeps import WARM, Meter, luminance_readings

from analysis.display_fit import GammaFit, fit_gamma, tolerated
from analysis.gamma_curve import Curve, PixelLevel
from analysis.luminance_levels import middle_of, pixel_levels
from analysis.meter_noise import Repeats
from data_schema.errors import InputError
from data_schema.sweep import LuminanceSweepDesign
from hardware.simulated_panel import PanelPhysics

DESIGN = LuminanceSweepDesign(factors=(), warm_up=0.0)
CURVE = Curve(gamma=2.2, peak=200.0, black=0.3)
VALUES = np.arange(17) / 16


def levels(
    means: Sequence[float], spread: float = 0.001, values: Sequence[float] = tuple(VALUES)
) -> list[PixelLevel]:
    """Three readings of each level, the middle one the mean."""
    read = (Repeats(m * (1 + spread * np.array([-1.0, 0.0, 1.0])), np.arange(3.0)) for m in means)
    return [PixelLevel(float(v), repeats) for v, repeats in zip(values, read, strict=True)]


def swept(
    seed: int,
    transfer: Callable[[float], float] | None = None,
    physics: PanelPhysics = WARM,
    meter: Meter | None = None,
    reflected: float = 0.0,
) -> GammaFit:
    readings = luminance_readings(physics, np.random.default_rng(seed), DESIGN, meter, transfer)
    return fit_gamma(pixel_levels(readings, reflected), reflected, middle_of(readings))


def srgb(v: float) -> float:
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1


def s_curve(v: float) -> float:
    return float(v**2.2 * (1 + 0.25 * (1 - v) * v * np.sin(2 * np.pi * v)))


def clipped_white(v: float) -> float:
    return float(min(v / 0.9, 1.0) ** 2.2)


def test_readings_on_a_curve_give_that_curve_back() -> None:
    fit = fit_gamma(levels(CURVE.luminance(VALUES).tolist()), 0.0, 1.0)
    assert fit.curve.gamma == pytest.approx(2.2, abs=1e-5)
    assert fit.curve.peak == pytest.approx(200.0, rel=1e-6)
    assert fit.curve.black == pytest.approx(0.3, abs=1e-5)
    assert fit.is_gamma()


@pytest.mark.parametrize("transfer", [srgb, s_curve, clipped_white])
@pytest.mark.parametrize("seed", range(5))
def test_a_display_with_another_curve_is_told(transfer: Callable[[float], float], seed: int) -> None:
    fit = swept(seed, transfer)
    assert not fit.is_gamma()
    assert fit.lack_of_fit_p is not None
    assert fit.lack_of_fit_p < 1e-6


def test_the_intervals_of_a_curve_that_does_not_fit_are_wider() -> None:
    ends = [fit.intervals[0] for fit in (swept(1), swept(1, srgb))]
    widths = [high - low for low, high in ends]
    assert widths[1] > 5 * widths[0]


def test_a_deviation_that_noise_explains_is_no_lack_of_fit() -> None:
    # A meter that scatters by 5 %: levels lie 3 % off, and the repeats say why.
    fits = [swept(seed, meter=Meter(share=0.05, digits=0)) for seed in range(20)]
    assert np.max([np.abs(fit.deviations()).max() for fit in fits]) > 0.02
    assert sum(fit.is_gamma() for fit in fits) >= 18


def test_a_clear_deviation_that_is_too_small_to_matter_is_tolerated() -> None:
    # 1 % at mid-gray, by a meter of 0.05 %: certain, and half of what is tolerated.
    fit = swept(
        1, lambda v: v**2.2 * (1 + 0.01 * np.sin(np.pi * v)), meter=Meter(share=5e-4, floor=5e-4, digits=6)
    )
    assert fit.lack_of_fit_p is not None
    assert fit.lack_of_fit_p < 0.01
    assert fit.is_gamma()


def test_neither_end_rules_the_fit() -> None:
    # One level off by three standard errors, at the dark or at the bright end, moves the curve within its
    # interval: no level weighs more than its noise allows.
    means = CURVE.luminance(VALUES)
    for place in (1, 16):
        moved = means.copy()
        moved[place] *= 1 + 3 * 0.001 / np.sqrt(3)
        fit = fit_gamma(levels(moved.tolist()), 0.0, 1.0)
        assert abs(fit.curve.gamma - 2.2) < 0.003
        assert abs(fit.curve.peak / 200 - 1) < 0.002


def test_reflected_light_belongs_to_no_parameter() -> None:
    bright_room = swept(3, physics=replace(WARM, reflected_luminance=4.0), reflected=4.0)
    assert bright_room.curve.black == pytest.approx(0.2, abs=0.02)
    assert bright_room.curve.peak == pytest.approx(200.0, rel=0.005)
    assert bright_room.curve.gamma == pytest.approx(2.2, abs=0.01)


def test_a_drift_during_the_sweep_is_told_from_the_curve() -> None:
    # 17 levels, 3 times, 3 s each: 0.0425 h in the middle of which the display has drifted half.
    fit = swept(4, physics=replace(WARM, drift_per_hour=0.4))
    assert fit.drift_rate * 3600 == pytest.approx(0.4, rel=0.15)
    assert fit.curve.gamma == pytest.approx(2.2, abs=0.01)
    assert fit.curve.peak == pytest.approx(200 * (1 + 0.4 * fit.time / 3600), rel=0.005)


def test_a_black_that_was_too_dark_is_bounded_by_what_could_be_read() -> None:
    # The meter reads from 0.3 on; the lowest level above is 200 · (1/16)^2.2 + 0.1 = 0.55.
    held = 0
    for seed in range(20):
        fit = swept(seed, physics=replace(WARM, black_level=0.1), meter=Meter(lowest=0.3))
        low, high = fit.intervals[2]
        assert fit.pixel_values[0] > 0
        assert high < 0.56
        held += low <= 0.1 <= high
    assert held >= 17  # 95 % of 20; 16 or fewer come once in 390 times


def test_a_reading_under_range_is_neither_zero_nor_nothing() -> None:
    # Too dark at the two lowest levels: the curve must pass below the third there, though nothing was read.
    readable = levels(CURVE.luminance(VALUES[2:]).tolist(), values=tuple(VALUES[2:]))
    empty = Repeats(np.empty(0), np.empty(0))
    dark = [PixelLevel(0.0, empty, 3), PixelLevel(1 / 16, empty, 3)]
    without, with_dark = fit_gamma(readable, 0.0, 1.0), fit_gamma([*dark, *readable], 0.0, 1.0)
    lowest = float(CURVE.luminance(VALUES[2]))
    assert with_dark.curve.black < lowest
    assert with_dark.intervals[2][1] <= max(without.intervals[2][1], lowest)
    assert with_dark.curve.gamma == pytest.approx(2.2, abs=0.01)


def test_a_black_below_the_reflected_light_is_zero_and_said_so() -> None:
    means = Curve(2.2, 200.0, 0.0).luminance(VALUES) - 0.1  # 0.1 too much was taken off
    fit = fit_gamma(levels(means.tolist()), 0.1, 1.0)
    assert fit.curve.black == 0.0
    assert fit.black_unconstrained == pytest.approx(-0.1, abs=0.01)
    assert fit.intervals[2] == (0.0, 0.0)


def test_one_reading_a_level_gives_a_curve_without_a_test() -> None:
    once = [
        PixelLevel(float(v), Repeats(np.array([float(L)]), np.array([0.0])))
        for v, L in zip(VALUES, CURVE.luminance(VALUES), strict=True)
    ]
    fit = fit_gamma(once, 0.0, 0.0)
    assert fit.lack_of_fit_p is None
    assert fit.curve.gamma == pytest.approx(2.2, abs=1e-5)


def test_a_meter_aimed_at_the_wall_is_refused() -> None:
    with pytest.raises(InputError, match="does not rise with pixel value"):
        fit_gamma(levels([3.0] * 17), 0.0, 1.0)


def test_two_levels_are_refused() -> None:
    with pytest.raises(InputError, match="needs luminances of 3 or more pixel values, got 2"):
        fit_gamma(levels([0.2, 100.0], values=(0.0, 1.0)), 0.0, 1.0)


def test_what_is_tolerated_is_two_percent_and_two_hundredths() -> None:
    assert tolerated([0.0, 1.0]).tolist() == pytest.approx([0.02, 0.04])
