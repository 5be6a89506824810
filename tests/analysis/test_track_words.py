"""The lines that a result begins with: what is saved, what that costs, how evenly, in words that are true."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_summary import made_summary as summary

from evenlight.analysis.tracks.first_page import told as told_of
from evenlight.analysis.tracks.first_page import verdict
from evenlight.analysis.tracks.track_words import (
    budget_in_words,
    compared,
    detection_in_words,
    outcome_in_words,
    rate_in_words,
)
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome

LITTLE = "little to gain here: constant dimming already loses nearly the same in every frame"


@pytest.mark.parametrize(("ours", "told"), [(0.00055, "0.055"), (0.0, "0.000")])
def test_less_of_next_to_nothing_is_called_little_to_gain(ours: float, told: str) -> None:
    """The case reported: 0.00055 against 0.00066, "17.3 % less"."""
    flat = summary(objective=ours, objective_baseline=0.00066, lower_bound=0.0,
                   worst_contrast_loss=0.031, worst_contrast_loss_baseline=0.032)  # fmt: skip
    said = outcome_in_words(flat)
    assert said[1:].startswith(f"{LITTLE[1:]}: two frames differ by {told} points")
    assert said.endswith("with constant dimming by 0.066.")
    everywhere = " ".join((*told_of(flat), said))
    assert f"film: {LITTLE}" in everywhere
    assert "17" not in everywhere
    assert "% less" not in everywhere


@pytest.mark.parametrize(
    "changed",
    [
        {"objective_baseline": 0.0051},
        {"worst_contrast_loss_baseline": 0.0711},  # a short scene that the track spares more than 1 %
        {"objective": 0.02},  # the track itself is uneven
        {
            "minimized": MinimizedOutcome("spread+mean", 0.06, 0.07, 0.0),
            "level_weight": 1.0,
            "lower_bound": 0.0,
        },
    ],
)
def test_little_to_gain_is_not_said_where_something_is_gained_or_lost(changed: dict[str, object]) -> None:
    small = {"objective": 0.0012, "objective_baseline": 0.0049, "lower_bound": 0.001,
             "worst_contrast_loss_baseline": 0.0699}  # fmt: skip
    assert LITTLE in verdict(summary(**small))
    assert LITTLE not in verdict(summary(**{**small, **changed}))


def test_a_track_that_is_as_even_as_constant_dimming_is_not_divided_by_zero() -> None:
    even = summary(objective=0.0, objective_baseline=0.0, lower_bound=0.0)
    assert (
        outcome_in_words(even) == "Constant dimming already loses the same share of contrast in every frame."
    )


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
