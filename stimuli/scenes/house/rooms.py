"""The rooms of the house from inside: linings, floors, ceilings, both flights of stairs."""

from __future__ import annotations

from collections.abc import Mapping

from evenlight.stimuli.scenes.house import materials as stuff
from evenlight.stimuli.scenes.house import plan
from evenlight.stimuli.scenes.house.walls import Opening, casing, flight, hollow, lining, reveal, room_edges
from evenlight.stimuli.scenes.model import Material, SceneModel

TRIM = (0.93, 0.92, 0.88)


def rooms(model: SceneModel) -> None:
    """Add the insides of all rooms and the stairs between them."""
    _living_room(model)
    _kitchen(model)
    _hall(model)
    _basement(model)
    _stairs(model)


def cased(hole: Opening) -> Opening:
    """Return the hole that the wall behind a casing has: corners must lie free to be lit."""
    return Opening(hole.low - 0.07, hole.high + 0.07, hole.sill, hole.head + 0.07)


def silled(hole: Opening) -> Opening:
    """Return the hole that the wall behind a window sill has."""
    return Opening(hole.low, hole.high, hole.sill - 0.03, hole.head)


def _room(
    model: SceneModel, corners: tuple[tuple[float, float], tuple[float, float]], heights: tuple[float, float],
    walls: dict[str, Material], holes: Mapping[str, tuple[Opening, ...]],
) -> None:  # fmt: skip
    """Add the four linings of a room: materials and openings by side "xXyY"."""
    (x0, y0), (x1, y1) = corners
    ends = {
        "y": ((x1, y0), (x0, y0)),
        "x": ((x0, y0), (x0, y1)),
        "Y": ((x0, y1), (x1, y1)),
        "X": ((x1, y1), (x1, y0)),
    }
    for side, line in ends.items():
        lining(model, line, heights, walls[side], holes.get(side, ()))


def floor(
    model: SceneModel, low: tuple[float, float], high: tuple[float, float], z: float, material: Material
) -> None:
    """Add a level rectangle that is seen from above."""
    model.quad([(*low, z), (high[0], low[1], z), (*high, z), (low[0], high[1], z)], material)


def ceiling(
    model: SceneModel, low: tuple[float, float], high: tuple[float, float], z: float, material: Material
) -> None:
    """Add a level rectangle that is seen from below."""
    model.quad([(low[0], high[1], z), (*high, z), (high[0], low[1], z), (*low, z)], material)


def _living_room(model: SceneModel) -> None:
    low, high = plan.LIVING
    holes = {
        "y": (silled(plan.GARDEN_WINDOW), cased(plan.TERRACE_DOOR)), "x": (silled(plan.WEST_WINDOW),),
        "X": (cased(plan.ARCH),), "Y": (cased(plan.LIVING_DOOR),),
    }  # fmt: skip
    walls = {"x": stuff.LIVING_WALL, "X": stuff.LIVING_WALL, "y": stuff.LIVING_WALL, "Y": stuff.FEATURE_WALL}
    _room(model, plan.LIVING, (0.1, plan.CEILING - 0.06), walls, holes)
    floor(model, low, high, 0.0, stuff.FLOOR_BOARDS)
    ceiling(model, low, high, plan.CEILING, stuff.CEILING)
    doors = {"y": (plan.TERRACE_DOOR,), "X": (plan.ARCH,), "Y": (plan.LIVING_DOOR,)}
    room_edges(model, low, high, (stuff.PAINT, TRIM, 0.0), doors)
    _cornice(model, low, high)


def _cornice(model: SceneModel, low: tuple[float, float], high: tuple[float, float]) -> None:
    """Add a moulding where the walls meet the ceiling."""
    (x0, y0), (x1, y1), z = low, high, plan.CEILING
    for size, drop in ((0.07, 0.03), (0.035, 0.07)):
        for a, b in (
            ((x0, y0), (x1, y0 + size)), ((x0, y1 - size), (x1, y1)),
            ((x0, y0 + size), (x0 + size, y1 - size)), ((x1 - size, y0 + size), (x1, y1 - size)),
        ):  # fmt: skip
            model.box((*a, z - drop), (*b, z), stuff.PAINT, skip="Z", tint=TRIM)


def _kitchen(model: SceneModel) -> None:
    low, high = plan.KITCHEN
    holes = {
        "y": (silled(plan.SINK_WINDOW),),
        "X": (silled(plan.EAST_WINDOW),),
        "x": (cased(plan.ARCH),),
        "Y": (cased(plan.KITCHEN_DOOR),),
    }
    _room(model, plan.KITCHEN, (0.1, plan.CEILING - 0.06), dict.fromkeys("xXyY", stuff.KITCHEN_WALL), holes)
    floor(model, low, high, 0.0, stuff.KITCHEN_FLOOR)
    ceiling(model, low, high, plan.CEILING, stuff.CEILING)
    room_edges(model, low, high, (stuff.PAINT, TRIM, 0.0), {"x": (plan.ARCH,), "Y": (plan.KITCHEN_DOOR,)})
    _cornice(model, low, high)


def _hall(model: SceneModel) -> None:
    """Add the hall, open above the stairs to a landing with a window."""
    low, high = plan.HALL
    (a, b), (c, d) = plan.STAIRWELL
    top = plan.CEILING + 0.18
    holes = {
        "x": (cased(plan.FRONT_DOOR), silled(plan.HALL_WINDOW)),
        "y": (cased(plan.LIVING_DOOR), cased(plan.KITCHEN_DOOR)),
    }
    _room(model, plan.HALL, (0.1, plan.CEILING), dict.fromkeys("xXyY", stuff.HALL_WALL), holes)
    for first, last in (((low[0], low[1]), (high[0], b)), ((low[0], b), (a, d)), ((c, b), (high[0], d))):
        floor(model, first, last, 0.0, stuff.HALL_FLOOR)
    for first, last in (
        ((low[0], low[1]), (high[0], b)),
        ((low[0], b), (a + 0.4, d)),
        ((c, b), (high[0], d)),
    ):
        ceiling(model, first, last, plan.CEILING, stuff.CEILING)
    lining(model, ((a + 0.4, d), (c, d)), (plan.CEILING, 5.2), stuff.HALL_WALL, (plan.LANDING_WINDOW,))
    hollow(model, (a + 0.4, b, plan.CEILING), (c, d, 5.2), stuff.HALL_WALL, skip="zYZ")
    ceiling(model, (a + 0.4, b), (c, d), 5.2, stuff.CEILING)
    model.quad(
        [
            (c - 0.01, d - 0.1, top),
            (c - 0.01, b + 0.1, top),
            (c - 0.01, b + 0.1, top + 2),
            (c - 0.01, d - 0.1, top + 2),
        ],
        stuff.DOOR,
        uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
    )
    doors = {"x": (plan.FRONT_DOOR,), "y": (plan.LIVING_DOOR, plan.KITCHEN_DOOR)}
    room_edges(model, low, high, (stuff.WALNUT, (1, 1, 1), 0.0), doors)


def _basement(model: SceneModel) -> None:
    """Add the cellar: painted brick, raw brick piers with a beam, concrete above and below."""
    low, high = plan.BASEMENT
    (a, b), (c, _) = plan.STAIRWELL
    walls = {
        "x": stuff.BASEMENT_BRICK,
        "X": stuff.RAW_BRICK,
        "y": stuff.BASEMENT_BRICK,
        "Y": stuff.BASEMENT_BRICK,
    }
    _room(model, plan.BASEMENT, (plan.CELLAR, plan.CELLAR_CEILING), walls, {"x": (plan.CELLAR_WINDOW,)})
    floor(model, low, high, plan.CELLAR, stuff.BASEMENT_FLOOR)
    for first, last in ((low, (high[0], b)), ((low[0], b), (a, high[1])), ((c, b), high)):
        ceiling(model, first, last, plan.CELLAR_CEILING, stuff.BASEMENT_CEILING)
    for y in (1.3, 5.2):
        model.box(
            (4.2, y - 0.22, plan.CELLAR),
            (4.64, y + 0.22, plan.CELLAR_CEILING - 0.2),
            stuff.RAW_BRICK,
            skip="zZ",
        )
    model.box(
        (4.24, low[1], plan.CELLAR_CEILING - 0.2), (4.6, b, plan.CELLAR_CEILING), stuff.OLD_WOOD, skip="Z"
    )
    for x in (1.2, 2.1, 3.0, 5.5, 6.4, 7.3):
        model.box(
            (x, low[1], plan.CELLAR_CEILING - 0.14),
            (x + 0.08, b, plan.CELLAR_CEILING),
            stuff.OLD_WOOD,
            skip="Z",
        )


def _stairs(model: SceneModel) -> None:
    """Add both flights, the wall below the upper one, the door frame of the cellar, and railings."""
    (a, b), (c, d) = plan.STAIRWELL
    top = plan.CEILING + 0.18
    flight(model, (a, b), (c, d), (0.0, top), 15, (stuff.OAK, stuff.PAINT))
    flight(model, (a, b), (c - 0.1, d), (plan.CELLAR, 0.0), 14, (stuff.OLD_WOOD, stuff.OLD_WOOD))
    # Between the flights: the slope above one's head, and the hall's panelling, seen from both sides.
    low, high = 0.0, top - 0.22
    model.quad([(a, d, low - 0.22), (c, d, high), (c, b, high), (a, b, low - 0.22)], stuff.PAINT)
    hall_side = [(a, b, 0.0), (c, b, 0.0), (c, b, top - 0.02), (a, b, 0.17)]
    model.mesh(hall_side, [(0, 1, 2), (0, 2, 3)], stuff.FENCE_BOARDS)
    stair_side = [(a, b, plan.CELLAR_CEILING), (c, b, plan.CELLAR_CEILING), (c, b, high), (a, b, -0.22)]
    model.mesh(stair_side, [(2, 1, 0), (3, 2, 0)], stuff.BASEMENT_BRICK)
    lining(model, ((a, d), (c, d)), (plan.CELLAR_CEILING, 0.0), stuff.BASEMENT_BRICK)
    model.quad([(a, d, -0.28), (a, b, -0.28), (a, b, 0.0), (a, d, 0.0)][::-1], stuff.PAINT)
    lining(
        model,
        ((c + 0.08, b), (c + 0.08, d)),
        (0.0, plan.CEILING),
        stuff.HALL_WALL,
        (cased(plan.CELLAR_DOOR),),
    )
    lining(model, ((c, d), (c, b)), (0.0, plan.CEILING), stuff.PAINT, (plan.CELLAR_DOOR,))
    reveal(model, plan.CELLAR_DOOR, (c, c + 0.08), "y", stuff.PAINT)
    casing(model, plan.CELLAR_DOOR, "y", (c + 0.08, c + 0.095), (stuff.PAINT, TRIM))
    floor(model, (c - 0.1, b), (c + 0.08, d), 0.0, stuff.OAK)
    _railings(model)


def _railings(model: SceneModel) -> None:
    """Add balusters and handrails along the open sides of both flights."""
    (a, b), (c, _) = plan.STAIRWELL
    for start, stop, z0, z1, count in (
        (a, c - 0.9, 0.1, 2.26, 20),
        (a + 0.1, c - 0.8, plan.CELLAR + 0.1, -0.85, 12),
    ):
        for post in range(count):
            share = (post + 0.5) / count
            x, z = start + (stop - start) * share, z0 + (z1 - z0) * share
            model.box(
                (x - 0.014, b + 0.02, z), (x + 0.014, b + 0.048, z + 0.85), stuff.PAINT, skip="zZ", tint=TRIM
            )
        model.cylinder(
            (start, b + 0.034, z0 + 0.88), (stop, b + 0.034, z1 + 0.88), 0.028, stuff.WALNUT, segments=10
        )
    model.box((a - 0.1, b - 0.02, 0.0), (a, b + 0.08, 1.12), stuff.WALNUT)
    model.sphere((a - 0.05, b + 0.03, 1.17), 0.065, stuff.WALNUT, segments=14)
