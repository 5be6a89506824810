"""The hall: coats, shoes, a mirror's frame, a console table, umbrellas, a runner, lamps."""

from __future__ import annotations

from evenlight.stimuli.scenes import house_materials as stuff
from evenlight.stimuli.scenes import house_plan as plan
from evenlight.stimuli.scenes.furniture import table
from evenlight.stimuli.scenes.furniture_storage import lying_books, vase
from evenlight.stimuli.scenes.household import bowl, garment, glow, picture, sheet, shoe, table_lamp
from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.plants import flower_bed, potted

COATS = ((0.55, 0.42, 0.2), (0.1, 0.14, 0.24), (0.45, 0.08, 0.07), (0.2, 0.26, 0.16), (0.35, 0.35, 0.36))
SHOES = ((0.16, 0.08, 0.04), (0.04, 0.04, 0.05), (0.6, 0.6, 0.58), (0.45, 0.1, 0.08), (0.12, 0.2, 0.35))


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
            glow(model, (-0.11, -0.11, -0.17), (0.11, 0.11, -0.05), 420.0)


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
                    garment(
                        model,
                        (0.34 + 0.06 * rng.random(), 0.85 + 0.25 * rng.random()),
                        stuff.CLOTH,
                        COATS[k % len(COATS)],
                        rng,
                    )
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
            model.cylinder(
                (0.03 * k - 0.03, 0, 0.05),
                (0.07 * k - 0.07, 0.03 * k, 0.85),
                0.022,
                stuff.CLOTH,
                segments=8,
                tint=tint,
            )
    with model.at((2.05, 7.4, 0.0)):
        potted(
            model,
            (0.16, 1.0),
            (stuff.PAINT, stuff.SOIL, stuff.PAINT),
            ((0.8, 0.78, 0.7), (0.13, 0.3, 0.08)),
            rng,
            24,
        )


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
        sheet(
            model,
            [(-0.09, -0.031, -0.09), (0.09, -0.031, -0.09), (0.09, -0.031, 0.09), (-0.09, -0.031, 0.09)],
            stuff.DIAL,
        )
    for x in (4.95, 6.12):
        model.box((x - 0.04, 5.12, 1.1), (x + 0.04, 5.13, 1.2), stuff.PAINT, skip="y")
