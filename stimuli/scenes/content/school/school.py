"""The school: library, corridor, changing room, gym and yard, on a sunny afternoon.

The changing room, which is small, is built here: tiles, benches, hooks with clothes on them, one tired lamp.
It lies at x 25 to 33 and y -6.3 to -0.3, between corridor and gym.
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
from evenlight.stimuli.scenes.content.school.corridor import add_corridor
from evenlight.stimuli.scenes.content.school.furniture import (
    bench,
    lockers,
    notice_board,
    school_bag,
    waste_bin,
)
from evenlight.stimuli.scenes.content.school.gym import add_gym
from evenlight.stimuli.scenes.content.school.library import add_library
from evenlight.stimuli.scenes.content.school.yard import add_yard
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import Scene
from evenlight.stimuli.scenes.engine.shapes import rectangle, ring

LOW, HIGH, TOP = (25.0, -6.3), (33.0, -0.3), 2.7  # [m]
COATS = (
    (0.15, 0.19, 0.32), (0.3, 0.31, 0.33), (0.42, 0.34, 0.25), (0.25, 0.28, 0.18), (0.45, 0.16, 0.15),
    (0.22, 0.31, 0.42), (0.17, 0.17, 0.18), (0.5, 0.46, 0.39), (0.17, 0.32, 0.29), (0.55, 0.42, 0.19),
)  # fmt: skip


def school(seed: int) -> Scene:
    """Return the school.

    Parameters
    ----------
    seed : int
        Of all that is random in it: which books stand where, what lies about, how the trees have grown.
    """
    model = SceneModel("school", seed)
    model.sun(azimuth=207.0, altitude=38.0, illuminance=1150.0, colour=(1.0, 0.92, 0.78))
    model.sky(zenith=(26.0, 42.0, 76.0), horizon=(72.0, 82.0, 92.0))
    for add in (add_library, add_corridor, add_changing_room, add_gym, add_yard):
        add(model)
    return model.build()


def add_changing_room(model: SceneModel) -> None:
    """Build and furnish the changing room."""
    rng = model.rng_for("changing room")
    _shell(model)
    _fittings(model, rng)
    for place in ((27.7, -1.7), (26.4, -4.9), (31.2, -4.6)):
        panel_lamp(model, place, TOP - 0.07, (0.9, 0.3), 320.0)
    model.place("changing room", (*LOW, 0.0), (*HIGH, TOP))
    model.walkable((27.4, -2.2), (28.1, 1.0))
    model.walkable((26.0, -2.5), (32.4, -1.6))
    model.walkable((25.95, -5.3), (26.55, -1.6))
    model.walkable((25.95, -5.35), (31.6, -4.75))
    model.walkable((31.0, -5.35), (32.1, -3.6))
    model.walkable((31.7, -4.2), (32.4, -1.6))
    model.walkable((31.7, -4.2), (34.2, -3.4))


def _shell(model: SceneModel) -> None:
    """Put up walls, tiled to above a man's height, floor and ceiling."""
    floor(model, LOW, HIGH, stuff.FLOOR_TILES)
    floor(model, (27.0, -0.3), (28.5, 0.0), stuff.FLOOR_TILES)
    floor(model, (33.0, -4.55), (33.3, -2.95), stuff.FLOOR_TILES)
    ceiling(model, LOW, HIGH, TOP, stuff.PAINT)
    inside = Faces(stuff.WALL_TILES, stuff.CORRIDOR_WALL, frame=(0.3, 0.32, 0.33))
    wall(model, ((33.0, -0.15), (24.85, -0.15)), (0.0, 3.5), inside, [WallOpening(4.5, 6.0, 0.0, 2.2)])
    outer, windows = Faces(stuff.WALL_TILES, stuff.BRICK), [WallOpening(2.0, 3.4, 2.05, 2.5, 2, 1)]
    wall(model, ((24.7, -6.45), (33.0, -6.45)), (0.0, 3.5), outer, windows)
    wall(model, ((24.85, -4.3), (24.85, -6.6)), (0.0, 3.5), Faces(stuff.WALL_TILES, stuff.BRICK))
    gym_door = [WallOpening(1.75, 3.35, 0.0, 2.3)]  # from y = -6.3: between -4.55 and -2.95
    faces = Faces(stuff.WALL_TILES, stuff.GYM_PANELS, frame=(0.3, 0.32, 0.33))
    wall(model, ((33.15, -6.3), (33.15, 0.0)), (0.0, 3.0), faces, gym_door)
    # A frosted pane, nearly all painted over.
    model.lamp(rectangle((26.7, 28.1), -6.48, (2.05, 2.5))[::-1], 12.0, (0.9, 1.0, 0.95))
    for low, high in (((24.75, -6.68, 2.98), (33.1, -0.1, 3.4)), ((24.62, -6.68, 2.98), (24.75, -4.3, 3.4))):
        model.box(low, high, stuff.ENAMEL, tint=(0.3, 0.32, 0.33))
    for low, high in (
        ((25.0, -0.32, 0.9), (27.0, -0.3, 1.02)),
        ((28.5, -0.32, 0.9), (33.0, -0.3, 1.02)),
        ((25.0, -6.3, 0.9), (33.0, -6.28, 1.02)),
        ((25.0, -6.3, 0.9), (25.02, -0.3, 1.02)),
    ):
        model.box(low, high, stuff.DADO, tint=(0.6, 0.9, 1.0))


def _fittings(model: SceneModel, rng: np.random.Generator) -> None:
    """Add benches with hooks and clothes, basins with mirrors, a bin, lost things on the floor."""
    for place, turn, length in (
        ((28.2, -6.3, 0.0), 180.0, 5.0),
        ((25.0, -3.4, 0.0), 90.0, 4.6),
        ((30.6, -0.3, 0.0), 0.0, 3.6),
    ):
        with model.at(place, turn):
            _hook_wall(model, rng, length)
    with model.at((28.7, -3.9, 0.0)):
        _island(model, rng, 3.6)
    with model.at((33.0, -5.4, 0.0), -90.0):
        _basins(model)
    with model.at((32.3, -6.3, 0.0), 180.0):
        lockers(model, 5, stuff.RED_LOCKERS)
    with model.at((32.7, -0.7, 0.0)):
        waste_bin(model)
    with model.at((25.02, -1.0, 1.85), 90.0):
        picture(model, stuff.WALL_POSTERS["sports"], (0.7, 0.7))
    with model.at((33.0, -1.75, 1.65), -90.0):
        notice_board(model, rng, (1.4, 1.0))


def _hook_wall(model: SceneModel, rng: np.random.Generator, length: float) -> None:
    """Add a bench along a wall behind it, a rail of hooks over it, and what hangs there."""
    with model.at((0.0, -0.25, 0.0)):
        bench(model, length)
    a = length / 2
    model.box((-a, -0.03, 1.62), (a, 0.0, 1.74), stuff.BEECH, skip="Y")
    for x in np.arange(-a + 0.2, a - 0.1, 0.32):
        model.cylinder((x, -0.03, 1.66), (x, -0.11, 1.69), 0.008, stuff.STEEL, segments=6)
        if rng.random() < 0.6:
            with model.at((float(x), -0.09, 1.67)):
                _hanging(model, rng)
        if rng.random() < 0.35:
            with model.at((float(x), -0.12, 0.46), rng.normal(0, 20)):
                school_bag(model, rng.uniform(0.12, 0.45, 3).tolist())
        elif rng.random() < 0.6:
            _shoes(model, rng, (float(x), -0.3 + rng.normal(0, 0.04)))


def _hanging(model: SceneModel, rng: np.random.Generator) -> None:
    """Hang a coat from a hook at the origin: a tube in folds, wide at the shoulders, and two sleeves."""
    long, wide = rng.uniform(0.6, 0.95), rng.uniform(0.13, 0.17)
    share, half = (
        np.array(levels)[:, None]
        for levels in ((0, 0.05, 0.12, 0.4, 0.7, 1), (0.25, 0.7, 1, 0.85, 0.95, 1.1))
    )
    around = np.linspace(0, 2 * np.pi, 25)[None]
    out = 1 + 0.16 * share * np.sin(7 * around + rng.uniform(0, 6))
    x, y = wide * half * np.cos(around), 0.4 * wide * half * out * np.sin(around)
    points = np.stack(np.broadcast_arrays(x, y, -long * share), axis=-1).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(5), np.arange(24), indexing="ij")
    k = (row * 25 + column).ravel()
    triangles = np.concatenate([np.stack([k + 25, k + 26, k + 1], 1), np.stack([k + 25, k + 1, k], 1)])
    colour = COATS[rng.integers(len(COATS))]
    model.mesh(points, triangles, stuff.CLOTH, tint=colour)
    for side in (-wide, wide):
        hand, shoulder = (1.2 * side, -0.03, -0.1 * long - 0.5), (0.85 * side, 0.0, -0.1 * long)
        model.cylinder(hand, shoulder, (0.055, 0.05), stuff.CLOTH, segments=10, tint=colour)


def _shoes(model: SceneModel, rng: np.random.Generator, place: tuple[float, float]) -> None:
    """Leave a pair of shoes on the floor."""
    colour = rng.choice([[0.6, 0.6, 0.62], [0.12, 0.12, 0.13], [0.5, 0.11, 0.1], [0.12, 0.18, 0.45]]).tolist()
    for side in (-0.06, 0.06):
        with model.at((place[0] + side, place[1], 0.0), rng.normal(0, 12)):
            model.sphere((0, -0.05, 0.045), (0.045, 0.11, 0.045), stuff.VINYL, segments=8, tint=colour)
            model.sphere((0, 0.05, 0.06), (0.04, 0.06, 0.06), stuff.VINYL, segments=8, tint=colour)
            model.sphere(
                (0, -0.02, 0.01), (0.05, 0.14, 0.014), stuff.VINYL, segments=8, tint=(0.7, 0.7, 0.68)
            )


def _island(model: SceneModel, rng: np.random.Generator, length: float) -> None:
    """Add two benches back to back, with a rack of hooks between them."""
    a = length / 2
    for side in (0, 1):
        with model.at((0.0, 0.0, 0.0), 180.0 * side):
            _hook_wall(model, rng, length)
    for x in (-a + 0.01, a - 0.06):
        model.box((x, -0.025, 0), (x + 0.05, 0.025, 1.8), stuff.STEEL, skip="z")
    model.box((-a, -0.2, 1.8), (a, 0.2, 1.83), stuff.OAK)
    for _ in range(3):
        x = rng.uniform(-a + 0.2, a - 0.2)
        model.sphere((x, 0.0, 1.94), 0.11, stuff.VINYL, segments=14, tint=rng.uniform(0.1, 0.7, 3).tolist())


def _basins(model: SceneModel) -> None:
    """Add two basins with taps, a framed mirror over each, a shelf between."""
    model.box((-0.12, -0.14, 1.1), (0.12, 0, 1.13), stuff.ENAMEL, skip="Y")
    for x in (-0.45, 0.45):
        model.box((x - 0.28, -0.02, 1.15), (x + 0.28, 0, 1.85), stuff.ENAMEL, skip="Y")
        mirror = rectangle((x - 0.24, x + 0.24), -0.022, (1.19, 1.81))
        model.quad(mirror, stuff.MIRROR, tint=(0.84, 0.88, 0.86))
        low, water = (x, -0.25, 0.72), (x, -0.25, 0.85)
        model.cylinder(low, (x, -0.25, 0.88), (0.15, 0.25), stuff.ENAMEL, segments=18, caps=False)
        model.cylinder(low, water, (0.13, 0.22), stuff.ENAMEL, segments=18, tint=(0.75, 0.77, 0.77))
        rim = np.array([x, -0.25]) + np.concatenate([r * ring(18) for r in (0.21, 0.255)])
        k = np.arange(18)
        around = np.concatenate([np.stack([k, k + 19, k + 20], 1), np.stack([k, k + 20, k + 1], 1)])
        model.mesh(np.column_stack([rim, np.full(len(rim), 0.88)]), around, stuff.ENAMEL)
        model.cylinder((x, -0.03, 0.9), (x, -0.03, 1.05), 0.016, stuff.STEEL, segments=8)
        model.cylinder((x, -0.03, 1.05), (x, -0.2, 1.02), 0.013, stuff.STEEL, segments=8)
        model.cylinder((x, -0.1, 0.2), (x, -0.1, 0.72), 0.025, stuff.STEEL, segments=8, caps=False)
