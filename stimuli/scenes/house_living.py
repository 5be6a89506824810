"""The living room: sofa, books, a rug, the television, plants, curtains, pictures, what lies about."""

from __future__ import annotations

from evenlight.stimuli.scenes import house_materials as stuff
from evenlight.stimuli.scenes import house_plan as plan
from evenlight.stimuli.scenes.furniture import cushion, scatter_cushion, sofa, table
from evenlight.stimuli.scenes.furniture_storage import bookcase, cabinet, lying_books, vase
from evenlight.stimuli.scenes.household import (
    bowl,
    drapes,
    floor_lamp,
    mug,
    paper,
    paper_globe,
    picture,
    rod,
    sheet,
    table_lamp,
)
from evenlight.stimuli.scenes.model import Material, SceneModel
from evenlight.stimuli.scenes.plants import flower_bed, potted

LEAF, PALE_LEAF = (0.13, 0.3, 0.08), (0.28, 0.42, 0.12)
POT, WHITE_POT = (0.3, 0.4, 0.45), (0.85, 0.83, 0.78)
BRASS = (0.6, 0.45, 0.2)


def living_room(model: SceneModel) -> None:
    """Add all that stands, lies and hangs in the living room."""
    _rug(model, (1.25, 1.15), (3.65, 3.65), stuff.RUG)
    _seats(model)
    _coffee_table(model)
    _television(model)
    _books(model)
    _curtains(model)
    _pictures(model)
    _plants(model)
    with model.at((2.2, 2.55, plan.CEILING)):
        paper_globe(model, 0.35, 0.2, stuff.PAINT, 2400.0)


def _rug(model: SceneModel, low: tuple[float, float], high: tuple[float, float], kind: Material) -> None:
    """Lay a rug: one tile of its texture, with a fringe at its two short ends."""
    (x0, y0), (x1, y1) = low, high
    sheet(model, [(x0, y0, 0.012), (x1, y0, 0.012), (x1, y1, 0.012), (x0, y1, 0.012)], kind)
    model.box((x0, y0, 0.0), (x1, y1, 0.0115), stuff.CLOTH, skip="zZ", tint=(0.3, 0.1, 0.08))
    for y in (y0, y1):
        model.box((x0, y - 0.06, 0.0), (x1, y + 0.06, 0.006), stuff.CLOTH, skip="z", tint=(0.75, 0.68, 0.5))


def _seats(model: SceneModel) -> None:
    """Add the sofa under the west window, an armchair by the books, a footstool."""
    with model.at((0.92, 2.45, 0.0), 90):
        sofa(model, 2.25, stuff.SOFA, stuff.WALNUT)
        for x, turn, cover in (
            (-0.72, -12, stuff.CUSHION_STRIPES),
            (-0.38, 6, stuff.ARMCHAIR),
            (0.75, 10, stuff.PLAID),
        ):
            with model.at((x, 0.02, 0.47), turn):
                scatter_cushion(model, 0.4, cover)
        # A blanket over the arm.
        for a, b in (
            ((-1.13, 0.62), (-0.92, 0.62)),
            ((-1.13, 0.62), (-1.13, 0.2)),
            ((-0.92, 0.62), (-0.92, 0.47)),
        ):
            corners = [(a[0], -0.3, a[1]), (b[0], -0.3, b[1]), (b[0], 0.25, b[1]), (a[0], 0.25, a[1])]
            model.quad([(x, y, z + 0.006) for x, y, z in corners], stuff.PLAID)
    with model.at((3.05, 3.95, 0.0), -38):
        sofa(model, 0.95, stuff.ARMCHAIR, stuff.WALNUT)
        with model.at((0.05, 0.05, 0.47), 8):
            scatter_cushion(model, 0.38, stuff.SOFA)
    with model.at((2.35, 3.45, 0.0), 15):
        model.cylinder((0, 0, 0.08), (0, 0, 0.36), 0.24, stuff.SOFA, segments=24)
        model.cylinder((0, 0, 0.36), (0, 0, 0.41), 0.24, stuff.SOFA, top_radius=0.19, segments=24)
        model.cylinder((0, 0, 0.0), (0, 0, 0.08), 0.2, stuff.WALNUT, segments=16)
    with model.at((0.62, 0.72, 0.0)):
        floor_lamp(model, 1.62, stuff.STEEL, 800.0)


def _coffee_table(model: SceneModel) -> None:
    """Add the low table with magazines, mugs, a bowl, a plant, glasses, a remote control."""
    rng = model.rng_for("coffee table")
    with model.at((2.3, 2.35, 0.012), 90):
        table(model, (1.15, 0.62, 0.42), stuff.OAK)
        model.box((-0.5, -0.24, 0.14), (0.5, 0.24, 0.16), stuff.OAK)
        for x, y, turn, kind in ((-0.3, 0.05, 14, stuff.POSTER), (-0.26, 0.02, -8, stuff.LABEL)):
            with model.at((x, y, 0.421), turn):
                paper(model, (0.21, 0.28), kind)
            with model.at((x, y, 0.161), 2 * turn):
                paper(model, (0.24, 0.3), kind)
        with model.at((0.3, -0.05, 0.42)):
            bowl(model, 0.14, stuff.GLAZED, (0.2, 0.42, 0.48))
        with model.at((0.0, 0.16, 0.42), 30):
            mug(model, stuff.GLAZED, (0.62, 0.2, 0.12))
        with model.at((0.05, -0.2, 0.42), 130):
            mug(model, stuff.GLAZED, (0.85, 0.82, 0.72))
        with model.at((-0.05, 0.0, 0.42)):
            vase(model, 0.2, stuff.GLAZED, (0.25, 0.33, 0.5))
        flower_bed(model, (-0.08, -0.03, 0.6), (-0.02, 0.03), 0.24, (stuff.ROSES,), rng)
        with model.at((0.42, 0.17, 0.42), 25):
            model.box((-0.025, -0.09, 0), (0.025, 0.09, 0.018), stuff.PAINT, tint=(0.05, 0.05, 0.06))
            sheet(
                model,
                [(-0.02, -0.08, 0.0185), (0.02, -0.08, 0.0185), (0.02, 0.06, 0.0185), (-0.02, 0.06, 0.0185)],
                stuff.KEYBOARD,
            )
        with model.at((0.25, 0.1, 0.16), 10):
            lying_books(model, 4, (stuff.BOOKS, stuff.PAGES), rng)


def _television(model: SceneModel) -> None:
    """Add the sideboard with the television, a lamp, loudspeakers, records."""
    rng = model.rng_for("sideboard")
    with model.at((6.06, 1.12, 0.0), -90):
        cabinet(model, (1.6, 0.42, 0.5), stuff.WALNUT, (3, 1))
        model.box((-0.5, -0.04, 0.56), (0.5, 0.0, 1.16), stuff.PAINT, skip="y", tint=(0.03, 0.03, 0.03))
        sheet(
            model,
            [(-0.5, -0.04, 0.56), (0.5, -0.04, 0.56), (0.5, -0.04, 1.16), (-0.5, -0.04, 1.16)],
            stuff.SCREEN,
        )
        model.box((-0.2, -0.12, 0.5), (0.2, 0.08, 0.515), stuff.PAINT, tint=(0.04, 0.04, 0.04))
        model.box((-0.04, -0.02, 0.515), (0.04, 0.02, 0.57), stuff.PAINT, tint=(0.04, 0.04, 0.04))
        for x in (-0.66,):
            model.box((x - 0.1, -0.12, 0.5), (x + 0.1, 0.1, 0.84), stuff.WALNUT)
            for z, radius in ((0.6, 0.07), (0.75, 0.035)):
                model.cylinder(
                    (x, -0.12, z), (x, -0.125, z), radius, stuff.PAINT, segments=18, tint=(0.05, 0.05, 0.05)
                )
        with model.at((0.67, 0.0, 0.5)):
            table_lamp(model, 0.46, stuff.GLAZED, 800.0, (0.25, 0.4, 0.42))
        with model.at((-0.35, -0.12, 0.5), 90):
            lying_books(model, 3, (stuff.BOOKS, stuff.PAGES), rng)


def _books(model: SceneModel) -> None:
    """Add the wall of books along the north side, and a pile beside the armchair."""
    rng = model.rng_for("books")
    with model.at((2.55, 4.83, 0.0)):
        bookcase(model, (4.3, 0.32, 2.35), stuff.OAK, (stuff.BOOKS, stuff.PAGES), rng)
    with model.at((3.75, 4.45, 0.0), 20):
        lying_books(model, 7, (stuff.BOOKS, stuff.PAGES), rng)


def _curtains(model: SceneModel) -> None:
    """Add curtains left and right of the windows to the garden and to the west."""
    for x, wide in ((0.52, 0.5), (2.88, 0.46), (5.22, 0.62)):
        with model.at((x + wide, 0.31, 0.03), 180):
            drapes(model, wide, 2.5, stuff.CURTAIN, x)
    with model.at((0.42, 0.4, 2.55)):
        rod(model, 5.55, stuff.STEEL, BRASS)
    for y, wide in ((1.12, 0.42), (3.38, 0.42)):
        with model.at((0.31, y, 0.55), 90):
            drapes(model, wide, 1.9, stuff.CURTAIN, y)
    with model.at((0.4, 1.05, 2.47), 90):
        rod(model, 2.82, stuff.STEEL, BRASS)


def _pictures(model: SceneModel) -> None:
    """Hang pictures and a clock."""
    east, south, west = -90.0, 180.0, 90.0
    for place, turn, size, image in (
        ((6.3, 4.45, 1.6), east, (0.62, 0.5), stuff.MILL),
        ((6.3, 0.62, 1.62), east, (0.36, 0.46), stuff.DUSK),
        ((6.3, 1.5, 1.72), east, (0.6, 0.46), stuff.SQUARES),
        ((0.3, 4.3, 1.6), west, (0.55, 0.7), stuff.ABSTRACT),
        ((0.3, 0.7, 1.75), west, (0.36, 0.46), stuff.DUSK),
        ((6.05, 0.3, 1.6), south, (0.32, 0.42), stuff.POSTER),
    ):
        with model.at(place, turn):
            picture(model, size, image, stuff.WALNUT)
    with model.at((4.88, 5.0, 1.5)):
        picture(model, (0.24, 0.34), stuff.SQUARES, stuff.WALNUT)


def _plants(model: SceneModel) -> None:
    """Add plants in pots on the floor and on the sills."""
    rng = model.rng_for("house plants")
    kinds = (stuff.PAINT, stuff.SOIL, stuff.PAINT)
    for place, size, colours, number in (
        ((3.2, 0.72, 0.0), (0.2, 1.5), (POT, LEAF), 34),
        ((5.85, 4.55, 0.0), (0.2, 1.25), (WHITE_POT, PALE_LEAF), 30),
        ((1.2, 0.2, 0.45), (0.08, 0.42), (WHITE_POT, LEAF), 16),
        ((2.0, 0.2, 0.45), (0.07, 0.36), (POT, PALE_LEAF), 18),
        ((2.6, 0.2, 0.45), (0.09, 0.45), (WHITE_POT, LEAF), 16),
        ((0.2, 2.1, 0.85), (0.07, 0.34), (POT, LEAF), 14),
    ):
        with model.at(place, 50 * rng.random()):
            potted(model, size, kinds, colours, rng, number)
    with model.at((0.55, 4.35, 0.0), 0):
        cushion(model, (0, 0, 0), (0.5, 0.5, 0.14), stuff.PLAID)
