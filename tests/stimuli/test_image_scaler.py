"""Images scaled on the graphics processor, against the triangle filter written out, in linear light."""

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from evenlight.stimuli.dithering import DEEP_LEVELS, GRID_LEVELS
from evenlight.stimuli.image_renderer import Image
from evenlight.stimuli.image_scaler import ImageScaler
from evenlight.stimuli.scenes.engine.graphics import offscreen_context

GAMMA = 2.0
WINDOW = (160, 90)


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    with offscreen_context() as context:
        yield context


def weights(n: int, scale: float, wanted: int) -> np.ndarray:
    """The share of each of n pixels in each of the middle `wanted` of the scaled ones, (wanted, n)."""
    middles = (np.arange(wanted) + 0.5 - wanted / 2) / scale + n / 2
    reach, edge = max(1.0, 1 / scale), n  # pixels beyond the edge are those at the edge
    places = np.arange(-edge, n + edge)
    shares = np.maximum(1 - np.abs(places + 0.5 - middles[:, None]) / reach, 0)
    kept = np.zeros((wanted, n))
    for place, column in zip(places, shares.T, strict=True):
        kept[:, np.clip(place, 0, n - 1)] += column
    return kept / kept.sum(axis=1, keepdims=True)


def image_of(context: moderngl.Context, levels: np.ndarray, count: int) -> Image:
    height, width, _ = levels.shape
    kind = "u1" if levels.dtype == np.uint8 else "u2"
    return Image(context.texture((width, height), 3, levels.tobytes(), alignment=1, dtype=kind), count)


@pytest.mark.parametrize(
    ("scale", "size"), [(3.7, (30, 20)), (7.2, (130, 75)), (0.4, (7, 4)), (1.0, (12, 9))]
)
@pytest.mark.parametrize(("count", "kind"), [(256, np.uint8), (GRID_LEVELS, np.uint16), (65536, np.uint16)])
def test_a_scaled_image_is_that_of_the_filter_in_linear_light(
    context: moderngl.Context, scale: float, size: tuple[int, int], count: int, kind: type
) -> None:
    levels = np.random.default_rng(1).integers(0, count, (11, 18, 3)).astype(kind)
    scaler = ImageScaler(context, GAMMA, WINDOW)
    scaled = scaler.scaled(image_of(context, levels, count), scale, size)
    got, highest = scaler.levels()
    assert (highest, scaled.levels) == (max(count, GRID_LEVELS), max(count, GRID_LEVELS))
    assert highest in (GRID_LEVELS, DEEP_LEVELS)
    light = (levels / (count - 1)) ** GAMMA
    light = np.einsum("yr,rcx->ycx", weights(11, scale, size[1]), light)
    light = np.einsum("xc,rcz->rxz", weights(18, scale, size[0]), light)
    wanted = light ** (1 / GAMMA) * (highest - 1)
    assert got.shape == (size[1], size[0], 3)
    assert np.abs(got - wanted).max() < 0.5 + 1e-5 * highest  # rounded to a level; float32 on the processor


def test_a_picture_made_smaller_keeps_its_light(context: moderngl.Context) -> None:
    """Stripes of black and white, four pixels to a new one: half of the light but for the edges."""
    levels = np.zeros((40, 40, 3), np.uint8)
    levels[:, ::2] = 255
    scaler = ImageScaler(context, GAMMA, WINDOW)
    scaler.scaled(image_of(context, levels, 256), 0.25, (10, 10))
    got, count = scaler.levels()
    np.testing.assert_allclose((got[1:-1, 1:-1] / (count - 1)) ** GAMMA, 0.5, atol=0.002)
