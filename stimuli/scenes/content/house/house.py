"""The house: a family's home with garden, living room, kitchen, hall and basement, on a sunny afternoon.

Around it lie the street, fences, the neighbours' houses, and trees on the horizon.
"""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.house.basement import basement
from evenlight.stimuli.scenes.content.house.garden import garden
from evenlight.stimuli.scenes.content.house.kitchen import kitchen
from evenlight.stimuli.scenes.content.house.living_room import hall, living_room
from evenlight.stimuli.scenes.content.house.plan import Opening, bar, lining, window
from evenlight.stimuli.scenes.content.house.shell import TRIM, floor, gable, shell
from evenlight.stimuli.scenes.content.props.plants import clump
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.scene import Scene

SUN_ILLUMINANCE = 620.0  # [lx]; with it sunlit plaster comes near the 100 cd/m^2 of a headset's display
SUN_COLOUR = (1.0, 0.93, 0.80)
ZENITH, HORIZON = (16.0, 30.0, 60.0), (52.0, 62.0, 72.0)
FAR = 34.0  # how far the ground reaches [m]


def house(seed: int) -> Scene:
    """Return the house, furnished by a seed."""
    model = SceneModel("house", seed)
    model.sun(228.0, 40.0, SUN_ILLUMINANCE, SUN_COLOUR)
    model.sky(ZENITH, HORIZON)
    shell(model)
    garden(model)
    surroundings(model)
    living_room(model)
    kitchen(model)
    hall(model)
    basement(model)
    _places(model)
    _ground(model)
    return model.build()


def _places(model: SceneModel) -> None:
    """Name the rooms and the outdoors."""
    for name, ((x0, y0), (x1, y1)), low, high in (
        ("living room", plan.LIVING, 0.0, plan.CEILING),
        ("kitchen", plan.KITCHEN, 0.0, plan.CEILING),
        ("hallway", plan.HALL, 0.0, plan.CEILING),
        ("basement", plan.BASEMENT, plan.CELLAR, plan.CELLAR_CEILING),
        ("terrace", (plan.DECK_LOW, plan.DECK_HIGH), -0.02, 3.0),
        ("porch", (plan.PORCH_LOW, plan.PORCH_HIGH), 0.0, 3.0),
        ("stairs", plan.STAIRWELL, plan.CELLAR, plan.CEILING),
        ("garden", ((-4.4, -12.5), (14.8, 0.0)), plan.GROUND, 5.0),
        ("front garden", ((-5.4, 0.0), (0.0, 12.0)), plan.GROUND, 5.0),
    ):
        model.place(name, (x0, y0, low), (x1, y1, high))


def _ground(model: SceneModel) -> None:
    """Say where one may walk: free floor, doorways, stairs."""
    for low, high in (
        ((3.65, 0.95), (5.55, 3.2)),
        ((4.3, 3.0), (5.6, 4.0)),
        ((3.65, 2.3), (6.9, 3.6)),  # living room
        ((1.4, 1.35), (1.75, 3.5)),
        ((2.85, 1.35), (3.8, 3.2)),
        ((1.4, 1.0), (3.8, 1.5)),
        ((5.25, 3.6), (5.85, 5.85)),  # to the hall
        ((6.8, 1.4), (7.7, 3.9)),
        ((7.6, 3.85), (10.2, 4.1)),
        ((6.8, 3.5), (7.3, 5.4)),
        ((6.8, 1.2), (10.3, 1.4)),  # kitchen
        ((0.75, 5.75), (7.15, 6.25)),
        ((0.75, 6.2), (2.0, 6.9)),
        ((6.75, 5.45), (7.2, 7.2)),
        ((6.05, 6.95), (7.2, 7.4)),  # hall
        ((-2.1, 5.8), (0.8, 6.4)),  # porch
        ((3.7, -1.0), (4.9, 1.2)),
        ((3.1, -2.8), (5.4, -0.9)),
        ((3.7, -3.4), (4.9, -2.7)),  # terrace
    ):
        model.walkable(low, high, 0.0)
    for stairs in (plan.GARDEN_STEPS, plan.PORCH_STEPS, plan.CELLAR_STAIRS):
        stairs.walk(model, beside=0.3)
    for low, high in (
        ((-3.0, -10.0), (6.5, -4.4)),
        ((6.0, -5.0), (12.0, -4.2)),
        ((-3.0, -10.0), (-2.2, 5.2)),
        ((-3.9, 4.6), (-2.9, 5.2)),
        ((-3.9, 4.6), (-3.3, 8.0)),
        ((-6.6, 5.8), (-3.2, 6.4)),
        ((-6.6, -11.0), (-5.7, 10.0)),  # pavement
    ):
        model.walkable(low, high, plan.GROUND)
    for low, high in (
        ((1.1, 6.95), (2.45, 7.4)),
        ((1.3, 5.9), (1.9, 7.4)),
        ((1.5, 1.2), (2.2, 6.1)),
        ((2.1, 1.2), (3.8, 4.8)),
        ((3.7, 2.7), (7.0, 4.0)),
        ((5.0, 2.1), (7.0, 4.0)),
        ((5.2, 3.9), (6.4, 6.3)),
    ):
        model.walkable(low, high, plan.CELLAR)


def surroundings(model: SceneModel) -> None:
    """Add everything beyond the house's own garden, and the ground."""
    _lawn_and_street(model)
    _fences(model)
    _neighbours(model)
    _belt(model)


def _lawn_and_street(model: SceneModel) -> None:
    """Add lawn around the house, the street, and paths."""
    (x0, y0), (x1, y1), z = plan.OUTER_LOW, plan.OUTER_HIGH, plan.GROUND
    for low, high in (
        ((-5.4, -FAR), (FAR, y0)), ((-5.4, y0), (x0, y1)), ((x1, y0), (FAR, y1)), ((-5.4, y1), (FAR, FAR)),
        ((-FAR, -FAR), (-12.5, FAR)),
    ):  # fmt: skip
        floor(model, low, high, z, stuff.GRASS)
    floor(model, (-11.0, -FAR), (-6.9, FAR), z - 0.12, stuff.ROAD)
    for low, high in (((-6.9, -FAR), (-5.4, FAR)), ((-12.5, -FAR), (-11.0, FAR))):
        model.box((*low, z - 0.3), (*high, z + 0.001), stuff.STONE, skip="z")
    model.box((-5.4, 5.5, z - 0.1), (-3.0, 6.7, z + 0.02), stuff.STONE, skip="z")
    model.box((-3.2, -0.6, z - 0.1), (-0.02, 3.6, z + 0.012), stuff.GRAVEL, skip="z")
    model.box((3.2, -6.2, z - 0.1), (5.4, -4.4, z + 0.02), stuff.STONE, skip="z")
    rng = model.rng_for("stepping stones")
    for step in range(9):
        x, y = 4.3 + 0.35 * np.sin(0.8 * step), -6.7 - 0.62 * step
        under, over, turn = (x - 0.3, y - 0.2, z - 0.1), (x + 0.3, y + 0.2, z + 0.025), 20 * rng.random() - 10
        model.box(under, over, stuff.STONE, turn=turn, skip="z")


def _fences(model: SceneModel) -> None:
    """Add the garden fence in the east, pickets along the street, the gate's posts."""
    z = plan.GROUND
    for y in np.arange(-12.4, 7.9, 1.8):
        model.box((14.85, y - 0.05, z), (14.95, y + 0.05, z + 1.75), stuff.OLD_WOOD, skip="z")
    lining(model, ((14.85, 8.0), (14.85, -12.4)), (z + 0.08, z + 1.65), stuff.FENCE_BOARDS)
    model.box((14.82, -12.4, z + 1.62), (14.98, 8.0, z + 1.7), stuff.OLD_WOOD)
    for y in (5.3, 6.9):
        model.box((-4.95, y - 0.12, z), (-4.7, y + 0.12, z + 1.35), stuff.NEIGHBOUR_BRICK, skip="z")
        model.box((-5.0, y - 0.16, z + 1.35), (-4.65, y + 0.16, z + 1.43), stuff.PLINTH)


def _belt(model: SceneModel) -> None:
    """Close the horizon with belts of trees beyond the gardens."""
    rng = model.rng_for("belt")
    z = plan.GROUND
    for low, high in (
        ((-28.0, -33.0), (32.0, -31.0)),
        ((31.0, -33.0), (33.0, 32.0)),
        ((-33.0, -33.0), (-30.0, 32.0)),
        ((-30.0, 30.0), (33.0, 32.0)),
    ):
        along = 0 if high[0] - low[0] > high[1] - low[1] else 1
        steps = np.arange(low[along], high[along], 4.0)
        for start in steps:
            tall = 4.5 + 3.5 * rng.random()
            a, b = list(low), list(high)
            a[along], b[along] = float(start), float(start) + 4.2
            model.box((*a, z - 0.2), (*b, z + tall - 1.5), stuff.HEDGE, skip="z", tint=(0.75, 0.85, 0.8))
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, z + tall - 1.6)
            clump(model, middle, 2.6, stuff.DARK_LEAVES, rng, 30)


def _neighbours(model: SceneModel) -> None:
    """Add houses around: one beyond the fence, one beyond the hedge, two across the street."""
    z = plan.GROUND
    for low, high, eaves, ridge, wall in (
        ((18.5, -13.0), (27.0, -4.0), 5.0, 8.0, stuff.NEIGHBOUR_BRICK),
        ((9.5, -28.0), (20.0, -20.0), 5.2, 8.5, stuff.FACADE),
        ((-8.0, -29.0), (2.0, -21.0), 4.2, 7.4, stuff.NEIGHBOUR_BRICK),
        ((-24.0, -4.0), (-15.5, 4.5), 4.8, 7.8, stuff.FACADE),
        ((-24.0, 7.0), (-15.5, 15.5), 5.0, 8.2, stuff.NEIGHBOUR_BRICK),
    ):
        _neighbour(model, low, high, (z, eaves, ridge), wall)


def _neighbour(
    model: SceneModel,
    low: tuple[float, float],
    high: tuple[float, float],
    heights: tuple[float, float, float],
    wall: Material,
) -> None:
    """Add a plain house with two rows of windows on the sides that face ours, and a door."""
    z, eaves, ridge = heights
    model.box((*low, z), (*high, eaves), wall, skip="zZ")
    gable(model, low, high, (eaves, ridge), (stuff.ROOF, wall))
    for sill in (z + 1.0, z + 3.6):
        for along, sides in (("y", (low[0], high[0])), ("x", (low[1], high[1]))):
            start, stop = (low[1], high[1]) if along == "y" else (low[0], high[0])
            for place in np.arange(start + 1.1, stop - 1.6, 2.3):
                hole = Opening(float(place), float(place) + 1.1, sill, sill + 1.35)
                for line, outward in zip(sides, (-1, 1), strict=True):
                    across = (line - 0.04, line) if outward < 0 else (line, line + 0.04)
                    pane = (line - 0.01, line) if outward < 0 else (line, line + 0.01)
                    glass = (stuff.GLAZED, (hole.sill, hole.head), (0.1, 0.13, 0.17))
                    bar(model, along, (hole.low, hole.high), pane, glass)
                    window(model, hole, along, across, (2, 1), material=(stuff.PAINT, TRIM))
