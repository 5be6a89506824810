"""The basement: workbench and pegboard, shelves of jars and boxes, laundry, pipes, a bicycle, bare bulbs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.props.furniture import (
    BLUE,
    WHITE,
    Tint,
    bicycle,
    ladder,
    loop,
    stool,
    workbench,
)
from evenlight.stimuli.scenes.content.props.household import (
    bare_bulb,
    garment,
    globe,
    picture,
    tube_lamp,
)
from evenlight.stimuli.scenes.content.props.storage import (
    GLASS_TINTS,
    bottle,
    carton,
    jar,
    lying_books,
    open_shelf,
)
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

COPPER, GREY, LAGGING = (0.55, 0.26, 0.12), (0.45, 0.46, 0.47), (0.7, 0.68, 0.6)
Z = plan.CELLAR
RED, YELLOW = (0.55, 0.06, 0.04), (0.75, 0.5, 0.05)


def basement(model: SceneModel) -> None:
    """Add all that stands, lies and hangs below."""
    _workshop(model)
    _jars(model)
    _laundry(model)
    _boxes(model)
    _pipes(model)
    _lamps(model)
    for x, z, image in ((5.5, 1.4, stuff.MILL), (3.35, -0.1, stuff.DUSK), (2.75, -0.6, stuff.SQUARES)):
        with model.at((x, 7.7, z)):
            picture(model, (0.42, 0.34), image, stuff.PINE, WHITE)
    with model.at((3.25, 5.55, Z), 8):
        bicycle(model, stuff.STEEL, stuff.PAINT, (0.1, 0.32, 0.36))


def _lamps(model: SceneModel) -> None:
    """Hang tubes over bench and laundry, bulbs by the jars and the bicycle, a globe on the stairs."""
    for x, y, turn, luminance in (
        (1.25, 4.3, 90.0, 700.0),
        (5.9, 1.75, 0.0, 850.0),
        (5.6, 4.6, 90.0, 1100.0),
    ):
        with model.at((x, y, plan.CELLAR_CEILING - 0.14), turn):
            tube_lamp(model, 1.25, stuff.PAINT, luminance)
    for x, y, luminance in ((2.3, 1.75, 6450.0), (3.0, 4.9, 5850.0)):
        with model.at((x, y, plan.CELLAR_CEILING)):
            bare_bulb(model, 0.2, stuff.PAINT, luminance)
    with model.at((4.6, 7.61, 1.1)):
        model.cylinder((0, 0, 0), (0, 0.09, 0), 0.05, stuff.STEEL, tint=(0.2, 0.2, 0.2))
        globe(model, 0.065, 1520.0)


def _workshop(model: SceneModel) -> None:
    """Add the bench under the pegboard on the west wall, tins, a stool, timber, a sawhorse."""
    rng = model.rng_for("workshop")
    with model.at((0.66, 4.3, Z), 90):
        workbench(model, 2.1, stuff.OLD_WOOD, stuff.STEEL)
        for k in range(7):
            with model.at((-0.6 + 0.24 * k, 0.18 + 0.06 * rng.random(), 0.87)):
                paint_can(model, 0.05 + 0.025 * rng.random(), stuff.STEEL, GLASS_TINTS[k % len(GLASS_TINTS)])
        with model.at((0.2, -0.1, 0.87), 25):
            model.box((-0.2, -0.1, 0), (0.2, 0.1, 0.14), stuff.STEEL, tint=(0.5, 0.08, 0.05))
            model.cylinder((-0.12, 0, 0.19), (0.12, 0, 0.19), 0.012, stuff.STEEL, segments=8)
            for x in (-0.12, 0.12):
                model.cylinder((x, 0, 0.13), (x, 0, 0.19), 0.008, stuff.STEEL, segments=6)
        with model.at((0.7, -0.12, 0.87), -15):
            model.box((-0.3, -0.05, 0), (0.3, 0.05, 0.03), stuff.PINE)
            model.box((-0.22, -0.02, 0.03), (0.35, 0.06, 0.055), stuff.PINE)
        for k in range(3):
            with model.at((-0.5 + 0.5 * k, 0.05, 0.23)):
                carton(model, (0.38, 0.36, 0.26), (stuff.CARTON, stuff.PINE))
    with model.at((0.31, 3.3, Z + 1.1), 90):
        pegboard(model, 2.0, 0.95, stuff.PEGBOARD, stuff.STEEL, stuff.PAINT)
    with model.at((1.45, 4.0, Z)):
        stool(model, 0.6, stuff.PINE)
    for k in range(6):
        with model.at((0.45 + 0.07 * k, 6.2 + 0.03 * k, Z), 90.0):
            wood = stuff.PINE if k % 2 else stuff.OLD_WOOD
            model.box((-0.05, -0.012, 0), (0.05, 0.012, 1.7 + 0.1 * (k % 3)), wood)
    with model.at((0.42, 1.1, Z + 0.1), 90, tilt=0):
        ladder(model, 0.42, 1.95, stuff.PINE)
    with model.at((0.31, 2.95, Z + 1.55), 90):
        picture(model, (0.42, 0.55), stuff.POSTER, stuff.PAINT)
    for y, tint in ((5.55, (0.16, 0.22, 0.36)), (6.95, (0.42, 0.36, 0.24))):
        with model.at((0.34, y, Z + 1.75), 90):
            model.cylinder((0, 0.04, 0.02), (0, -0.05, 0.03), 0.012, stuff.STEEL, segments=8)
            garment(model, (0.42, 1.0), stuff.CLOTH, tint, rng)


def _jars(model: SceneModel) -> None:
    """Add racks along the south wall: preserves, bottles, boxes."""
    rng = model.rng_for("jars")
    for x in (1.55, 3.0):
        with model.at((x, 0.56, Z), 180):
            heights = open_shelf(model, (1.35, 0.42, 2.0), 5, stuff.OLD_WOOD)
            for level, z in enumerate(heights[1:-1] if x < 2 else heights[2:-1]):
                for row in (0.08, -0.1):
                    for k in range(8):
                        if rng.random() < 0.88:
                            place = (-0.58 + 0.165 * k + 0.02 * rng.random(), row, z)
                            tint = GLASS_TINTS[(level * 2 + int(2.2 * rng.random())) % len(GLASS_TINTS)]
                            with model.at(place):
                                tall = 0.16 + 0.06 * rng.random()
                                jar(model, tall, stuff.GLAZED, stuff.STEEL, [0.06 + 0.9 * t for t in tint])
            for k in range(3):
                with model.at((-0.42 + 0.42 * k, 0.0, heights[0]), 10 * rng.random() - 5):
                    carton(model, (0.34, 0.36, 0.28), (stuff.CARTON, stuff.PINE))
                with model.at((-0.42 + 0.42 * k, 0.0, heights[-1]), 10 * rng.random() - 5):
                    carton(model, (0.36, 0.34, 0.2), (stuff.LABEL, stuff.PINE))
            if x > 2:
                for k in range(9):
                    with model.at((-0.56 + 0.14 * k, 0.02, heights[1])):
                        bottle(model, 0.3, stuff.GLAZED, ((0.1, 0.22, 0.1), (0.26, 0.15, 0.08))[k % 2])


def _laundry(model: SceneModel) -> None:
    """Add the machines, a sink of stone, baskets, washing on the line, an ironing board."""
    for x, tint in ((5.35, (1.0, 1.0, 1.0)), (6.02, (0.92, 0.93, 0.9))):
        with model.at((x, 0.63, Z), 180):
            washing_machine(model, stuff.GLAZED, stuff.STEEL, stuff.KEYBOARD, tint)
    with model.at((6.95, 0.6, Z)):
        model.box((-0.38, -0.28, 0.45), (0.38, 0.28, 0.8), stuff.PLINTH)
        model.box((-0.32, -0.22, 0.8), (0.32, 0.2, 0.803), stuff.PLINTH, skip="z", tint=(0.45, 0.45, 0.45))
        for x in (-0.3, 0.3):
            model.box((x - 0.05, -0.24, 0), (x + 0.05, 0.24, 0.45), stuff.PLINTH, skip="zZ")
        model.cylinder((0, -0.28, 1.05), (0, -0.05, 1.05), 0.014, stuff.STEEL, segments=8)
        model.cylinder((0, -0.06, 0.97), (0, -0.06, 1.05), 0.011, stuff.STEEL, segments=8)
    for place, tint in (((5.05, 1.5, Z), (0.75, 0.75, 0.78)), ((7.45, 1.6, Z), (0.35, 0.2, 0.35))):
        with model.at(place):
            basket(model, 0.27, 0.42, stuff.OLD_WOOD, stuff.CLOTH, tint)
    for k, (x, tall, tint) in enumerate(
        ((5.35, 0.22, (0.85, 0.85, 0.8)), (5.5, 0.3, (0.1, 0.3, 0.55)), (6.1, 0.26, (0.7, 0.35, 0.1)))
    ):
        with model.at((x, 0.55 + 0.05 * k, Z + 0.86)):
            bottle(model, tall, stuff.GLAZED, tint)
    with model.at((7.98, 3.4, Z + 0.85), -90):
        boiler(model, stuff.GLAZED, stuff.STEEL, stuff.DIAL)
    _washing(model)


def _washing(model: SceneModel) -> None:
    """Hang washing on two lines across the laundry."""
    rng = model.rng_for("washing")
    for line, x in enumerate((6.75, 7.25)):
        z = plan.CELLAR_CEILING - 0.25
        model.cylinder((x, 4.3, z), (x, 6.6, z), 0.004, stuff.PAINT, segments=4, caps=False)
        for k in range(4):
            y, wide, tall = 4.45 + 0.53 * k, 0.42 + 0.06 * rng.random(), 0.5 + 0.35 * rng.random()
            kind = (stuff.TOWEL, stuff.CLOTH, stuff.GINGHAM, stuff.PLAID)[(k + 2 * line) % 4]
            steps = np.linspace(0, wide, 9)
            sway = 0.03 * np.sin(6 * steps / wide + k)
            points = [(x + s, y + a, z) for a, s in zip(steps, 0.2 * sway, strict=True)]
            points += [(x + s, y + a, z - tall) for a, s in zip(steps, sway, strict=True)]
            faces = [t for a in range(8) for t in ((a, a + 10, a + 1), (a, a + 9, a + 10))]
            uvs = [(a / kind.tile, 0.0) for a in steps] + [(a / kind.tile, -tall / kind.tile) for a in steps]
            model.mesh(points, faces, kind, uvs=uvs)
            model.mesh(points, [(a, c, b) for a, b, c in faces], kind, uvs=uvs)
            for a in (0.04, wide - 0.04):
                model.box(
                    (x - 0.012, y + a - 0.006, z - 0.05), (x + 0.012, y + a + 0.006, z + 0.02), stuff.PINE
                )
    with model.at((7.96, 5.6, Z + 1.75), -90):
        garment(model, (0.4, 0.95), stuff.CLOTH, (0.18, 0.25, 0.4), rng)


def _boxes(model: SceneModel) -> None:
    """Stack cartons and old things under the stairs and by the piers."""
    rng = model.rng_for("boxes")
    for x, y, z, size in (
        (4.9, 7.2, 0.0, 0.55),
        (5.55, 7.3, 0.0, 0.5),
        (5.0, 7.2, 0.45, 0.45),
        (4.3, 7.25, 0.0, 0.42),
        (4.42, 2.1, 0.0, 0.5),
        (4.45, 2.05, 0.42, 0.42),
        (4.95, 5.9, 0.0, 0.5),
        (7.5, 7.2, 0.0, 0.6),
        (7.45, 7.2, 0.5, 0.5),
    ):
        with model.at((x, y, Z + z), 16 * rng.random() - 8):
            side = stuff.CARTON if rng.random() < 0.6 else stuff.LABEL
            carton(model, (size, 0.85 * size, 0.8 * size), (side, stuff.PINE))
    with model.at((6.4, 7.2, Z)):
        loop(model, (0, 0, 0.1), 0.28, 0.1, stuff.PAINT, plane="xy", tint=(0.2, 0.2, 0.205))
        loop(model, (0.02, 0, 0.3), 0.28, 0.1, stuff.PAINT, plane="xy", tint=(0.21, 0.21, 0.215))
    with model.at((4.42, 1.75, Z + 0.76), 10):
        lying_books(model, 6, (stuff.BOOKS, stuff.PAGES), rng)


def _pipes(model: SceneModel) -> None:
    """Run pipes under the ceiling: heating, water, the drain; a meter, a fuse box, cables."""
    top = plan.CELLAR_CEILING
    water = [(0.55, 0.42, top - 0.22), (7.8, 0.42, top - 0.22), (7.8, 3.1, top - 0.22), (7.8, 3.1, Z + 1.85)]
    pipe(model, water, 0.03, stuff.STEEL, COPPER)
    heating = [(0.55, 0.55, top - 0.24), (7.7, 0.55, top - 0.24), (7.7, 3.2, top - 0.24)]
    pipe(model, heating, 0.022, stuff.STEEL, COPPER)
    drain = [(3.75, 0.36, top), (3.75, 0.36, top - 0.27), (3.75, 6.4, top - 0.22), (3.75, 6.4, top)]
    pipe(model, drain, 0.055, stuff.PAINT, LAGGING)
    pipe(model, [(7.85, 6.9, Z), (7.85, 6.9, top)], 0.06, stuff.STEEL, GREY)
    pipe(model, [(6.95, 0.36, Z + 1.05), (6.95, 0.36, top - 0.22)], 0.014, stuff.STEEL, COPPER)
    with model.at((7.98, 4.5, Z + 1.35), -90):
        model.box((-0.2, -0.1, 0), (0.2, 0, 0.5), stuff.STEEL, skip="Y", tint=(0.55, 0.56, 0.55))
        model.box((-0.17, -0.105, 0.28), (0.17, -0.1, 0.46), stuff.KEYBOARD, skip="Y")
        model.cylinder((0, -0.1, 0.13), (0, -0.115, 0.13), 0.06, stuff.GLAZED, segments=18)


def washing_machine(
    model: SceneModel, enamel: Material, steel: Material, keys: Material, tint: Tint = WHITE
) -> None:
    """Add a washing machine with its round door, drawer, knobs; front -y."""
    model.box((-0.3, -0.28, 0.02), (0.3, 0.3, 0.85), enamel, tint=tint)
    model.box((-0.28, -0.285, 0.02), (0.28, -0.28, 0.14), enamel, skip="Y", tint=[0.8 * t for t in tint])
    loop(model, (0, -0.29, 0.45), 0.17, 0.03, steel, tint=(0.7, 0.72, 0.75))
    model.cylinder(
        (0, -0.27, 0.45), (0, -0.31, 0.45), (0.15, 0.11), steel, segments=24, tint=(0.03, 0.035, 0.045)
    )
    model.box((-0.28, -0.29, 0.71), (-0.08, -0.28, 0.82), enamel, skip="Y", tint=[0.9 * t for t in tint])
    model.cylinder(
        (0.02, -0.28, 0.765), (0.02, -0.315, 0.765), 0.032, steel, segments=16, tint=(0.6, 0.6, 0.62)
    )
    model.quad(rectangle((0.08, 0.27), -0.281, (0.73, 0.8)), keys, uvs=WHOLE)


def pegboard(
    model: SceneModel, wide: float, tall: float, board: Material, steel: Material, grip: Material
) -> None:
    """Hang a pegboard full of tools, its lower left corner at the origin, before a wall at y = 0."""
    model.box((0, -0.015, 0), (wide, 0, tall), board, skip="Y")
    x, tool = 0.1, 0
    while x < wide - 0.12:
        with model.at((x, -0.02, tall - 0.1)):
            HANGING[tool % len(HANGING)](model, steel, grip)
        x, tool = x + 0.17 + 0.03 * (tool % 3), tool + 1
    for row in range(9):  # spanners, the smaller the further right
        x, size = 0.12 + 0.075 * row, 0.2 - 0.012 * row
        model.box((x - 0.009, -0.026, 0.08), (x + 0.009, -0.018, 0.08 + size), steel)
        for z in (0.08, 0.08 + size):
            model.cylinder((x, -0.016, z), (x, -0.028, z), 0.02 - 0.001 * row, steel, segments=10)


def _saw(model: SceneModel, steel: Material, grip: Material) -> None:
    points = [(-0.05, 0, -0.1), (-0.035, 0, -0.52), (0.0, 0, -0.52), (0.07, 0, -0.1)]
    model.mesh(points, [(0, 1, 2), (0, 2, 3)], steel, tint=(0.8, 0.82, 0.85))
    model.box((-0.055, -0.012, -0.11), (0.075, 0.012, 0.03), grip, tint=(0.7, 0.4, 0.2))


def _hammer(model: SceneModel, steel: Material, grip: Material) -> None:
    model.box((-0.012, -0.012, -0.34), (0.012, 0.012, 0.02), grip, tint=(0.9, 0.7, 0.4))
    model.box((-0.055, -0.018, -0.02), (0.06, 0.018, 0.025), steel, tint=(0.3, 0.3, 0.32))


def _driver(model: SceneModel, steel: Material, grip: Material) -> None:
    for x, tint in ((-0.03, RED), (0.03, YELLOW)):
        model.cylinder((x, -0.012, -0.1), (x, -0.012, 0.02), 0.017, grip, segments=10, tint=tint)
        model.cylinder((x, -0.012, -0.26), (x, -0.012, -0.1), 0.005, steel, segments=6)


def _pliers(model: SceneModel, steel: Material, grip: Material) -> None:
    for side in (-1, 1):
        model.cylinder(
            (side * 0.008, -0.01, 0.0), (side * 0.035, -0.01, -0.16), 0.01, grip, segments=8, tint=BLUE
        )
    model.box((-0.016, -0.016, -0.02), (0.016, -0.002, 0.07), steel, tint=(0.4, 0.4, 0.42))


def _level(model: SceneModel, steel: Material, grip: Material) -> None:
    model.box((-0.025, -0.02, -0.55), (0.025, 0.0, 0.02), grip, tint=YELLOW)
    model.box((-0.012, -0.022, -0.28), (0.012, -0.02, -0.22), steel, skip="Y", tint=(0.6, 0.9, 0.3))


def _coil(model: SceneModel, steel: Material, grip: Material) -> None:
    for radius in (0.09, 0.105):
        loop(model, (0, -0.02, -0.1), radius, 0.01, grip, tint=(0.5, 0.16, 0.05), segments=20)


HANGING = (_saw, _hammer, _driver, _pliers, _coil, _level)


def pipe(
    model: SceneModel, line: Sequence[Sequence[float]], radius: float, stuff: Material, tint: Tint = WHITE
) -> None:
    """Add a pipe along a line of points, with elbows, and clips at its middles."""
    for start, stop in pairwise(line):
        model.cylinder(start, stop, radius, stuff, segments=12, caps=False, tint=tint)
        middle, along = (np.asarray(start) + stop) / 2, np.subtract(stop, start)
        along = along / np.linalg.norm(along) * 0.02
        model.cylinder(
            middle - along, middle + along, 1.3 * radius, stuff, segments=12, tint=[0.6 * t for t in tint]
        )
    for corner in line[1:-1]:
        model.sphere(corner, 1.35 * radius, stuff, segments=12, tint=tint)


def boiler(model: SceneModel, enamel: Material, steel: Material, dial: Material) -> None:
    """Add a hot-water boiler on the wall at y = 0: gauge, valves; the origin is its lower middle."""
    model.cylinder((0, -0.27, 0), (0, -0.27, 0.95), 0.23, enamel, segments=32)
    for z in (0.08, 0.87):
        model.cylinder((0, -0.27, z - 0.01), (0, -0.27, z + 0.01), 0.236, steel, segments=32, caps=False)
    model.cylinder((0, -0.49, 0.5), (0, -0.515, 0.5), 0.05, steel, segments=18, tint=(0.3, 0.3, 0.3))
    model.quad(rectangle((-0.045, 0.045), -0.516, (0.455, 0.545)), dial, uvs=WHOLE)
    for x, tint in ((-0.1, RED), (0.1, BLUE)):
        model.cylinder(
            (x, -0.27, -0.5), (x, -0.27, 0), 0.014, steel, segments=8, caps=False, tint=(0.7, 0.35, 0.15)
        )
        loop(model, (x, -0.3, -0.2), 0.03, 0.007, steel, tint=tint, segments=12)


def paint_can(model: SceneModel, radius: float, steel: Material, tint: Tint) -> None:
    """Add a paint can with a band of its colour."""
    tall = 2.1 * radius
    model.cylinder((0, 0, 0), (0, 0, tall), radius, steel, segments=18, tint=(0.75, 0.76, 0.78))
    model.cylinder(
        (0, 0, 0.2 * tall), (0, 0, 0.8 * tall), 1.015 * radius, steel, segments=18, caps=False, tint=tint
    )


def basket(
    model: SceneModel, radius: float, tall: float, wicker: Material, cloth: Material, tint: Tint
) -> None:
    """Add a laundry basket with clothes heaped in it."""
    model.cylinder((0, 0, 0), (0, 0, tall), (0.8 * radius, radius), wicker, segments=20, caps=False)
    loop(model, (0, 0, tall), radius, 0.015, wicker, plane="xy", segments=20)
    model.sphere(
        (0, 0, 0.85 * tall), (0.9 * radius, 0.9 * radius, 0.35 * tall), cloth, segments=14, tint=tint
    )
    radii = (0.5 * radius, 0.45 * radius, 0.25 * tall)
    model.sphere((0.3 * radius, 0.2 * radius, tall), radii, cloth, segments=12, tint=[1 - t for t in tint])
