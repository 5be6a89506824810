"""The corridor with its lockers, and the lobby that leads out to the yard.

The corridor lies at x -8 to 33 and y 0 to 3, the lobby south of it at x 18.3 to 24.7 and y -4 to -0.3.
"""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.content.school.building import (
    Faces,
    WallOpening,
    ceiling,
    floor,
    panel_lamp,
    picture,
    wall,
)
from evenlight.stimuli.scenes.content.school.furniture import (
    bench,
    extinguisher,
    lockers,
    notice_board,
    school_bag,
    wall_clock,
    waste_bin,
)
from evenlight.stimuli.scenes.engine.model import SceneModel

WEST, EAST, NORTH = -8.0, 33.0, 3.0  # [m]
TOP, LOBBY_TOP = 2.9, 3.1
CLASSROOM_DOORS = (-3.5, 3.6, 10.2, 16.6, 26.6)  # left edges, in the north wall


def add_corridor(model: SceneModel) -> None:
    """Build the corridor and the lobby."""
    _shell(model)
    _north_side(model)
    _south_side(model)
    _lobby(model)
    _lamps(model)
    model.place("corridor", (WEST, 0.0, 0.0), (EAST, NORTH, TOP))
    model.place("lobby", (18.3, -4.0, 0.0), (24.7, -0.3, LOBBY_TOP))
    model.walkable((WEST + 0.5, 0.85), (EAST - 0.5, 2.15))
    model.walkable((19.4, -3.8), (23.6, 1.0))
    model.walkable((20.2, -5.0), (22.8, -3.5))


def _shell(model: SceneModel) -> None:
    """Put up floor, ceiling and the walls that no room has built."""
    floor(model, (WEST, 0.0), (EAST, NORTH), stuff.TERRAZZO)
    ceiling(model, (WEST, 0.0), (EAST, NORTH), TOP)
    faces = Faces(stuff.CORRIDOR_WALL, stuff.BRICK)
    wall(model, ((EAST + 0.3, NORTH + 0.15), (WEST - 0.3, NORTH + 0.15)), (0.0, 3.5), faces)
    west = [WallOpening(0.4, 2.6, 0.05, 2.5, 2, 3)]  # from y = 3: a glazed end
    wall(model, ((WEST - 0.15, NORTH), (WEST - 0.15, 0.0)), (0.0, 3.5), faces, west)
    x = WEST - 0.15
    model.window([(x, 0.4, 0.05), (x, 0.4, 2.5), (x, 2.6, 2.5), (x, 2.6, 0.05)])
    faces = Faces(stuff.CORRIDOR_WALL, stuff.GYM_PANELS)
    wall(model, ((EAST + 0.15, 0.0), (EAST + 0.15, NORTH)), (0.0, 3.0), faces)
    for start, end in (
        ((-5.8, 0.0), (14.0, 0.0)),
        ((15.8, 0.0), (18.3, 0.0)),
        ((24.7, 0.0), (27.0, 0.0)),
        ((28.5, 0.0), (33.0, 0.0)),
    ):
        _dado(model, start[0], end[0], 0.0)
    edges = [WEST, *(edge for x in CLASSROOM_DOORS for edge in (x - 0.08, x + 1.03)), EAST]
    for left, right in zip(edges[::2], edges[1::2], strict=True):
        _dado(model, left, right, NORTH)


def _dado(model: SceneModel, left: float, right: float, y: float) -> None:
    """Paint the lower part of a wall, with a rail above it and a skirting below."""
    out = 0.012 if y == 0 else -0.012
    low, high = sorted((y, y + out))
    model.box((left, low, 0.1), (right, high, 1.2), stuff.DADO, skip="zZxX")
    model.box((left, low - 0.012, 1.2), (right, high + 0.012, 1.26), stuff.OAK, skip="xX")
    model.box(
        (left, low - 0.008, 0.0), (right, high + 0.008, 0.1), stuff.VINYL, skip="xXz", tint=(0.1, 0.1, 0.11)
    )


def _lamps(model: SceneModel) -> None:
    """Hang the lamps: some tubes are weak, those in the east above all: the corridor has darker stretches."""
    for k, x in enumerate(np.arange(WEST + 2.0, EAST, 3.0).tolist()):
        luminance = 700.0 if k % 3 == 2 else 1600.0 if x < 23 else 1000.0
        panel_lamp(model, (x, 1.5), TOP - 0.07, (1.2, 0.3), luminance)
    for x in (20.0, 23.0):
        panel_lamp(model, (x, -2.1), LOBBY_TOP - 0.07, (0.6, 0.6), 1000.0)


def _north_side(model: SceneModel) -> None:
    """Furnish the north wall, seen from the south: classroom doors, lockers between them, signs."""
    rng = model.rng_for("corridor")
    for x in CLASSROOM_DOORS:
        with model.at((x, NORTH, 0.0)):
            _classroom_door(model)
        with model.at((x + 1.3, NORTH, 1.7)):
            model.box((-0.14, -0.02, -0.08), (0.14, 0, 0.08), stuff.ENAMEL, skip="Y", tint=(0.1, 0.2, 0.3))
            model.box((-0.1, -0.024, -0.03), (0.1, -0.02, 0.03), stuff.ENAMEL, skip="Y")
    for start, count, front in (
        (-2.0, 16, stuff.LOCKERS),
        (5.3, 14, stuff.RED_LOCKERS),
        (11.9, 13, stuff.LOCKERS),
        (18.6, 22, stuff.RED_LOCKERS),
        (28.5, 12, stuff.LOCKERS),
    ):
        with model.at((start, NORTH, 0.0)):
            lockers(model, count, front)
            for _ in range(3):
                _on_top(model, rng, rng.uniform(0.3, count * 0.3 - 0.3))
    with model.at((25.95, NORTH, 1.65)):
        notice_board(model, rng, (1.1, 1.2))
    with model.at((-5.4, NORTH, 1.65)):
        notice_board(model, rng, (2.2, 1.2))
    for x in (-2.3, 17.9):
        with model.at((x, NORTH, 0.55)):
            extinguisher(model)


def _on_top(model: SceneModel, rng: np.random.Generator, x: float) -> None:
    """Leave a box, a ball or a folder on the lockers."""
    colour = rng.uniform(0.05, 0.6, 3).tolist()
    kind = rng.integers(3)
    if kind == 0:
        turn, carton = rng.uniform(-20, 20), (0.5, 0.36, 0.2)
        model.box((x, -0.35, 1.94), (x + 0.35, -0.1, 2.12), stuff.PAINT, turn=turn, skip="z", tint=carton)
    elif kind == 1:
        model.sphere((x, -0.22, 2.05), 0.11, stuff.VINYL, segments=16, tint=colour)
    else:
        turn = rng.uniform(-20, 20)
        model.box((x, -0.4, 1.94), (x + 0.32, -0.16, 2.0), stuff.VINYL, turn=turn, skip="z", tint=colour)


def _classroom_door(model: SceneModel) -> None:
    """Add a closed door, 0.95 m wide, with a pane that shows a dim classroom."""
    model.box((-0.07, -0.04, 0), (0.0, 0, 2.15), stuff.ENAMEL, skip="zY", tint=(0.75, 0.73, 0.66))
    model.box((0.95, -0.04, 0), (1.02, 0, 2.15), stuff.ENAMEL, skip="zY", tint=(0.75, 0.73, 0.66))
    model.box((0, -0.04, 2.07), (0.95, 0, 2.15), stuff.ENAMEL, skip="xXY", tint=(0.75, 0.73, 0.66))
    model.box((0, -0.02, 0.01), (0.95, 0, 2.07), stuff.OAK, skip="xXY")
    with model.at((0.68, -0.012, 1.5)):
        picture(model, stuff.CLASSROOM, (0.3, 0.8), 0.025)
    model.box((0.06, -0.03, 0.03), (0.89, -0.02, 0.28), stuff.STEEL, skip="Y")
    model.box((0.07, -0.035, 0.95), (0.12, -0.02, 1.15), stuff.STEEL, skip="Y")
    model.cylinder((0.095, -0.07, 1.05), (0.21, -0.07, 1.05), 0.011, stuff.STEEL, segments=8)
    model.cylinder((0.095, -0.02, 1.05), (0.095, -0.075, 1.05), 0.011, stuff.STEEL, segments=8)


def _south_side(model: SceneModel) -> None:
    """Furnish the south wall, seen from the north: boards, posters, benches, bags, clock, doors' leaves."""
    rng = model.rng_for("corridor south")
    with model.at((0.5, 0.0, 1.7), 180.0):
        notice_board(model, rng, (2.6, 1.2))
    for x, kind, wide in (
        (3.4, "elements", 1.3),
        (6.2, "planets", 0.9),
        (7.6, "reading", 0.8),
        (11.6, "map", 1.3),
        (17.2, "sports", 0.9),
        (26.0, "timetable", 0.8),
        (30.0, "sports", 0.9),
        (31.6, "elements", 1.1),
    ):
        with model.at((x, 0.0, 1.35 + wide / 2), 180.0):
            picture(model, stuff.WALL_POSTERS[kind], (wide, wide))
    for x, count in ((9.6, 3), (-3.0, 2)):
        for k in range(count):
            with model.at((x + 0.75 * (k - 1), 0.0, 1.8 + 0.05 * (k % 2)), 180.0):
                picture(model, stuff.WALL_POSTERS["paintings"], (0.62, 0.62))
    for x in (1.0, 9.0, 30.6):
        with model.at((x, 0.28, 0.0), 180.0):
            bench(model, 1.9)
        with model.at((x + rng.uniform(-0.6, 0.6), 0.12, 0.46), 180.0 + rng.normal(0, 10)):
            school_bag(model, rng.uniform(0.05, 0.5, 3).tolist())
        with model.at((x + 1.25, 0.06, 0.0), 180.0 + rng.normal(0, 10)):
            school_bag(model, rng.uniform(0.05, 0.5, 3).tolist())
    for x in (4.9, 17.6, 29.0):
        with model.at((x, 0.27, 0.0)):
            waste_bin(model)
    with model.at((13.2, 0.0, 2.35), 180.0):
        wall_clock(model)
    with model.at((14.9, 0.0, 2.5), 180.0):
        model.box((-0.55, -0.03, -0.12), (0.55, 0, 0.12), stuff.ENAMEL, skip="Y", tint=(0.35, 0.19, 0.08))
    _open_leaf(model, (14.02, 0.07), 176.0)
    _open_leaf(model, (15.78, 0.07), 4.0)
    # The corridor's east end: a tiled drinking fountain under a poster.
    with model.at((EAST, 1.5, 0.0), -90.0):
        model.box((-0.8, -0.015, 0.1), (0.8, 0, 1.5), stuff.WALL_TILES, skip="zY")
        model.box((-0.5, -0.4, 0.7), (0.5, -0.015, 0.9), stuff.ENAMEL, tint=(0.9, 0.9, 0.88))
        model.cylinder((0, -0.1, 0.9), (0, -0.16, 1.08), 0.015, stuff.STEEL, segments=8)
    with model.at((EAST, 1.5, 2.1), -90.0):
        picture(model, stuff.WALL_POSTERS["sports"], (0.9, 0.9))


def _open_leaf(model: SceneModel, hinge: tuple[float, float], turn: float) -> None:
    """Add an open leaf of a door, 0.86 m wide, with a pane, a handle and a kick plate on both sides."""
    with model.at((*hinge, 0.0), turn):
        model.box((0.0, -0.02, 0.01), (0.86, 0.02, 2.2), stuff.OAK)
        for low, high in (
            ((0.3, 1.15), (0.56, 1.95)),
            ((0.06, 0.03), (0.8, 0.28)),
            ((0.74, 0.9), (0.8, 1.15)),
        ):
            pane = stuff.GLASS if low[1] > 1 else stuff.STEEL
            model.box((low[0], -0.028, low[1]), (high[0], 0.028, high[1]), pane)
        for y in (-0.07, 0.07):
            model.cylinder((0.77, 0, 1.05), (0.77, y, 1.05), 0.012, stuff.STEEL, segments=8, caps=False)
            model.cylinder((0.78, y, 1.05), (0.66, y, 1.05), 0.012, stuff.STEEL, segments=8)


def _lobby(model: SceneModel) -> None:
    """Build the lobby: wide to the corridor, glazed doors to the yard, a mat, boards, a sign."""
    rng = model.rng_for("lobby")
    floor(model, (18.3, -4.0), (24.7, 0.0), stuff.TERRAZZO)
    ceiling(model, (18.3, -4.0), (24.7, -0.3), LOBBY_TOP)
    inside = Faces(stuff.CORRIDOR_WALL, stuff.CORRIDOR_WALL, frame=(0.35, 0.22, 0.12))
    wall(model, ((24.85, -0.15), (18.15, -0.15)), (0.0, 3.5), inside, [WallOpening(0.9, 5.8, 0.0, 2.55)])
    front = Faces(stuff.CORRIDOR_WALL, stuff.BRICK, frame=(0.12, 0.24, 0.22))
    holes = [
        WallOpening(0.35, 1.75, 0.5, 2.6, 1, 2),
        WallOpening(2.0, 4.6, 0.0, 2.6),
        WallOpening(4.85, 6.2, 0.5, 2.6, 1, 2),
    ]
    wall(model, ((18.15, -4.15), (24.85, -4.15)), (0.0, 3.9), front, holes)
    for hole in holes:
        left, right = 18.15 + hole.left, 18.15 + hole.right
        low, high = hole.bottom, hole.top
        model.window([(left, -4.15, low), (left, -4.15, high), (right, -4.15, high), (right, -4.15, low)])
    wall(model, ((18.45, 0.0), (18.45, -4.0)), (0.0, 3.1), Faces(stuff.CORRIDOR_WALL, stuff.CORRIDOR_WALL))
    wall(model, ((24.85, -4.3), (24.85, -0.3)), (0.0, 3.9), Faces(stuff.CORRIDOR_WALL, stuff.WALL_TILES))
    model.box((18.2, -4.5, 3.25), (24.9, -0.05, 3.5), stuff.ENAMEL, tint=(0.3, 0.32, 0.33))
    floor(model, (20.0, -3.7), (23.0, -2.2), stuff.CLOTH, 0.008, (0.12, 0.12, 0.13))
    for x, turn in ((20.2, -97.0), (22.7, -83.0)):
        _glazed_leaf(model, (x, -4.2), turn)
    with model.at((21.5, -0.3, 2.8)):
        picture(model, stuff.EXIT_SIGN, (0.6, 0.25))
    with model.at((21.5, 0.0, 2.72), 180.0):
        picture(model, stuff.EXIT_SIGN, (0.6, 0.25))
    with model.at((18.6, -2.2, 1.6), 90.0):
        notice_board(model, rng, (2.2, 1.3))
    with model.at((24.7, -2.0, 0.0), -90.0):
        _trophies(model, rng)
    with model.at((18.95, -2.2, 0.0), 90.0):
        bench(model, 2.2)


def _glazed_leaf(model: SceneModel, hinge: tuple[float, float], turn: float) -> None:
    """Add an open glazed door: a frame, a cross bar, a push plate."""
    green = (0.12, 0.24, 0.22)
    with model.at((*hinge, 0.0), turn):
        for low, high in (
            ((0, -0.03, 0), (0.12, 0.03, 2.5)),
            ((1.1, -0.03, 0), (1.22, 0.03, 2.5)),
            ((0.12, -0.03, 0), (1.1, 0.03, 0.3)),
            ((0.12, -0.03, 2.38), (1.1, 0.03, 2.5)),
            ((0.12, -0.03, 1.0), (1.1, 0.03, 1.12)),
        ):
            model.box(low, high, stuff.ENAMEL, tint=green)
        model.box((0.14, -0.07, 1.04), (1.08, -0.045, 1.08), stuff.STEEL)


def _trophies(model: SceneModel, rng: np.random.Generator) -> None:
    """Add a cabinet with cups, its back at the wall behind it."""
    model.box((-1.1, -0.4, 0), (1.1, 0, 0.8), stuff.OAK, skip="zY")
    for x in (-1.1, -0.02, 1.06):
        model.box((x, -0.4, 0.8), (x + 0.04, -0.36, 1.95), stuff.OAK, skip="zZ")
    model.box((-1.12, -0.42, 1.95), (1.12, 0, 2.02), stuff.OAK)
    model.box((-1.1, -0.02, 0.8), (1.1, 0, 1.95), stuff.GLASS, skip="Y", tint=(0.4, 0.4, 0.5))
    model.box((-1.06, -0.36, 1.38), (1.06, -0.02, 1.4), stuff.STEEL)
    for k in range(9):
        for z in (0.8, 1.4):
            x, tall = -0.95 + 0.24 * k + rng.normal(0, 0.02), rng.uniform(0.16, 0.36)
            tint = ((0.85, 0.62, 0.2), (0.8, 0.8, 0.82), (0.6, 0.35, 0.18))[int(rng.integers(3))]
            black = (0.03, 0.03, 0.03)
            model.box((x - 0.045, -0.24, z), (x + 0.045, -0.15, z + 0.05), stuff.VINYL, skip="z", tint=black)
            low, middle, high = ((x, -0.195, level) for level in (z + 0.05, z + tall * 0.5, z + tall))
            model.cylinder(low, middle, 0.014, stuff.STEEL, segments=7, caps=False, tint=tint)
            model.cylinder(middle, high, (0.02, 0.06), stuff.STEEL, segments=10, caps=False, tint=tint)
