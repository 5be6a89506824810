"""The library: a reading hall with tall windows, and the dim stacks beside it.

The hall lies at x 4 to 18 and y -11.3 to -0.3, the stacks west of it at x -8 to 3.7.
"""

from __future__ import annotations

import itertools

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
    card_catalogue,
    chair,
    closed_books,
    globe,
    notice_board,
    open_book,
    reading_table,
    school_bag,
    service_desk,
    wall_clock,
    waste_bin,
)
from evenlight.stimuli.scenes.content.school.shelves import CASE_WIDTH, book_trolley, bookcase, stack_row
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.shapes import rectangle

HALL_TOP, STACKS_TOP = 5.2, 2.9  # [m]
TALL_WINDOWS = tuple(WallOpening(x, x + 2.1, 0.75, 4.6, 3, 5) for x in (1.0, 4.4, 7.5, 10.9))
TABLES = tuple((x, y) for x in (7.4, 14.2) for y in (-3.7, -6.1, -8.4))
STACK_ROWS = (-10.65, -8.75, -6.85, -4.95, -3.05)
AISLES = (-9.7, -7.8, -5.9, -4.0)  # y, between the rows


def add_library(model: SceneModel) -> None:
    """Build the hall and the stacks."""
    _hall_shell(model)
    _hall_furniture(model)
    _stacks(model)
    model.place("reading hall", (4.0, -11.3, 0.0), (18.0, -0.3, HALL_TOP))
    model.place("window bay", (4.0, -11.3, 0.0), (18.0, -9.2, 4.6))
    model.place("stacks", (-8.0, -11.3, 0.0), (3.7, -0.3, STACKS_TOP))
    model.walkable((4.6, -10.25), (17.4, -9.55))
    model.walkable((9.4, -10.1), (12.2, -2.1))
    model.walkable((9.4, -2.5), (16.2, -1.9))
    model.walkable((9.4, -3.1), (12.7, -1.95))
    model.walkable((14.3, -2.5), (15.5, 1.0))
    model.walkable((13.0, -2.5), (15.5, -1.6))
    model.walkable((4.6, -10.1), (5.8, -4.9))
    model.walkable((4.8, -2.5), (9.8, -1.5))
    model.walkable((4.75, -5.4), (5.6, -1.5))
    model.walkable((3.2, -6.6), (5.4, -5.2))
    for y in AISLES:
        model.walkable((-7.4, y - 0.3), (3.4, y + 0.3))
    model.walkable((2.2, -10.8), (3.3, -0.8))
    model.walkable((-7.4, -10.8), (-6.1, -0.7))
    model.walkable((-6.95, -1.0), (-6.15, 1.2))


def _hall_shell(model: SceneModel) -> None:
    """Put up walls, windows, floor and ceiling of the hall."""
    floor(model, (4.0, -11.3), (18.0, -0.3), stuff.PARQUET)
    floor(model, (14.0, -0.3), (15.8, 0.0), stuff.PARQUET)
    ceiling(model, (4.0, -11.3), (18.0, -0.3), HALL_TOP, stuff.PAINT)
    dark = Faces(stuff.HALL_WALL, stuff.BRICK, frame=(0.82, 0.82, 0.78))
    wall(model, ((3.7, -11.45), (18.3, -11.45)), (0.0, 5.6), dark, [_moved(o, 0.3) for o in TALL_WINDOWS])
    wall(model, ((18.15, -11.6), (18.15, 0.0)), (0.0, 5.6), dark)
    doors = [WallOpening(2.2, 4.0, 0.0, 2.3)]  # from x = 18: between 14.0 and 15.8
    wall(model, ((18.0, -0.15), (4.0, -0.15)), (0.0, 5.6), Faces(stuff.HALL_WALL, stuff.CORRIDOR_WALL), doors)
    inner = Faces(stuff.STACKS_WALL, stuff.HALL_WALL, frame=(0.3, 0.19, 0.1))
    wall(model, ((3.85, -11.3), (3.85, -0.3)), (0.0, 5.6), inner, [WallOpening(4.2, 6.6, 0.0, 2.5)])
    model.box((3.7, -11.6, 5.6), (18.3, 0.0, 5.75), stuff.PAINT, tint=(0.45, 0.45, 0.44))
    model.box((3.6, -11.7, 5.45), (18.4, 0.1, 5.6), stuff.ENAMEL, tint=(0.3, 0.32, 0.33))
    for x in (4.05, 7.55, 11.0, 14.45, 17.75):
        model.box((x - 0.15, -11.3, 4.85), (x + 0.2, -0.3, HALL_TOP), stuff.DARK_OAK, skip="yYZ")
    for y in (-8.55, -5.8, -3.05):
        model.box((4.0, y - 0.08, 4.98), (18.0, y + 0.08, HALL_TOP), stuff.DARK_OAK, skip="xXZ")
    for o in TALL_WINDOWS:
        left, right = 3.7 + o.left + 0.3, 3.7 + o.right + 0.3
        y = -11.45
        model.window([(left, y, o.bottom), (left, y, o.top), (right, y, o.top), (right, y, o.bottom)])
        for x in (left - 0.32, right - 0.08):
            _curtain(model, (x, x + 0.4), (0.3, 4.85), -11.2)


def _moved(opening: WallOpening, by: float) -> WallOpening:
    """Return an opening shifted along its wall."""
    return WallOpening(
        opening.left + by, opening.right + by, opening.bottom, opening.top, opening.across, opening.up
    )


def _curtain(model: SceneModel, across: tuple[float, float], levels: tuple[float, float], y: float) -> None:
    """Hang a curtain in folds, seen from +y."""
    x = np.linspace(across[1], across[0], 17)
    depth = y + 0.05 * np.sin(np.arange(17) * np.pi / 2) + 0.05
    points = np.array([(a, d, z) for z in levels for a, d in zip(x, depth, strict=True)])
    k = np.arange(16)
    triangles = np.concatenate([np.stack([k, k + 1, k + 18], 1), np.stack([k, k + 18, k + 17], 1)])
    model.mesh(points, triangles, stuff.CLOTH, tint=(0.42, 0.1, 0.08))


def _hall_furniture(model: SceneModel) -> None:
    """Furnish the hall: tables in two files, cases along the walls, desk, catalogue, globe."""
    rng = model.rng_for("reading hall")
    for x, y in TABLES:
        with model.at((x, y, 0.0)):
            reading_table(model)
            _sat_at(model, rng)
    for place, turn, cases in (
        ((18.0, -1.3, 0), -90.0, 10), ((4.0, -4.3, 0), 90.0, 4),
        ((4.0, -11.0, 0), 90.0, 4), ((4.45, -0.3, 0), 0.0, 5),
    ):  # fmt: skip
        with model.at(place, turn):
            bookcase(model, rng, cases, 7)
    with model.at((11.3, -1.25, 0.0)):
        service_desk(model, rng)
        with model.at((0.3, 0.62, 0.0), 10.0):
            chair(model, stuff.VINYL, (0.08, 0.09, 0.12))
    with model.at((16.8, -0.62, 0.0)):
        card_catalogue(model)
    with model.at((16.9, -10.6, 0.0)):
        globe(model)
    with model.at((9.9, -3.1, 0.0), 75.0):
        book_trolley(model, rng)
    _window_bay(model, rng)
    _hall_walls(model)


def _sat_at(model: SceneModel, rng: np.random.Generator) -> None:
    """Put chairs around a table, and what readers leave on it."""
    for side in (-1, 1):
        for x in (-0.75, 0.0, 0.75):
            pull = rng.uniform(0.0, 0.16)
            with model.at((x, side * (0.62 + pull), 0.0), (0.0 if side > 0 else 180.0) + rng.normal(0, 7)):
                chair(model)
            if rng.random() < 0.55:
                with model.at((x + rng.normal(0, 0.05), side * 0.28, 0.757), rng.normal(0, 12)):
                    open_book(model, rng.uniform(0.05, 0.45, 3).tolist())
            elif rng.random() < 0.6:
                with model.at((x + 0.1, side * 0.25, 0.755)):
                    closed_books(model, rng, int(rng.integers(1, 5)))


def _window_bay(model: SceneModel, rng: np.random.Generator) -> None:
    """Add seats under the windows, with cushions, and things left on them."""
    for o in TALL_WINDOWS:
        left, right = 4.0 + o.left, 4.0 + o.right
        model.box((left, -11.3, 0.0), (right, -10.75, 0.42), stuff.OAK, skip="zy")
        for k in range(3):
            x = left + 0.05 + k * 0.68
            tint = ((0.5, 0.14, 0.1), (0.12, 0.3, 0.33), (0.6, 0.42, 0.12))[int(rng.integers(3))]
            model.box((x, -11.2, 0.42), (x + 0.62, -10.78, 0.52), stuff.CLOTH, skip="z", tint=tint)
        with model.at((left + 1.0 + rng.normal(0, 0.3), -10.95, 0.52), rng.normal(0, 30)):
            closed_books(model, rng, 3)
    with model.at((10.75, -10.75, 0.0), 180.0):
        school_bag(model, (0.2, 0.32, 0.14))
    for x, tall in ((7.55, 1.5), (14.15, 1.7)):
        _pot_plant(model, rng, (x, -10.85), tall)


def _pot_plant(model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float) -> None:
    """Add a rubber plant in a pot: leaves as bent blades around a stem."""
    with model.at((*place, 0.0)):
        model.cylinder(
            (0, 0, 0), (0, 0, 0.38), (0.14, 0.2), stuff.ENAMEL, segments=16, tint=(0.55, 0.24, 0.14)
        )
        model.cylinder((0, 0, 0.3), (0, 0, tall), 0.015, stuff.DARK_OAK, segments=6, caps=False)
        for leaf in range(26):
            height = 0.5 + (tall - 0.45) * leaf / 26
            green = (0.14, rng.uniform(0.34, 0.5), 0.11)
            with model.at((0, 0, height), 137.5 * leaf, tilt=rng.uniform(10, 45)):
                reach, wide = rng.uniform(0.22, 0.34), 0.06
                blade = [
                    (0.02, 0, 0),
                    (0.5 * reach, -wide, 0.03),
                    (reach, 0, -0.04),
                    (0.5 * reach, wide, 0.03),
                ]
                model.mesh(blade, [(0, 1, 2), (0, 2, 3), (2, 1, 0), (3, 2, 0)], stuff.VINYL, tint=green)


def _hall_walls(model: SceneModel) -> None:
    """Hang pictures, posters, the clock and the ceiling lamps of the hall."""
    for x in (5.4, 7.6):
        with model.at((x, -0.3, 3.4)):
            picture(model, stuff.PAINTING, (1.5, 1.1), 0.08)
    for y in (-3.0, -5.8, -8.6):
        with model.at((18.0, y, 3.5), -90.0):
            picture(model, stuff.PAINTING, (1.6, 1.15), 0.08)
    with model.at((11.2, -0.3, 3.0)):
        wall_clock(model)
    with model.at((9.6, -0.3, 1.75)):
        picture(model, stuff.WALL_POSTERS["reading"], (0.8, 1.0))
    with model.at((13.0, -0.3, 1.75)):
        picture(model, stuff.WALL_POSTERS["map"], (1.2, 1.0))
    with model.at((4.0, -5.9, 3.6), 90.0):
        picture(model, stuff.WALL_POSTERS["planets"], (1.8, 1.4), 0.06)
    with model.at((13.3, -0.6, 0.0)):
        waste_bin(model)
    for x in (5.8, 9.3, 12.7, 16.1):
        for y in (-1.9, -5.2, -8.5):
            panel_lamp(model, (x, y), 3.9, (1.5, 0.4), 1300.0)
            for end in (-0.5, 0.5):
                model.cylinder(
                    (x + end, y, 3.96), (x + end, y, HALL_TOP), 0.008, stuff.ENAMEL, segments=5, caps=False
                )
    # A runner leads from the door to the windows.
    floor(model, (10.2, -10.4), (11.4, -2.2), stuff.CLOTH, 0.006, (0.36, 0.07, 0.06))
    for edge in (10.26, 11.24):
        floor(model, (edge, -10.34), (edge + 0.1, -2.26), stuff.CLOTH, 0.01, (0.55, 0.4, 0.12))


def _stacks(model: SceneModel) -> None:
    """Build the stacks: rows of racks, steps, weak lamps."""
    rng = model.rng_for("stacks")
    floor(model, (-8.0, -11.3), (4.0, -0.3), stuff.STACKS_FLOOR)
    floor(model, (-7.3, -0.3), (-5.8, 0.0), stuff.STACKS_FLOOR)
    ceiling(model, (-8.0, -11.3), (3.7, -0.3), STACKS_TOP, stuff.STACKS_WALL)
    faces = Faces(stuff.STACKS_WALL, stuff.BRICK)
    wall(model, ((-8.3, -11.45), (3.7, -11.45)), (0.0, 3.5), faces)
    wall(model, ((-8.15, 0.0), (-8.15, -11.6)), (0.0, 3.5), faces)
    # From x = 4: the door is between -7.3 and -5.8.
    inner, doors = Faces(stuff.STACKS_WALL, stuff.CORRIDOR_WALL), [WallOpening(9.8, 11.3, 0.0, 2.2)]
    wall(model, ((4.0, -0.15), (-8.0, -0.15)), (0.0, 3.5), inner, doors)
    model.box((-8.36, -11.66, 3.2), (3.7, -0.05, 3.5), stuff.ENAMEL, tint=(0.35, 0.35, 0.35))
    for y in STACK_ROWS:
        with model.at((-5.6, y, 0.0)):
            stack_row(model, rng, 8)
            _shelf_marks(model, STACK_ROWS.index(y))
    # Weak, but one for every few steps: nothing is too dark for a dimmed display to show.
    for x, y in itertools.product((-6.75, -4.0, -0.6, 2.75), AISLES):
        panel_lamp(model, (x, y), 2.78, (1.2, 0.15), 270.0)
    _stacks_things(model, rng)


def _shelf_marks(model: SceneModel, row: int) -> None:
    """Put a sign at both ends of a rack: which books stand there."""
    low, high = 1 - (row + 1) / len(STACK_ROWS), 1 - row / len(STACK_ROWS)
    uvs = [(0, low), (1, low), (1, high), (0, high)]
    for x, side in ((8 * CASE_WIDTH + 0.035, 1), (-0.035, -1)):
        corners = rectangle(x, (-0.24 * side, 0.24 * side), (1.55, 1.72))
        model.quad(corners, stuff.SHELF_MARKS, uvs=uvs)


def _stacks_things(model: SceneModel, rng: np.random.Generator) -> None:
    """Leave steps, boxes of books, a study nook and posters in the stacks."""
    with model.at((-7.55, -8.3, 0.0), 90.0):
        model.box((-0.4, -0.4, 0.72), (0.4, 0.4, 0.75), stuff.OAK)
        for x in (-0.38, 0.34):
            model.box((x, -0.38, 0), (x + 0.04, 0.38, 0.72), stuff.OAK, skip="zZ")
        with model.at((0.0, 0.0, 0.75), 20.0):
            closed_books(model, rng, 6)
    with model.at((3.1, -2.2, 0.0), 100.0):
        book_trolley(model, rng)
    for x, y, tall in ((-7.6, -1.2, 0.3), (-7.6, -10.8, 0.36), (2.6, -10.8, 0.3)):
        with model.at((x, y, 0.0), rng.uniform(-15, 15)):
            model.box((-0.22, -0.2, 0), (0.22, 0.2, tall), stuff.PAINT, skip="z", tint=(0.5, 0.36, 0.2))
            with model.at((0.0, 0.0, tall)):
                closed_books(model, rng, 5)
    for y, kind, size in (
        (-5.9, "reading", (0.9, 1.1)),
        (-4.4, "paintings", (1.1, 1.1)),
        (-8.3, "map", (1.3, 1.1)),
    ):
        with model.at((-8.0, y, 1.7), 90.0):
            picture(model, stuff.WALL_POSTERS[kind], size, 0.03)
    with model.at((3.7, -3.7, 1.7), -90.0):
        picture(model, stuff.WALL_POSTERS["elements"], (1.3, 1.1), 0.03)
    with model.at((-8.0, -2.4, 1.6), 90.0):
        notice_board(model, rng, (1.7, 1.1))
    with model.at((1.9, -1.45, 0.0)):
        for step in range(3):
            low, high = (-0.25, -0.3 + 0.2 * step, 0), (0.25, -0.1 + 0.2 * step, 0.22 * (step + 1))
            model.box(low, high, stuff.ENAMEL, skip="z", tint=(0.5, 0.1, 0.07))
    with model.at((-7.75, -4.4, 0.0), 90.0):
        bench(model, 1.4)
    with model.at((-6.55, -0.3, 2.45)):
        picture(model, stuff.EXIT_SIGN, (0.5, 0.22))
    for x, kind in ((-4.9, "map"), (-3.3, "elements"), (-7.75, "timetable")):
        with model.at((x, -0.3, 1.7)):
            picture(model, stuff.WALL_POSTERS[kind], (0.4 if x < -7 else 1.2, 0.5 if x < -7 else 1.0), 0.03)
