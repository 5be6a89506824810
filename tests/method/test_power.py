"""Power of LCD and OLED panels."""

import numpy as np
import pytest

from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.method.power import power, power_per_factor
from evenlight.method.preset_files import load_power_model


def test_the_published_model_at_full_brightness() -> None:
    # vision.md 0.2: P(750) = 0.001858 · 750 + 0.2945 = 1.688 W.
    assert power(load_power_model("surace2025"), [1.0], np.ones((1, 3)))[0] == pytest.approx(1.688, abs=1e-4)


def test_a_backlight_takes_the_same_power_for_any_content() -> None:
    dark_and_bright = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    taken = power(load_power_model("surace2025"), [0.4, 0.4], dark_and_bright)
    assert taken[0] == taken[1]


OLED = PowerModel("oled", PanelKind.OLED, 0.25, red_power=0.5, green_power=0.75, blue_power=1.5)


@pytest.mark.parametrize(
    ("channels", "factor", "expected"),
    [
        ((0.0, 0.0, 0.0), 1.0, 0.25),  # black: the panel's electronics alone
        ((1.0, 1.0, 1.0), 1.0, 3.0),  # white: 0.25 + 0.5 + 0.75 + 1.5
        ((1.0, 1.0, 1.0), 0.5, 1.625),  # half of the light: 0.25 + 2.75 / 2
        ((1.0, 0.0, 0.0), 0.5, 0.5),  # red: 0.25 + 0.5 / 2
        ((0.0, 0.0, 1.0), 0.5, 1.0),  # blue is dear: 0.25 + 1.5 / 2
        ((0.25, 0.5, 0.125), 0.5, 0.59375),  # 0.25 + (0.125 + 0.375 + 0.1875) / 2
    ],
)
def test_oled_power_by_hand(channels, factor, expected) -> None:
    assert power(OLED, [factor], [channels])[0] == expected


def test_oled_frames_each_have_their_own_power_per_factor() -> None:
    frames = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0]]
    assert power_per_factor(OLED, frames).tolist() == [0.0, 2.75, 0.75]


def test_equal_light_of_another_colour_is_not_equal_power() -> None:
    red, blue = power(OLED, [1.0, 1.0], [[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]])
    assert (red, blue) == (0.5, 1.0)
