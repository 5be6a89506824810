"""The schoolyard south of the building: games painted on asphalt, trees, bicycles, fence; and the facades."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.props.plants import hedge, shrub, tree
from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.content.school.building import Faces, WallOpening, floor, picture, wall
from evenlight.stimuli.scenes.content.school.equipment import ball, basket, bicycle
from evenlight.stimuli.scenes.content.school.furniture import bench, school_bag, waste_bin
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

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
GREEN_STEEL = (0.08, 0.18, 0.13)


def add_yard(model: SceneModel) -> None:
    """Lay out the yard and finish the outside of the building."""
    rng = model.rng_for("yard")
    _ground(model)
    _games(model)
    _trees(model, rng)
    _fences(model)
    _furniture(model, rng)
    _upper_storey(model)
    _outer_walls(model)
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
    """Add two goals to the pitch, with nets behind and on both sides."""
    for x, turn in ((33.6, 90.0), (55.9, -90.0)):
        half, tall, back = 1.5, 2.0, 1.0
        with model.at((x, -23.0, 0.0), turn):
            for side in (-half, half):
                post, foot = (side, 0.0, tall), (side, back, 0.0)
                model.cylinder((side, 0, 0), post, 0.05, stuff.ENAMEL, segments=10)
                model.cylinder(post, foot, 0.02, stuff.STEEL, segments=6, caps=False)
                model.cylinder((side, 0, 0.02), foot, 0.02, stuff.STEEL, segments=6, caps=False)
                model.mesh([(side, 0, 0), foot, post], [(0, 1, 2)], stuff.NET, uvs=[(0, 0), (2, 0), (0, 4)])
            model.cylinder((-half, 0, tall), (half, 0, tall), 0.05, stuff.ENAMEL, segments=10)
            model.cylinder((-half, back, 0.02), (half, back, 0.02), 0.02, stuff.STEEL, segments=6)
            net = [(-half, back, 0), (half, back, 0), (half, 0, tall), (-half, 0, tall)]
            model.quad(net, stuff.NET, uvs=[(0, 0), (6, 0), (6, 4.5), (0, 4.5)])


def _sign(model: SceneModel) -> None:
    """Add the canopy over the entrance, with a board on it, and planters beside it."""
    model.box((19.2, -6.3, 2.95), (23.8, -4.3, 3.15), stuff.ENAMEL, tint=(0.12, 0.24, 0.22))
    for x in (19.4, 23.5):
        green = (0.12, 0.24, 0.22)
        model.cylinder((x, -6.1, 0), (x, -6.1, 2.95), 0.06, stuff.ENAMEL, segments=12, caps=False, tint=green)
    middle = [(u, 0.3 + 0.4 * v) for u, v in WHOLE]
    model.quad(rectangle((20.3, 22.7), -6.31, (3.18, 3.78)), stuff.SIGN, uvs=middle)
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
    wall(model, ((-8.15, 3.3), (-8.15, 0.3)), (3.5, 7.2), front)
    wall(model, ((33.0, 3.15), (-8.3, 3.15)), (3.5, 7.2), front)
    model.box((-8.2, 0.05, 3.2), (33.2, 3.2, 3.4), stuff.CONCRETE)
    model.box((-8.6, -0.35, 7.2), (33.2, 3.6, 7.45), stuff.ENAMEL, tint=(0.75, 0.73, 0.68))
    model.box((-8.33, -0.05, 6.75), (33.25, 0.0, 6.85), stuff.CONCRETE)
    for x in (-7.9, 24.95, 33.1):
        y, grey = -0.42 if x < 0 else -0.06, (0.4, 0.4, 0.4)
        model.cylinder((x, y, 3.5), (x, y, 7.2), 0.05, stuff.ENAMEL, segments=8, caps=False, tint=grey)


def _outer_walls(model: SceneModel) -> None:
    """Relieve the brick of library and gym: plinths, a band, pillars, downpipes, paintings by the pupils."""
    for (x, y), (to_x, to_y), tall in (
        ((33.0, -12.68), (55.6, -12.6), 0.5), ((33.0, -12.66), (55.6, -12.6), 3.4),
        ((18.3, -11.6), (18.36, -4.35), 0.5), ((3.4, -11.68), (18.36, -11.6), 0.5),
        ((32.92, -12.68), (33.0, -6.7), 0.5), ((32.94, -12.66), (33.0, -6.7), 3.4),
    ):  # fmt: skip
        low = 0.0 if tall < 1 else tall - 0.18
        model.box((x, y, low), (to_x, to_y, tall), stuff.CONCRETE)
    for x in np.arange(37.7, 52.5, 3.6).tolist():
        model.box((x - 0.25, -12.75, 0), (x + 0.25, -12.6, 7.7), stuff.BRICK, skip="zY")
    for x, y in ((18.38, -11.4), (18.38, -4.6), (32.92, -12.3), (54.9, -12.7)):
        model.cylinder(
            (x, y, 0), (x, y, 5.4), 0.05, stuff.ENAMEL, segments=8, caps=False, tint=(0.4, 0.4, 0.4)
        )
    for y in (-10.0, -8.2, -6.4):
        with model.at((18.3, y, 1.9), 90.0):
            picture(model, stuff.WALL_POSTERS["paintings"], (1.4, 1.4), 0.06)


def _neighbours(model: SceneModel) -> None:
    """Put houses beyond the fence."""
    for place, size, tint in (
        ((-2.0, -52.0), (13.0, 6.0), (1, 0.95, 0.85)),
        ((16.0, -55.0), (11.0, 7.5), (0.85, 0.9, 0.95)),
        ((32.0, -53.0), (14.0, 5.5), (0.95, 0.85, 0.75)),
        ((52.0, -56.0), (12.0, 8.0), (0.9, 0.9, 0.8)),
    ):
        with model.at((*place, 0.0)):
            _house(model, size, tint)


def _house(model: SceneModel, size: tuple[float, float], tint: tuple[float, float, float]) -> None:
    """Add a house 8 m deep, its front at y = 0 towards +y: gables, roof, chimney, windows, a door."""
    (wide, tall), ridge = size, size[1] + 3.0
    model.box((0, -8, 0), (wide, 0, tall), stuff.CORRIDOR_WALL, skip="zZ", tint=tint)
    model.box((-0.04, -8.04, 0), (wide + 0.04, 0.04, 0.5), stuff.CONCRETE, skip="zZ")
    for x, left, right in ((0, -8, 0), (wide, 0, -8)):
        gable = (x, left, tall), (x, -4, ridge), (x, right, tall)
        model.mesh(gable, [(0, 1, 2)], stuff.CORRIDOR_WALL, tint=tint)
    for y in (0.5, -8.5):
        eaves = [
            (wide + 0.4, y, tall - 0.38),
            (-0.4, y, tall - 0.38),
            (-0.4, -4, ridge),
            (wide + 0.4, -4, ridge),
        ]
        model.quad(eaves if y > 0 else eaves[::-1], stuff.BRICK, tint=(0.8, 0.7, 0.7))
    model.cylinder((-0.4, 0.52, tall - 0.42), (wide + 0.4, 0.52, tall - 0.42), 0.07, stuff.STEEL, segments=8)
    model.box((0.25 * wide, -3.4, tall + 1), (0.25 * wide + 0.8, -2.8, ridge + 0.9), stuff.BRICK, skip="z")
    door = wide / 2 - 0.55
    model.box((door - 0.12, 0, 0), (door + 1.12, 0.06, 2.3), stuff.ENAMEL, skip="yz")
    model.box((door, 0.06, 0.1), (door + 1.0, 0.09, 2.2), stuff.PAINT, skip="y", tint=(0.2, 0.3, 0.26))
    for x in np.arange(1.0, wide - 1.2, 2.4).tolist():
        for z in np.arange(0.9, tall - 1.4, 2.6).tolist():
            if z < 2.5 and abs(x + 0.6 - wide / 2) < 1.4:
                continue
            model.box((x - 0.1, 0, z - 0.1), (x + 1.3, 0.05, z + 1.5), stuff.ENAMEL, skip="y")
            for left, right in ((x, x + 0.56), (x + 0.64, x + 1.2)):
                model.quad(rectangle((right, left), 0.06, (z, z + 1.4)), stuff.GLASS)
            model.box((x - 0.15, 0, z - 0.18), (x + 1.35, 0.14, z - 0.1), stuff.CONCRETE, skip="y")
