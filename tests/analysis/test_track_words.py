"""The lines that a result begins with: what is saved, what that costs, how evenly, in words that are true."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_summary import made_summary as summary

from evenlight.analysis.tracks.price_figure import ABOUT, about
from evenlight.analysis.tracks.track_words import (
    budget_in_words,
    compared,
    detection_in_words,
    first_words,
    gain_in_words,
    key_figures,
    outcome_in_words,
    rate_in_words,
)
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, WatchedTrack
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome

LITTLE = "little to gain here: constant dimming already loses nearly the same in every frame"
WATCHED = WatchedTrack(periods=8, noticed=0.71, noticed_sensitive=0.94, assumed="")


def test_a_film_with_much_to_gain_says_what_is_saved_what_it_costs_and_how_evenly() -> None:
    """By hand: 4 - 1 W are three quarters; 1 - 0.012/0.04 = 70 %."""
    assert gain_in_words(summary()) == (
        "film saves 3.00 of 4.00 W (75 %)",
        "3.0 % of the visible contrast is lost on average, 6.0 % in the worst frame; with constant dimming "
        "at equal power 4.0 % and 12.5 %",
        "two frames differ by 1.20 points in what they lose, with constant dimming by 4.00: 70 % less; best "
        "possible 0.50 points",
    )


def test_numbers_that_are_compared_have_the_same_decimals() -> None:
    """The case reported: 0.68 and 1.38 points, as in the table of `judge`; losses of 0.9 and 1.4 %."""
    told = summary(objective=0.0068, objective_baseline=0.0138, lower_bound=0.0,
                   mean_contrast_loss=0.009, mean_contrast_loss_baseline=0.014)  # fmt: skip
    words = "differ by 0.68 points in what they lose, with constant dimming by 1.38: 51 % less"
    assert words in outcome_in_words(told)
    _, loss, spread, _ = key_figures(told)
    assert (loss.value, loss.beside) == ("0.90 %", "constant dimming 1.40 %")
    assert (spread.value, spread.beside) == ("0.68 points", "constant dimming 1.38")


def test_a_battery_is_told_in_hours_of_the_power_models_display_alone() -> None:
    """20 Wh are 20 h at 1 W and 5 h at 4 W; the display is named where it is not the one that is watched."""
    life = {"battery_capacity": 20.0, "battery_life": 20.0, "battery_life_full": 5.0}
    saving = gain_in_words(summary(power_model="other", **life))[0]
    assert saving == (
        "film saves 3.00 of 4.00 W (75 %) on the display of the power model other; 20 Wh last that panel "
        "alone 20 h instead of 5 h"
    )
    published = gain_in_words(summary(power_model="surace2025"))[0]
    assert published.endswith(" on the published panel (surace2025; give desk's own as --power-model)")


@pytest.mark.parametrize(("ours", "told"), [(0.00055, "0.055"), (0.0, "0.000")])
def test_less_of_next_to_nothing_is_called_little_to_gain(ours: float, told: str) -> None:
    """The case reported: 0.00055 against 0.00066, "17.3 % less"."""
    flat = summary(objective=ours, objective_baseline=0.00066, lower_bound=0.0,
                   worst_contrast_loss=0.031, worst_contrast_loss_baseline=0.032)  # fmt: skip
    said = gain_in_words(flat)[2]
    assert said.startswith(f"{LITTLE}: two frames differ by {told} points")
    assert said.endswith("with constant dimming by 0.066")
    everywhere = " ".join((*gain_in_words(flat), outcome_in_words(flat), first_words(flat)))
    assert "17" not in everywhere
    assert "% less" not in everywhere


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
    assert LITTLE in gain_in_words(summary(**small))[-1]
    assert LITTLE not in gain_in_words(summary(**{**small, **changed}))[-1]


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
    assert gain_in_words(summary(objective=0.05))[2].endswith("by 4.00: 25 % more; best possible 0.50 points")


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
        "film saves no power: 4.00 W, as at full brightness",
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


def test_a_track_that_is_as_even_as_constant_dimming_is_not_divided_by_zero() -> None:
    even = summary(objective=0.0, objective_baseline=0.0, lower_bound=0.0)
    assert (
        outcome_in_words(even) == "Constant dimming already loses the same share of contrast in every frame."
    )


def test_a_video_in_which_nothing_is_visible_is_called_so() -> None:
    black = summary(objective=0.0, objective_baseline=0.0, lower_bound=0.0, frames_without_contrast=100,
                    mean_contrast_loss=0.0, mean_contrast_loss_baseline=0.0)  # fmt: skip
    assert gain_in_words(black)[1] == "nothing is visible in any frame, so there is no contrast to lose"


def test_weights_are_told_where_frames_count_differently() -> None:
    assert "weight" not in outcome_in_words(summary())
    assert "in what they lose, by their weights, with" in outcome_in_words(summary(weighted=True))


def test_what_was_minimized_is_told_in_the_unit_of_the_loss() -> None:
    """1 - 6/8 = 25 %; a largest loss is a share, and a difference plus a mean is in points."""
    best = MinimizedOutcome("minimax", 0.06, 0.08, 0.0)
    assert outcome_in_words(summary(minimized=best, lower_bound=0.0)).startswith(
        "Minimized was the largest loss of any frame: 6.0 %, with constant dimming 8.0 (25 % less). Two "
    )
    mixed = MinimizedOutcome("spread+mean", 0.06, 0.08, 0.05)
    assert (
        "plus 0.5 times the mean loss: 6.0 points, with constant dimming 8.0 (25 % less; best possible 5.0 "
        in (outcome_in_words(summary(minimized=mixed, level_weight=0.5, lower_bound=0.0)))
    )


@given(st.floats(1e-9, 1.0), st.floats(1e-9, 1.0))
def test_words_of_a_comparison_are_true(ours: float, constant: float) -> None:
    words, ratio = compared(ours, constant), ours / constant
    number = float(words.split()[0]) if words[0].isdigit() else None
    if words == "as much":
        assert ratio == pytest.approx(1, abs=0.005)
    elif "%" in words:
        assert number is not None
        said = 1 - number / 100 if "less" in words else 1 + number / 100
        assert said == pytest.approx(ratio, abs=0.00501)
    else:
        assert ratio >= (2 if number else 1000)
        assert number is None or number == pytest.approx(ratio, rel=0.006)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "mean brightness factor 0.5"),
        ({"achieved": 0.500001}, "mean brightness factor 0.5"),
        ({"achieved": 0.898}, "mean brightness factor 0.898 (budget 0.5)"),
        ({"achieved": 0.37, "clips": 2}, "mean brightness factor 0.37 (0.5 shared by 2 clips)"),
    ],
)
def test_a_title_has_what_was_reached_not_what_was_asked(changes: dict[str, object], words: str) -> None:
    assert budget_in_words(summary(**changes)) == words


def test_the_key_figures_tell_the_same_numbers_in_the_same_units() -> None:
    power, loss, spread, rate = key_figures(summary(max_rate_ratio=0.997))
    assert power.in_words == "mean power: 1.00 W (as with constant dimming; full brightness 4.00 W)"
    assert loss.in_words == "of visible contrast lost: 3.0 % (constant dimming 4.0 %)"
    assert spread.in_words == (
        "difference in loss between two frames: 1.20 points (constant dimming 4.00; best possible 0.50)"
    )
    assert rate.in_words == "of the rate limit, fastest change: 100 %"
    seen = key_figures(summary(watched=WATCHED))[-1]
    assert seen.beside == "noticed in 71 % of its periods by the median person, in 94 % by a sensitive one"
    assert not rate.warns
    assert key_figures(summary(max_rate_ratio=1.01))[-1].warns
    assert "constant dimming 1.10 W" in key_figures(summary(baseline_power=1.1))[0].beside


def test_the_first_words_of_a_track_are_few() -> None:
    long = summary(power_model="surace2025", objective=0.0012, objective_baseline=0.0049, lower_bound=0.0,
                   worst_contrast_loss_baseline=0.0699)  # fmt: skip
    assert 20 < len(first_words(long).split()) <= 60


@pytest.mark.parametrize(
    ("near", "turns", "words"),
    [
        (0.998, 0.025, "The track is near its limit all the time and reverses once in 40 s."),
        (0.634, 2.5, "The track is near its limit 63 % of the time and reverses 2.5 times a second."),
        (0.998, 1.0, "The track is near its limit all the time and reverses once a second."),
        (0.001, 0.0, "The track is never near its limit and never reverses."),
    ],
)
def test_how_near_its_limit_a_track_is_is_told_by_time(near: float, turns: float, words: str) -> None:
    known = {"share_near_limit": near, "reversals_per_s": turns}
    assert detection_in_words(summary(**known)) == words
    assert "older file" in detection_in_words(summary())


def test_who_notices_a_track_is_told_with_what_was_assumed_and_by_what_task() -> None:
    watched = "watched on a plain screen it is"
    by = "in 71 % of its periods by the median person, in 94 % by a sensitive one"
    each = "a period is 5 s long, and 5 % of people are as sensitive"
    known = {"duration": 40.0, "watched": WATCHED}
    assert gain_in_words(summary(**known))[-2:] == (f"{watched} noticed {by}", each)
    moved = rate_in_words(summary(**known, noticed=0.25, simulated=True))
    assert "of the rate limit 'limit' (simulated) for 25 % noticed" in moved
    figure = key_figures(summary(noticed=0.25))[-1]
    assert figure.what == "of the rate limit for 25 % noticed, fastest change"
    two = gain_in_words(summary(**known, rate_limit_procedure=Procedure.TWO_INTERVAL))[-2]
    assert two.startswith(f"{watched} told from stillness in 71 %")
    assumed = replace(WATCHED, assumed="width 1.6")
    assert gain_in_words(summary(duration=40.0, watched=assumed))[-2:] == (
        f"{watched} noticed {by} (assumed)",
        f"{each}; assumed: width 1.6",
    )
    assert about(summary(watched=assumed)) == f"{ABOUT} Assumed: width 1.6."
    assert about(summary(watched=WATCHED)) == ABOUT  # as the calibration tells


@pytest.mark.parametrize(
    ("allowance", "ratio", "words"),
    [
        (1.0, 1.0, "of the rate limit 'limit'"),
        (10.0, 8.7, "as allowed; where allowances say so, up to 8.7 times the fitted limit"),
        (10.0, 0.9, "as allowed; nowhere beyond the fitted limit, though allowances go up to 10 times it"),
    ],
)
def test_a_step_beyond_the_fitted_limit_is_told(allowance: float, ratio: float, words: str) -> None:
    told = rate_in_words(summary(largest_allowance=allowance, max_rate_ratio_fitted=ratio))
    assert told.startswith("fastest change 90.0 % of the rate limit 'limit'")
    assert told.endswith(words)
