"""The kitchen and its equipment: cupboards, sink under the window, stove, refrigerator, the laid table."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.props.furniture import DARK, WHITE, Tint, chair, table
from evenlight.stimuli.scenes.content.props.household import (
    bowl,
    drapes,
    fruit,
    mug,
    pendant,
    picture,
    plate,
    rod,
    sheet,
)
from evenlight.stimuli.scenes.content.props.plants import flower_bed, potted
from evenlight.stimuli.scenes.content.props.storage import GLASS_TINTS, bottle, jar, panelled_front, vase
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

FRONT = (0.34, 0.47, 0.44)
CREAM = (0.86, 0.8, 0.66)


def kitchen(model: SceneModel) -> None:
    """Add all that stands, lies and hangs in the kitchen."""
    _sink_side(model)
    _stove_side(model)
    _dining(model)
    _add_small_objects(model)


def _sink_side(model: SceneModel) -> None:
    """Fit the south wall: cupboards under the window, sink, drying dishes, herbs on the sill."""
    rng = model.rng_for("sink side")
    with model.at((8.6, 0.6, 0.0), 180):
        base_unit(model, 4.1, stuff.BOARD, stuff.OAK, FRONT)
        with model.at((0.0, 0.0, 0.9)):
            sink(model, stuff.STEEL)
        for number in range(6):
            with model.at((-0.28 + 0.035 * number, 0.02, 1.02)):
                model.cylinder((0, 0, 0), (0.01, 0, 0), 0.11, stuff.GLAZED, segments=20)
        for x, y, tint in (
            (0.62, 0.1, (0.2, 0.35, 0.15)),
            (0.75, 0.12, (0.75, 0.7, 0.3)),
            (0.7, -0.05, (0.5, 0.2, 0.1)),
        ):
            with model.at((x, y, 0.9)):
                bottle(model, 0.26, stuff.GLAZED, tint)
        with model.at((-1.2, 0.05, 0.9), 20):
            kettle(model, stuff.GLAZED, (0.55, 0.1, 0.08))
        with model.at((-1.7, 0.05, 0.9)):
            _bread_box(model)
        with model.at((1.35, 0.0, 0.9), 8):
            fruit(model, 0.16, stuff.GLAZED, rng)
    lining_low = (6.42, 0.9)
    for low, high in (
        ((lining_low[0], 0.9), (7.5, 1.5)),
        ((7.5, 0.9), (9.6, 1.1)),
        ((9.6, 0.9), (10.7, 1.5)),
    ):
        model.box((low[0], 0.3, low[1]), (high[0], 0.312, high[1]), stuff.ACCENT_TILES, skip="yz")
    for x in (7.85, 8.35, 8.95, 9.3):
        with model.at((x, 0.2, 1.1)):
            pot, colours = (stuff.PAINT, stuff.SOIL, stuff.PAINT), ((0.62, 0.28, 0.16), (0.22, 0.4, 0.1))
            potted(model, (0.065, 0.3), pot, colours, rng, 16)
    with model.at((9.72, 0.33, 2.06), 180):
        drapes(model, 2.34, 0.26, stuff.GINGHAM)
    with model.at((7.35, 0.37, 2.33)):
        rod(model, 2.4, stuff.PAINT, (0.9, 0.88, 0.8))


def _bread_box(model: SceneModel) -> None:
    model.box((-0.2, -0.13, 0), (0.2, 0.13, 0.2), stuff.PINE)
    model.box((-0.18, -0.137, 0.02), (0.18, -0.13, 0.18), stuff.OAK, skip="Y")
    model.sphere((0, -0.15, 0.1), 0.014, stuff.WALNUT, segments=8)


def _stove_side(model: SceneModel) -> None:
    """Fit the north wall: refrigerator, cupboards, stove with its hood, tiles, wall cupboards."""
    with model.at((7.86, 4.66, 0.0)):
        refrigerator(model, stuff.GLAZED, stuff.STEEL, CREAM, stuff.PAPERS)
    with model.at((8.65, 4.7, 0.0)):
        base_unit(model, 0.92, stuff.BOARD, stuff.OAK, FRONT)
        for number, (x, tall) in enumerate(((-0.36, 0.2), (-0.24, 0.17), (-0.13, 0.14), (-0.03, 0.11))):
            with model.at((x, 0.12, 0.9)):
                jar(model, tall, stuff.GLAZED, stuff.STEEL, GLASS_TINTS[number + 3])
        with model.at((0.25, 0.1, 0.9)):
            bowl(model, 0.13, stuff.GLAZED, (0.8, 0.75, 0.6))
        model.box((0.1, -0.2, 0.9), (0.42, -0.02, 0.918), stuff.WALNUT)
    with model.at((9.42, 4.7, 0.0)):
        stove(model, stuff.GLAZED, stuff.STEEL, stuff.KEYBOARD)
        for x, y, radius, tint in (
            (-0.145, 0.13, 0.11, (0.75, 0.2, 0.1)),
            (0.145, -0.14, 0.09, (0.8, 0.8, 0.82)),
        ):
            with model.at((x, y, 0.932)):
                pot(model, radius, stuff.STEEL, tint)
    with model.at((10.21, 4.7, 0.0)):
        base_unit(model, 0.97, stuff.BOARD, stuff.OAK, FRONT)
        for x, tint in ((-0.3, (0.1, 0.25, 0.1)), (-0.2, (0.35, 0.2, 0.05)), (0.1, (0.7, 0.65, 0.5))):
            with model.at((x, 0.15, 0.9)):
                bottle(model, 0.3, stuff.GLAZED, tint)
        with model.at((0.3, 0.05, 0.9)):
            vase(model, 0.17, stuff.GLAZED, (0.8, 0.78, 0.7))
            for k in range(5):
                low, high = (0.01 * k - 0.02, 0, 0.1), (0.05 * k - 0.1, 0.02 * k - 0.04, 0.33)
                model.cylinder(low, high, 0.008, stuff.PINE, segments=6)
    model.box((8.18, 4.988, 0.9), (10.7, 5.0, 1.55), stuff.KITCHEN_TILES, skip="Yz")
    for x, wide in ((8.65, 0.92), (10.2, 0.96)):
        with model.at((x, 4.99, 1.5)):
            wall_unit(model, wide, 0.75, stuff.BOARD, FRONT)
            half = wide / 2 - 0.08  # a light under the cupboard
            model.lamp(rectangle((-half, half), (-0.1, -0.16), -0.004), 1500.0, (1.0, 0.9, 0.75))
    with model.at((9.42, 4.98, 1.62)):
        hood(model, stuff.STEEL)
    with model.at((9.1, 4.985, 1.42)):
        hanging_tools(model, 0.64, stuff.STEEL, stuff.PINE)


def _dining(model: SceneModel) -> None:
    """Add the dining table with chairs, laid for breakfast, under a lamp."""
    rng = model.rng_for("dining")
    with model.at((9.15, 2.6, 0.0)):
        table(model, (1.6, 0.9, 0.75), stuff.OAK)
        for x, y, turn in (
            (-0.42, 0.62, 4.0),
            (0.42, 0.66, -6.0),
            (-0.4, -0.64, 176.0),
            (0.44, -0.6, 187.0),
            (1.02, 0.0, -88.0),
        ):
            with model.at((x, y, 0.0), turn):
                chair(model, stuff.BOARD, stuff.GINGHAM, (0.8, 0.62, 0.4))
        model.box((-0.78, -0.2, 0.75), (0.78, 0.2, 0.753), stuff.TOWEL, skip="z")
        for x, y in ((-0.42, 0.3), (0.42, 0.3), (-0.42, -0.3), (0.42, -0.3)):
            with model.at((x, y, 0.752)):
                plate(model, 0.12, stuff.GLAZED, (0.85, 0.88, 0.9))
            with model.at((x + 0.2, y * 0.9, 0.752), 70 * x):
                mug(model, stuff.GLAZED, ((0.2, 0.4, 0.55), (0.7, 0.55, 0.2))[int(y > 0)])
            for side in (-0.15, -0.165):
                model.box(
                    (x + side, y - 0.09, 0.752), (x + side + 0.008, y + 0.09, 0.756), stuff.STEEL, skip="z"
                )
        with model.at((0.0, 0.0, 0.753)):
            vase(model, 0.22, stuff.GLAZED, (0.85, 0.83, 0.75))
            flower_bed(model, (-0.05, -0.05, 0.2), (0.05, 0.05), 0.3, (stuff.DAISIES,), rng)
        with model.at((0.33, 0.02, 0.753), 30):
            model.box((-0.15, -0.1, 0), (0.15, 0.1, 0.018), stuff.WALNUT)
            model.sphere((0.0, 0.0, 0.05), (0.12, 0.06, 0.05), stuff.SOIL, segments=14, tint=(1, 0.8, 0.5))
        with model.at((-0.3, 0.02, 0.753)):
            jar(model, 0.12, stuff.GLAZED, stuff.STEEL, GLASS_TINTS[0])
    with model.at((7.6, 3.3, plan.CEILING)):
        model.cylinder((0, 0, -0.07), (0, 0, 0), 0.2, stuff.PAINT, segments=28, tint=(0.8, 0.78, 0.7))
        model.lamp(rectangle((-0.15, 0.15), (0.15, -0.15), -0.072), 4800.0, (1.0, 0.9, 0.75))
    with model.at((9.15, 2.6, plan.CEILING)):
        pendant(model, 0.72, stuff.GLAZED, 4000.0, (0.5, 0.12, 0.08))


def _add_small_objects(model: SceneModel) -> None:
    """Hang a clock, a picture, a calendar and an apron; stand a basket and a bin."""
    with model.at((6.42, 4.45, 1.85), 90):
        model.cylinder((0, 0, 0), (0, -0.03, 0), 0.16, stuff.PAINT, segments=32, tint=(0.3, 0.08, 0.06))
        sheet(model, rectangle((-0.15, 0.15), -0.031, (-0.15, 0.15)), stuff.DIAL)
    with model.at((6.42, 4.45, 1.25), 90):
        picture(model, (0.36, 0.5), stuff.POSTER, stuff.PINE)
    with model.at((10.7, 4.15, 1.65), -90):
        picture(model, (0.4, 0.5), stuff.MILL, stuff.WALNUT)
    with model.at((10.7, 1.3, 1.65), -90):
        picture(model, (0.36, 0.44), stuff.SQUARES, stuff.WALNUT)
    for y in (1.35, 3.72):
        with model.at((10.69, y + 0.34, 0.7), -90):
            drapes(model, 0.34, 1.65, stuff.GINGHAM, y)
    with model.at((10.6, 1.25, 2.4), 90):
        rod(model, 2.95, stuff.PAINT, (0.9, 0.88, 0.8))
    with model.at((6.7, 1.45, 0.0)):
        model.cylinder((0, 0, 0), (0, 0, 0.5), 0.14, stuff.STEEL, segments=20, caps=False)
        model.cylinder(
            (0, 0, 0.5), (0, 0, 0.55), (0.145, 0.06), stuff.STEEL, segments=20, tint=(0.2, 0.2, 0.2)
        )
    rng = np.random.default_rng(5)
    with model.at((10.35, 4.05, 0.0)):
        model.cylinder((0, 0, 0), (0, 0, 0.3), (0.17, 0.21), stuff.OLD_WOOD, segments=18, caps=False)
        for k in range(9):
            x, y = 0.12 * np.cos(2.4 * k) * (k > 0), 0.12 * np.sin(2.4 * k) * (k > 0)
            model.sphere(
                (x, y, 0.27 + 0.03 * rng.random()), 0.055, stuff.SOIL, segments=10, tint=(1.0, 0.9, 0.7)
            )


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
            x = each - 0.05 if door % 2 == 0 else 0.05
            model.sphere((x, -0.035, 0.45), 0.014, stuff, segments=8, tint=(0.12, 0.1, 0.08))
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
    model.quad(rectangle((-0.29, 0.29), -0.301, (0.735, 0.745)), keys, uvs=WHOLE)
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
    part = [(0.1, 0.1), (0.9, 0.1), (0.9, 0.95), (0.1, 0.95)]
    model.quad(rectangle((-0.12, 0.22), -0.346, (1.24, 1.68)), notes, uvs=part)


def pot(model: SceneModel, radius: float, steel: Material, tint: Tint = WHITE) -> None:
    """Add a cooking pot with lid and two handles."""
    tall = 1.1 * radius
    model.cylinder((0, 0, 0), (0, 0, tall), radius, steel, segments=20, caps=False, tint=tint)
    model.cylinder(
        (0, 0, tall), (0, 0, tall + 0.02), (1.04 * radius, 0.5 * radius), steel, segments=20, tint=tint
    )
    model.sphere((0, 0, tall + 0.03), 0.014, steel, segments=8, tint=DARK)
    for side in (-1, 1):
        x = side * (radius + 0.02)
        model.box((x - 0.025, -0.03, 0.75 * tall), (x + 0.025, 0.03, 0.85 * tall), steel, tint=DARK)


def kettle(model: SceneModel, stuff: Material, tint: Tint) -> None:
    """Add a kettle with spout and handle."""
    model.cylinder((0, 0, 0), (0, 0, 0.1), (0.09, 0.075), stuff, segments=18, caps=False, tint=tint)
    model.cylinder((0, 0, 0.1), (0, 0, 0.15), (0.075, 0.03), stuff, segments=18, tint=tint)
    model.sphere((0, 0, 0.16), 0.015, stuff, segments=8, tint=DARK)
    model.cylinder((0.07, 0, 0.05), (0.13, 0, 0.12), (0.018, 0.01), stuff, segments=8, tint=tint)
    for start, stop in (
        ((-0.06, 0.13), (-0.05, 0.22)),
        ((-0.05, 0.22), (0.05, 0.22)),
        ((0.05, 0.22), (0.06, 0.13)),
    ):
        model.cylinder((start[0], 0, start[1]), (stop[0], 0, stop[1]), 0.009, stuff, segments=6, tint=DARK)


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
