"""Frames averaged to fewer pixels: by area, in linear light."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.frame import Frame
from evenlight.stimuli.video.frame_conversion import area_weights, coarser

GAMMA = 2.2


def one(pixels: np.ndarray, shape: tuple[int, int], gamma: float = GAMMA) -> np.ndarray:
    (small,) = coarser([Frame(0.0, 0.04, pixels)], shape, gamma)
    assert small.pixel_values.shape == (*shape, 3)
    return small.pixel_values


def test_a_fine_checkerboard_gives_half_the_light_and_not_half_the_pixel_value() -> None:
    board = (np.indices((8, 12)).sum(axis=0) % 2 * 255).astype(np.uint8)
    np.testing.assert_allclose(one(np.dstack([board] * 3), (4, 6)), 0.5 ** (1 / GAMMA), rtol=1e-6)


def test_whole_factors_are_means_of_blocks() -> None:
    pixels = np.random.default_rng(1).random((6, 8, 3))
    blocks = pixels.reshape(3, 2, 2, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(one(pixels, (3, 2), gamma=1.0), blocks, atol=1e-6)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_integers_are_shares_of_their_range(kind: type) -> None:
    full = np.full((4, 4, 3), np.iinfo(kind).max, kind)
    np.testing.assert_array_equal(one(full, (3, 2)), 1.0)


@given(many=st.integers(1, 60), data=st.data())
def test_every_pixel_counts_alike_and_every_cell_is_a_mean(many: int, data: st.DataObject) -> None:
    few = data.draw(st.integers(1, many))
    weights = area_weights(many, few).toarray()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(weights.sum(axis=0), few / many, atol=1e-5)
    assert (weights >= 0).all()


@given(shape=st.tuples(st.integers(1, 9), st.integers(1, 11)), seed=st.integers(0, 99))
def test_the_mean_light_of_a_frame_stays(shape: tuple[int, int], seed: int) -> None:
    pixels = np.random.default_rng(seed).random((9, 11, 3)).astype(np.float32)
    light = (one(pixels, shape).astype(np.float64) ** GAMMA).mean()
    assert light == pytest.approx((pixels.astype(np.float64) ** GAMMA).mean(), rel=1e-4)


def test_more_pixels_than_there_are_is_refused() -> None:
    with pytest.raises(ValueError, match="need 1 to 4 pixels in place of 4, got 5"):
        area_weights(4, 5)
