"""The lines that a result begins with: what is saved, what that costs, how evenly, in words that are true."""

import pytest

from evenlight.analysis.report_sections import meaning_of
from evenlight.analysis.tracks.gain_words import gain_in_words
from evenlight.analysis.tracks.objective_words import spread_in_words
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome, OptimizationSummary

LITTLE = "little to gain here: constant dimming already loses nearly the same in every frame"


def summary(**changed: object) -> OptimizationSummary:
    """A film that takes 1 of 4 W, and whose frames lose 3 % on average, 6 % in the worst of them."""
    given = {
        "video": "film", "display": "desk", "rate_limit": "limit", "power_model": "desk",
        "frames": 100, "duration": 4.0, "budget": 0.5, "budget_unit": BudgetUnit.FACTOR, "achieved": 0.5,
        "objective": 0.012, "objective_baseline": 0.04, "lower_bound": 0.005, "max_rate_ratio": 0.9,
        "mean_contrast_loss": 0.03, "mean_contrast_loss_baseline": 0.04, "mean_factor": 0.5,
        "baseline_factor": 0.5, "mean_power": 1.0, "baseline_power": 1.0, "full_power": 4.0,
        "frames_without_contrast": 0, "limit_curve": "fitted", "modulated": "frame_mean",
        "lowest_factor": 0.2, "pixels_per_degree": 40.0, "contrast_model": "default", "simulated": False,
        "solver": "splitting", "iterations": 4, "calm": 0.0, "solve_s": 0.1, "curves_s": 1.0,
        "bound_s": 0.1, "seed": None, "versions": {}, "provenance": Provenance(),
        "worst_contrast_loss": 0.06, "worst_contrast_loss_baseline": 0.125,
    }  # fmt: skip
    return OptimizationSummary(**{**given, **changed})


def test_a_film_with_much_to_gain_says_what_is_saved_what_it_costs_and_how_evenly() -> None:
    """By hand: 4 - 1 W are three quarters; 1 - 0.012/0.04 = 70 %."""
    assert gain_in_words(summary()) == (
        "film saves 3 of 4 W (75 %)",
        "3.0 % of the visible contrast is lost on average, 6.0 % in the worst frame; with constant dimming "
        "at equal power 4.0 % and 12.5 %",
        "two frames differ by 1.2 percentage points in what they lose, with constant dimming by 4.0: "
        "70 % less",
    )


def test_a_battery_is_told_in_hours_of_the_power_models_display_alone() -> None:
    """20 Wh are 20 h at 1 W and 5 h at 4 W; the display is named where it is not the one that is watched."""
    life = {"battery_capacity": 20.0, "battery_life": 20.0, "battery_life_full": 5.0}
    saving = gain_in_words(summary(power_model="other", **life))[0]
    assert saving == (
        "film saves 3 of 4 W (75 %) on the display of the power model other; 20 Wh last that panel alone "
        "20 h instead of 5 h"
    )
    published = gain_in_words(summary(power_model="surace2025"))[0]
    assert published.endswith(" on the published panel (surace2025; for desk give --power-model)")


@pytest.mark.parametrize("ours", [0.00055, 0.0])
def test_less_of_next_to_nothing_is_called_little_to_gain(ours: float) -> None:
    """The case reported: 0.00055 against 0.00066, "17.3 % less"."""
    flat = summary(objective=ours, objective_baseline=0.00066, lower_bound=0.0,
                   worst_contrast_loss=0.031, worst_contrast_loss_baseline=0.032)  # fmt: skip
    said = gain_in_words(flat)[2]
    assert said.startswith(f"{LITTLE}: two frames differ by {100 * ours:.2g} percentage points")
    assert said.endswith("with constant dimming by 0.066")
    everywhere = " ".join((*gain_in_words(flat), spread_in_words(flat), meaning_of(flat)))
    assert "17" not in everywhere
    assert "% less" not in everywhere
    assert f"There is {LITTLE}" in meaning_of(flat)


@pytest.mark.parametrize(
    "changed",
    [
        {"objective_baseline": 0.0051},
        {"worst_contrast_loss_baseline": 0.0711},  # a short scene that the track spares more than 1 %
        {"objective": 0.02},  # the track itself is uneven
        {"minimized": MinimizedOutcome("minimax", 0.06, 0.07, 0.0), "lower_bound": 0.0},
    ],
)
def test_little_to_gain_is_not_said_where_something_is_gained_or_lost(changed: dict[str, object]) -> None:
    small = {"objective": 0.0012, "objective_baseline": 0.0049, "lower_bound": 0.001,
             "worst_contrast_loss_baseline": 0.0699}  # fmt: skip
    assert LITTLE in gain_in_words(summary(**small))[2]
    assert LITTLE not in gain_in_words(summary(**{**small, **changed}))[2]


def test_a_worst_frame_far_above_the_mean_is_not_called_nearly_the_same() -> None:
    """The case reported: 0.25 % lost on average, 1.3 % in the worst frame."""
    told = summary(objective=0.00088, objective_baseline=0.0029, lower_bound=0.0,
                   mean_contrast_loss_baseline=0.0025,
                   worst_contrast_loss=0.0036, worst_contrast_loss_baseline=0.013)  # fmt: skip
    little = "little to gain here: constant dimming already loses little (worst frame 1.3 %)"
    assert gain_in_words(told)[2].startswith(f"{little}: ")


def test_a_rate_limit_that_leaves_no_room_is_not_called_little_to_gain() -> None:
    """0.0395 of 0.04: frames differ much, and nothing can be done about it; more than it is told as more."""
    kept = gain_in_words(summary(objective=0.0395, lower_bound=0.039))[2]
    assert kept.endswith("next to nothing gained; budget, rate limit and lowest factor leave no room")
    assert gain_in_words(summary(objective=0.0395))[2].endswith(": next to nothing gained")  # not certain
    assert LITTLE not in kept
    assert gain_in_words(summary(objective=0.05))[2].endswith("by 4.0: 25 % more")


def test_a_budget_that_is_not_met_is_told_in_its_unit() -> None:
    assert gain_in_words(summary(budget=0.4))[3] == "the budget of 0.4 (factor) is exceeded: 0.5 on average"
    unused = gain_in_words(summary(budget=2.0, achieved=1.0, budget_unit=BudgetUnit.WATT))
    assert unused[3] == "the budget of 2 (watt) is not used up: 1 on average"
    assert len(gain_in_words(summary(budget=0.4, clips=2))) == 3  # all of them share it


def test_full_brightness_neither_saves_nor_costs() -> None:
    full = summary(mean_power=4.0, baseline_power=4.0,
                   mean_contrast_loss=0.0, mean_contrast_loss_baseline=0.0,
                   objective=0.0, objective_baseline=0.0, lower_bound=0.0)  # fmt: skip
    assert gain_in_words(full) == (
        "film saves no power: 4 W, as at full brightness",
        "no visible contrast is lost in any frame, nor is it with constant dimming",
    )


def test_of_an_oled_whose_power_goes_by_content_constant_dimming_is_said_to_have_the_same_factor() -> None:
    """Online, constant dimming has the mean factor; on an OLED panel it then takes another power."""
    cost = gain_in_words(summary(baseline_power=1.1))[1]
    assert "with constant dimming at the same mean factor 4.0 % and 12.5 %" in cost


def test_an_older_summary_without_the_worst_frame_is_told_without_it() -> None:
    older = summary(worst_contrast_loss=None, worst_contrast_loss_baseline=None)
    assert gain_in_words(older)[1] == (
        "3.0 % of the visible contrast is lost on average, 4.0 % with constant dimming at equal power"
    )
