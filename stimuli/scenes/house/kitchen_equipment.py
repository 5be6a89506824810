"""Kitchen equipment: fitted cupboards, worktop, sink, stove, hood, refrigerator, things on the worktop."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.house.furniture import WHITE, Tint
from evenlight.stimuli.scenes.house.household import WHOLE
from evenlight.stimuli.scenes.house.storage import panelled_front
from evenlight.stimuli.scenes.model import Material, SceneModel

DARK = (0.05, 0.05, 0.055)


def base_unit(model: SceneModel, wide: float, stuff: Material, top: Material, tint: Tint) -> None:
    """Add a run of floor cupboards under a worktop, front -y, back at y = 0.3."""
    model.box(
        (-wide / 2, -0.24, 0), (wide / 2, 0.29, 0.08), stuff, skip="zZ", tint=[0.25 * part for part in tint]
    )
    model.box(
        (-wide / 2, -0.29, 0.08), (wide / 2, 0.29, 0.86), stuff, skip="Z", tint=[0.5 * part for part in tint]
    )
    each = wide / max(1, round(wide / 0.5))
    for door in range(max(1, round(wide / 0.5))):
        with model.at((-wide / 2 + each * door + 0.004, -0.291, 0.085)):
            panelled_front(model, (each - 0.008, 0.6), stuff, tint)
            model.box((0.0, -0.022, 0.61), (each - 0.008, 0.0, 0.765), stuff, skip="Y", tint=tint)
            model.sphere((each / 2, -0.035, 0.69), 0.014, stuff, segments=8, tint=(0.12, 0.1, 0.08))
            model.sphere(
                (each - 0.05 if door % 2 == 0 else 0.05, -0.035, 0.45),
                0.014,
                stuff,
                segments=8,
                tint=(0.12, 0.1, 0.08),
            )
    model.box((-wide / 2, -0.33, 0.86), (wide / 2, 0.3, 0.9), top)


def wall_unit(model: SceneModel, wide: float, tall: float, stuff: Material, tint: Tint) -> None:
    """Add a run of wall cupboards; the origin is below their back, their front is -y."""
    model.box((-wide / 2, -0.33, 0), (wide / 2, 0, tall), stuff, skip="Y", tint=tint)
    model.box((-wide / 2 - 0.02, -0.36, tall), (wide / 2 + 0.02, 0, tall + 0.05), stuff, tint=tint)
    doors = max(1, round(wide / 0.45))
    each = wide / doors
    for door in range(doors):
        x = -wide / 2 + each * door
        with model.at((x + 0.004, -0.331, 0.004)):
            panelled_front(model, (each - 0.008, tall - 0.008), stuff, tint)
        knob = x + (each - 0.05 if door % 2 == 0 else 0.05)
        model.sphere((knob, -0.366, 0.1), 0.013, stuff, segments=8, tint=(0.12, 0.1, 0.08))


def sink(model: SceneModel, steel: Material) -> None:
    """Add a sink with its tap on a worktop at the origin; the tap is at the back."""
    model.box((-0.42, -0.24, 0.0), (0.42, 0.22, 0.012), steel, skip="z", tint=(0.75, 0.77, 0.8))
    model.box((-0.36, -0.2, 0.012), (0.06, 0.16, 0.0125), steel, skip="zxXyY", tint=(0.22, 0.23, 0.25))
    for rib in range(5):
        x = 0.12 + 0.055 * rib
        model.box((x, -0.18, 0.012), (x + 0.02, 0.16, 0.017), steel, skip="z", tint=(0.7, 0.72, 0.75))
    model.cylinder((-0.14, 0.19, 0.01), (-0.14, 0.19, 0.26), 0.014, steel, segments=10)
    turns = np.linspace(0, math.pi, 7)
    arc = [(-0.14, 0.19 - 0.09 * (1 - math.cos(t)), 0.26 + 0.09 * math.sin(t)) for t in turns]
    for start, stop in pairwise(arc):
        model.cylinder(start, stop, 0.012, steel, segments=8, caps=False)
    for x in (-0.2, -0.08):
        model.cylinder((x, 0.19, 0.01), (x, 0.19, 0.06), 0.02, steel, segments=10)


def stove(model: SceneModel, enamel: Material, steel: Material, keys: Material) -> None:
    """Add a gas stove with oven: door with window and handle, knobs, four burners; front -y, back y = 0.3."""
    model.box((-0.3, -0.3, 0.06), (0.3, 0.3, 0.88), enamel)
    model.box((-0.29, -0.24, 0.0), (0.29, 0.28, 0.06), enamel, tint=DARK)
    model.box((-0.27, -0.325, 0.2), (0.27, -0.3, 0.7), enamel, skip="Y")
    model.box((-0.19, -0.327, 0.3), (0.19, -0.325, 0.58), steel, skip="Y", tint=(0.03, 0.028, 0.03))
    model.cylinder((-0.24, -0.36, 0.65), (0.24, -0.36, 0.65), 0.012, steel, segments=8)
    model.box((-0.27, -0.315, 0.09), (0.27, -0.3, 0.18), enamel, skip="Y", tint=(0.9, 0.9, 0.9))
    for knob in range(5):
        x = -0.22 + 0.11 * knob
        model.cylinder((x, -0.3, 0.8), (x, -0.335, 0.8), 0.023, steel, segments=12, tint=(0.15, 0.15, 0.16))
    model.quad(
        [(-0.29, -0.301, 0.735), (0.29, -0.301, 0.735), (0.29, -0.301, 0.745), (-0.29, -0.301, 0.745)],
        keys,
        uvs=WHOLE,
    )
    model.box((-0.3, -0.3, 0.88), (0.3, 0.3, 0.9), steel, tint=(0.5, 0.5, 0.52))
    model.box((-0.3, 0.28, 0.9), (0.3, 0.3, 1.0), enamel)
    for x in (-0.145, 0.145):
        for y in (-0.14, 0.13):
            model.cylinder((x, y, 0.9), (x, y, 0.915), 0.05, steel, segments=16, tint=(0.12, 0.12, 0.12))
            for turn in (0.0, 90.0):
                model.box(
                    (x - 0.11, y - 0.006, 0.92), (x + 0.11, y + 0.006, 0.932), steel, turn=turn, tint=DARK
                )


def hood(model: SceneModel, steel: Material) -> None:
    """Add a hood over the stove, its lower edge at z = 0, its back at y = 0, its flue 0.9 m up; front -y."""
    points = [(-0.3, -0.48, 0.06), (0.3, -0.48, 0.06), (0.3, 0, 0.06), (-0.3, 0, 0.06),
              (-0.12, -0.24, 0.3), (0.12, -0.24, 0.3), (0.12, 0, 0.3), (-0.12, 0, 0.3)]  # fmt: skip
    model.mesh(points, [(0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (3, 0, 4), (3, 4, 7)], steel)
    model.box((-0.3, -0.48, 0), (0.3, 0, 0.06), steel)
    model.box((-0.12, -0.24, 0.3), (0.12, 0, 0.9), steel, skip="zZY")


def refrigerator(model: SceneModel, enamel: Material, steel: Material, tint: Tint, notes: Material) -> None:
    """Add a tall refrigerator with two doors, handles, papers under magnets; front -y, back y = 0.32."""
    model.box((-0.31, -0.3, 0.05), (0.31, 0.32, 1.82), enamel, tint=tint)
    for low, high in ((0.07, 1.14), (1.155, 1.81)):
        model.box((-0.305, -0.345, low), (0.305, -0.3, high), enamel, skip="Y", tint=tint)
    for low, high in ((0.75, 1.1), (1.2, 1.45)):
        model.cylinder((-0.25, -0.375, low), (-0.25, -0.375, high), 0.011, steel, segments=8)
    model.quad(
        [(-0.12, -0.346, 1.24), (0.22, -0.346, 1.24), (0.22, -0.346, 1.68), (-0.12, -0.346, 1.68)],
        notes,
        uvs=[(0.1, 0.1), (0.9, 0.1), (0.9, 0.95), (0.1, 0.95)],
    )


def pot(model: SceneModel, radius: float, steel: Material, tint: Tint = WHITE) -> None:
    """Add a cooking pot with lid and two handles."""
    tall = 1.1 * radius
    model.cylinder((0, 0, 0), (0, 0, tall), radius, steel, segments=20, caps=False, tint=tint)
    model.cylinder(
        (0, 0, tall),
        (0, 0, tall + 0.02),
        1.04 * radius,
        steel,
        top_radius=0.5 * radius,
        segments=20,
        tint=tint,
    )
    model.sphere((0, 0, tall + 0.03), 0.014, steel, segments=8, tint=DARK)
    for side in (-1, 1):
        x = side * (radius + 0.02)
        model.box((x - 0.025, -0.03, 0.75 * tall), (x + 0.025, 0.03, 0.85 * tall), steel, tint=DARK)


def kettle(model: SceneModel, stuff: Material, tint: Tint) -> None:
    """Add a kettle with spout and handle."""
    model.cylinder((0, 0, 0), (0, 0, 0.1), 0.09, stuff, top_radius=0.075, segments=18, caps=False, tint=tint)
    model.cylinder((0, 0, 0.1), (0, 0, 0.15), 0.075, stuff, top_radius=0.03, segments=18, tint=tint)
    model.sphere((0, 0, 0.16), 0.015, stuff, segments=8, tint=DARK)
    model.cylinder((0.07, 0, 0.05), (0.13, 0, 0.12), 0.018, stuff, top_radius=0.01, segments=8, tint=tint)
    for start, stop in (
        ((-0.06, 0.13), (-0.05, 0.22)),
        ((-0.05, 0.22), (0.05, 0.22)),
        ((0.05, 0.22), (0.06, 0.13)),
    ):
        model.cylinder((start[0], 0, start[1]), (stop[0], 0, stop[1]), 0.009, stuff, segments=6, tint=DARK)


def bottle(model: SceneModel, tall: float, stuff: Material, tint: Tint) -> None:
    """Add a bottle."""
    radius = 0.13 * tall
    model.cylinder((0, 0, 0), (0, 0, 0.6 * tall), radius, stuff, segments=12, caps=False, tint=tint)
    model.cylinder(
        (0, 0, 0.6 * tall),
        (0, 0, 0.75 * tall),
        radius,
        stuff,
        top_radius=0.35 * radius,
        segments=12,
        caps=False,
        tint=tint,
    )
    model.cylinder((0, 0, 0.75 * tall), (0, 0, tall), 0.35 * radius, stuff, segments=10, tint=tint)


def hanging_tools(model: SceneModel, wide: float, steel: Material, wooden: Material) -> None:
    """Hang ladles, whisks and pans from a rail at the origin along x, before a wall at y = 0."""
    model.cylinder((0, -0.04, 0), (wide, -0.04, 0), 0.008, steel, segments=8)
    count = int(wide / 0.11)
    for tool in range(count):
        x, long = 0.06 + 0.11 * tool, 0.2 + 0.05 * ((tool * 7) % 3)
        stuff = wooden if tool % 3 == 1 else steel
        model.box((x - 0.006, -0.046, -long), (x + 0.006, -0.038, -0.01), stuff)
        if tool % 3 == 0:
            model.cylinder((x, -0.03, -long - 0.05), (x, -0.055, -long - 0.05), 0.055, steel, segments=14)
        elif tool % 3 == 1:
            model.box((x - 0.03, -0.046, -long - 0.09), (x + 0.03, -0.038, -long), wooden)
        else:
            model.sphere((x, -0.042, -long - 0.03), (0.035, 0.02, 0.04), steel, segments=10)
