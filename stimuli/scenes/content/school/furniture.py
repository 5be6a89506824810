"""Furniture of the library and the corridors; at the origin of the placement, its front towards -y.

Shelves and their books are in `shelves`.
"""

from __future__ import annotations

import itertools

import numpy as np

from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.content.school.building import picture
from evenlight.stimuli.scenes.content.textures.school import LOCKER_DOORS
from evenlight.stimuli.scenes.content.textures.school_pictures import PAPERS as PAPER_FIELDS
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle, sphere

Tint = tuple[float, float, float]
BLACK: Tint = (0.06, 0.06, 0.065)
GREEN_GLASS: Tint = (0.08, 0.3, 0.15)


def whole(
    model: SceneModel, low: tuple[float, float, float], high: tuple[float, float, float], front: Material
) -> None:
    """Add the front (towards -y) of a box, one tile of a material over all of it."""
    corners = rectangle((low[0], high[0]), low[1], (low[2], high[2]))
    model.quad(corners, front, uvs=WHOLE)


def reading_table(model: SceneModel, length: float = 2.4, depth: float = 1.05) -> None:
    """Add a heavy table with two lamps on it."""
    a, b = length / 2, depth / 2
    model.box((-a, -b, 0.71), (a, b, 0.755), stuff.OAK)
    model.box((-a + 0.1, -b + 0.1, 0.62), (a - 0.1, b - 0.1, 0.71), stuff.DARK_OAK, skip="Z")
    for x in (-a + 0.08, a - 0.18):
        for y in (-b + 0.08, b - 0.18):
            model.box((x, y, 0), (x + 0.1, y + 0.1, 0.71), stuff.DARK_OAK, skip="zZ")
    for x in (-0.28 * length, 0.28 * length):
        with model.at((x, 0.0, 0.755)):
            reading_lamp(model)


def reading_lamp(model: SceneModel) -> None:
    """Add a brass lamp with a long green shade."""
    model.cylinder((0, 0, 0), (0, 0, 0.02), 0.08, stuff.BRASS, segments=14)
    model.cylinder((0, 0, 0.02), (0, 0, 0.36), 0.012, stuff.BRASS, segments=8, caps=False)
    shade = [(-0.16, -0.09), (0.16, -0.09), (0.16, 0.09), (-0.16, 0.09)]
    top = [(-0.11, -0.03), (0.11, -0.03), (0.11, 0.03), (-0.11, 0.03)]
    for k in range(4):
        after = (k + 1) % 4
        corners = [(*shade[k], 0.31), (*shade[after], 0.31), (*top[after], 0.39), (*top[k], 0.39)]
        model.quad(corners, stuff.ENAMEL, tint=GREEN_GLASS)
    model.quad([(*corner, 0.39) for corner in top], stuff.ENAMEL, tint=GREEN_GLASS)
    light = [(-0.15, -0.08, 0.315), (-0.15, 0.08, 0.315), (0.15, 0.08, 0.315), (0.15, -0.08, 0.315)]
    model.lamp(light, 450.0, (1, 0.8, 0.5))


def chair(model: SceneModel, seat: Material = stuff.OAK, tint: Tint = (1, 1, 1)) -> None:
    """Add a chair whose back is at +y."""
    model.box((-0.21, -0.2, 0.43), (0.21, 0.21, 0.46), seat, tint=tint)
    for x in (-0.2, 0.165):
        model.box((x, -0.19, 0), (x + 0.035, -0.155, 0.43), stuff.DARK_OAK, skip="zZ")
        model.box((x, 0.17, 0), (x + 0.035, 0.205, 0.88), stuff.DARK_OAK, skip="z")
    for z in (0.6, 0.78):
        model.box((-0.165, 0.18, z), (0.165, 0.2, z + 0.09), seat, skip="xX", tint=tint)


def open_book(model: SceneModel, tint: Tint) -> None:
    """Add an open book that lies on a table."""
    model.box((-0.19, -0.13, 0), (0.19, 0.13, 0.012), stuff.PAINT, skip="z", tint=tint)
    for side in (-1, 1):
        field = 0.25 * (side + 1)
        corners = [
            (0, -0.12, 0.028),
            (0.18 * side, -0.12, 0.014),
            (0.18 * side, 0.12, 0.014),
            (0, 0.12, 0.028),
        ]
        uvs = [(field, 0), (field + 0.25, 0), (field + 0.25, 0.25), (field, 0.25)]
        order = slice(None, None, side)
        model.quad(corners[order], stuff.PAPERS, uvs=uvs[order])


def closed_books(model: SceneModel, rng: np.random.Generator, number: int) -> None:
    """Add a pile of books that lie on each other."""
    z = 0.0
    for _ in range(number):
        wide, deep, thick = rng.uniform(0.2, 0.28), rng.uniform(0.14, 0.2), rng.uniform(0.018, 0.045)
        colour = rng.uniform(0.1, 0.55, 3)
        with model.at((0, 0, z), rng.uniform(-14, 14)):
            low, high = (-wide / 2, -deep / 2, 0), (wide / 2, deep / 2, thick)
            model.box(low, high, stuff.VINYL, skip="z", tint=colour.tolist())
        z += thick


def globe(model: SceneModel) -> None:
    """Add a globe on a wooden stand, 1.1 m high."""
    model.cylinder((0, 0, 0), (0, 0, 0.05), 0.24, stuff.DARK_OAK, segments=20)
    model.cylinder((0, 0, 0.05), (0, 0, 0.55), 0.04, stuff.DARK_OAK, segments=12, caps=False)
    model.cylinder((0, 0, 0.5), (0, 0, 0.56), 0.12, stuff.BRASS, segments=16)
    points, triangles, uvs = sphere(28)
    with model.at((0, 0, 0.83), 30.0, tilt=23.4):
        model.mesh(0.28 * points, triangles, stuff.GLOBE, uvs=uvs, normals=points)
    angle = np.linspace(-0.6 * np.pi, 0.6 * np.pi, 22)
    for r, s in itertools.pairwise(angle):
        ends = [(0.31 * np.cos(t), 0.0, 0.83 + 0.31 * np.sin(t)) for t in (r, s)]
        model.cylinder(ends[0], ends[1], 0.012, stuff.BRASS, segments=6, caps=False)


def card_catalogue(model: SceneModel) -> None:
    """Add a card catalogue, 1.6 m wide."""
    model.box((-0.82, -0.25, 0.05), (0.82, 0.25, 1.25), stuff.DARK_OAK, skip="y")
    model.box((-0.86, -0.28, 1.25), (0.86, 0.28, 1.29), stuff.DARK_OAK)
    model.box((-0.78, -0.2, 0), (0.78, 0.2, 0.05), stuff.DARK_OAK, skip="zZ")
    for k in range(2):
        whole(model, (-0.82 + 0.82 * k, -0.25, 0.4), (0.82 * k, -0.25, 1.25), stuff.CATALOGUE)
        whole(model, (-0.82 + 0.82 * k, -0.25, 0.05), (0.82 * k, -0.25, 0.4), stuff.CATALOGUE)


def service_desk(model: SceneModel, rng: np.random.Generator) -> None:
    """Add the librarian's desk: counter, monitor with the catalogue on it, keyboard, books, lamp, pens."""
    model.box((-1.2, -0.4, 0), (1.2, -0.32, 1.08), stuff.OAK, skip="z")
    model.box((-1.25, -0.48, 1.08), (1.25, -0.18, 1.12), stuff.DARK_OAK)
    model.box((-1.2, -0.32, 0.7), (1.2, 0.45, 0.74), stuff.OAK)
    for x in (-1.2, 1.16):
        model.box((x, -0.32, 0), (x + 0.04, 0.45, 0.7), stuff.OAK, skip="zZ")
    for k in range(5):
        model.box((-1.1 + 0.45 * k, -0.415, 0.15), (-0.72 + 0.45 * k, -0.4, 0.98), stuff.DARK_OAK, skip="Y")
    with model.at((0.35, 0.0, 0.74), 180.0):
        monitor(model)
    with model.at((-0.75, -0.33, 1.12), 8.0):
        closed_books(model, rng, 4)
    with model.at((-0.5, 0.15, 0.755), 175.0):
        open_book(model, (0.3, 0.05, 0.05))
    with model.at((1.0, -0.33, 1.12)):
        reading_lamp(model)
    model.cylinder(
        (0.5, -0.34, 1.12), (0.5, -0.34, 1.22), 0.04, stuff.ENAMEL, segments=12, tint=(0.7, 0.2, 0.15)
    )
    for lean in (-0.03, 0.0, 0.03):
        model.cylinder(
            (0.5 + lean / 3, -0.34, 1.15), (0.5 + lean, -0.34 + lean, 1.29), 0.005, stuff.ENAMEL, segments=5
        )


def monitor(model: SceneModel) -> None:
    """Add a monitor and a keyboard."""
    model.box((-0.28, 0.0, 0.12), (0.28, 0.04, 0.48), stuff.ENAMEL, tint=BLACK)
    whole(model, (-0.265, -0.004, 0.135), (0.265, -0.004, 0.465), stuff.SCREEN)
    model.box((-0.03, 0.02, 0.0), (0.03, 0.05, 0.2), stuff.ENAMEL, tint=BLACK)
    model.box((-0.13, -0.05, 0.0), (0.13, 0.13, 0.012), stuff.ENAMEL, tint=BLACK)
    model.box((-0.22, -0.32, 0.0), (0.22, -0.17, 0.02), stuff.ENAMEL, skip="Z", tint=BLACK)
    model.quad(rectangle((-0.22, 0.22), (-0.32, -0.17), 0.021), stuff.KEYBOARD, uvs=WHOLE)


def lockers(model: SceneModel, columns: int, front: Material = stuff.LOCKERS) -> None:
    """Add a row of lockers in two tiers, 0.3 m wide each, on a plinth; the row begins at the origin."""
    width, tier = 0.3, 0.92
    end = columns * width
    model.box((0, -0.45, 0), (end, 0, 0.1), stuff.PAINT, skip="zZY", tint=BLACK)
    model.box((0, -0.44, 0.1), (end, 0, 0.1 + 2 * tier), stuff.ENAMEL, skip="zyY", tint=(0.16, 0.24, 0.3))
    for column in range(columns):
        for row in range(2):
            low, high = (
                (column * width + 0.006, -0.455, 0.106 + row * tier),
                ((column + 1) * width - 0.006, -0.44, 0.094 + (row + 1) * tier),
            )
            door = (column * 3 + row) % LOCKER_DOORS / LOCKER_DOORS
            edge = 0.01 / LOCKER_DOORS
            u, v = door + edge, door + 1 / LOCKER_DOORS - edge
            corners = [low, (high[0], low[1], low[2]), (high[0], low[1], high[2]), (low[0], low[1], high[2])]
            model.quad(corners, front, uvs=[(u, 0), (v, 0), (v, 1), (u, 1)])
            x, z = high[0], low[2]
            model.box((x - 0.045, -0.475, z + 0.4), (x - 0.02, -0.455, z + 0.53), stuff.STEEL, skip="Y")


def notice_board(model: SceneModel, rng: np.random.Generator, size: tuple[float, float]) -> None:
    """Add a cork board with papers pinned on it, its middle at the origin."""
    a, b = size[0] / 2, size[1] / 2
    model.quad(rectangle((-a, a), -0.02, (-b, b)), stuff.CORK)
    for low, high in (
        ((-a - 0.04, -0.035, -b - 0.04), (a + 0.04, 0, -b)),
        ((-a - 0.04, -0.035, b), (a + 0.04, 0, b + 0.04)),
        ((-a - 0.04, -0.035, -b), (-a, 0, b)),
        ((a, -0.035, -b), (a + 0.04, 0, b)),
    ):
        model.box(low, high, stuff.BEECH, skip="Y")
    layer = 0.021
    columns, rows = int(size[0] / 0.27), int(size[1] / 0.34)
    for column in range(columns):
        for row in range(rows):
            if rng.random() < 0.16:
                continue
            layer += 0.0005
            place = (-a + (column + 0.5) * size[0] / columns, 0.0, -b + (row + 0.5) * size[1] / rows)
            with model.at(np.add(place, (rng.normal(0, 0.02), 0, rng.normal(0, 0.02)))):
                _pinned(model, rng, layer)


def _pinned(model: SceneModel, rng: np.random.Generator, layer: float) -> None:
    """Add a sheet of paper with a pin, a little askew."""
    wide, tall, lean = rng.uniform(0.09, 0.115), rng.uniform(0.12, 0.155), np.radians(rng.normal(0, 4))
    turn = np.array([[np.cos(lean), -np.sin(lean)], [np.sin(lean), np.cos(lean)]])
    corners = np.array([(-wide, -tall), (wide, -tall), (wide, tall), (-wide, tall)]) @ turn.T
    u, v = rng.integers(PAPER_FIELDS, size=2) / PAPER_FIELDS
    side = 1 / PAPER_FIELDS
    uvs = [(u, v), (u + side, v), (u + side, v + side), (u, v + side)]
    model.quad([(x, -layer, z) for x, z in corners], stuff.PAPERS, uvs=uvs)
    pin = rng.choice([0.1, 0.7], size=3).tolist()
    model.box(
        (-0.008, -layer - 0.012, tall - 0.03), (0.008, -layer, tall - 0.014), stuff.ENAMEL, skip="Y", tint=pin
    )


def wall_clock(model: SceneModel) -> None:
    """Add a round clock, its middle at the origin."""
    model.cylinder((0, 0, 0), (0, -0.06, 0), 0.19, stuff.ENAMEL, segments=24, tint=BLACK)
    with model.at((0, -0.052, 0)):
        picture(model, stuff.CLOCK, (0.26, 0.26))


def extinguisher(model: SceneModel) -> None:
    """Add a fire extinguisher on its hook, its foot at the origin."""
    red = (0.6, 0.03, 0.02)
    model.cylinder((0, -0.1, 0.0), (0, -0.1, 0.42), 0.08, stuff.ENAMEL, segments=14, tint=red)
    model.cylinder(
        (0, -0.1, 0.42), (0, -0.1, 0.5), (0.08, 0.03), stuff.ENAMEL, segments=14, caps=False, tint=red
    )
    model.cylinder((0, -0.1, 0.5), (0, -0.1, 0.56), 0.025, stuff.ENAMEL, segments=8, tint=BLACK)
    model.box((-0.02, -0.2, 0.55), (0.02, -0.05, 0.57), stuff.ENAMEL, tint=BLACK)
    model.cylinder(
        (0.03, -0.14, 0.52), (0.1, -0.15, 0.1), 0.012, stuff.VINYL, segments=6, caps=False, tint=BLACK
    )
    model.box((-0.06, -0.185, 0.15), (0.06, -0.175, 0.3), stuff.PAINT, tint=(0.8, 0.78, 0.7))
    model.box((-0.12, -0.01, 0.72), (0.12, 0, 0.96), stuff.ENAMEL, skip="Y", tint=red)
    model.box((-0.05, -0.014, 0.76), (0.05, -0.01, 0.9), stuff.ENAMEL, skip="Y")


def bench(model: SceneModel, length: float, tint: Tint = (1, 1, 1)) -> None:
    """Add a bench of slats on steel legs, its middle at the origin."""
    a = length / 2
    for y in (-0.17, -0.05, 0.07):
        model.box((-a, y, 0.42), (a, y + 0.1, 0.455), stuff.BEECH, tint=tint)
    for x in (-a + 0.15, a - 0.2):
        model.box((x, -0.16, 0), (x + 0.05, -0.11, 0.42), stuff.STEEL, skip="zZ")
        model.box((x, 0.11, 0), (x + 0.05, 0.16, 0.42), stuff.STEEL, skip="zZ")
        model.box((x, -0.16, 0.38), (x + 0.05, 0.16, 0.42), stuff.STEEL, skip="Z")


def school_bag(model: SceneModel, tint: Tint) -> None:
    """Add a rucksack that leans at a wall, 0.42 m high."""
    darker = tuple(0.6 * part for part in tint)
    with model.at((0, -0.05, 0.0)):
        model.box((-0.15, -0.16, 0), (0.15, 0.0, 0.345), stuff.VINYL, skip="yzZ", tint=tint)
        # A piece is lit at its middle: none lies under the pocket.
        for across, up in (
            ((-0.15, -0.11), (0.0, 0.33)),
            ((0.11, 0.15), (0.0, 0.33)),
            ((-0.11, 0.11), (0.2, 0.33)),
        ):
            model.quad(rectangle(across, -0.166, up), stuff.VINYL, tint=tint)
        model.cylinder((-0.15, -0.08, 0.36), (0.15, -0.08, 0.36), 0.08, stuff.VINYL, segments=14, tint=tint)
        model.box((-0.11, -0.21, 0.0), (0.11, -0.16, 0.2), stuff.VINYL, tint=darker)
        for x in (-0.09, 0.06):
            model.box((x, -0.175, 0.2), (x + 0.03, -0.166, 0.4), stuff.VINYL, tint=darker)


def waste_bin(model: SceneModel, tint: Tint = (0.15, 0.17, 0.18)) -> None:
    """Add a round bin."""
    model.cylinder((0, 0, 0), (0, 0, 0.5), (0.15, 0.19), stuff.ENAMEL, segments=16, caps=False, tint=tint)
    model.cylinder((0, 0, 0.4), (0, 0, 0.41), 0.17, stuff.VINYL, segments=16, tint=(0.02, 0.02, 0.02))
