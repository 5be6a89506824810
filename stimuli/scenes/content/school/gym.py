"""The gym hall: a court with two baskets under high windows, apparatus along the walls.

It lies at x 33.3 to 55.3 and y -12.3 to 2.7.
"""

from __future__ import annotations

import itertools

import numpy as np

from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.content.school.building import Faces, WallOpening, ceiling, floor, picture, wall
from evenlight.stimuli.scenes.content.school.equipment import (
    ball,
    ball_rack,
    basket,
    crash_mat,
    rings,
    rope,
    vaulting_box,
    wall_bars,
)
from evenlight.stimuli.scenes.content.school.furniture import bench, school_bag
from evenlight.stimuli.scenes.engine.model import SceneModel

LOW, HIGH, TOP = (33.3, -12.3), (55.3, 2.7), 7.4  # [m]
PANELS = 3.0  # [m], up to where the walls are of wood
COURT = ((35.3, -11.1), (53.3, 1.5))
MIDDLE = (44.3, -4.8)
WHITE, RED, BLUE, GREEN, YELLOW = (
    (0.9, 0.9, 0.88),
    (0.62, 0.06, 0.05),
    (0.04, 0.14, 0.5),
    (0.05, 0.3, 0.1),
    (0.85, 0.6, 0.06),
)
LINE_HEIGHTS = {RED: 0.004, BLUE: 0.0048, GREEN: 0.0056, WHITE: 0.0064}  # [m]: where lines cross, one wins
HIGH_WINDOWS = tuple(WallOpening(x, x + 2.6, 3.7, 6.6, 4, 3) for x in (1.2, 4.8, 8.4, 12.0, 15.6, 19.2))


def add_gym(model: SceneModel) -> None:
    """Build and furnish the gym."""
    _shell(model)
    _court(model)
    _apparatus(model)
    _ceiling(model)
    model.place("gym", (*LOW, 0.0), (*HIGH, TOP))
    model.walkable((33.9, -4.3), (36.0, -3.3))
    model.walkable((35.5, -10.6), (53.0, 0.6))


def _shell(model: SceneModel) -> None:
    """Put up the walls in two storeys: wood below, plaster and windows above."""
    floor(model, LOW, HIGH, stuff.GYM_FLOOR)
    ceiling(model, LOW, HIGH, TOP, stuff.PAINT)
    (left, south), (right, north) = LOW, HIGH
    out = 0.15
    below, above = (
        Faces(stuff.GYM_PANELS, stuff.BRICK),
        Faces(stuff.GYM_WALL, stuff.BRICK, frame=(0.2, 0.23, 0.24)),
    )
    ends = ((left, south - out), (right, south - out))
    wall(model, ends, (0.0, PANELS), below)
    wall(model, ends, (PANELS, TOP + 0.4), above, HIGH_WINDOWS)
    for start, stop in (
        ((right + out, south - 0.3), (right + out, north)),
        ((right + 0.3, north + out), (left - 0.3, north + out)),
    ):
        wall(model, (start, stop), (0.0, PANELS), below)
        wall(model, (start, stop), (PANELS, TOP + 0.4), above)
    wall(model, ((left - out, -6.3), (left - out, south - 0.3)), (0.0, PANELS), below)
    wall(model, ((left - out, north), (left - out, south - 0.3)), (PANELS, TOP + 0.4), above)
    for hole in HIGH_WINDOWS:
        a, b, y = left + hole.left, left + hole.right, south - out
        model.window([(a, y, hole.bottom), (a, y, hole.top), (b, y, hole.top), (b, y, hole.bottom)])
    low, high = (left - 0.4, south - 0.4, TOP + 0.4), (right + 0.4, north + 0.4, TOP + 0.6)
    model.box(low, high, stuff.ENAMEL, tint=(0.3, 0.32, 0.33))


def _strip(
    model: SceneModel,
    start: tuple[float, float],
    end: tuple[float, float],
    colour: tuple[float, float, float],
) -> None:
    """Paint a straight line on the floor, 5 cm wide."""
    along = np.subtract(end, start)
    side = np.array([-along[1], along[0]]) / np.hypot(*along) * 0.025
    z = LINE_HEIGHTS[colour]
    corners = [np.array(start) - side, np.array(end) - side, np.array(end) + side, np.array(start) + side]
    model.quad([(x, y, z) for x, y in corners], stuff.PAINT, tint=colour)


def _arc(
    model: SceneModel,
    centre: tuple[float, float],
    radius: float,
    turns: tuple[float, float],
    colour: tuple[float, float, float],
) -> None:
    """Paint an arc on the floor, 5 cm wide, between two angles from x [degrees]."""
    steps = max(int(abs(turns[1] - turns[0]) / 7.5), 2)
    angle = np.radians(np.linspace(*turns, steps + 1))
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.add(centre, r * circle) for r in (radius - 0.025, radius + 0.025)])
    k = np.arange(steps)
    triangles = np.concatenate(
        [np.stack([k, k + steps + 1, k + steps + 2], 1), np.stack([k, k + steps + 2, k + 1], 1)]
    )
    model.mesh(
        np.column_stack([points, np.full(len(points), LINE_HEIGHTS[colour])]),
        triangles,
        stuff.PAINT,
        tint=colour,
    )


def _rectangle(
    model: SceneModel, low: tuple[float, float], high: tuple[float, float], colour: tuple[float, float, float]
) -> None:
    """Paint the outline of a rectangle on the floor."""
    corners = [low, (high[0], low[1]), high, (low[0], high[1]), low]
    for start, end in itertools.pairwise(corners):
        _strip(model, start, end, colour)


def _court(model: SceneModel) -> None:
    """Paint the courts: basketball in red, volleyball in blue, badminton in green, the zones filled."""
    (left, south), (right, north) = COURT
    x, y = MIDDLE
    _rectangle(model, *COURT, RED)
    _strip(model, (x, south), (x, north), RED)
    _arc(model, MIDDLE, 1.8, (0, 360), RED)
    for end, inward in ((left, 1), (right, -1)):
        line = end + 5.8 * inward
        zone = [(end, y - 1.8), (line, y - 1.8), (line, y + 1.8), (end, y + 1.8)][::inward]
        model.quad([(a, b, 0.003) for a, b in zone], stuff.PAINT, tint=(0.36, 0.09, 0.05))
        for side in (-1.8, 1.8):
            _strip(model, (end, y + side), (line, y + side), WHITE)
        _strip(model, (line, y - 1.8), (line, y + 1.8), WHITE)
        _arc(model, (line, y), 1.8, (-90, 90) if inward > 0 else (90, 270), WHITE)
        _arc(model, (end + 1.4 * inward, y), 5.6, (-80, 80) if inward > 0 else (100, 260), RED)
    _rectangle(model, (x - 7.5, y - 4.5), (x + 7.5, y + 4.5), BLUE)
    for side in (-3, 3):
        _strip(model, (x + side, y - 4.5), (x + side, y + 4.5), BLUE)
    _rectangle(model, (x - 6.7, y - 3.05), (x + 6.7, y + 3.05), GREEN)
    _strip(model, (x - 6.7, y), (x - 2, y), GREEN)
    _strip(model, (x + 2, y), (x + 6.7, y), GREEN)


def _apparatus(model: SceneModel) -> None:
    """Set up baskets, wall bars, boxes, mats, benches and balls."""
    rng = model.rng_for("gym")
    for place, turn in (((LOW[0], MIDDLE[1], 0), 90.0), ((HIGH[0], MIDDLE[1], 0), -90.0)):
        with model.at(place, turn):
            basket(model)
    for x in np.arange(36.4, 47.0, 0.95):
        with model.at((float(x), HIGH[1], 0.0)):
            wall_bars(model)
    for y in (-11.2, -10.25, -9.3, -8.35):
        with model.at((HIGH[0], y, 0.0), -90.0):
            wall_bars(model)
    with model.at((49.2, 0.2, 0.0), 20.0):
        vaulting_box(model)
    with model.at((47.2, -0.6, 0.0), 20.0):
        crash_mat(model, (2.0, 1.2, 0.06), BLUE)
    for k in range(6):
        with model.at((53.6, 1.3, 0.07 * k), 90.0 + rng.normal(0, 1.5)):
            crash_mat(model, (2.0, 1.2, 0.065), (BLUE, GREEN)[k % 2])
    with model.at((51.3, 2.65, 0.0)):
        model.box((-0.9, -0.3, 0.0), (0.9, 0.0, 1.9), stuff.VINYL, skip="z", tint=(0.05, 0.2, 0.45))
        model.box((-0.9, -0.31, 0.92), (0.9, -0.3, 0.98), stuff.VINYL, skip="Y", tint=WHITE)
    with model.at((54.6, -2.3, 0.0), 90.0):
        ball_rack(model, rng)
    for x, y, kind in ((46.3, -6.4, 0), (40.7, -2.2, 0), (47.8, -4.0, 1), (38.2, -8.8, 2)):
        with model.at((x, y, 0.0), rng.uniform(0, 360)):
            ball(model, kind)
    for x in (37.5, 41.5, 45.5):
        with model.at((x, -11.95, 0.0), 180.0):
            bench(model, 3.4)
    for x in (38.4, 45.0):
        with model.at((x, -11.75, 0.0), 180.0):
            school_bag(model, rng.uniform(0.1, 0.5, 3).tolist())
    _team_goal(model)
    _signs(model)


def _team_goal(model: SceneModel) -> None:
    """Add a hurdle course: cones in four colours and two hoops on the floor."""
    for x, y, colour in ((50.0, -9.3, RED), (48.6, -9.6, YELLOW), (47.2, -9.3, BLUE), (51.2, -9.7, GREEN)):
        model.cylinder((x, y, 0.02), (x, y, 0.32), (0.1, 0.02), stuff.VINYL, segments=14, tint=colour)
        model.box((x - 0.13, y - 0.13, 0), (x + 0.13, y + 0.13, 0.025), stuff.VINYL, skip="z", tint=colour)
    for x, y, colour in ((49.3, -8.0, YELLOW), (51.0, -7.6, RED)):
        angle = np.linspace(0, 2 * np.pi, 29)
        for a, b in itertools.pairwise(angle):
            ends = [(x + 0.4 * np.cos(t), y + 0.4 * np.sin(t), 0.015) for t in (a, b)]
            model.cylinder(ends[0], ends[1], 0.013, stuff.VINYL, segments=5, caps=False, tint=colour)


def _signs(model: SceneModel) -> None:
    """Hang scoreboard, banners and exit signs."""
    with model.at((HIGH[0], MIDDLE[1], 5.7), -90.0):
        model.box((-1.7, -0.15, -0.85), (1.7, 0, 0.85), stuff.ENAMEL, skip="Y", tint=(0.05, 0.05, 0.06))
        with model.at((0.0, -0.15, 0.0)):
            picture(model, stuff.SCOREBOARD, (3.2, 1.6))
    for x, colour in ((36.0, RED), (38.0, BLUE), (40.0, GREEN), (48.5, YELLOW), (50.5, RED), (52.5, BLUE)):
        model.box(
            (x - 0.45, HIGH[1] - 0.02, 4.0), (x + 0.45, HIGH[1], 5.9), stuff.VINYL, skip="Y", tint=colour
        )
        y = HIGH[1]
        model.box((x - 0.25, y - 0.026, 4.8), (x + 0.25, y - 0.02, 5.3), stuff.VINYL, skip="Y", tint=WHITE)
        model.box((x - 0.45, y - 0.026, 4.1), (x + 0.45, y - 0.02, 4.22), stuff.VINYL, skip="Y", tint=WHITE)
    with model.at((44.2, HIGH[1], 4.9)):
        picture(model, stuff.WALL_POSTERS["sports"], (2.4, 2.4), 0.08)
    with model.at((LOW[0], -3.75, 2.62), 90.0):
        picture(model, stuff.EXIT_SIGN, (0.6, 0.25))
    with model.at((HIGH[0], -0.6, 0.0), -90.0):
        model.box((-0.95, -0.04, 0.0), (0.95, 0, 2.3), stuff.OAK, skip="zY")
        model.box((-0.01, -0.045, 0.0), (0.01, -0.04, 2.3), stuff.ENAMEL, skip="zY", tint=(0.1, 0.08, 0.05))
        for x in (-0.75, 0.1):
            model.box((x, -0.08, 1.0), (x + 0.65, -0.06, 1.04), stuff.STEEL)
    with model.at((HIGH[0], -0.6, 2.55), -90.0):
        picture(model, stuff.EXIT_SIGN, (0.6, 0.25))


def _ceiling(model: SceneModel) -> None:
    """Span trusses, and hang lamps, ropes and rings from them."""
    grey = (0.42, 0.45, 0.47)
    for x in np.arange(LOW[0] + 2.0, HIGH[0] - 1.0, 3.6).tolist():
        for z in (6.5, 7.25):
            model.box(
                (x - 0.07, LOW[1], z), (x + 0.07, HIGH[1], z + 0.14), stuff.ENAMEL, skip="yY", tint=grey
            )
        for k, y in enumerate(np.arange(LOW[1], HIGH[1] - 0.5, 1.5)):
            ends = (6.6, 7.3) if k % 2 else (7.3, 6.6)
            low, high = (x, float(y), ends[0]), (x, float(y) + 1.5, ends[1])
            model.cylinder(low, high, 0.04, stuff.ENAMEL, segments=6, caps=False, tint=grey)
        for y in (-9.6, -4.8, 0.0):
            model.box((x + 1.5, y - 0.6, 6.75), (x + 2.1, y + 0.6, 6.85), stuff.ENAMEL, tint=(0.8, 0.8, 0.8))
            model.lamp(
                [
                    (x + 1.55, y - 0.55, 6.745),
                    (x + 1.55, y + 0.55, 6.745),
                    (x + 2.05, y + 0.55, 6.745),
                    (x + 2.05, y - 0.55, 6.745),
                ],
                1600.0,
                (0.95, 1.0, 0.95),
            )
    for y in (-10.8, -10.0, -9.2):
        with model.at((35.3, y, 0.0)):
            rope(model, 6.5)
    with model.at((49.7, -10.9, 0.0)):
        rings(model, 6.5)
