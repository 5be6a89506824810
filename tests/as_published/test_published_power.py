"""The paper's power model P(L) = 0.001858 L + 0.2945 W, from the measured pairs behind it."""

import numpy as np
import pytest

from evenlight.analysis.sweeps.power_fit import LineFit, fit_line, points_of
from evenlight.method.preset_files import load_power_model

# Luminance of the panel [cd/m²] and current from its 5 V supply [A], as the authors published them.
LUMINANCE = (750.0, 620.0, 440.0, 290.0, 128.0, 48.0, 8.4, 0.02)
CURRENT = (0.35, 0.28, 0.22, 0.16, 0.10, 0.08, 0.07, 0.06)
VOLTAGE = 5.0


def published_fit() -> LineFit:
    power = [VOLTAGE * current for current in CURRENT]
    return fit_line(points_of(LUMINANCE, power, [L / max(LUMINANCE) for L in LUMINANCE]))


def test_the_fit_to_the_published_pairs_is_the_published_line() -> None:
    fit = published_fit()
    assert round(fit.power_per_luminance, 6) == 0.001858
    assert round(fit.base_power, 4) == 0.2945
    # Unrounded, as the authors' program prints them.
    assert fit.power_per_luminance == pytest.approx(0.00185775, abs=5e-9)
    assert fit.base_power == pytest.approx(0.29451434, abs=5e-9)


def test_the_preset_is_that_line_within_its_rounding() -> None:
    preset, fit = load_power_model("surace2025"), published_fit()
    assert preset.power_per_luminance == pytest.approx(fit.power_per_luminance, abs=5e-7)
    assert preset.base_power == pytest.approx(fit.base_power, abs=5e-5)
    low, high = fit.base_power_interval
    assert low < preset.base_power < high


def test_the_published_line_misses_the_measured_power_at_full_brightness_by_four_percent() -> None:
    # 5 V · 0.35 A = 1.75 W measured; 0.001858 · 750 + 0.2945 = 1.688 W on the line.
    fit = published_fit()
    full = int(np.argmax(fit.level_luminance))
    assert fit.deviations[full] == pytest.approx(1.75 / 1.688 - 1, abs=1e-3)


def test_one_reading_a_level_leaves_the_lack_of_fit_untested() -> None:
    fit = published_fit()
    assert fit.lack_of_fit_p is None
    assert fit.bend_p is not None
