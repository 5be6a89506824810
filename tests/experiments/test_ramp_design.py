"""The order of a ramp session."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.ramp import RampDesign
from experiments.design import ramp_levels, ramp_order, trial_count

DISPLAY = Display("bench", 100.0, 0.5, 2.0, 60.0)
SECONDS_PER_TRIAL = 8.5  # one second before, five of ramp, one of hold, answer and pause


def order(design: RampDesign, seed: int = 1, display: Display = DISPLAY):  # type: ignore[no-untyped-def] # brevity
    return ramp_order(design, display, np.random.default_rng(seed))


def test_dimming_scales_the_black_level_too_and_reflected_light_not() -> None:
    # Gray 0.5, gamma 2: I = 0.25 · 99.5 + 0.5 = 25.375; b = 0.4 makes 10.15, and 3 are reflected.
    lit = Display("lit", 100.0, 0.5, 2.0, 60.0, reflected_luminance=3.0)
    design = RampDesign(factors=(0.4,), gray_pixel_value=0.5)
    white, gray = ramp_levels(design, lit)
    assert (white.screen, gray.screen) == ("white", "gray")
    assert white.luminance == pytest.approx(0.4 * 100 + 3)
    assert gray.luminance == pytest.approx(10.15 + 3)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 1000), st.integers(1, 4), st.floats(0.0, 0.5), st.sampled_from([(1.0,), (0.2, 0.6, 1.0)])
)
def test_every_ramp_comes_as_often_as_the_design_says(
    seed: int, repetitions: int, catch_share: float, factors: tuple[float, ...]
) -> None:
    design = RampDesign(factors=factors, repetitions=repetitions, catch_share=catch_share)
    trials = order(design, seed)
    ramps = Counter((t.level, t.rate) for t in trials if not t.is_catch)
    assert set(ramps.values()) == {repetitions}
    assert len(ramps) == 2 * len(factors) * len(design.relative_rates)
    assert (sum(ramps.values()), len(trials) - sum(ramps.values())) == trial_count(design)


def test_catch_trials_have_their_share_and_are_spread_over_the_levels() -> None:
    design = RampDesign(catch_share=0.23)
    trials = order(design)
    catches = Counter(t.level for t in trials if t.is_catch)
    assert sum(catches.values()) / len(trials) == pytest.approx(0.23, abs=1 / len(trials))
    assert len(catches) == 10
    assert max(catches.values()) - min(catches.values()) <= 1


def test_rates_are_shares_of_the_initial_luminance_and_end_accordingly() -> None:
    for planned in order(RampDesign(relative_rates=(0.02,), factors=(0.5,))):
        if not planned.is_catch:
            assert planned.rate == pytest.approx(0.02 * planned.level.luminance)
            assert planned.final_luminance == pytest.approx(0.9 * planned.level.luminance)
        else:
            assert planned.final_luminance == planned.level.luminance


def test_the_order_is_random_but_the_seeds_own() -> None:
    design = RampDesign()
    assert order(design, 1) == order(design, 1)
    assert order(design, 1) != order(design, 2)
    # Catch trials stand in both halves: all 60 and more in one half has a chance below 1e-30.
    half = len(order(design)) // 2
    assert any(t.is_catch for t in order(design)[:half])
    assert any(t.is_catch for t in order(design)[half:])


def test_the_default_session_lasts_at_most_ninety_minutes() -> None:
    assert sum(trial_count(RampDesign())) * SECONDS_PER_TRIAL <= 90 * 60


def test_a_ramp_below_the_reflected_light_is_refused() -> None:
    lit = Display("sunny", 100.0, 0.5, 2.0, 60.0, reflected_luminance=60.0)
    with pytest.raises(InputError, match=r"below the 60 cd/m\^2 that 'sunny' reflects; take out"):
        order(RampDesign(), display=lit)
