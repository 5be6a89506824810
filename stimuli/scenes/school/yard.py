"""The schoolyard south of the building: games painted on asphalt, trees, bicycles, fence; and the facades."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.plants import hedge, shrub, tree
from evenlight.stimuli.scenes.school import building as stuff
from evenlight.stimuli.scenes.school.building import Faces, WallOpening, floor, wall
from evenlight.stimuli.scenes.school.equipment import ball, basket, bicycle
from evenlight.stimuli.scenes.school.furniture import bench, school_bag, waste_bin
from evenlight.stimuli.scenes.shapes import WHOLE, rectangle

WEST, EAST, SOUTH = -12.0, 58.0, -34.0  # [m], of the asphalt
TREES = (
    (9.0, -20.0, 8.5),
    (14.8, -17.2, 6.5),
    (27.4, -14.5, 7.0),
    (3.0, -28.0, 9.5),
    (31.0, -25.5, 8.0),
    (40.0, -21.0, 9.0),
    (-8.0, -18.5, 8.0),
    (21.0, -37.5, 10.0),
    (12.0, -38.0, 9.0),
    (33.0, -38.5, 11.0),
    (48.0, -37.0, 9.0),
    (0.0, -37.5, 10.5),
)
FAR_TREES = ((-14.0, 3.5, 7.5), (-17.5, -2.0, 8.5), (-19.0, 6.0, 9.0))
GREEN_STEEL = (0.06, 0.16, 0.11)


def add_yard(model: SceneModel) -> None:
    """Lay out the yard and finish the outside of the building."""
    rng = model.rng_for("yard")
    _ground(model)
    _games(model)
    _trees(model, rng)
    _fences(model)
    _furniture(model, rng)
    _upper_storey(model)
    _neighbours(model)
    model.place("schoolyard", (WEST, SOUTH, 0.0), (EAST, -4.3, 12.0))
    model.walkable((15.5, -24.0), (26.0, -11.8))
    model.walkable((19.0, -12.5), (24.0, -4.6))


def _ground(model: SceneModel) -> None:
    """Lay asphalt, a paved forecourt, lawns around."""
    for low, high in (
        ((WEST, SOUTH), (EAST, -12.6)),
        ((WEST, -12.6), (33.0, -11.6)),
        ((55.6, -12.6), (EAST, -11.6)),
    ):
        floor(model, low, high, stuff.ASPHALT)
    for low, high in (((18.3, -11.6), (24.7, -4.0)), ((24.7, -11.6), (33.0, -6.6))):
        floor(model, low, high, stuff.PAVING)
    for low, high in (
        ((-70.0, -80.0), (110.0, SOUTH)),
        ((-70.0, SOUTH), (WEST, 40.0)),
        ((EAST, SOUTH), (110.0, 40.0)),
        ((WEST, 3.3), (EAST, 40.0)),
        ((WEST, -11.6), (-8.3, 3.3)),
        ((55.6, -11.6), (EAST, 3.3)),
    ):
        floor(model, low, high, stuff.GRASS)
    for x in (WEST, EAST - 0.15):
        model.box((x, SOUTH, 0.0), (x + 0.15, -11.6, 0.12), stuff.CONCRETE, skip="z")
    model.box((WEST, SOUTH, 0.0), (EAST, SOUTH + 0.15, 0.12), stuff.CONCRETE, skip="z")


def _games(model: SceneModel) -> None:
    """Paint games and a pitch on the asphalt."""
    for x, y, size, material in (
        (17.2, -15.2, 3.6, stuff.HOPSCOTCH),
        (24.6, -17.5, 3.6, stuff.SNAIL),
        (18.6, -20.2, 3.4, stuff.FOUR_SQUARE),
        (29.8, -17.6, 3.4, stuff.FOUR_SQUARE),
    ):
        a = size / 2
        corners = rectangle((x - a, x + a), (y - a, y + a), 0.008)
        model.quad(corners, material, uvs=WHOLE)
    for x in (33.5, 56.0):
        model.quad(rectangle((x, x + 0.08), (-30.0, -16.0), 0.006), stuff.PAINT, tint=(0.8, 0.8, 0.74))
    for y in (-30.0, -16.0):
        model.quad(rectangle((33.5, 56.0), (y, y + 0.08), 0.006), stuff.PAINT, tint=(0.8, 0.8, 0.74))
    for k in range(5):
        x = 21.0 + 0.55 * k
        model.quad(rectangle((x, x + 0.35), (-12.6, -11.8), 0.006), stuff.PAINT, tint=(0.8, 0.62, 0.1))


def _trees(model: SceneModel, rng: np.random.Generator) -> None:
    """Plant trees in the yard and beyond, hedges along the fence, shrubs under the windows."""
    for x, y, tall in (*TREES, *FAR_TREES):
        with model.at((x, y, 0.0), rng.uniform(0, 360)):
            tree(model, (tall, 0.3 * tall), (stuff.BARK, stuff.LEAVES), rng)
        if y > SOUTH and x > WEST:
            model.box((x - 0.75, y - 0.75, 0.0), (x + 0.75, y + 0.75, 0.09), stuff.CONCRETE, skip="z")
            floor(model, (x - 0.62, y - 0.62), (x + 0.62, y + 0.62), stuff.GRASS, 0.1)
    for x in np.arange(-7.2, 17.5, 1.35):
        with model.at((float(x), -12.3 + rng.normal(0, 0.08), 0.0)):
            shrub(model, rng.uniform(0.4, 0.6), stuff.LEAVES, rng, 14)
    hedge(model, (-12.6, -38.0, 0.0), (-11.9, 9.0, 1.7), (stuff.HEDGE, stuff.LEAVES), rng)
    hedge(model, (-12.0, -35.6, 0.0), (58.0, -34.9, 1.3), (stuff.HEDGE, stuff.LEAVES), rng)


def _fences(model: SceneModel) -> None:
    """Put a wire fence on posts along the south and the east of the yard."""
    tall = 2.2
    for start, end in (
        ((WEST, SOUTH - 0.4), (EAST, SOUTH - 0.4)),
        ((EAST + 0.4, SOUTH - 0.4), (EAST + 0.4, -12.5)),
    ):
        corners = [(*start, 0.05), (*end, 0.05), (*end, tall), (*start, tall)]
        model.quad(corners, stuff.FENCE)
        length = float(np.hypot(*np.subtract(end, start)))
        for share in np.arange(0, length + 0.1, 3.5) / length:
            x, y = np.add(start, share * np.subtract(end, start)).tolist()
            model.cylinder((x, y, 0), (x, y, tall + 0.05), 0.035, stuff.STEEL, segments=6, tint=GREEN_STEEL)
        model.cylinder((*start, tall), (*end, tall), 0.025, stuff.STEEL, segments=6, tint=GREEN_STEEL)


def _furniture(model: SceneModel, rng: np.random.Generator) -> None:
    """Set up bicycle racks, benches, bins, a table for table tennis, baskets, a slide."""
    for k in range(9):
        with model.at((25.6 + 0.75 * k, -7.6, 0.0), 90.0):
            for x in (-0.35, 0.35):
                model.cylinder((x, 0, 0), (x, 0, 0.75), 0.022, stuff.STEEL, segments=6, caps=False)
            model.cylinder((-0.35, 0, 0.75), (0.35, 0, 0.75), 0.022, stuff.STEEL, segments=6)
        if k not in (3, 6):
            with model.at((25.88 + 0.75 * k, -7.7, 0.0), 90.0 + rng.normal(0, 3)):
                bicycle(model, rng.uniform(0.04, 0.6, 3).tolist())
    for x, y, turn in (
        (19.1, -7.0, 90.0),
        (19.1, -10.0, 90.0),
        (27.4, -12.6, 0.0),
        (15.0, -19.5, 0.0),
        (12.0, -14.2, 180.0),
    ):
        with model.at((x, y, 0.0), turn):
            bench(model, 2.0, (0.85, 0.7, 0.55))
    with model.at((18.9, -9.2, 0.46), 90.0):
        school_bag(model, (0.5, 0.08, 0.06))
    for x, y in ((18.8, -8.5), (26.2, -12.4)):
        with model.at((x, y, 0.0)):
            waste_bin(model, GREEN_STEEL)
    with model.at((12.6, -23.4, 0.0), 12.0):
        _table_tennis(model)
    with model.at((44.0, -12.62, 0.0), 0.0):
        basket(model)
    with model.at((22.7, -15.4, 0.0), 40.0):
        ball(model, 0)
    _lamp_post(model, (24.2, -11.9))
    _goals(model)
    _sign(model)


def _table_tennis(model: SceneModel) -> None:
    """Add a concrete table with a steel net."""
    model.box((-1.37, -0.76, 0.68), (1.37, 0.76, 0.76), stuff.PAINT, tint=(0.08, 0.24, 0.2))
    for x in (-0.9, 0.7):
        model.box((x, -0.5, 0), (x + 0.2, 0.5, 0.68), stuff.CONCRETE, skip="zZ")
    model.box((-0.01, -0.8, 0.76), (0.01, 0.8, 0.91), stuff.STEEL)
    for y in (-0.76, 0.74):
        model.box((-1.37, y, 0.761), (1.37, y + 0.02, 0.763), stuff.PAINT, skip="z")


def _lamp_post(model: SceneModel, place: tuple[float, float]) -> None:
    """Add a lamp post, off by day."""
    x, y = place
    model.cylinder((x, y, 0), (x, y, 4.2), (0.06, 0.04), stuff.ENAMEL, segments=10, tint=GREEN_STEEL)
    model.sphere((x, y, 4.35), 0.2, stuff.ENAMEL, segments=16)


def _goals(model: SceneModel) -> None:
    """Add two goals with nets to the pitch."""
    for x, back in ((33.6, -1.0), (55.9, 1.0)):
        y, half, tall = -23.0, 1.5, 2.0
        for side in (-half, half):
            model.cylinder((x, y + side, 0), (x, y + side, tall), 0.05, stuff.ENAMEL, segments=8)
            model.cylinder(
                (x, y + side, tall), (x + back, y + side, 0), 0.02, stuff.STEEL, segments=6, caps=False
            )
        model.cylinder((x, y - half, tall), (x, y + half, tall), 0.05, stuff.ENAMEL, segments=8)
        model.quad(
            [(x + back, y - half, 0), (x + back, y + half, 0), (x, y + half, tall), (x, y - half, tall)],
            stuff.NET,
            uvs=[(0, 0), (4, 0), (4, 2), (0, 2)],
        )


def _sign(model: SceneModel) -> None:
    """Add the canopy over the entrance, with a board on it, and planters beside it."""
    model.box((19.2, -6.3, 2.95), (23.8, -4.3, 3.15), stuff.ENAMEL, tint=(0.12, 0.24, 0.22))
    for x in (19.4, 23.5):
        green = (0.12, 0.24, 0.22)
        model.cylinder((x, -6.1, 0), (x, -6.1, 2.95), 0.06, stuff.ENAMEL, segments=12, caps=False, tint=green)
    model.quad(rectangle((20.3, 22.7), -6.31, (3.18, 3.78)), stuff.SIGN, uvs=WHOLE)
    model.box((20.25, -6.3, 3.13), (22.75, -6.22, 3.83), stuff.ENAMEL, skip="y")
    rng = model.rng_for("planters")
    for x in (19.0, 24.0):
        model.box((x - 0.4, -5.4, 0), (x + 0.4, -4.6, 0.45), stuff.CONCRETE, skip="z")
        with model.at((x, -5.0, 0.35)):
            shrub(model, 0.42, stuff.LEAVES, rng, 16)


def _upper_storey(model: SceneModel) -> None:
    """Put a second storey over the corridor, its windows dark panes, and a cornice."""
    holes = [WallOpening(float(x), float(x) + 1.5, 4.4, 6.4, 2, 2) for x in np.arange(1.2, 40.0, 2.6)]
    front = Faces(stuff.BRICK, stuff.BRICK)
    wall(model, ((-8.3, 0.15), (33.3, 0.15)), (3.4, 7.2), front, holes)
    model.quad(rectangle((-8.3, 33.3), 0.25, (4.2, 6.6)), stuff.GLASS)
    wall(model, ((-8.15, 3.3), (-8.15, 0.3)), (3.4, 7.2), front)
    wall(model, ((33.0, 3.15), (-8.3, 3.15)), (3.4, 7.2), front)
    model.box((-8.3, 0.0, 3.2), (33.3, 3.3, 3.4), stuff.CONCRETE)
    model.box((-8.6, -0.35, 7.2), (33.2, 3.6, 7.45), stuff.ENAMEL, tint=(0.75, 0.73, 0.68))
    model.box((-8.33, -0.05, 6.75), (33.3, 0.0, 6.85), stuff.CONCRETE)
    for x in (-7.9, 24.95, 33.1):
        y, grey = -0.42 if x < 0 else -0.06, (0.4, 0.4, 0.4)
        model.cylinder((x, y, 3.5), (x, y, 7.2), 0.05, stuff.ENAMEL, segments=8, caps=False, tint=grey)


def _neighbours(model: SceneModel) -> None:
    """Put houses beyond the fence: facades with windows, and roofs."""
    for x, y, wide, tall, tint in (
        (-2.0, -52.0, 13.0, 6.0, (1, 0.95, 0.85)),
        (16.0, -55.0, 11.0, 7.5, (0.85, 0.9, 0.95)),
        (32.0, -53.0, 14.0, 5.5, (0.95, 0.85, 0.75)),
        (52.0, -56.0, 12.0, 8.0, (0.9, 0.9, 0.8)),
    ):
        model.box(
            (x, y - 8.0, 0), (x + wide, y, tall), stuff.PAINT, skip="z", tint=[0.75 * part for part in tint]
        )
        ridge = tall + 3.0
        model.quad(
            [
                (x + wide + 0.4, y + 0.5, tall - 0.3),
                (x - 0.4, y + 0.5, tall - 0.3),
                (x - 0.4, y - 4, ridge),
                (x + wide + 0.4, y - 4, ridge),
            ],
            stuff.BRICK,
            tint=(0.8, 0.7, 0.7),
        )
        for a in np.arange(x + 1.0, x + wide - 1.2, 2.4):
            for z in np.arange(0.9, tall - 1.4, 2.6):
                model.box(
                    (float(a), y, float(z)), (float(a) + 1.2, y + 0.03, float(z) + 1.4), stuff.GLASS, skip="y"
                )
                low, high = (float(a) - 0.08, y, float(z) - 0.1), (float(a) + 1.28, y + 0.08, float(z))
                model.box(low, high, stuff.VINYL, skip="y")
