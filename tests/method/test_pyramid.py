"""Pyramids: against the kernel written out in two dimensions, exact reconstruction, and symmetries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    expanded,
    gaussian_pyramid,
    laplacian_bands,
    level_shapes,
)

KERNEL = np.outer(*2 * [[0.05, 0.25, 0.4, 0.25, 0.05]])  # Burt & Adelson (1983), a = 0.4
SHAPES = [(8, 8), (9, 13), (16, 11), (3, 7), (2, 2), (1, 5), (1, 1)]


def mirror(i, n):
    """Where index i lies in ... 2 1 0 1 2 ... n-2 n-1 n-2 ..."""
    while not 0 <= i < n:
        i = -i if i < 0 else 2 * (n - 1) - i
        if n == 1:
            return 0
    return i


def reduce_as_printed(fine):
    """g_l(i, j) = Σ_m Σ_n w(m, n) g_{l-1}(2i + m, 2j + n)."""
    height, width = fine.shape
    coarse = np.zeros(((height + 1) // 2, (width + 1) // 2))
    for i, j in np.ndindex(coarse.shape):
        for m in range(-2, 3):
            for n in range(-2, 3):
                at = mirror(2 * i + m, height), mirror(2 * j + n, width)
                coarse[i, j] += KERNEL[m + 2, n + 2] * fine[at]
    return coarse


def expand_as_printed(coarse, shape):
    """g_{l,n}(i, j) = 4 Σ_m Σ_n w(m, n) g_{l,n-1}((i - m)/2, (j - n)/2), over the terms that exist."""
    fine = np.zeros(shape)
    for i, j in np.ndindex(shape):
        for m in range(-2, 3):
            for n in range(-2, 3):
                at = mirror(i - m, shape[0]), mirror(j - n, shape[1])
                # Parity of i - m and of its mirror agree: a mirror moves an index by an even number.
                if at[0] % 2 == 0 and at[1] % 2 == 0:
                    fine[i, j] += 4 * KERNEL[m + 2, n + 2] * coarse[at[0] // 2, at[1] // 2]
    return fine


@pytest.fixture(params=SHAPES, ids=str)
def image(request):
    return np.random.default_rng(1).uniform(0, 100, request.param)


def test_reduction_is_as_printed(image):
    np.testing.assert_allclose(gaussian_pyramid(image, 2)[1], reduce_as_printed(image), rtol=1e-12)


def test_expansion_is_as_printed(image):
    coarse = gaussian_pyramid(image, 2)[1]
    if min(image.shape) > 1:  # along a side of one pixel the printed sum has only the centre tap
        np.testing.assert_allclose(
            expanded(coarse, image.shape), expand_as_printed(coarse, image.shape), rtol=1e-12
        )


def test_bands_and_residual_give_the_image_back(image):
    levels = gaussian_pyramid(image, len(level_shapes(image.shape)))
    collapsed = levels[-1]
    for band in reversed(laplacian_bands(levels)):
        collapsed = band + expanded(collapsed, band.shape)
    np.testing.assert_allclose(collapsed, image, rtol=1e-12)


def test_level_sizes_are_those_of_the_pyramid(image):
    shapes = level_shapes(image.shape)
    assert [level.shape for level in gaussian_pyramid(image, len(shapes))] == shapes
    assert min(shapes[-1]) == 1


@given(st.floats(1e-6, 1e6), st.tuples(st.integers(1, 20), st.integers(1, 20)))
def test_an_area_of_one_luminance_has_no_contrast_at_all(value, shape):
    """Not even rounding noise, which masking would magnify (0.2th power)."""
    levels = gaussian_pyramid(np.full(shape, value), 4)
    assert all((band == 0).all() for band in laplacian_bands(levels))
    assert (adaptation_luminance(levels, 1) == value).all()


def test_a_ramp_passes_to_the_next_level_inside_the_frame():
    """The kernel is symmetric and its taps sum to 1 at either parity, so it reproduces straight lines."""
    ramp = np.tile(np.arange(32.0), (32, 1))
    levels = gaussian_pyramid(ramp, 2)
    assert np.abs(laplacian_bands(levels)[0][6:-6, 6:-6]).max() < 1e-12


@given(arrays(np.float64, (9, 6), elements=st.floats(0, 100)))
def test_rows_and_columns_are_treated_alike(image):
    upright, turned = (laplacian_bands(gaussian_pyramid(x, 3)) for x in (image, image.T))
    for a, b in zip(upright, turned, strict=True):
        np.testing.assert_allclose(a, b.T, atol=1e-11)


@given(arrays(np.float64, (17, 9), elements=st.floats(0, 100)))
def test_a_mirrored_image_has_the_mirrored_pyramid(image):
    """Where sides are 2^k + 1, so that every level samples both edges."""
    straight, mirrored = (laplacian_bands(gaussian_pyramid(x, 4)) for x in (image, image[:, ::-1]))
    for a, b in zip(straight, mirrored, strict=True):
        np.testing.assert_allclose(a, b[:, ::-1], atol=1e-11)


@given(arrays(np.float64, (8, 8), elements=st.floats(0, 1e4)))
def test_adaptation_luminance_lies_within_the_luminances_of_the_frame(image):
    """Both steps are averages with positive weights."""
    adaptation = adaptation_luminance(gaussian_pyramid(image, 4), 1)
    margin = 1e-12 * image.max()
    assert adaptation.min() >= image.min() - margin
    assert adaptation.max() <= image.max() + margin


def test_the_image_is_not_written_to():
    image = np.ones((8, 8))
    image.flags.writeable = False
    gaussian_pyramid(image, 4)
