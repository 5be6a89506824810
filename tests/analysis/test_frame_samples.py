"""Frames kept from a video that streams past."""

import numpy as np
import pytest

from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.data_schema.frame import Frame


def refilled(count: int):
    """Frames of value 0, 1, 2, ... in one array that is filled again: what a source may do."""
    pixels = np.empty((8, 8, 3), np.uint8)
    for value in range(count):
        pixels[:] = value
        yield Frame(value / 25, 1 / 25, pixels)


@pytest.mark.parametrize("count", [1, 4, 5, 100])
def test_a_frame_that_is_kept_stays_as_it_was(count: int) -> None:
    samples = FrameSamples(most=4)
    assert len(list(samples.watch(refilled(count)))) == count
    assert [int(pixels[0, 0, 0]) for _, pixels in samples.held] == [index for index, _ in samples.held]


@pytest.mark.parametrize("count", [5, 17, 64, 250])
def test_between_half_of_the_most_and_the_most_are_kept_evenly_spread(count: int) -> None:
    samples = FrameSamples(most=8)
    list(samples.watch(refilled(count)))
    told = FrameSamples(most=8)
    list(told.watch(refilled(count), count))
    assert [index for index, _ in told.held] == [index for index, _ in samples.held]
    indices = [index for index, _ in samples.held]
    assert min(count, 4) <= len(indices) <= 8
    assert len(set(np.diff(indices).tolist())) == 1
    assert count - indices[-1] <= samples.stride
