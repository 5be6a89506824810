"""The garden of the house: terrace, porch, trees, beds and hedges, what stands on the lawn."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.house.plan import Opening, bar, flight, window
from evenlight.stimuli.scenes.content.house.shell import GREEN_TRIM, TRIM, gable
from evenlight.stimuli.scenes.content.props.furniture import bench, chair, deck_chair, round_table
from evenlight.stimuli.scenes.content.props.household import mug, plate
from evenlight.stimuli.scenes.content.props.plants import flower_bed, hedge, potted, shrub, tree
from evenlight.stimuli.scenes.content.props.storage import bottle
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.shapes import rectangle

TERRACOTTA, LEAF = (0.62, 0.28, 0.16), (0.22, 0.4, 0.1)
BLACK, RED = (0.06, 0.06, 0.06), (0.5, 0.1, 0.08)


def garden(model: SceneModel) -> None:
    """Add what is outside within the hedges."""
    _terrace(model)
    _porch(model)
    _planting(model)
    _lawn(model)


def _terrace(model: SceneModel) -> None:
    """Add the deck with its steps, railing, table under a parasol, pots."""
    (x0, y0), (x1, y1) = plan.DECK_LOW, plan.DECK_HIGH
    model.box((x0, y0, plan.GROUND), (x1, y1, -0.02), stuff.DECK, skip="zY")
    flight(model, plan.GARDEN_STEPS, (stuff.DECK, stuff.PLINTH), solid=True)
    a, c = plan.GARDEN_STEPS.low[0], plan.GARDEN_STEPS.high[0]
    _railing(model, "x", (x0, a - 0.05), y0)
    _railing(model, "x", (c + 0.05, x1), y0)
    _railing(model, "y", (y0, y1 - 0.1), x0)
    _railing(model, "y", (y0, y1 - 0.1), x1)
    rng = model.rng_for("terrace")
    with model.at((1.9, -1.75, -0.02)):
        _laid_table(model)
    for x, y, radius, tall in (
        (5.75, -0.5, 0.22, 0.95),
        (6.5, -0.55, 0.18, 0.7),
        (3.05, -2.85, 0.17, 0.6),
        (5.55, -2.85, 0.17, 0.6),
        (0.95, -0.45, 0.2, 1.0),
    ):
        with model.at((x, y, -0.02)):
            potted(model, (radius, tall), (stuff.PAINT, stuff.SOIL, stuff.PAINT), (TERRACOTTA, LEAF), rng, 26)
            if tall < 0.8:
                flower_bed(model, (-0.14, -0.14, 1.4 * radius), (0.14, 0.14), 0.28, (stuff.ROSES,), rng)
    with model.at((6.35, -2.0, -0.02), -90):
        bench(model, 1.5, stuff.PINE)
    with model.at((5.9, -1.3, -0.02), -50):
        _watering_can(model)


def _laid_table(model: SceneModel) -> None:
    """Add the garden table with its chairs and a parasol, set for coffee."""
    round_table(model, 0.55, 0.73, stuff.PINE, (0.95, 0.93, 0.88))
    for turn in (25.0, 120.0, 215.0, 310.0):
        with model.at((0.0, 0.0, 0.0), turn), model.at((0.0, 0.78, 0.0)):
            chair(model, stuff.STEEL, stuff.CUSHION_STRIPES, GREEN_TRIM)
        with model.at((0.0, 0.0, 0.73), turn), model.at((0.0, 0.36, 0.0)):
            plate(model, 0.11, stuff.GLAZED)
            with model.at((0.15, 0.03, 0.0), 40):
                mug(model, stuff.GLAZED, (0.2, 0.4, 0.55))
    with model.at((0.12, -0.1, 0.73)):
        bottle(model, 0.28, stuff.GLAZED, (0.1, 0.3, 0.12))
    model.cylinder((0, 0, 0), (0, 0, 2.55), 0.022, stuff.PINE, segments=10)
    model.cylinder((0, 0, 0.0), (0, 0, 0.08), 0.24, stuff.PLINTH, segments=20)
    _parasol(model, 1.45, 2.5)


def _parasol(model: SceneModel, radius: float, tall: float) -> None:
    """Add a parasol's cloth of eight gores, seen from above and from below."""
    turns = np.linspace(0, 2 * np.pi, 9)
    rim = np.column_stack([radius * np.cos(turns), radius * np.sin(turns), np.full(9, tall - 0.45)])
    top = np.array([0.0, 0.0, tall])
    for k in range(8):
        corners = [rim[k], rim[k + 1], top]
        mapped = [(0.0, 0.0), (0.33, 0.0), (0.167, 1.0)]
        model.mesh(corners, [(0, 1, 2)], stuff.AWNING, uvs=mapped)
        model.mesh(corners, [(2, 1, 0)], stuff.AWNING, uvs=mapped, tint=(0.8, 0.8, 0.8))
        fringe = [rim[k] - [0, 0, 0.16], rim[k + 1] - [0, 0, 0.16], rim[k + 1], rim[k]]
        for order in (1, -1):
            model.quad(fringe[::order], stuff.AWNING)


def _watering_can(model: SceneModel) -> None:
    model.cylinder((0, 0, 0), (0, 0, 0.26), 0.12, stuff.STEEL, segments=18, tint=(0.25, 0.42, 0.3))
    model.cylinder((0.1, 0, 0.06), (0.38, 0, 0.32), 0.022, stuff.STEEL, segments=8, tint=(0.25, 0.42, 0.3))
    model.cylinder(
        (0.36, 0, 0.3), (0.4, 0, 0.335), (0.03, 0.055), stuff.STEEL, segments=12, tint=(0.6, 0.5, 0.2)
    )


def _railing(model: SceneModel, along: str, span: tuple[float, float], line: float) -> None:
    """Add a white wooden railing on the deck."""
    across = (line - 0.02, line + 0.02)
    for low, high in ((0.06, 0.1), (0.82, 0.88)):
        bar(model, along, span, across, (stuff.PAINT, (low, high), TRIM))
    count = max(2, round((span[1] - span[0]) / 0.13))
    for place in np.linspace(span[0] + 0.02, span[1] - 0.02, count):
        post = place in (span[0] + 0.02, span[1] - 0.02)
        half = 0.04 if post else 0.014
        paint = (stuff.PAINT, (-0.02, 0.95 if post else 0.83), TRIM)
        bar(model, along, (place - half, place + half), (line - half, line + half), paint)


def _porch(model: SceneModel) -> None:
    """Add the porch at the front door: steps, a roof on posts, lamp, letter box, pots."""
    (x0, y0), (x1, y1) = plan.PORCH_LOW, plan.PORCH_HIGH
    model.box((x0, y0, plan.GROUND), (x1, y1, 0.0), stuff.STONE, skip="zX")
    flight(model, plan.PORCH_STEPS, (stuff.STONE, stuff.PLINTH), solid=True)
    for y in (y0 + 0.12, y1 - 0.12):
        model.box((x0 + 0.06, y - 0.06, 0), (x0 + 0.18, y + 0.06, 2.45), stuff.PAINT, skip="zZ", tint=TRIM)
        model.box((x0 + 0.03, y - 0.09, 0), (x0 + 0.21, y + 0.09, 0.2), stuff.PAINT, skip="z", tint=TRIM)
    # Without a top, the wall between ceiling and tiles is buried, and has the light of what is below.
    model.box((x0 - 0.1, y0 - 0.1, 2.45), (x1, y1 + 0.1, 2.6), stuff.PAINT, skip="XZ", tint=TRIM)
    points = [(x0 - 0.25, y0 - 0.2, 2.6), (x0 - 0.25, y1 + 0.2, 2.6), (0, y1 + 0.2, 3.1), (0, y0 - 0.2, 3.1)]
    model.quad(points[::-1], stuff.ROOF)
    for y in (y0 + 0.05, y1 - 0.05):
        bar(model, "x", (x0 + 0.2, -0.02), (y - 0.02, y + 0.02), (stuff.PAINT, (0.85, 0.9), TRIM))
        for x in np.arange(x0 + 0.3, -0.05, 0.13):
            model.box(
                (x - 0.014, y - 0.014, 0), (x + 0.014, y + 0.014, 0.85), stuff.PAINT, skip="zZ", tint=TRIM
            )
    for low, high, tint in (
        ((-0.02, 5.18, 1.66), (0.0, 5.3, 2.04), BLACK), ((-0.13, 5.17, 1.72), (-0.02, 5.31, 1.94), TRIM),
        ((-0.15, 5.15, 1.94), (-0.02, 5.33, 1.97), BLACK), ((-0.15, 5.15, 1.69), (-0.02, 5.33, 1.72), BLACK),
        ((-0.12, 6.68, 1.25), (0.0, 6.92, 1.56), RED), ((-0.14, 6.66, 1.56), (0.0, 6.94, 1.59), RED),
        ((-0.124, 6.71, 1.49), (-0.12, 6.89, 1.515), BLACK),
        ((-0.124, 6.74, 1.33), (-0.12, 6.86, 1.39), TRIM),
    ):  # fmt: skip
        model.box(low, high, stuff.STEEL if tint in (BLACK, RED) else stuff.PAINT, skip="X", tint=tint)
    with model.at((-0.5, 6.05, 0.001), 90):
        model.box((-0.4, -0.25, 0), (0.4, 0.25, 0.012), stuff.DOORMAT, skip="z")
    rng = model.rng_for("porch")
    for x, y, tall in ((-1.45, 6.8, 1.0), (-0.4, 6.85, 0.75), (-1.4, 5.4, 0.8)):
        with model.at((x, y, 0)):
            potted(model, (0.17, tall), (stuff.PAINT, stuff.SOIL, stuff.PAINT), (TERRACOTTA, LEAF), rng)


def _planting(model: SceneModel) -> None:
    """Add trees, shrubs, beds and hedges."""
    z = plan.GROUND
    for number, (x, y, tall, spread) in enumerate(
        (
            (10.4, -8.2, 6.4, 2.5),
            (-1.6, -10.2, 5.2, 2.0),
            (13.3, -3.0, 7.0, 2.4),
            (1.2, -16.5, 8.5, 3.2),
            (7.6, -17.5, 9.0, 3.4),
            (-9.5, 13.0, 7.5, 2.8),
            (-3.9, 11.0, 5.5, 2.0),
            (-13.6, 1.0, 7.5, 2.8),
            (-13.8, 8.8, 8.0, 2.6),
        )
    ):
        rng = model.rng_for(f"tree {number}")
        with model.at((x, y, z), 40.0 * number):
            leaves = stuff.LEAVES if number % 2 == 0 else stuff.DARK_LEAVES
            tree(model, (tall, spread), (stuff.BARK, leaves), rng)
    rng = model.rng_for("hedges")
    hedge(model, (-4.2, -13.4, z), (15.0, -12.5, z + 1.75), (stuff.HEDGE, stuff.DARK_LEAVES), rng)
    hedge(model, (-5.2, -13.4, z), (-4.4, 4.6, z + 1.25), (stuff.HEDGE, stuff.DARK_LEAVES), rng)
    hedge(model, (-5.2, 7.4, z), (-4.4, 15.0, z + 1.25), (stuff.HEDGE, stuff.DARK_LEAVES), rng)
    rng = model.rng_for("beds")
    for low, high in (
        ((-0.1, -3.9), (3.1, -3.35)),
        ((5.5, -3.9), (7.8, -3.35)),
        ((7.4, -1.5), (10.8, -0.25)),
        ((6.3, -12.2), (11.5, -11.3)),
        ((-1.9, 3.9), (-0.15, 4.9)),
    ):
        model.box((*low, z - 0.1), (*high, z + 0.05), stuff.SOIL, skip="z")
        under, over = (low[0] - 0.06, low[1] - 0.06, z - 0.1), (high[0] + 0.06, high[1] + 0.06, z + 0.04)
        model.box(under, over, stuff.PLINTH, skip="z")
        flower_bed(model, (*low, z), high, 0.55, (stuff.ROSES, stuff.DAISIES, stuff.FERN, stuff.DAISIES), rng)
    for x, y, radius in (
        (8.2, -9.8, 0.7),
        (12.6, -9.5, 0.9),
        (-3.2, -6.5, 0.8),
        (-3.4, -1.8, 0.6),
        (12.5, -0.8, 0.7),
        (-3.6, 9.2, 0.8),
    ):
        with model.at((x, y, z)):
            shrub(model, radius, stuff.DARK_LEAVES, rng)


def _lawn(model: SceneModel) -> None:
    """Add what stands on the lawn: deck chairs, a shed, a swing, a bird bath, washing, a ball, a barrow."""
    z = plan.GROUND
    for x, y, turn in ((7.6, -6.2, 150.0), (8.9, -5.6, 120.0)):
        with model.at((x, y, z), turn):
            deck_chair(model, stuff.PINE, stuff.AWNING if turn > 130 else stuff.CUSHION_STRIPES)
    with model.at((0.6, -11.0, z)):
        _shed(model)
    with model.at((8.3, -10.6, z)):
        _swing(model)
    with model.at((1.4, -7.4, z)):
        model.cylinder((0, 0, 0), (0, 0, 0.7), (0.16, 0.08), stuff.PLINTH, segments=16)
        model.cylinder((0, 0, 0.7), (0, 0, 0.82), (0.12, 0.33), stuff.PLINTH, segments=24, caps=False)
        model.cylinder(
            (0, 0, 0.74), (0, 0, 0.79), (0.2, 0.3), stuff.GLAZED, segments=24, tint=(0.25, 0.35, 0.42)
        )
    model.sphere((6.2, -7.6, z + 0.12), 0.12, stuff.CUSHION_STRIPES, segments=18)
    with model.at((1.0, -4.9, z), 60):
        _barrow(model)


def _shed(model: SceneModel) -> None:
    """Add a garden shed with door, window and roof, tools leaning on it."""
    model.box((-1.4, -0.9, 0), (1.1, 0.9, 2.0), stuff.SHED_BOARDS, skip="z")
    gable(model, (-1.4, -0.9), (1.1, 0.9), (2.0, 2.65), (stuff.ROOF, stuff.SHED_BOARDS))
    model.box((-0.9, 0.9, 0.05), (-0.1, 0.94, 1.85), stuff.FENCE_BOARDS, skip="Y", tint=GREEN_TRIM)
    model.quad(rectangle((-0.1, -0.9), 0.94, (0.05, 1.85)), stuff.FENCE_BOARDS, tint=GREEN_TRIM)
    model.box((0.25, 0.9, 0.95), (0.85, 0.92, 1.5), stuff.GLAZED, tint=(0.08, 0.1, 0.12))
    window(model, Opening(0.25, 0.85, 0.95, 1.5), "x", (0.9, 0.95), (2, 2), material=(stuff.PAINT, TRIM))
    for x, lean in ((0.12, 0.3), (0.98, 0.25)):
        model.cylinder((x, 0.9 + lean, 0), (x, 0.93, 1.5), 0.014, stuff.PINE, segments=6)
        model.box(
            (x - 0.1, 0.88 + lean, 0.0), (x + 0.1, 0.92 + lean, 0.25), stuff.STEEL, tint=(0.3, 0.3, 0.3)
        )


def _swing(model: SceneModel) -> None:
    """Add a wooden swing for two."""
    for x in (-1.4, 1.4):
        for y in (-0.8, 0.8):
            model.cylinder((x, y, 0), (x * 0.94, 0, 2.2), 0.045, stuff.PINE, segments=8)
    model.cylinder((-1.45, 0, 2.2), (1.45, 0, 2.2), 0.05, stuff.PINE, segments=10)
    for seat, tint in ((-0.6, (0.6, 0.1, 0.08)), (0.6, (0.1, 0.25, 0.5))):
        for x in (seat - 0.2, seat + 0.2):
            model.cylinder((x, 0, 0.45), (x, 0, 2.2), 0.008, stuff.STEEL, segments=4, caps=False)
        model.box((seat - 0.24, -0.1, 0.42), (seat + 0.24, 0.1, 0.45), stuff.PAINT, tint=tint)


def _barrow(model: SceneModel) -> None:
    """Add a wheelbarrow with soil in it."""
    low, high = (
        [(-0.3, -0.22), (0.32, -0.22), (0.32, 0.22), (-0.3, 0.22)],
        [(-0.42, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.42, 0.3)],
    )
    points = [(*p, 0.32) for p in low] + [(*p, 0.6) for p in high]
    sides = [(k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)]
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    model.mesh(points, triangles, stuff.STEEL, tint=(0.12, 0.35, 0.2))
    model.quad(rectangle((-0.39, 0.46), (-0.28, 0.28), 0.54), stuff.SOIL)
    model.cylinder(
        (0.6, -0.04, 0.18), (0.6, 0.04, 0.18), 0.18, stuff.STEEL, segments=20, tint=(0.05, 0.05, 0.05)
    )
    for y in (-0.26, 0.26):
        model.cylinder((0.6, 0.2 * y, 0.18), (-1.0, y, 0.62), 0.018, stuff.PINE, segments=6)
        model.cylinder((-0.4, y, 0.0), (-0.35, y, 0.4), 0.016, stuff.STEEL, segments=6, tint=(0.2, 0.2, 0.2))
