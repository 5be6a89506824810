"""Luminance maps of a video that streams past."""

import numpy as np
import pytest

from evenlight.analysis.reproduction.adaptation_lag import LuminanceMaps, block_means, seen_luminance
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.luminance import emitted_luminance

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0, reflected_luminance=1.5)


def noise(dtype: type, shape: tuple[int, int] = (18, 32)) -> np.ndarray:
    values = np.random.default_rng(1).uniform(size=(*shape, 3))
    if np.issubdtype(dtype, np.integer):
        return (values * np.iinfo(dtype).max).astype(dtype)
    return values.astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_block_has_the_mean_of_the_luminance_of_its_pixels(dtype: type) -> None:
    pixels = noise(dtype)
    maps = LuminanceMaps(LAB, width=8)
    list(maps.watch([Frame(0.0, 0.04, pixels)]))
    whole = emitted_luminance(pixels, LAB)
    expected = whole.reshape(4, -1, 8, 4).mean(axis=(1, 3)) if whole.shape[0] % 4 == 0 else None
    assert maps.luminance.shape == (1, 4, 8)  # 18 / 32 · 8 = 4.5, to even
    if expected is not None:
        np.testing.assert_allclose(maps.luminance[0], expected, rtol=1e-6)
    else:
        assert maps.luminance[0, 0, 0] == pytest.approx(whole[:4, :4].mean(), rel=1e-6)
        assert maps.luminance[0, -1, -1] == pytest.approx(whole[13:, 28:].mean(), rel=1e-6)


def test_frames_pass_through_and_a_source_may_fill_them_again() -> None:
    pixels = np.empty((4, 8, 3), np.uint8)

    def refilled():
        for value in (0, 128, 255):
            pixels[:] = value
            yield Frame(value / 100, 0.5, pixels)

    maps = LuminanceMaps(LAB, width=4)
    assert [frame.time for frame in maps.watch(refilled())] == [0.0, 1.28, 2.55]
    assert maps.durations == [0.5] * 3
    np.testing.assert_allclose(maps.luminance.mean(axis=(1, 2))[[0, 2]], [0.1, 100.0], rtol=1e-6)


def test_no_more_blocks_than_pixels() -> None:
    maps = LuminanceMaps(LAB)
    list(maps.watch([Frame(0.0, 0.04, noise(np.uint8, (3, 5)))]))
    assert maps.luminance.shape == (1, 3, 5)


def test_blocks_of_unequal_size_lose_no_pixel() -> None:
    values = np.random.default_rng(2).uniform(size=(2, 7, 11))
    means = block_means(values, (3, 4))
    rows, columns = np.array([0, 2, 4, 7]), np.array([0, 2, 5, 8, 11])
    sizes = np.outer(np.diff(rows), np.diff(columns))
    np.testing.assert_allclose((means * sizes).sum(axis=(1, 2)), values.sum(axis=(1, 2)))
    assert means[1, 2, 3] == pytest.approx(values[1, 4:, 8:].mean())


def test_reflected_light_is_not_dimmed() -> None:
    emitted = np.array([[[100.0, 10.0]], [[50.0, 0.0]]])
    seen = seen_luminance(emitted, np.array([0.5, 1.0]), LAB)
    assert seen.tolist() == [[[51.5, 6.5]], [[51.5, 1.5]]]
