"""The pyramid that compute shaders make: the levels of the definition, no rounding where nothing changes."""

import numpy as np
import pytest
from compute_shaders import own_context

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.contrast.pyramid import gaussian_pyramid
from evenlight.method.gpu.pyramid import SUM_WORDS, GpuPyramid, packed, sums_of

pytestmark = pytest.mark.slow

HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=72.28)
LEVELS = 5


def levels_of(frame, order):
    """The levels of a frame, and the sums of its channels, from the memory of the graphics processor."""
    own = own_context()

    def made(context):
        pyramid = GpuPyramid(context, frame.shape[:2], HEADSET, order, LEVELS)
        results = context.buffer(bytes(4 * SUM_WORDS))
        pyramid.fill(packed(frame), results)
        context.finish()
        cells = np.frombuffer(pyramid.buffer.read(), np.float32)
        parts = zip(pyramid.begins, pyramid.begins[1:], pyramid.shapes, strict=False)
        levels = [cells[first:last].reshape(shape) for first, last, shape in parts]
        return levels, sums_of(np.frombuffer(results.read(), np.uint32))

    return own.run(made, own.context)


@pytest.mark.parametrize("order", list(PixelToLuminance))
@pytest.mark.parametrize("shape", [(37, 70), (64, 33), (16, 200)])
def test_levels_and_sums_are_those_of_the_definition(shape, order):
    frame = np.random.default_rng(3).integers(0, 256, (*shape, 3), dtype=np.uint8)
    emitted = emitted_luminance(frame, HEADSET, order)
    levels, sums = levels_of(frame, order)
    for level, expected in zip(levels, gaussian_pyramid(emitted, LEVELS), strict=True):
        np.testing.assert_allclose(level, expected, rtol=3e-6)
    np.testing.assert_allclose(0.2 + 104.2 * sums[3] / emitted.size, emitted.mean(), rtol=1e-6)


@pytest.mark.parametrize("order", list(PixelToLuminance))
def test_one_colour_stays_one_luminance_to_the_last_bit(order):
    """Masking takes contrasts to the power 0.2, which makes 0.04 of rounding noise of 1e-7."""
    for value in range(0, 256, 17):
        frame = np.full((35, 52, 3), (value, 255 - value, 77), np.uint8)
        levels, _ = levels_of(frame, order)
        assert len({float(cell) for level in levels for cell in np.unique(level)}) == 1
