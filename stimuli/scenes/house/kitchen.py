"""The kitchen: fitted cupboards, sink under the window, stove, refrigerator, the laid table."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.house import materials as stuff
from evenlight.stimuli.scenes.house import plan
from evenlight.stimuli.scenes.house.furniture import chair, table
from evenlight.stimuli.scenes.house.household import (
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
from evenlight.stimuli.scenes.house.kitchen_equipment import (
    base_unit,
    bottle,
    hanging_tools,
    hood,
    kettle,
    pot,
    refrigerator,
    sink,
    stove,
    wall_unit,
)
from evenlight.stimuli.scenes.house.storage import GLASS_TINTS, jar, vase
from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.plants import flower_bed, potted

FRONT = (0.34, 0.47, 0.44)
CREAM = (0.86, 0.8, 0.66)


def kitchen(model: SceneModel) -> None:
    """Add all that stands, lies and hangs in the kitchen."""
    _sink_side(model)
    _stove_side(model)
    _dining(model)
    _odds(model)


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
            potted(
                model,
                (0.065, 0.3),
                (stuff.PAINT, stuff.SOIL, stuff.PAINT),
                ((0.62, 0.28, 0.16), (0.22, 0.4, 0.1)),
                rng,
                16,
            )
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
                model.cylinder(
                    (0.01 * k - 0.02, 0, 0.1),
                    (0.05 * k - 0.1, 0.02 * k - 0.04, 0.33),
                    0.008,
                    stuff.PINE,
                    segments=6,
                )
    model.box((8.18, 4.988, 0.9), (10.7, 5.0, 1.55), stuff.KITCHEN_TILES, skip="Yz")
    for x, wide in ((8.65, 0.92), (10.2, 0.96)):
        with model.at((x, 4.99, 1.5)):
            wall_unit(model, wide, 0.75, stuff.BOARD, FRONT)
            half = wide / 2 - 0.08  # a light under the cupboard
            model.lamp(
                [(-half, -0.1, -0.004), (half, -0.1, -0.004), (half, -0.16, -0.004), (-half, -0.16, -0.004)],
                1500.0,
                (1.0, 0.9, 0.75),
            )
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
        model.lamp(
            [(-0.15, 0.15, -0.072), (0.15, 0.15, -0.072), (0.15, -0.15, -0.072), (-0.15, -0.15, -0.072)],
            4800.0,
            (1.0, 0.9, 0.75),
        )
    with model.at((9.15, 2.6, plan.CEILING)):
        pendant(model, 0.72, stuff.GLAZED, 4000.0, (0.5, 0.12, 0.08))


def _odds(model: SceneModel) -> None:
    """Hang a clock, a picture, a calendar and an apron; stand a basket and a bin."""
    with model.at((6.42, 4.45, 1.85), 90):
        model.cylinder((0, 0, 0), (0, -0.03, 0), 0.16, stuff.PAINT, segments=32, tint=(0.3, 0.08, 0.06))
        sheet(
            model,
            [(-0.15, -0.031, -0.15), (0.15, -0.031, -0.15), (0.15, -0.031, 0.15), (-0.15, -0.031, 0.15)],
            stuff.DIAL,
        )
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
            (0, 0, 0.5), (0, 0, 0.55), 0.145, stuff.STEEL, top_radius=0.06, segments=20, tint=(0.2, 0.2, 0.2)
        )
    rng = np.random.default_rng(5)
    with model.at((10.35, 4.05, 0.0)):
        model.cylinder((0, 0, 0), (0, 0, 0.3), 0.17, stuff.OLD_WOOD, top_radius=0.21, segments=18, caps=False)
        for k in range(9):
            x, y = 0.12 * np.cos(2.4 * k) * (k > 0), 0.12 * np.sin(2.4 * k) * (k > 0)
            model.sphere(
                (x, y, 0.27 + 0.03 * rng.random()), 0.055, stuff.SOIL, segments=10, tint=(1.0, 0.9, 0.7)
            )
