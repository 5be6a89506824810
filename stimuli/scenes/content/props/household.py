"""Things that lie, hang and stand about in a house: lamps, pictures, curtains, clothes, crockery."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evenlight.stimuli.scenes.content.props.furniture import WHITE, Tint
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

WARM = (1.0, 0.80, 0.55)


def picture(
    model: SceneModel,
    size: tuple[float, float],
    image: Material,
    edge: Material,
    tint: Tint = (0.2, 0.16, 0.12),
) -> None:
    """Hang a picture on a wall at y = 0 that is seen from -y; the origin is its middle."""
    x, z = size[0] / 2, size[1] / 2
    model.box((-x, -0.03, -z), (x, 0.0, z), edge, skip="yY", tint=tint)
    model.quad(rectangle((-x, x), -0.03, (-z, z)), image, uvs=WHOLE)


def sheet(model: SceneModel, corners: Sequence[Sequence[float]], image: Material, tint: Tint = WHITE) -> None:
    """Add one whole tile of a texture on a quad, lower left corner first."""
    model.quad(corners, image, uvs=WHOLE, tint=tint)


def glow(
    model: SceneModel, low: Sequence[float], high: Sequence[float], luminance: float, colour: Tint = WARM
) -> None:
    """Add a luminous box: a bulb or a lampshade that shines to all sides."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    faces = (
        rectangle((x0, x1), y0, (z0, z1)),
        rectangle(x1, (y0, y1), (z0, z1)),
        rectangle((x1, x0), y1, (z0, z1)),
        rectangle(x0, (y1, y0), (z0, z1)),
        rectangle((x0, x1), (y1, y0), z0),
    )
    for corners in faces:
        model.lamp(corners, luminance, colour)


def lantern(
    model: SceneModel,
    radii: tuple[float, float],
    heights: tuple[float, float],
    luminance: float,
    colour: Tint = WARM,
) -> None:
    """Add a luminous shade of eight sides around the z axis: radii below and above, heights of its edges."""
    for k in range(8):
        (a, b), (c, d) = (
            [(r * math.cos(t), r * math.sin(t)) for t in (math.pi / 4 * (k + 0.5), math.pi / 4 * (k + 1.5))]
            for r in radii
        )
        corners = [(*a, heights[0]), (*b, heights[0]), (*d, heights[1]), (*c, heights[1])]
        model.lamp(corners, luminance, colour)


def globe(model: SceneModel, radius: float, luminance: float, colour: Tint = WARM) -> None:
    """Add a luminous globe around the origin, open at its top."""
    narrow, low, high = 0.35 * radius, -0.88 * radius, 0.4 * radius
    lantern(model, (narrow, radius), (low, -high), luminance, colour)
    lantern(model, (radius, radius), (-high, high), luminance, colour)
    lantern(model, (radius, narrow), (high, -low), luminance, colour)
    model.lamp(rectangle((-narrow, narrow), (narrow, -narrow), low), luminance, colour)


def floor_lamp(model: SceneModel, tall: float, stuff: Material, luminance: float) -> None:
    """Add a standing lamp with a cloth shade."""
    model.cylinder((0, 0, 0), (0, 0, 0.03), 0.15, stuff, segments=24, tint=(0.25, 0.22, 0.2))
    model.cylinder((0, 0, 0.03), (0, 0, tall), 0.013, stuff, segments=8, caps=False, tint=(0.35, 0.3, 0.25))
    lantern(model, (0.2, 0.2), (tall - 0.32, tall), luminance)
    shade_rims(model, 0.2, (tall - 0.32, tall), stuff)


def shade_rims(model: SceneModel, radius: float, heights: tuple[float, float], stuff: Material) -> None:
    """Add the rings that hold a shade open."""
    for z in heights:
        low, high, brass = (0, 0, z - 0.006), (0, 0, z + 0.006), (0.5, 0.4, 0.25)
        model.cylinder(low, high, 1.01 * radius, stuff, segments=24, caps=False, tint=brass)


def table_lamp(model: SceneModel, tall: float, stuff: Material, luminance: float, tint: Tint) -> None:
    """Add a lamp with a bellied foot for a sideboard or a desk."""
    model.sphere((0, 0, 0.3 * tall), (0.2 * tall, 0.2 * tall, 0.28 * tall), stuff, segments=16, tint=tint)
    model.cylinder((0, 0, 0.5 * tall), (0, 0, 0.65 * tall), 0.012, stuff, segments=8, caps=False)
    lantern(model, (0.3 * tall, 0.3 * tall), (0.62 * tall, tall), luminance)


def pendant(model: SceneModel, drop: float, stuff: Material, luminance: float, tint: Tint) -> None:
    """Hang a lamp with an opaque shade from the origin: a cord, a cone, a luminous disc that looks down."""
    model.cylinder((0, 0, -drop), (0, 0, 0), 0.006, stuff, segments=6, caps=False, tint=(0.05, 0.05, 0.05))
    model.cylinder((0, 0, -0.03), (0, 0, 0), 0.05, stuff, segments=16, tint=tint)
    model.cylinder(
        (0, 0, -drop - 0.2), (0, 0, -drop), (0.24, 0.05), stuff, segments=28, caps=False, tint=tint
    )
    z = -drop - 0.185
    model.lamp(rectangle((-0.14, 0.14), (0.14, -0.14), z), luminance, WARM)


def paper_globe(model: SceneModel, drop: float, radius: float, stuff: Material, luminance: float) -> None:
    """Hang a globe of paper from the origin: luminous strips, a luminous lid below, rings of wire."""
    model.cylinder((0, 0, -drop), (0, 0, 0), 0.006, stuff, segments=6, caps=False, tint=(0.05, 0.05, 0.05))
    model.cylinder((0, 0, -0.03), (0, 0, 0), 0.05, stuff, segments=16)
    colour = (1.0, 0.88, 0.70)
    with model.at((0.0, 0.0, -drop - radius)):
        for share, low, high in ((0.8, -0.75, -0.4), (1.0, -0.4, 0.4), (0.8, 0.4, 0.75)):
            lantern(model, (share * radius, share * radius), (low * radius, high * radius), luminance, colour)
        flat = 0.56 * radius
        model.lamp(rectangle((-flat, flat), (flat, -flat), -0.75 * radius), luminance, colour)
        for level, share in ((-0.75, 0.8), (-0.4, 1.0), (0.0, 1.0), (0.4, 1.0), (0.75, 0.8)):
            z = level * radius
            under, over, wire = (0, 0, z - 0.003), (0, 0, z + 0.003), (0.5, 0.42, 0.3)
            model.cylinder(under, over, 1.02 * share * radius, stuff, segments=24, caps=False, tint=wire)


def bare_bulb(model: SceneModel, drop: float, stuff: Material, luminance: float) -> None:
    """Hang a bulb without a shade from the origin."""
    model.cylinder((0, 0, -drop), (0, 0, 0), 0.005, stuff, segments=6, caps=False, tint=(0.04, 0.04, 0.04))
    model.cylinder((0, 0, -drop - 0.06), (0, 0, -drop), 0.022, stuff, segments=12, tint=(0.1, 0.1, 0.1))
    with model.at((0.0, 0.0, -drop - 0.1)):
        globe(model, 0.05, luminance)


def tube_lamp(model: SceneModel, long: float, stuff: Material, luminance: float) -> None:
    """Hang a fluorescent tube along x under its holder, whose upper side is at the origin."""
    model.box((-long / 2, -0.03, -0.05), (long / 2, 0.03, 0.0), stuff)
    for x in (-long / 2 + 0.02, long / 2 - 0.02):
        model.box((x - 0.02, -0.022, -0.11), (x + 0.02, 0.022, -0.05), stuff, skip="Z")
    x = long / 2 - 0.04
    glow(model, (-x, -0.016, -0.1), (x, 0.016, -0.064), luminance, (0.95, 1.0, 0.97))


def drapes(model: SceneModel, wide: float, tall: float, cloth: Material, seed_phase: float = 0.0) -> None:
    """Hang a curtain in folds from x = 0 to wide, from z = 0 to tall, before a wall at y = 0."""
    steps = max(12, int(wide / 0.022))
    x = np.linspace(0, wide, steps + 1)
    wave = 0.035 * np.sin(2 * math.pi * x / 0.13 + seed_phase) + 0.012 * np.sin(2 * math.pi * x / 0.31)
    lower = np.column_stack([x, -0.07 + 1.25 * wave, np.zeros_like(x)])
    upper = np.column_stack([x, -0.07 + 0.8 * wave, np.full_like(x, tall)])
    points = np.concatenate([lower, upper])
    # Cloth in folds is longer than the window is wide.
    uvs = np.concatenate([np.column_stack([1.6 * x, np.full_like(x, v)]) for v in (0.0, tall)]) / cloth.tile
    k = np.arange(steps)
    front = np.concatenate(
        [np.stack([k, k + 1, k + steps + 2], 1), np.stack([k, k + steps + 2, k + steps + 1], 1)]
    )
    model.mesh(points, front, cloth, uvs=uvs)
    model.mesh(points, front[:, ::-1], cloth, uvs=uvs)


def rod(model: SceneModel, wide: float, stuff: Material, tint: Tint) -> None:
    """Add a curtain rod along x from the origin, with a knob at each end."""
    model.cylinder((0, 0, 0), (wide, 0, 0), 0.014, stuff, segments=10, tint=tint)
    for x in (0.0, wide):
        model.sphere((x, 0, 0), 0.03, stuff, segments=10, tint=tint)


def garment(
    model: SceneModel, size: tuple[float, float], cloth: Material, tint: Tint, rng: np.random.Generator
) -> None:
    """Hang a coat or jacket from the origin, before a wall at y = 0: shoulders, body in folds, a sleeve."""
    wide, tall = size
    steps = 14
    angle = np.linspace(math.pi, 2 * math.pi, steps + 1)
    folds = 1 + 0.10 * rng.normal(size=steps + 1)
    rows = []
    for height, spread, deep in (
        (0.0, 0.12, 0.05),
        (-0.06, 0.75, 0.09),
        (-0.3, 0.85, 0.12),
        (-tall, 1.0, 0.14),
    ):
        x, y = wide / 2 * spread * np.cos(angle), deep * np.sin(angle) * folds
        rows.append(np.column_stack([x, y, np.full(steps + 1, height)]))
    points, k = np.concatenate(rows), np.arange(steps)
    triangles = [
        np.concatenate([np.stack([a + k, a + k + 1, b + k + 1], 1), np.stack([a + k, b + k + 1, b + k], 1)])[
            :, ::-1
        ]
        for a, b in (((row) * (steps + 1), (row + 1) * (steps + 1)) for row in range(3))
    ]
    model.mesh(points, np.concatenate(triangles), cloth, tint=tint)
    for side in (-1, 1):
        model.cylinder(
            (side * wide * 0.5, -0.09, -0.62),
            (side * wide * 0.34, -0.06, -0.09),
            (0.05, 0.058),
            cloth,
            segments=8,
            caps=False,
            tint=[0.9 * t for t in tint],
        )
        shoulder, radii = (side * wide * 0.34, -0.06, -0.095), (0.063, 0.063, 0.055)
        model.sphere(shoulder, radii, cloth, segments=10, tint=[0.9 * t for t in tint])


def shoe(model: SceneModel, stuff: Material, tint: Tint, tall: float = 0.09) -> None:
    """Add a shoe, or with more height a boot, its tip towards -y."""
    model.box((-0.045, -0.14, 0.0), (0.045, 0.13, 0.02), stuff, tint=(0.08, 0.07, 0.06))
    model.sphere((0, -0.07, 0.03), (0.046, 0.08, 0.045), stuff, segments=8, tint=tint)
    model.cylinder((0, 0.06, 0.015), (0, 0.07, tall), (0.05, 0.042), stuff, segments=8, tint=tint)


def mug(model: SceneModel, stuff: Material, tint: Tint) -> None:
    """Add a mug with its handle."""
    model.cylinder((0, 0, 0), (0, 0, 0.09), 0.038, stuff, segments=14, caps=False, tint=tint)
    model.cylinder((0, 0, 0.06), (0, 0, 0.075), 0.036, stuff, segments=14, tint=(0.1, 0.05, 0.02))
    for z in (0.025, 0.065):
        model.box((0.034, -0.006, z - 0.006), (0.064, 0.006, z + 0.006), stuff, tint=tint)
    model.box((0.054, -0.006, 0.025), (0.066, 0.006, 0.065), stuff, tint=tint)


def bowl(model: SceneModel, radius: float, stuff: Material, tint: Tint) -> None:
    """Add a bowl; its inside is a disc below the rim."""
    model.cylinder(
        (0, 0, 0), (0, 0, 0.45 * radius), (0.45 * radius, radius), stuff, segments=20, caps=False, tint=tint
    )
    low, high, inner = (0, 0, 0.28 * radius), (0, 0, 0.38 * radius), [0.75 * t for t in tint]
    model.cylinder(low, high, (0.75 * radius, 0.96 * radius), stuff, segments=20, tint=inner)


def fruit(model: SceneModel, radius: float, stuff: Material, rng: np.random.Generator) -> None:
    """Add a bowl with apples, oranges and a lemon."""
    bowl(model, radius, stuff, (0.55, 0.68, 0.75))
    colours = ((0.62, 0.06, 0.04), (0.85, 0.36, 0.03), (0.5, 0.55, 0.08), (0.85, 0.7, 0.06), (0.6, 0.1, 0.05))
    for number in range(7):
        turn, out = 2.4 * number, 0.55 * radius * (number > 0)
        model.sphere(
            (out * math.cos(turn), out * math.sin(turn), 0.55 * radius + 0.02 * (number == 0)),
            0.036 + 0.006 * rng.random(),
            stuff,
            segments=9,
            tint=colours[number % len(colours)],
        )


def plate(model: SceneModel, radius: float, stuff: Material, tint: Tint = WHITE) -> None:
    """Add a plate with a raised rim."""
    model.cylinder(
        (0, 0, 0), (0, 0, 0.018), (0.6 * radius, radius), stuff, segments=24, caps=False, tint=tint
    )
    model.cylinder(
        (0, 0, 0.0), (0, 0, 0.012), 0.86 * radius, stuff, segments=24, tint=[0.92 * t for t in tint]
    )


def paper(model: SceneModel, size: tuple[float, float], image: Material, tint: Tint = WHITE) -> None:
    """Lay a sheet, a magazine or a place mat flat on the origin, its lower edge towards -y."""
    x, y = size[0] / 2, size[1] / 2
    model.box((-x, -y, 0), (x, y, 0.004), image, skip="zZ", tint=tint)
    sheet(model, rectangle((-x, x), (-y, y), 0.004), image, tint)
