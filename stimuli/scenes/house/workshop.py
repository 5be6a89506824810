"""Things of a basement: washing machine, pegboard with tools, workbench, bicycle, pipes, a boiler."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.house.furniture import WHITE, Tint
from evenlight.stimuli.scenes.house.household import WHOLE
from evenlight.stimuli.scenes.model import Material, SceneModel

DARK = (0.05, 0.05, 0.055)
RED, BLUE, YELLOW = (0.55, 0.06, 0.04), (0.07, 0.16, 0.42), (0.75, 0.5, 0.05)


def loop(
    model: SceneModel, centre: Sequence[float], radius: float, tube: float, stuff: Material,
    *, plane: str = "xz", tint: Tint = WHITE, segments: int = 22,
) -> None:  # fmt: skip
    """Add a ring of round tube, such as a tyre, a rim, a coil, in the plane "xz" or "xy"."""
    around, across = np.linspace(0, 2 * math.pi, segments + 1), np.linspace(0, 2 * math.pi, 7)
    a, c = np.meshgrid(around, across, indexing="ij")
    out = radius + tube * np.cos(c)
    flat, other, deep = out * np.cos(a), out * np.sin(a), tube * np.sin(c)
    normal = np.stack([np.cos(c) * np.cos(a), np.cos(c) * np.sin(a), np.sin(c)], axis=-1).reshape(-1, 3)
    points = np.stack([flat, other, deep], axis=-1).reshape(-1, 3)
    if plane == "xz":  # a turn about x by 90 degrees keeps the orientation
        points, normal = points[:, [0, 2, 1]] * [1, -1, 1], normal[:, [0, 2, 1]] * [1, -1, 1]
    low = (np.arange(segments)[:, None] * 7 + np.arange(6)).ravel()
    triangles = np.concatenate([np.stack([low, low + 7, low + 8], 1), np.stack([low, low + 8, low + 1], 1)])
    uvs = np.stack([a * radius, c * tube], axis=-1).reshape(-1, 2) / stuff.tile
    model.mesh(points + np.asarray(centre), triangles, stuff, uvs=uvs, normals=normal, tint=tint)


def washing_machine(
    model: SceneModel, enamel: Material, steel: Material, keys: Material, tint: Tint = WHITE
) -> None:
    """Add a washing machine with its round door, drawer, knobs; front -y."""
    model.box((-0.3, -0.28, 0.02), (0.3, 0.3, 0.85), enamel, tint=tint)
    model.box((-0.28, -0.285, 0.02), (0.28, -0.28, 0.14), enamel, skip="Y", tint=[0.8 * t for t in tint])
    loop(model, (0, -0.29, 0.45), 0.17, 0.03, steel, tint=(0.7, 0.72, 0.75))
    model.cylinder(
        (0, -0.27, 0.45),
        (0, -0.31, 0.45),
        0.15,
        steel,
        top_radius=0.11,
        segments=24,
        tint=(0.03, 0.035, 0.045),
    )
    model.box((-0.28, -0.29, 0.71), (-0.08, -0.28, 0.82), enamel, skip="Y", tint=[0.9 * t for t in tint])
    model.cylinder(
        (0.02, -0.28, 0.765), (0.02, -0.315, 0.765), 0.032, steel, segments=16, tint=(0.6, 0.6, 0.62)
    )
    model.quad(
        [(0.08, -0.281, 0.73), (0.27, -0.281, 0.73), (0.27, -0.281, 0.8), (0.08, -0.281, 0.8)],
        keys,
        uvs=WHOLE,
    )


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


def workbench(model: SceneModel, wide: float, stuff: Material, steel: Material) -> None:
    """Add a heavy bench with a vice, a lower board and a drawer; front -y."""
    model.box((-wide / 2, -0.33, 0.8), (wide / 2, 0.33, 0.87), stuff)
    for x in (-wide / 2 + 0.08, wide / 2 - 0.08):
        for y in (-0.27, 0.27):
            model.box((x - 0.045, y - 0.045, 0), (x + 0.045, y + 0.045, 0.8), stuff, skip="zZ")
    model.box((-wide / 2 + 0.05, -0.28, 0.2), (wide / 2 - 0.05, 0.28, 0.23), stuff)
    model.box((0.1, -0.32, 0.64), (0.55, 0.2, 0.8), stuff)
    model.cylinder((0.32, -0.32, 0.72), (0.32, -0.35, 0.72), 0.018, steel, segments=10, tint=DARK)
    with model.at((-wide / 2 + 0.3, -0.36, 0.82)):
        model.box((-0.09, -0.12, -0.1), (0.09, -0.06, 0.1), steel, tint=BLUE)
        model.box((-0.09, 0.0, -0.1), (0.09, 0.14, 0.1), steel, tint=BLUE)
        model.cylinder((0, -0.3, -0.02), (0, 0.0, -0.02), 0.014, steel, segments=8)
        model.cylinder((-0.11, -0.28, -0.02), (0.11, -0.28, -0.02), 0.007, steel, segments=6)


def bicycle(model: SceneModel, steel: Material, rubber: Material, tint: Tint) -> None:
    """Add a bicycle that points along +x, its wheels on the floor, upright."""
    wheels = (-0.52, 0.52)
    for x in wheels:
        loop(model, (x, 0, 0.34), 0.32, 0.02, rubber, tint=(0.06, 0.06, 0.06), segments=26)
        loop(model, (x, 0, 0.34), 0.295, 0.009, steel, segments=26)
        model.cylinder((x, -0.04, 0.34), (x, 0.04, 0.34), 0.022, steel, segments=10)
        for spoke in range(14):
            turn = 2 * math.pi * spoke / 14
            rim = (x + 0.29 * math.cos(turn), 0.0, 0.34 + 0.29 * math.sin(turn))
            model.cylinder((x, 0.03 * (-1) ** spoke, 0.34), rim, 0.0018, steel, segments=3, caps=False)
    crank, seat, head = (-0.08, 0.0, 0.3), (-0.22, 0.0, 0.78), (0.36, 0.0, 0.82)
    tubes = ((crank, seat), (crank, (0.39, 0, 0.68)), ((-0.2, 0, 0.72), head), (head, (0.4, 0, 0.64)))
    for start, stop in tubes:
        model.cylinder(start, stop, 0.017, steel, segments=10, tint=tint)
    for y in (-0.05, 0.05):
        for start, stop in (
            (crank, (wheels[0], y, 0.34)),
            ((-0.2, 0.0, 0.7), (wheels[0], y, 0.34)),
            ((0.4, 0.0, 0.64), (wheels[1], y, 0.34)),
        ):
            model.cylinder(start, stop, 0.009, steel, segments=8, tint=tint)
    model.cylinder(seat, (-0.24, 0, 0.88), 0.012, steel, segments=8)
    model.sphere((-0.25, 0, 0.9), (0.14, 0.075, 0.035), rubber, segments=14, tint=(0.12, 0.06, 0.03))
    model.cylinder(head, (0.34, 0, 0.95), 0.012, steel, segments=8)
    model.cylinder((0.34, -0.27, 0.97), (0.34, 0.27, 0.97), 0.011, steel, segments=8)
    for y in (-0.25, 0.25):
        model.cylinder((0.34, y - 0.05, 0.97), (0.34, y + 0.05, 0.97), 0.017, rubber, segments=8, tint=DARK)
    loop(model, (-0.08, -0.05, 0.3), 0.085, 0.008, steel, segments=20)
    for side in (-1, 1):
        pedal = (-0.08 + side * 0.11, side * 0.09, 0.3 + side * 0.1)
        model.cylinder((-0.08, side * 0.06, 0.3), pedal, 0.009, steel, segments=6)
        model.box(
            np.subtract(pedal, (0.04, 0.035, 0.01)), np.add(pedal, (0.04, 0.035, 0.01)), rubber, tint=DARK
        )
    for x in wheels:
        _mudguard(model, x, steel, tint)


def _mudguard(model: SceneModel, x: float, steel: Material, tint: Tint) -> None:
    """Add an arc over a wheel."""
    turns = np.linspace(0.15 * math.pi, 0.95 * math.pi, 11)
    line = [(x + 0.365 * math.cos(t), 0.34 + 0.365 * math.sin(t)) for t in turns]
    for (x0, z0), (x1, z1) in pairwise(line):
        model.quad([(x0, -0.025, z0), (x0, 0.025, z0), (x1, 0.025, z1), (x1, -0.025, z1)], steel, tint=tint)
        model.quad([(x1, -0.025, z1), (x1, 0.025, z1), (x0, 0.025, z0), (x0, -0.025, z0)], steel, tint=tint)


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
    model.quad(
        [(-0.045, -0.516, 0.455), (0.045, -0.516, 0.455), (0.045, -0.516, 0.545), (-0.045, -0.516, 0.545)],
        dial,
        uvs=WHOLE,
    )
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
    model.cylinder((0, 0, 0), (0, 0, tall), 0.8 * radius, wicker, top_radius=radius, segments=20, caps=False)
    loop(model, (0, 0, tall), radius, 0.015, wicker, plane="xy", segments=20)
    model.sphere(
        (0, 0, 0.85 * tall), (0.9 * radius, 0.9 * radius, 0.35 * tall), cloth, segments=14, tint=tint
    )
    model.sphere(
        (0.3 * radius, 0.2 * radius, tall),
        (0.5 * radius, 0.45 * radius, 0.25 * tall),
        cloth,
        segments=12,
        tint=[1 - t for t in tint],
    )


def ladder(model: SceneModel, wide: float, long: float, stuff: Material) -> None:
    """Add a ladder that lies in the plane y = 0, from z = 0 up."""
    for x in (-wide / 2, wide / 2 - 0.03):
        model.box((x, -0.02, 0), (x + 0.03, 0.02, long), stuff)
    for rung in range(int(long / 0.28)):
        z = 0.2 + 0.28 * rung
        model.cylinder((-wide / 2, 0, z), (wide / 2, 0, z), 0.014, stuff, segments=8, caps=False)
