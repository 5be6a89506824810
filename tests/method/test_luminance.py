"""The display model: by hand, and what dimming does and does not scale."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.method.contrast.luminance import (
    channel_means,
    dimmed_luminance,
    displayed_luminance,
    emitted_luminance,
)

LAB = Display("lab", peak_luminance=101.0, black_level=1.0, gamma=2.0, pixels_per_degree=60.0)
BRIGHT_ROOM = dataclasses.replace(LAB, reflected_luminance=5.0)


def test_equation_1_by_hand():
    """0.5² · (101 - 1) + 1 + 5 = 31."""
    assert displayed_luminance(0.5, BRIGHT_ROOM) == pytest.approx(31.0)


def test_a_gray_frame_emits_equation_1_less_its_reflections():
    gray = np.full((2, 3, 3), 51, np.uint8)  # 51/255 = 0.2; 0.04 · 100 + 1 = 5
    np.testing.assert_allclose(emitted_luminance(gray, BRIGHT_ROOM), 5.0, rtol=1e-12)


def test_linear_channels_are_weighed_by_default():
    """Green at half: 0.7152 · 0.5² · 100 + 1; weighing first gives (0.7152 · 0.5)² · 100 + 1."""
    green = np.array([[[0.0, 0.5, 0.0]]])
    assert emitted_luminance(green, LAB).item() == pytest.approx(18.88)
    luma_first = emitted_luminance(green, LAB, PixelToLuminance.LUMA_FIRST)
    assert luma_first.item() == pytest.approx(100 * 0.3576**2 + 1)


@given(st.floats(0, 1))
def test_both_orders_agree_on_gray(value):
    """The weights sum to 1, so a gray pixel has luma L' whichever comes first."""
    gray = np.full((1, 1, 3), value)
    orders = [emitted_luminance(gray, LAB, order) for order in PixelToLuminance]
    np.testing.assert_allclose(*orders, rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_integers_span_their_whole_range(dtype):
    ends = np.array([[[0] * 3, [np.iinfo(dtype).max] * 3]], dtype)
    np.testing.assert_allclose(emitted_luminance(ends, LAB), [[1.0, 101.0]])


def test_channel_means_are_of_linear_values():
    frame = np.array([[[0.0, 0.5, 1.0], [1.0, 0.5, 1.0]]])
    np.testing.assert_allclose(channel_means(frame, gamma=2.0), [0.5, 0.25, 1.0])


def test_dimming_scales_the_black_level_and_not_the_reflected_light():
    """Decision `dimming`: black at b = 0.2 is 0.2 · 1 + 5."""
    black = emitted_luminance(np.zeros((1, 1, 3), np.uint8), BRIGHT_ROOM)
    assert dimmed_luminance(black, 0.2, BRIGHT_ROOM).item() == pytest.approx(5.2)


@given(st.floats(0, 1))
def test_undimmed_is_equation_1(value):
    emitted = emitted_luminance(np.full((1, 1, 3), value), BRIGHT_ROOM)
    expected = displayed_luminance(value, BRIGHT_ROOM)
    np.testing.assert_allclose(dimmed_luminance(emitted, 1.0, BRIGHT_ROOM).item(), expected, rtol=1e-12)
