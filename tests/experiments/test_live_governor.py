"""A budget for a walk: met over its horizon by what refreshes use, however late the losses come."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.experiments.playback.live_dimming import LiveBudget, LiveDimmer, LiveGovernor, PictureUse
from evenlight.experiments.playback.live_record import (
    LiveDimming,
    asked_budget,
    dimming_in_words,
    live_control,
)
from evenlight.experiments.playback.play_options import LiveOptions
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings, ControllerState, SteeredTarget
from evenlight.method.online.governor import GovernorSettings, frame_costs, governor_of
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit
from evenlight.method.rate_limit import ScalarRateLimit, scalar_rate_limit

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

    def result(self) -> float | None:
        if self.loss is None or self._refresh < self._asked + self._late:
            return None
        answer, self.loss = self.loss, None
        return answer

    def close(self) -> None:
        """Nothing to let go of."""


def walked(
    meter: MadeUp,
    budget: LiveBudget,
    refreshes: int,
    target: float | None = None,
    first: float | None = None,
    limit: ScalarRateLimit = LIMIT,
) -> list[LiveRefresh]:
    """What the dimmer does in so many refreshes."""
    controller = Controller(ControllerSettings(target or 0.0), limit)
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
    met = recorded(budget, rows)
    assert met.achieved == pytest.approx(0.6, abs=0.01)
    assert met.horizon_error < 0.025
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
    governed = (governor_of(controller, budget.settings), costs)
    offline = control_curves(curves, controller, 0.6, None, governed)
    rows = walked(MadeUp(strength, luminance, 1), budget, 600, 0.05, 0.6)
    # Live, a frame's loss is known a refresh later, and its power when the next one appears.
    np.testing.assert_allclose([row.factor for row in rows[1:]], offline.factors[:-1], atol=4e-3)
    assert np.ptp(offline.factors) > 0.1


def surplus_of_the_fall(limit: ScalarRateLimit, luminance: float, to: float) -> float:
    """∫ (b − to) dt while b falls from 1 as fast as a limit allows at some luminance [s]."""
    factors = np.linspace(to, 1.0, 400)
    seconds_per_factor = luminance / np.array([limit(b * luminance) for b in factors])
    return float(np.trapezoid((factors - to) * seconds_per_factor, factors))


def day_after_night(limit: ScalarRateLimit) -> tuple[float, list[LiveRefresh]]:
    """Most of a horizon of 20 s above the budget, as a share of what full brightness uses; the refreshes."""
    n, day, full = round(60 * RATE), round(20 * RATE), 3.0 * 50.0 / 104.4
    light = np.where(np.arange(n) < day, 0.5, 50.0)
    budget = asked(0.2 + 0.6 * full, BudgetUnit.WATT, 20.0, OLED)
    rows = walked(MadeUp(np.full(n, 0.2), light, 3), budget, n, 0.03, limit=limit)
    met = recorded(budget, rows)
    return met.horizon_excess / full, rows


@pytest.mark.slow
@pytest.mark.parametrize("faster", [1.0, 10.0])
def test_of_a_day_after_a_night_no_horizon_uses_much_too_much(
    faster: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tenth of what full brightness takes, and what the fall at the rate limit adds; ungoverned, more.

    At ten times the paper's limit the fall adds hardly anything: the tenth is the governor's own.
    """

    def limit(luminance: float) -> float:
        return faster * LIMIT(luminance)

    most = 0.1 + surplus_of_the_fall(limit, 50.0, 0.6) / 20.0
    above, rows = day_after_night(limit)
    assert 0 < above < most
    powers = [0.2 + row.factor * 3.0 * row.mean_luminance / 104.4 for row in rows]
    np.testing.assert_allclose([row.power for row in rows], powers, rtol=1e-9)
    monkeypatch.setattr(LiveGovernor, "aim", lambda *_: None)
    assert day_after_night(limit)[0] > most


def begun(budget: LiveBudget, factor: float) -> tuple[LiveGovernor, ControllerState]:
    """A governor at its first loss, and the controller's answer to that."""
    governor = LiveGovernor(budget, Controller(ControllerSettings(0.05), LIMIT), 0.05)
    governor.begin(factor, 0.1)
    return governor, ControllerState(factor, factor, 0.0, 50.0, 1 / RATE)


@pytest.mark.parametrize("batch", [1, 3, 8])
def test_after_a_night_no_answer_leads_beyond_what_the_content_is_allowed(batch: int) -> None:
    """However many refreshes it answers to, but for what m pays back with it: 10/4 of a T's share of m.

    A T lasts 20 answers, and m takes up a tenth of an answer's share of T: 10/4 · 1/10 · 1/20 = 1/80 of it.
    """
    governor, answer = begun(asked(0.6, BudgetUnit.POWER, 20.0, OLED), 0.2)
    for k in range(1000 * batch):
        governor.take(PictureUse(0.2, 0.0, 1 / RATE))
        if k % batch == batch - 1:
            governor.aim(answer, 0.2, 0.1)
    for _ in range(batch):
        governor.take(PictureUse(0.2, 2.0, 1 / RATE))
    aim = governor.aim(answer, 0.2, 0.1)
    allowed = (0.6 * (0.2 + 2.0) - 0.2) / 2.0
    assert aim is not None
    assert 0.03 < aim.shift <= (allowed - 0.2) * (1 + 1 / 80) + 1e-9


def test_a_second_answer_at_one_time_moves_nothing() -> None:
    governor, answer = begun(asked(0.5, BudgetUnit.FACTOR, 20.0), 0.7)
    governor.take(PictureUse(0.7, 1.0, 0.1))
    first, second = governor.aim(answer, 0.7, 0.1), governor.aim(answer, 0.7, 0.1)
    assert first is not None
    assert first.shift < 0
    assert second == SteeredTarget(first.target_loss, 0.0)


@pytest.mark.parametrize(("base", "unit"), [(0.2, BudgetUnit.WATT), (0.0, BudgetUnit.POWER)])
def test_exact_black_is_walked_through_and_recorded(base: float, unit: BudgetUnit) -> None:
    """Before anything is seen, for a whole horizon; with no base power black is a share of nothing."""
    model = replace(OLED, base_power=base)
    below, _ = begun(asked(0.01, unit, 2.0, model), 0.5)
    assert below.first_factor(0.0) == 1.0  # what is refused elsewhere divides by nothing here either
    budget = asked(0.6, unit, 2.0, model)
    n = round(8 * RATE)
    light = np.where(np.arange(n) < n // 2, 0.0, 50.0)
    for first in (None, 0.6):
        for pictures in (light, np.zeros(n)):
            rows = walked(MadeUp(np.full(n, 0.2), pictures, 3), budget, n, 0.03, first)
            kept = recorded(budget, rows)
            assert len(rows) == n
            black_share = base == 0 and not pictures.any()
            assert (kept.achieved is None) == (kept.horizon_error is None) == black_share


def recorded(budget: LiveBudget, rows: list[LiveRefresh]) -> LiveControl:
    display = load_display("varjo-xr3")
    dimming = LiveDimming.asked_for(LiveOptions(), display, None)
    seen = "house", display, "cpu"
    return live_control(replace(dimming, budget=budget), seen, rows, simulated=True)


def said_of(budget: LiveBudget, rows: list[LiveRefresh]) -> str:
    return dimming_in_words(recorded(budget, rows), budget, rows)


def test_a_horizon_of_too_few_answers_is_told_and_recorded() -> None:
    """An answer every 15 refreshes at 30 Hz: T is 20 answers, 10 s, and ten times that 100 s."""
    n, budget = round(20 * RATE), asked(0.6, BudgetUnit.FACTOR, 20.0)
    rows = walked(MadeUp(np.full(n, 0.2), np.full(n, 50.0), 15), budget, n, 0.03, 0.6)
    assert recorded(budget, rows).steered_horizon == pytest.approx(100.0)
    assert said_of(budget, rows).endswith(
        "the horizon of 20 s holds 40 answers, too few to steer by: look for the budget over 100 s"
    )
    prompt = walked(MadeUp(np.full(n, 0.2), np.full(n, 50.0), 2), budget, n, 0.03, 0.6)
    assert recorded(budget, prompt).steered_horizon == 20.0
    assert "too few" not in said_of(budget, prompt)


def test_what_is_said_of_a_walk_is_what_its_record_says() -> None:
    """Of content out of reach of its budget: at the lowest factor the bound holds it."""
    n, budget = round(30 * RATE), asked(0.21, BudgetUnit.WATT, 9.0, OLED)
    rows = walked(MadeUp(np.full(n, 0.2), np.full(n, 50.0), 2), budget, n, 0.03, 0.25)
    kept = recorded(budget, rows)
    said = said_of(budget, rows)
    assert f"{kept.mean_loss:.3g} and factor {kept.mean_factor:.3g} on average" in said
    assert f"budget 0.21 (watt): {kept.achieved:.3g} on average" in said
    assert f"off by {kept.horizon_error:.2g} at most, above it by {kept.horizon_excess:.2g}" in said
    assert kept.max_rate_ratio == pytest.approx(max(abs(row.rate) / row.rate_limit for row in rows[1:]))
    held = [row.budget_held for row in rows[:-1]]
    assert kept.share_budget_held == pytest.approx(sum(held) / len(held))
    assert 0.3 < kept.share_budget_held < 1
    assert not any(row.budget_held for row in rows if row.factor > 0.21)


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
    for budget, met in (
        (asked(0.5, BudgetUnit.FACTOR, 2.0), (0.4375, None, 0.25, 0.125)),
        (asked(1.5, BudgetUnit.WATT, 2.0), (1.0, 1.0, 1.5, 0.5)),
        # Of full power: 4/6 over the first two seconds, 3/5 over the next two, 0 over the last.
        (asked(0.5, BudgetUnit.POWER, 2.0), (0.5, 1.0, 0.5, 4 / 6 - 0.5)),
        (asked(0.5, BudgetUnit.FACTOR, 9.0), (0.4375, None, None, None)),
    ):
        kept = recorded(budget, rows)
        outcome = (kept.achieved, kept.mean_power, kept.horizon_error, kept.horizon_excess)
        assert outcome == pytest.approx(met, abs=1e-12)
    at_once = asked(0.5, BudgetUnit.FACTOR, 9.0)
    assert recorded(at_once, rows[:1]).achieved is None
    assert said_of(at_once, rows[:1]) == "no loss was measured"


def test_the_record_says_what_the_budget_was_and_how_it_was_met() -> None:
    rows = [a_row(k, float(k), 0.5, 1.0, 2.0) for k in range(5)]
    kept = recorded(asked(0.75, BudgetUnit.WATT, 2.0, OLED), rows)
    assert (kept.budget, kept.budget_unit, kept.horizon) == (0.75, BudgetUnit.WATT, 2.0)
    assert (kept.target_loss, kept.final_target_loss) == (0.1, 0.14)
    assert (kept.power_model, kept.mean_power) == ("oled", 1.0)
    assert (kept.horizon_error, kept.horizon_excess) == (0.25, 0.25)
    nothing = recorded(asked(0.75, BudgetUnit.FACTOR, 2.0), [])
    assert (nothing.target_loss, nothing.power_model, nothing.horizon_error) == (None, None, None)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"budget": 0.0}, "--budget must be above 0, got 0"),
        ({"budget": 0.5, "horizon": 0.0}, r"--horizon must lie in 0\.1 to 1e\+06, got 0"),
        ({"budget": 0.5, "power_model": "surace2025"}, "--power-model is for a budget in power or watt"),
    ],
)
def test_a_budget_that_cannot_be_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        asked_budget(LiveOptions(**options), load_display("varjo-xr3"))


def test_a_budget_that_no_factor_meets_is_refused_before_the_window_opens() -> None:
    for budget, says in (
        (
            asked_budget(LiveOptions(budget=0.1), load_display("varjo-xr3")),
            r"the budget 0\.1 \(factor\) cannot be met",
        ),
        (asked(0.5, BudgetUnit.FACTOR, 60.0, OLED), "says nothing of the power of an OLED panel"),
        (asked(0.05, BudgetUnit.WATT, 60.0, OLED), r"0\.05 \(watt\) cannot be met on any content"),
        (asked(50.0, BudgetUnit.WATT, 60.0, OLED), r"50 \(watt\) cannot be met on any content"),
        (asked(0.001, BudgetUnit.POWER, 60.0, OLED), r"0\.001 \(power\) cannot be met"),
    ):
        with pytest.raises(InputError, match=says):
            LiveDimming.asked_for(LiveOptions(), load_display("varjo-xr3"), budget)
    assert asked_budget(LiveOptions(), load_display("varjo-xr3")) is None
