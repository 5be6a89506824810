"""What is left of a ring's contrast where pixels dim it: everything, down to the display's black."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.stimuli.dithering import level_luminance
from evenlight.stimuli.rings.landolt import shown_contrast

LAB = Display("lab", 100.0, 0.5, 2.2, pixels_per_degree=60.0)
contrasts = st.floats(-1.0, 3.0)
backgrounds = st.floats(0.5, 100.0)
factors = st.floats(0.05, 1.0)


@pytest.mark.parametrize(
    ("contrast", "background", "factor", "left"),
    [
        (-0.5, 8.0, 0.25, -0.5),  # 2 and 1 cd/m^2
        (-0.9, 8.0, 0.25, -0.75),  # 2 and 0.2, drawn as 0.5
        (-0.5, 1.0, 0.25, 0.0),  # 0.25 and 0.125: both black
        (3.0, 1.0, 0.25, 1.0),  # 0.25, drawn as 0.5, and 1
        (3.0, 8.0, 0.25, 3.0),
    ],
)
def test_by_hand(contrast, background, factor, left) -> None:
    assert shown_contrast(contrast, background, factor, LAB, by_pixels=True) == pytest.approx(left)


@given(contrasts, backgrounds, factors)
def test_a_backlight_and_a_display_without_black_leave_the_contrast_as_it_is(
    contrast, background, factor
) -> None:
    deep = dataclasses.replace(LAB, black_level=0.0)
    assert shown_contrast(contrast, background, factor, LAB, by_pixels=False) == contrast
    assert shown_contrast(contrast, background, factor, deep, by_pixels=True) == contrast


@given(contrasts, backgrounds, factors)
def test_the_floor_takes_contrast_away_and_never_turns_it_round(contrast, background, factor) -> None:
    left = shown_contrast(contrast, background, factor, LAB, by_pixels=True)
    assert left * contrast >= 0
    assert abs(left) <= abs(contrast) + 1e-9


@pytest.mark.parametrize("factor", [1.0, 0.4, 0.1])
@pytest.mark.parametrize("level", [10, 25, 60, 200])
def test_it_is_the_contrast_that_the_renderer_draws(level, factor) -> None:
    """Two grey levels of 8 bits, dimmed and drawn as `stimuli.dithering` says; that table has the floor."""
    full, dimmed = level_luminance(256, 1.0, LAB), level_luminance(256, factor, LAB)
    asked = full[level // 2] / full[level] - 1
    drawn = dimmed[level // 2] / dimmed[level] - 1
    assert shown_contrast(asked, full[level], factor, LAB, by_pixels=True) == pytest.approx(drawn, abs=1e-9)
