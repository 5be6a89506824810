"""Stairs climb along the axis that they are told, stand closed on the ground, and are walked up by treads."""

from __future__ import annotations

import numpy as np
import pytest

from evenlight.stimuli.scenes.content.house.materials import PLINTH, STONE
from evenlight.stimuli.scenes.content.house.plan import Stairs, flight
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import Floats, Scene

# Wider than deep, like steps before a terrace: 4 steps of 0.2 m by 0.25 m, from -0.8 m to 0.
WIDE = Stairs((0.0, 0.0), (2.0, 1.0), "y", (-0.8, 0.0), 4)
EAST = Stairs((0.0, 0.0), (1.0, 2.0), "x", (-0.8, 0.0), 4)


def built(stairs: Stairs, *, solid: bool) -> Scene:
    model = SceneModel("stairs", 1)
    flight(model, stairs, (STONE, PLINTH), solid=solid)
    stairs.walk(model, beside=0.3)
    return model.build()


def corners(scene: Scene, facing: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Return the lower and higher corners of all patches that face some way."""
    p = scene.patches
    chosen = (p.normals[:, 0] @ facing) > 0.99
    four = np.stack([p.origin, p.origin + p.along, p.origin + p.across, p.origin + p.along + p.across], 1)
    return four[chosen].min(axis=1), four[chosen].max(axis=1)


@pytest.mark.parametrize(("stairs", "axis"), [(WIDE, 1), (EAST, 0)])
def test_treads_rise_along_the_axis_that_is_said_also_where_the_flight_is_wider_than_deep(stairs, axis):
    _, high = corners(built(stairs, solid=True), (0, 0, 1))
    for k in range(4):  # the tread, and the riser's upper side 35 mm under it
        ends = np.isclose(high[:, axis], 0.25 * (k + 1))
        np.testing.assert_allclose(np.sort(high[ends, 2]), [-0.635 + 0.2 * k, -0.6 + 0.2 * k], atol=1e-9)


def test_the_sides_of_solid_stairs_are_closed_from_the_ground_to_each_tread():
    low, high = corners(built(WIDE, solid=True), (-1, 0, 0))
    for k in range(4):
        middle = 0.125 + 0.25 * k
        over = (low[:, 1] < middle) & (high[:, 1] > middle)
        assert low[over, 2].min() <= -0.8
        assert high[over, 2].max() == pytest.approx(-0.6 + 0.2 * k)
        # One piece ends where the next begins.
        assert sorted(high[over, 2])[0] == pytest.approx(sorted(low[over, 2])[1])


def test_one_walks_over_the_middles_of_the_treads():
    (ground,) = built(WIDE, solid=True).walkable
    assert ground.height(1.0, -0.125) == pytest.approx(-0.8)  # half a tread before the first riser
    for k in range(4):
        assert ground.height(1.0, 0.125 + 0.25 * k) == pytest.approx(-0.6 + 0.2 * k)
    assert (ground.low[0], ground.high[0]) == (0.3, 1.7)
