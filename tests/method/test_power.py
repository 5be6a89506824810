"""Power of LCD and OLED panels."""

import numpy as np
import pytest

from method.power import power
from method.preset_files import load_power_model


def test_the_published_model_at_full_brightness() -> None:
    # vision.md 0.2: P(750) = 0.001858 · 750 + 0.2945 = 1.688 W.
    assert power(load_power_model("surace2025"), [1.0], np.ones((1, 3)))[0] == pytest.approx(1.688, abs=1e-4)


def test_a_backlight_takes_the_same_power_for_any_content() -> None:
    dark_and_bright = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    taken = power(load_power_model("surace2025"), [0.4, 0.4], dark_and_bright)
    assert taken[0] == taken[1]
