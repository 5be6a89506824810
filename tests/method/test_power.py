"""Power of LCD and OLED panels, and what frames use of a budget."""

import numpy as np
import pytest

from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.online.controller import ControllerState
from evenlight.method.online.governor import ContentCosts, Governor, GovernorSettings, first_factor
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


# --- frame costs

LCD = load_power_model("surace2025")

OLED_OF_FRAME_COSTS = PowerModel("oled", PanelKind.OLED, 0.2, red_power=0.5, green_power=1.0, blue_power=1.5)


def test_costs_by_hand() -> None:
    """H = 20 s, so T = 2 s and the content of late is that of 6 s; white takes 3 W, 0.75 W are due."""
    watts = GovernorSettings(OLED_OF_FRAME_COSTS.base_power + 0.75, BudgetUnit.WATT, 20.0)
    costs = ContentCosts(watts, OLED_OF_FRAME_COSTS)
    assert costs.of(1.5, 0.1) == pytest.approx((1.5, 0.75, 0.75, 1.5))  # half of it meets the budget
    assert costs.of(0.4, 0.1) == pytest.approx((0.4, 0.4 * 0.75 / 0.95, 0.75, 0.95))
    assert costs.of(0.0, 0.1) == pytest.approx((0.0, 0.0, 0.75, 1.9 / 3))
    assert costs.of(0.2, 0.1) == pytest.approx((0.2, 0.2, 0.75, 2.1 / 4))  # less than due: all of it
    for _ in range(1000):
        costs.of(0.0, 0.1)
    for k in range(1, 40):
        cost = costs.of(3.0, 0.1)
        late = 3.0 * (1 - (1 - 0.1 / 6) ** k)
        assert cost.allowance == pytest.approx(3.0 * min(0.75 / late, 1.0), rel=1e-6)
        assert cost.scale == pytest.approx(max(late, 3.0 * 0.1 / 2), rel=1e-6)


@pytest.mark.parametrize("watts", [0.1, 0.2, 0.95])
def test_black_to_begin_with_may_be_shown_at_any_factor(watts: float) -> None:
    """Even of a budget below what black takes already: there is nothing to share out."""
    asked = GovernorSettings(watts, BudgetUnit.WATT, 20.0)
    cost = ContentCosts(asked, OLED_OF_FRAME_COSTS).of(0.0, 0.1)
    assert (cost.per_factor, cost.allowance, cost.fair_factor) == (0.0, 0.0, 1.0)
    assert first_factor(asked, OLED_OF_FRAME_COSTS, 0.0, (0.2, 1.0)) == 1.0


@pytest.mark.parametrize(
    ("unit", "budget", "model", "expected"),
    [
        (BudgetUnit.FACTOR, 0.4, LCD, 0.4),
        (BudgetUnit.WATT, 0.8, OLED_OF_FRAME_COSTS, 0.4),  # 0.2 W and 0.4 of 1.5 W
        (BudgetUnit.POWER, 0.7, OLED_OF_FRAME_COSTS, (0.7 * 1.7 - 0.2) / 1.5),
        (BudgetUnit.WATT, 0.25, OLED_OF_FRAME_COSTS, 0.2),  # nearest to 0.05 of 1.5 W
        (BudgetUnit.WATT, 2.5, OLED_OF_FRAME_COSTS, 1.0),
    ],
)
def test_the_first_factor_is_where_the_first_frame_meets_the_budget(
    unit: BudgetUnit, budget: float, model: PowerModel, expected: float
) -> None:
    found = first_factor(GovernorSettings(budget, unit, 20.0), model, 1.5, (0.2, 1.0))
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("unit", [BudgetUnit.POWER, BudgetUnit.WATT])
@pytest.mark.parametrize("duration", [0.1, 1.0, 5.0])
def test_no_frame_is_answered_by_more_than_it_is_too_bright(unit: BudgetUnit, duration: float) -> None:
    """White after 1000 s of black, of which the mean of the content tells next to nothing."""
    costs = ContentCosts(GovernorSettings(0.7, unit, 20.0), OLED_OF_FRAME_COSTS)
    governor = Governor(20.0, 0.01)
    for _ in range(round(1000 / duration)):
        costs.of(0.0, duration)
    for _ in range(50):
        cost = costs.of(3.0, duration)
        shown = ControllerState(0.99, 0.99, 0.0, 50.0, duration)
        aim = governor.step(
            governor.start(0.1, 0.99, 0.1), shown, 0.1, cost.excess(0.99)._replace(over_horizon=0.0)
        )[1]
        assert abs(aim.shift) <= abs(0.99 - cost.allowance / 3.0) * (1 + 1e-9)
