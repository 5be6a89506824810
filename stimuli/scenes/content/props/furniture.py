"""Sofa, chairs, tables, cushions; workbench, ladder, bicycle: each stands where `model.at` puts it.

Origins are on the floor in the middle of the piece; the front faces -y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.engine.model import Material, SceneModel

Tint = Sequence[float]
WHITE: Tint = (1.0, 1.0, 1.0)
DARK, BLUE = (0.05, 0.05, 0.055), (0.07, 0.16, 0.42)


def cushion(
    model: SceneModel, position: Sequence[float], size: tuple[float, float, float], cover: Material
) -> None:
    """Add a soft block, its edges rounded, the middle of its underside at a position; size in x, y, z."""
    x, y, z = position
    wide, deep, tall = size
    soft = min(size) * 0.28
    layers = (
        (0.0, soft),
        (soft * 0.35, soft * 0.35),
        (tall / 2, 0.0),
        (tall - soft * 0.35, soft * 0.35),
        (tall, soft),
    )
    points, triangles = [], []
    for height, inset in layers:
        across, along = wide / 2 - inset, deep / 2 - inset
        cut = soft * 0.6
        outline = (
            (-across + cut, -along), (across - cut, -along), (across, -along + cut), (across, along - cut),
            (across - cut, along), (-across + cut, along), (-across, along - cut), (-across, -along + cut),
        )  # fmt: skip
        points += [(x + a, y + b, z + height) for a, b in outline]
    for layer in range(len(layers) - 1):
        for corner in range(8):
            a, b = layer * 8 + corner, layer * 8 + (corner + 1) % 8
            triangles += [(a, b, b + 8), (a, b + 8, a + 8)]
    top = (len(layers) - 1) * 8
    triangles += [(top, top + k, top + k + 1) for k in range(1, 7)]
    model.mesh(points, triangles, cover)


def sofa(model: SceneModel, wide: float, cover: Material, feet: Material) -> None:
    """Add a sofa with seat and back cushions, arms and feet."""
    seats = max(1, round((wide - 0.4) / 0.65))
    model.box((-wide / 2 + 0.18, -0.40, 0.12), (wide / 2 - 0.18, 0.42, 0.30), cover)
    for side in (-1, 1):
        cushion(model, (side * (wide / 2 - 0.1), 0, 0.12), (0.2, 0.9, 0.48), cover)
        for front in (-0.38, 0.38):
            x = side * (wide / 2 - 0.1)
            model.cylinder((x, front, 0), (x, front, 0.13), 0.025, feet, segments=8)
    cushion(model, (0, 0.38, 0.14), (wide - 0.34, 0.2, 0.62), cover)
    each = (wide - 0.42) / seats
    for seat in range(seats):
        middle = -wide / 2 + 0.21 + each * (seat + 0.5)
        cushion(model, (middle, -0.08, 0.29), (each - 0.01, 0.72, 0.17), cover)
        with model.at((middle, 0.24, 0.44), tilt=0.0):
            cushion(model, (0, 0, 0), (each - 0.03, 0.17, 0.44), cover)


def scatter_cushion(model: SceneModel, size: float, cover: Material) -> None:
    """Add a loose cushion that stands on its edge, leaning back a little: a pillow of 9 by 9 points."""
    points, triangles, uvs = [], list[tuple[int, int, int]](), []
    for face in (-1, 1):
        for row in range(9):
            for column in range(9):
                u, v = column / 8, row / 8
                bulge = 0.085 * ((1 - (2 * u - 1) ** 2) * (1 - (2 * v - 1) ** 2)) ** 0.6
                points.append(((u - 0.5) * size, face * bulge + 0.25 * (v - 0.5) * size, v * size))
                uvs.append((u * size / cover.tile, v * size / cover.tile))
    for face in (0, 81):
        for row in range(8):
            for column in range(8):
                a = face + row * 9 + column
                pair = ((a, a + 1, a + 10), (a, a + 10, a + 9))
                triangles += pair if face == 0 else [(p, r, q) for p, q, r in pair]
    model.mesh(points, triangles, cover, uvs=uvs)


def chair(model: SceneModel, stuff: Material, seat: Material, tint: Tint = WHITE) -> None:
    """Add a kitchen chair with a slatted back."""
    for x in (-0.19, 0.19):
        model.box((x - 0.018, -0.2, 0), (x + 0.018, -0.164, 0.44), stuff, tint=tint)
        model.box((x - 0.018, 0.17, 0), (x + 0.018, 0.206, 0.92), stuff, tint=tint)
        model.box((x - 0.012, -0.17, 0.2), (x + 0.012, 0.18, 0.23), stuff, tint=tint)
    model.box((-0.21, -0.22, 0.43), (0.21, 0.2, 0.455), stuff, tint=tint)
    cushion(model, (0, -0.01, 0.455), (0.38, 0.38, 0.035), seat)
    for height in (0.56, 0.70, 0.84):
        model.box((-0.18, 0.175, height), (0.18, 0.197, height + 0.055), stuff, tint=tint)


def table(model: SceneModel, size: tuple[float, float, float], stuff: Material, tint: Tint = WHITE) -> None:
    """Add a table with four legs and an apron; size in x, y, z."""
    wide, deep, tall = size
    model.box((-wide / 2, -deep / 2, tall - 0.03), (wide / 2, deep / 2, tall), stuff, tint=tint)
    x, y = wide / 2 - 0.06, deep / 2 - 0.06
    model.box((-x, -y, tall - 0.11), (x, y, tall - 0.03), stuff, skip="Z", tint=tint)
    for a in (-x, x):
        for b in (-y, y):
            model.box((a - 0.03, b - 0.03, 0), (a + 0.03, b + 0.03, tall - 0.03), stuff, skip="Zz", tint=tint)


def round_table(model: SceneModel, radius: float, tall: float, stuff: Material, tint: Tint = WHITE) -> None:
    """Add a round table on one leg with a foot."""
    model.cylinder((0, 0, tall - 0.03), (0, 0, tall), radius, stuff, segments=32, tint=tint)
    model.cylinder((0, 0, 0.04), (0, 0, tall - 0.03), 0.035, stuff, segments=12, caps=False, tint=tint)
    model.cylinder((0, 0, 0), (0, 0, 0.05), (radius * 0.55, 0.06), stuff, segments=24, tint=tint)


def stool(model: SceneModel, tall: float, stuff: Material, tint: Tint = WHITE) -> None:
    """Add a three-legged stool."""
    model.cylinder((0, 0, tall - 0.035), (0, 0, tall), 0.17, stuff, segments=20, tint=tint)
    for x, y in ((0.13, 0.0), (-0.065, 0.113), (-0.065, -0.113)):
        foot, head = (1.2 * x, 1.2 * y, 0), (0.8 * x, 0.8 * y, tall - 0.03)
        model.cylinder(foot, head, 0.016, stuff, segments=8, caps=False, tint=tint)


def deck_chair(model: SceneModel, stuff: Material, cloth: Material) -> None:
    """Add a deck chair: a wooden frame with striped cloth sagging in it."""
    for x in (-0.3, 0.3):
        _beam(model, (x, -0.5, 0.0), (x, 0.45, 0.85), stuff)
        _beam(model, (x * 0.93, 0.45, 0.0), (x * 0.93, -0.45, 0.42), stuff)
    for y, z in ((-0.45, 0.42), (0.45, 0.85), (-0.5, 0.03), (0.45, 0.03)):
        model.cylinder((-0.31, y, z), (0.31, y, z), 0.016, stuff, segments=8)
    line = ((-0.45, 0.43), (-0.22, 0.27), (0.0, 0.24), (0.2, 0.42), (0.45, 0.86))
    for (y0, z0), (y1, z1) in pairwise(line):
        corners = [(-0.26, y0, z0), (0.26, y0, z0), (0.26, y1, z1), (-0.26, y1, z1)]
        u = 0.26 / cloth.tile
        mapped = [(-u, y0), (u, y0), (u, y1), (-u, y1)]
        model.quad(corners, cloth, uvs=mapped)
        model.quad(corners[::-1], cloth, uvs=mapped[::-1])


def _beam(model: SceneModel, start: Sequence[float], stop: Sequence[float], stuff: Material) -> None:
    model.cylinder(start, stop, 0.018, stuff, segments=6)


def bench(model: SceneModel, wide: float, stuff: Material, tint: Tint = WHITE) -> None:
    """Add a bench of slats with a back."""
    for x in (-wide / 2 + 0.1, wide / 2 - 0.1):
        model.box((x - 0.03, -0.22, 0), (x + 0.03, -0.16, 0.42), stuff, tint=tint)
        model.box((x - 0.03, 0.18, 0), (x + 0.03, 0.24, 0.85), stuff, tint=tint)
        model.box((x - 0.03, -0.22, 0.36), (x + 0.03, 0.2, 0.42), stuff, tint=tint)
    for slat in range(4):
        y = -0.23 + 0.115 * slat
        model.box((-wide / 2, y, 0.42), (wide / 2, y + 0.095, 0.445), stuff, tint=tint)
    for slat in range(3):
        z = 0.52 + 0.12 * slat
        model.box((-wide / 2, 0.155, z), (wide / 2, 0.18, z + 0.09), stuff, tint=tint)


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


def ladder(model: SceneModel, wide: float, long: float, stuff: Material) -> None:
    """Add a ladder that lies in the plane y = 0, from z = 0 up."""
    for x in (-wide / 2, wide / 2 - 0.03):
        model.box((x, -0.02, 0), (x + 0.03, 0.02, long), stuff)
    for rung in range(int(long / 0.28)):
        z = 0.2 + 0.28 * rung
        # From rail to rail: an end inside one would be dark.
        model.cylinder((0.03 - wide / 2, 0, z), (wide / 2 - 0.03, 0, z), 0.014, stuff, segments=8, caps=False)
