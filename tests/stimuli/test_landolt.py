"""The Landolt ring: its fifths, its parallel gap, and what is refused."""

import dataclasses
import math
import re

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.stimuli.rings.landolt import Ring, covered, gap_pixels, require_drawable

RING = Ring(azimuth=30.0, altitude=-5.0, gap=10.0, contrast=-0.3, orientation=45)


def fine_grid(steps: int = 1001) -> tuple[np.ndarray, float]:
    """Points over a square of 6 x 6 gaps around the centre, and the area of each."""
    side = (np.arange(steps) + 0.5) / steps * 6 - 3
    return np.stack(np.meshgrid(side, side), axis=-1), (6 / steps) ** 2


def area_by_hand() -> float:
    """A ring of radii 1.5 and 2.5 less a strip 1 wide between them, in square gaps.

    The strip under a circle of radius R reaches to sqrt(R^2 - y^2); its area for |y| < 1/2 is
    sqrt(R^2 - 1/4) / 2 + R^2 asin(1 / 2R).
    """

    def strip(radius: float) -> float:
        return math.sqrt(radius**2 - 0.25) / 2 + radius**2 * math.asin(0.5 / radius)

    return math.pi * (2.5**2 - 1.5**2) - (strip(2.5) - strip(1.5))


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_covered_area_is_that_of_a_ring_with_a_straight_strip_cut_out(orientation) -> None:
    """The rim crosses about 6 / 0.006 points a gap of length; each is wrong by half of its area at most."""
    points, each = fine_grid()
    assert covered(points, orientation).sum() * each == pytest.approx(area_by_hand(), abs=0.01)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("radius", [1.6, 2.0, 2.4])
def test_the_gap_is_as_wide_as_the_stroke_at_every_radius(orientation, radius) -> None:
    """Counted along a line across the gap; a wedge would be half as wide again at 2.4 as at 1.6."""
    turn = math.radians(orientation)
    across = np.linspace(-0.7, 0.7, 14001)
    centre = radius * np.array([math.cos(turn), math.sin(turn)])
    line = centre + across[:, np.newaxis] * np.array([-math.sin(turn), math.cos(turn)])
    open_ = across[~covered(line, orientation) & (np.hypot(*line.T) < 2.5) & (np.hypot(*line.T) > 1.5)]
    assert open_.max() - open_.min() == pytest.approx(1.0, abs=3e-4)


def test_diameter_and_stroke_are_five_gaps_and_one() -> None:
    line = np.linspace(-3, 3, 60001)
    beside = covered(np.stack([np.zeros_like(line), line], axis=-1), orientation=0)
    assert line[beside].min() == pytest.approx(-2.5, abs=2e-4)
    assert line[beside].max() == pytest.approx(2.5, abs=2e-4)
    upper = line[beside & (line > 0)]
    assert upper.max() - upper.min() == pytest.approx(1.0, abs=3e-4)
    assert RING.diameter == 50.0


def test_the_gap_of_each_orientation_is_where_it_says() -> None:
    names = {
        0: (1, 0),
        90: (0, 1),
        180: (-1, 0),
        270: (0, -1),
        45: (1, 1),
        135: (-1, 1),
        225: (-1, -1),
        315: (1, -1),
    }
    for orientation, towards in names.items():
        point = 2 * np.array(towards) / np.hypot(*towards)
        assert not covered(point, orientation)
        assert all(covered(point, other) for other in ORIENTATIONS if other != orientation)


def test_a_gap_of_a_degree_is_as_many_pixels_as_the_display_has_in_one() -> None:
    assert gap_pixels(dataclasses.replace(RING, gap=60.0), 72.28) == pytest.approx(72.28)


def test_a_gap_under_two_pixels_is_refused_and_the_size_named_instead_is_not() -> None:
    coarse = Display("headset", 100.0, 0.0, 2.2, pixels_per_degree=7.3)
    with pytest.raises(InputError, match=r"1\.22 pixels on the display 'headset' of 7\.3 pixels") as said:
        require_drawable(RING, coarse)
    named = re.search(r"give ([0-9.]+) arcmin", str(said.value))
    assert named is not None
    smallest = float(named[1])
    assert smallest == pytest.approx(2 / 7.3 * 60, abs=0.011)
    require_drawable(dataclasses.replace(RING, gap=smallest), coarse)
    with pytest.raises(InputError):
        require_drawable(dataclasses.replace(RING, gap=smallest - 0.02), coarse)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gap": 0.0}, "gap must be above 0"),
        ({"gap": 601.0}, "at most 600 arcmin, got 601"),
        ({"contrast": 0.0}, "contrast must be -1 or more and not 0"),
        ({"contrast": -1.1}, "got -1.1"),
        ({"orientation": 30}, "one of 0, 45, 90, 135, 180, 225, 270, 315 deg, got 30"),
        ({"altitude": 91.0}, "altitude from -90 to 90"),
        ({"azimuth": math.nan}, "finite azimuth"),
    ],
)
def test_a_ring_that_cannot_be_is_refused(change, said) -> None:
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(RING, **change)
