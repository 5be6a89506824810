"""A budget for a walk: met over its horizon by what refreshes use, however late the losses come."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from data_schema.brightness_track import BudgetUnit
from data_schema.errors import InputError
from data_schema.live_control import LiveRefresh
from data_schema.loss_curves import LossCurves
from data_schema.power_model import PanelKind, PowerModel
from experiments.live_dimming import LiveDimmer
from experiments.live_governor import LiveBudget, LiveGovernor
from experiments.live_record import BudgetMet, how_met, live_control, settings_of, with_budget
from experiments.walk_request import LiveRequest, WalkRequest, budget_asked
from method.choices import LimitCurve
from method.control_curves import Governed, control_curves
from method.controller import Controller, ControllerSettings
from method.frame_costs import frame_costs
from method.governor import GovernorSettings, governor_of
from method.horizon_errors import HorizonErrors
from method.preset_files import load_display, load_power_model, load_rate_limit
from method.scalar_rate_limit import scalar_rate_limit

LIMIT = scalar_rate_limit(load_rate_limit("surace2025"))
LCD = load_power_model("surace2025")
OLED = PowerModel("oled", PanelKind.OLED, 0.2, red_power=0.5, green_power=1.0, blue_power=1.5)
RATE = 30.0


class MadeUp:
    """Knows the loss of content, strength · (1 - b), some refreshes after it was asked; gray pictures."""

    name = "made up"

    def __init__(self, strength: np.ndarray, luminance: np.ndarray, late: int) -> None:
        self._strength, self._luminance, self._late = strength, luminance, late
        self._refresh, self._asked = -1, -1
        self.loss: float | None = None

    def mean_luminance(self) -> float:
        self._refresh += 1
        return float(self._luminance[self._refresh])

    def channel_means(self) -> np.ndarray:
        return np.full(3, self._luminance[self._refresh] / 104.4)

    def begin(self, factor: float) -> bool:
        if self.loss is not None:
            return False
        self.loss, self._asked = float(self._strength[self._refresh] * (1 - factor)), self._refresh
        return True

    def result(self) -> "MadeUp | None":
        if self.loss is None or self._refresh < self._asked + self._late:
            return None
        answer = MadeUp(self._strength, self._luminance, self._late)
        answer.loss, self.loss = self.loss, None
        return answer

    def close(self) -> None:
        """Nothing to let go of."""


def walked(
    meter: MadeUp, budget: LiveBudget, refreshes: int, target: float | None = None, first: float | None = None
) -> list[LiveRefresh]:
    """What the dimmer does in so many refreshes."""
    controller = Controller(ControllerSettings(target or 0.0), LIMIT)
    dimmer = LiveDimmer(controller, meter, first, 1 / RATE, LiveGovernor(budget, controller, target))
    for k in range(refreshes):
        dimmer.next_factor(k / RATE)
        dimmer.note(k / RATE)
    return dimmer.rows


def asked(budget: float, unit: BudgetUnit, horizon: float, model: PowerModel = LCD) -> LiveBudget:
    return LiveBudget(GovernorSettings(budget, unit, horizon), model)


@pytest.mark.parametrize("late", [1, 3])
def test_the_budget_is_met_over_every_horizon_and_the_rate_limit_kept(late: int) -> None:
    """Content jumps every 10 s; the horizon of 20 s is 200 answers at least."""
    n = round(70 * RATE)
    dark = (np.arange(n) // round(10 * RATE)) % 2 == 1
    meter = MadeUp(np.where(dark, 0.3, 0.15), np.where(dark, 12.0, 55.0), late)
    budget = asked(0.6, BudgetUnit.FACTOR, 20.0)
    rows = walked(meter, budget, n, 0.05, 0.6)
    met = how_met(budget, rows)
    assert met is not None
    assert met.errors is not None
    assert met.achieved == pytest.approx(0.6, abs=0.01)
    assert met.errors.either_way < 0.025
    assert all(abs(row.rate) <= row.rate_limit * (1 + 1e-6) for row in rows[1:])
    assert len({row.target_loss for row in rows}) > 100 / late  # it is the target that moves


def test_with_prompt_losses_it_does_what_the_governor_does_offline(
    make_curves: Callable[..., LossCurves],
) -> None:
    """Of an OLED panel, whose content changes."""
    k = np.arange(600)
    strength, luminance = 0.2 + 0.1 * np.sin(k / 40), 40.0 + 25.0 * np.sin(k / 70)
    budget = asked(0.8, BudgetUnit.WATT, 20.0, OLED)
    curves = make_curves(strength, luminance=luminance, frames_per_second=RATE)
    controller = Controller(ControllerSettings(0.05), LIMIT)
    costs = frame_costs(curves, budget.settings, OLED)
    governed = Governed(governor_of(controller, budget.settings), costs)
    offline = control_curves(curves, controller, 0.6, None, governed)
    rows = walked(MadeUp(strength, luminance, 1), budget, 600, 0.05, 0.6)
    # Live, a frame's loss is known a refresh later, and its power when the next one appears.
    np.testing.assert_allclose([row.factor for row in rows[1:]], offline.factors[:-1], atol=4e-3)
    assert np.ptp(offline.factors) > 0.1


def test_of_a_day_after_a_night_no_horizon_uses_much_too_much() -> None:
    """A tenth of what full brightness takes, and what the rate limit adds; as offline."""
    n, day = round(60 * RATE), round(20 * RATE)
    light = np.where(np.arange(n) < day, 0.5, 50.0)
    full = 3.0 * 50.0 / 104.4
    budget = asked(0.2 + 0.6 * full, BudgetUnit.WATT, 20.0, OLED)
    rows = walked(MadeUp(np.full(n, 0.2), light, 3), budget, n, 0.03)
    met = how_met(budget, rows)
    assert met is not None
    assert met.errors is not None
    fall = min(LIMIT(b * 50.0) for b in np.linspace(0.6, 1, 20)) / 50.0
    assert 0 < met.errors.above < (0.1 + 0.4**2 / (2 * fall * 20.0)) * full
    powers = [0.2 + row.factor * 3.0 * row.mean_luminance / 104.4 for row in rows]
    np.testing.assert_allclose([row.power for row in rows], powers, rtol=1e-9)


@pytest.mark.parametrize(
    ("budget", "first"),
    [
        (asked(0.55, BudgetUnit.FACTOR, 20.0), 0.55),
        (
            asked(LCD.base_power + 0.7 * LCD.power_per_luminance * LCD.peak_luminance, BudgetUnit.WATT, 9.0),
            0.7,
        ),
        (asked(0.2 + 0.3 * 3.0 * 50.0 / 104.4, BudgetUnit.WATT, 20.0, OLED), 0.3),
        (asked(0.2 + 3.0, BudgetUnit.WATT, 20.0, OLED), 1.0),
        (asked(0.21, BudgetUnit.WATT, 20.0, OLED), 0.2),  # out of reach: the lowest
    ],
    ids=["factor", "lcd", "oled", "oled by day", "oled out of reach"],
)
def test_without_a_target_it_begins_where_the_budget_is_met(budget: LiveBudget, first: float) -> None:
    rows = walked(MadeUp(np.full(9, 0.2), np.full(9, 50.0), 3), budget, 9)
    assert [row.factor for row in rows] == pytest.approx([first] * 9, abs=1e-6)  # and rests there
    assert [row.target_loss for row in rows[:3]] == [None] * 3
    assert rows[3].target_loss == rows[3].contrast_loss == pytest.approx(0.2 * (1 - first))


def a_row(k: int, time: float, factor: float, power: float | None, full: float | None) -> LiveRefresh:
    return LiveRefresh(k, time, factor, target_loss=0.1 + k / 100, power=power, full_power=full)


def test_what_a_walk_used_by_hand() -> None:
    """Pictures of 1, 1 and 2 s; the last one appears and counts for nothing."""
    rows = [
        a_row(0, 0.0, 0.5, 1.0, 2.0),
        a_row(1, 1.0, 0.75, 3.0, 4.0),
        a_row(2, 2.0, 0.25, 0.0, 1.0),
        a_row(3, 4.0, 1.0, 9.0, 9.0),
    ]
    assert how_met(asked(0.5, BudgetUnit.FACTOR, 2.0), rows) == BudgetMet(
        0.4375, None, HorizonErrors(0.25, 0.125)
    )
    assert how_met(asked(1.5, BudgetUnit.WATT, 2.0), rows) == BudgetMet(1.0, 1.0, HorizonErrors(1.5, 0.5))
    # Of full power: 4/6 over the first two seconds, 3/5 over the next two, 0 over the last.
    share = how_met(asked(0.5, BudgetUnit.POWER, 2.0), rows)
    assert share is not None
    assert share.errors is not None
    assert (share.achieved, share.mean_power) == (0.5, 1.0)
    assert share.errors == pytest.approx((0.5, 4 / 6 - 0.5))
    assert how_met(asked(0.5, BudgetUnit.FACTOR, 9.0), rows) == BudgetMet(0.4375, None, None)
    assert how_met(asked(0.5, BudgetUnit.FACTOR, 9.0), rows[:1]) is None


def test_the_record_says_what_the_budget_was_and_how_it_was_met() -> None:
    limit, seen = (
        (load_rate_limit("surace2025"), LimitCurve.FITTED),
        ("house", load_display("varjo-xr3"), "cpu"),
    )
    rows = [a_row(k, float(k), 0.5, 1.0, 2.0) for k in range(5)]
    plain = live_control(settings_of(0.0, None), limit, seen, rows, simulated=True)
    kept = with_budget(plain, asked(0.75, BudgetUnit.WATT, 2.0, OLED), rows)
    assert (kept.budget, kept.budget_unit, kept.horizon) == (0.75, BudgetUnit.WATT, 2.0)
    assert (kept.target_loss, kept.final_target_loss) == (0.1, 0.14)
    assert (kept.power_model, kept.mean_power) == ("oled", 1.0)
    assert (kept.horizon_error, kept.horizon_excess) == (0.25, 0.25)
    nothing = with_budget(plain, asked(0.75, BudgetUnit.FACTOR, 2.0), [])
    assert (nothing.target_loss, nothing.power_model, nothing.horizon_error) == (None, None, None)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((0.0, None, None, None), "--budget must be above 0, got 0"),
        ((0.5, None, 0.0, None), r"--horizon must lie in 0\.1 to 1e\+06, got 0"),
        ((0.5, None, None, "surace2025"), "--power-model is for a budget in power or watt"),
    ],
)
def test_a_budget_that_cannot_be_is_refused(words: tuple, says: str) -> None:
    with pytest.raises(InputError, match=says):
        budget_asked(*words)


def test_a_budget_that_no_factor_meets_is_refused_before_the_window_opens() -> None:
    display = load_display("varjo-xr3")
    for budget, says in (
        (budget_asked(0.1, None, None, None), r"--budget 0\.1 \(factor\) cannot be met"),
        (asked(0.5, BudgetUnit.FACTOR, 60.0, OLED), "says nothing of the power of an OLED panel"),
    ):
        live = LiveRequest(budget=budget)
        with pytest.raises(InputError, match=says):
            live.governor(display, live.controller(display))
    assert budget_asked(None, None, None, None) is None
    assert WalkRequest("house", None, None, None, None, None, 2.0, None, False).factor is None
    with pytest.raises(InputError, match="give --target-loss or --budget with it"):
        LiveRequest(out=Path("somewhere"))
