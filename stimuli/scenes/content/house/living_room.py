"""The living room: sofa, books, a rug, the television, plants, curtains, pictures; and the hall beside it."""

from __future__ import annotations

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.props.furniture import cushion, scatter_cushion, sofa, table
from evenlight.stimuli.scenes.content.props.household import (
    bowl,
    drapes,
    floor_lamp,
    garment,
    globe,
    mug,
    paper,
    paper_globe,
    picture,
    rod,
    sheet,
    shoe,
    table_lamp,
)
from evenlight.stimuli.scenes.content.props.plants import flower_bed, potted
from evenlight.stimuli.scenes.content.props.storage import bookcase, cabinet, lying_books, vase
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import rectangle

LEAF, PALE_LEAF = (0.13, 0.3, 0.08), (0.28, 0.42, 0.12)
POT, WHITE_POT = (0.3, 0.4, 0.45), (0.85, 0.83, 0.78)
BRASS = (0.6, 0.45, 0.2)
COATS = ((0.55, 0.42, 0.2), (0.14, 0.19, 0.3), (0.45, 0.13, 0.11), (0.22, 0.28, 0.18), (0.35, 0.35, 0.36))
SHOES = ((0.2, 0.12, 0.08), (0.09, 0.09, 0.1), (0.6, 0.6, 0.58), (0.45, 0.1, 0.08), (0.12, 0.2, 0.35))


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
    sheet(model, rectangle((x0, x1), (y0, y1), 0.012), kind)
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
        model.cylinder((0, 0, 0.36), (0, 0, 0.41), (0.24, 0.19), stuff.SOFA, segments=24)
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
            sheet(model, rectangle((-0.02, 0.02), (-0.08, 0.06), 0.0185), stuff.KEYBOARD)
        with model.at((0.25, 0.1, 0.16), 10):
            lying_books(model, 4, (stuff.BOOKS, stuff.PAGES), rng)


def _television(model: SceneModel) -> None:
    """Add the sideboard with the television, a lamp, loudspeakers, records."""
    rng = model.rng_for("sideboard")
    with model.at((6.06, 1.12, 0.0), -90):
        cabinet(model, (1.6, 0.42, 0.5), stuff.WALNUT, (3, 1))
        model.box((-0.5, -0.04, 0.56), (0.5, 0.0, 1.16), stuff.PAINT, skip="y", tint=(0.03, 0.03, 0.03))
        sheet(model, rectangle((-0.5, 0.5), -0.04, (0.56, 1.16)), stuff.SCREEN)
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


def hall(model: SceneModel) -> None:
    """Add all that stands, lies and hangs in the hall."""
    _coats(model)
    _console(model)
    _walls(model)
    sheet(
        model,
        [(4.8, 5.5, 0.008), (4.8, 6.35, 0.008), (1.3, 6.35, 0.008), (1.3, 5.5, 0.008)][::-1],
        stuff.RUNNER,
    )
    for x in (2.0, 5.6):
        with model.at((x, 5.88, plan.CEILING)):
            model.cylinder((0, 0, -0.05), (0, 0, 0), 0.13, stuff.STEEL, segments=20, tint=(0.6, 0.5, 0.3))
            with model.at((0.0, 0.0, -0.16)):
                globe(model, 0.13, 800.0, (1.0, 0.86, 0.68))


def _coats(model: SceneModel) -> None:
    """Hang coats on a board of hooks on the south side, hats above, shoes on a rack below."""
    rng = model.rng_for("coats")
    with model.at((3.3, 5.12, 0.0), 180):
        model.box((-0.75, -0.025, 1.62), (0.75, 0.0, 1.78), stuff.OAK)
        model.box((-0.75, -0.26, 1.82), (0.75, 0.0, 1.845), stuff.OAK)
        for k in range(6):
            x = -0.6 + 0.24 * k
            model.cylinder((x, -0.02, 1.68), (x, -0.1, 1.71), 0.01, stuff.STEEL, segments=8)
            if k != 3:
                with model.at((x, -0.05, 1.69)):
                    size = (0.34 + 0.06 * rng.random(), 0.85 + 0.25 * rng.random())
                    garment(model, size, stuff.CLOTH, COATS[k % len(COATS)], rng)
        for x, tint in ((-0.5, (0.5, 0.4, 0.25)), (0.45, (0.2, 0.1, 0.1))):
            model.cylinder((x, -0.14, 1.846), (x, -0.14, 1.856), 0.17, stuff.CLOTH, segments=20, tint=tint)
            model.sphere((x, -0.14, 1.88), (0.1, 0.1, 0.075), stuff.CLOTH, segments=14, tint=tint)
        for z in (0.12, 0.34):
            model.box((-0.75, -0.3, z), (0.75, -0.02, z + 0.02), stuff.OAK)
        for x in (-0.75, 0.73):
            model.box((x, -0.3, 0), (x + 0.02, -0.02, 0.42), stuff.OAK)
        for level, z in enumerate((0.14, 0.36)):
            for k in range(6):
                if (k + level) % 5 != 4:
                    for foot in (-0.055, 0.055):
                        with model.at((-0.6 + 0.24 * k + foot, -0.16, z), 5 * foot / 0.055 - 2):
                            shoe(model, stuff.PAINT, SHOES[(k + 2 * level) % 5])
        for x in (0.92, 1.04):
            with model.at((x, -0.2, 0.0), 8):
                shoe(model, stuff.GLAZED, (0.16, 0.3, 0.14), 0.32)


def _console(model: SceneModel) -> None:
    """Add the table by the stairs with lamp, keys, letters, flowers, and the mirror's frame over it."""
    rng = model.rng_for("console")
    with model.at((1.35, 7.48, 0.0)):
        table(model, (1.1, 0.36, 0.8), stuff.WALNUT)
        with model.at((-0.36, 0.0, 0.8)):
            table_lamp(model, 0.48, stuff.GLAZED, 220.0, (0.5, 0.3, 0.15))
        with model.at((0.34, 0.02, 0.8)):
            vase(model, 0.24, stuff.GLAZED, (0.25, 0.4, 0.5))
            flower_bed(model, (-0.05, -0.05, 0.22), (0.05, 0.05), 0.3, (stuff.ROSES,), rng)
        with model.at((0.02, -0.04, 0.8)):
            bowl(model, 0.09, stuff.GLAZED, (0.7, 0.65, 0.5))
        with model.at((0.12, 0.0, 0.35)):
            lying_books(model, 3, (stuff.BOOKS, stuff.PAGES), rng)
        model.box((-0.48, -0.14, 0.33), (0.48, 0.14, 0.35), stuff.WALNUT)
    with model.at((1.35, 7.7, 1.65)):
        picture(model, (0.62, 0.8), stuff.DUSK, stuff.WALNUT)
    with model.at((0.5, 7.5, 0.0)):
        model.cylinder(
            (0, 0, 0), (0, 0, 0.55), 0.11, stuff.STEEL, segments=18, caps=False, tint=(0.45, 0.35, 0.2)
        )
        for k, tint in enumerate(((0.05, 0.05, 0.06), (0.4, 0.08, 0.08), (0.1, 0.2, 0.35))):
            low, high = (0.03 * k - 0.03, 0, 0.05), (0.07 * k - 0.07, 0.03 * k, 0.85)
            model.cylinder(low, high, 0.022, stuff.CLOTH, segments=8, tint=tint)
    with model.at((2.05, 7.4, 0.0)):
        pot, colours = (stuff.PAINT, stuff.SOIL, stuff.PAINT), ((0.8, 0.78, 0.7), (0.13, 0.3, 0.08))
        potted(model, (0.16, 1.0), pot, colours, rng, 24)


def _walls(model: SceneModel) -> None:
    """Hang pictures up the stairs and beside the doors, a board with notes, a barometer."""
    with model.at((1.4, 5.12, 1.55), 180):
        picture(model, (0.7, 0.52), stuff.MILL, stuff.WALNUT)
    with model.at((4.5, 5.12, 1.6), 180):
        picture(model, (0.42, 0.54), stuff.ABSTRACT, stuff.WALNUT)
    with model.at((7.5, 5.9, 1.5), -90):
        picture(model, (0.6, 0.5), stuff.PAPERS, stuff.PINE)
    for x, z, image in ((3.3, 2.0, stuff.SQUARES), (4.2, 2.15, stuff.POSTER)):
        with model.at((x, 7.7, z)):
            picture(model, (0.36, 0.44), image, stuff.WALNUT)
    with model.at((6.28, 5.12, 1.65), 180):
        model.cylinder((0, 0, 0), (0, -0.03, 0), 0.11, stuff.WALNUT, segments=28)
        sheet(model, rectangle((-0.09, 0.09), -0.031, (-0.09, 0.09)), stuff.DIAL)
    for x in (4.95, 6.12):
        model.box((x - 0.04, 5.12, 1.1), (x + 0.04, 5.13, 1.2), stuff.PAINT, skip="y")
