"""The shell of the house and its rooms: walls with windows and doors, floors, ceilings, stairs, roof."""

from __future__ import annotations

from collections.abc import Mapping

from evenlight.stimuli.scenes.content.house import materials as stuff
from evenlight.stimuli.scenes.content.house import plan
from evenlight.stimuli.scenes.content.house.plan import (
    Opening,
    bar,
    casing,
    flight,
    hollow,
    lining,
    reveal,
    room_edges,
    seen_from,
    window,
)
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

GREEN_TRIM = (0.16, 0.27, 0.23)
UPPER_SOUTH = tuple(Opening(x, x + 1.2, 3.5, 4.8) for x in (1.2, 3.7, 6.4, 8.9))
UPPER_WEST = tuple(Opening(y, y + 1.1, 3.5, 4.8) for y in (1.8, 5.2))
TRIM = (0.93, 0.92, 0.88)


def shell(model: SceneModel) -> None:
    """Add everything of the house that carries or closes it."""
    _facade(model)
    _roof(model)
    rooms(model)
    _openings(model)


def _facade(model: SceneModel) -> None:
    """Add the outside: plinth, plastered walls, closed windows of the first floor."""
    (x0, y0), (x1, y1) = plan.OUTER_LOW, plan.OUTER_HIGH
    south = (silled(plan.GARDEN_WINDOW), cased(plan.TERRACE_DOOR), silled(plan.SINK_WINDOW))
    west = (silled(plan.WEST_WINDOW), cased(plan.FRONT_DOOR), silled(plan.HALL_WINDOW))
    sides = (
        (((x0, y0), (x1, y0)), south), (((x1, y0), (x1, y1)), (plan.EAST_WINDOW,)),
        (((x1, y1), (x0, y1)), (plan.LANDING_WINDOW,)), (((x0, y1), (x0, y0)), west),
    )  # fmt: skip
    for ends, holes in sides:
        lining(model, ends, (-0.05, plan.EAVES), stuff.FACADE, holes)
        cellar = (plan.CELLAR_WINDOW,) if ends[0][0] == ends[1][0] == x0 else ()
        lining(model, ends, (plan.GROUND - 0.3, -0.05), stuff.PLINTH, cellar)
    for hole in UPPER_SOUTH:
        _blind_window(model, hole, "x", (-0.05, 0.0))
    for hole in UPPER_WEST:
        _blind_window(model, hole, "y", (-0.05, 0.0))
    model.box(
        (x0 - 0.03, y0 - 0.03, 2.82), (x1 + 0.03, y1 + 0.03, 2.94), stuff.PAINT, tint=(0.86, 0.82, 0.72)
    )


def _blind_window(model: SceneModel, hole: Opening, along: str, across: tuple[float, float]) -> None:
    """Add a window that one only sees from outside: frame, dark pane, curtain behind it, shutters."""
    pane = Opening(hole.low, hole.high, hole.sill, hole.head)
    window(model, pane, along, across, (2, 3), material=(stuff.PAINT, TRIM))
    depth = across[1] - 0.012
    middle = (hole.low + hole.high) / 2
    for low, high, tint in ((hole.low, middle, (0.07, 0.09, 0.11)), (middle, hole.high, (0.1, 0.12, 0.15))):
        bar(model, along, (low, high), (depth - 0.005, depth), (stuff.GLAZED, (hole.sill, hole.head), tint))
    wide = (hole.high - hole.low) / 2
    for low in (hole.low - wide - 0.02, hole.high + 0.02):
        outer = (across[0] + 0.005, across[1])
        shutter = (stuff.FENCE_BOARDS, (hole.sill, hole.head), GREEN_TRIM)
        bar(model, along, (low, low + wide), outer, shutter)
    sill = (stuff.PLINTH, (hole.sill - 0.05, hole.sill), (1, 1, 1))
    bar(model, along, (hole.low - 0.05, hole.high + 0.05), (across[0] - 0.06, across[1]), sill)


def _roof(model: SceneModel) -> None:
    """Add the roof: two slopes with eaves, the gables, a chimney, gutters."""
    gable(model, plan.OUTER_LOW, plan.OUTER_HIGH, (plan.EAVES, plan.RIDGE), (stuff.ROOF, stuff.FACADE))
    model.box((7.6, 4.6, 7.2), (8.4, 5.3, 9.2), stuff.NEIGHBOUR_BRICK)
    model.cylinder(
        (-0.4, -0.5, 5.32), (11.4, -0.5, 5.32), 0.07, stuff.STEEL, segments=10, tint=(0.5, 0.52, 0.52)
    )
    for x in (0.25, 10.75):
        model.cylinder(
            (x, -0.06, plan.GROUND), (x, -0.06, 5.3), 0.045, stuff.STEEL, segments=10, tint=(0.5, 0.52, 0.52)
        )


def gable(
    model: SceneModel, low: tuple[float, float], high: tuple[float, float], heights: tuple[float, float],
    kinds: tuple[Material, Material],
) -> None:  # fmt: skip
    """Add a roof whose ridge runs along x over a rectangle: heights of eaves and ridge, tiles and wall."""
    (x0, y0), (x1, y1) = low, high
    eaves, ridge = heights
    tiles, wall = kinds
    out, middle = 0.5, (y0 + y1) / 2
    drop = out * (ridge - eaves) / (middle - y0)
    left, right = x0 - 0.4, x1 + 0.4
    lower, upper = (y0 - out, eaves - drop + 0.12), (y1 + out, eaves - drop + 0.12)
    top = (middle, ridge + 0.12)
    long, slope = (
        (right - left) / tiles.tile,
        ((middle - lower[0]) ** 2 + (top[1] - lower[1]) ** 2) ** 0.5 / tiles.tile,
    )
    mapped = [(0, 0), (long, 0), (long, slope), (0, slope)]
    model.quad([(left, *lower), (right, *lower), (right, *top), (left, *top)], tiles, uvs=mapped)
    model.quad([(right, *upper), (left, *upper), (left, *top), (right, *top)], tiles, uvs=mapped)
    for a, b in (((y0 - out, eaves - drop), (middle, ridge)), ((middle, ridge), (y1 + out, eaves - drop))):
        model.quad([(left, *a), (left, *b), (right, *b), (right, *a)], wall, tint=(0.6, 0.5, 0.4))
    for x, order in ((x0, (1, 0, 2)), (x1, (0, 1, 2))):
        corners = [(x, y0, eaves), (x, y1, eaves), (x, middle, ridge)]
        model.mesh([corners[k] for k in order], [(0, 1, 2)], wall)


def _openings(model: SceneModel) -> None:
    """Add reveals, frames, casings and sills of all windows and doors."""
    white = (stuff.PAINT, TRIM)
    for hole, along, depth, panes in (
        (plan.GARDEN_WINDOW, "x", (0.0, 0.3), (3, 1)), (plan.SINK_WINDOW, "x", (0.0, 0.3), (3, 2)),
        (plan.WEST_WINDOW, "y", (0.0, 0.3), (2, 2)), (plan.EAST_WINDOW, "y", (10.7, 11.0), (3, 2)),
        (plan.HALL_WINDOW, "y", (0.0, 0.3), (1, 3)), (plan.CELLAR_WINDOW, "y", (0.0, 0.3), (2, 1)),
        (plan.LANDING_WINDOW, "x", (7.7, 8.0), (2, 2)),
    ):  # fmt: skip
        reveal(model, hole, depth, along, stuff.PAINT)
        # Beside the middle of the reveal, where light is looked for if it is looked for at one place only.
        middle = (depth[0] + 0.05, depth[0] + 0.11) if depth[0] < 5 else (depth[1] - 0.11, depth[1] - 0.05)
        window(model, hole, along, middle, panes, material=white)
        seen_from(model, hole, along, sum(middle) / 2)
        wide = (hole.low - 0.06, hole.high + 0.06)
        outer = (depth[0] - 0.06, depth[0] + 0.02) if depth[0] < 5 else (depth[1] - 0.02, depth[1] + 0.06)
        bar(model, along, wide, outer, (stuff.PLINTH, (hole.sill - 0.05, hole.sill), (1, 1, 1)))
        inner = (depth[1] - 0.02, depth[1] + 0.07) if depth[0] < 5 else (depth[0] - 0.07, depth[0] + 0.02)
        bar(model, along, wide, inner, (stuff.PAINT, (hole.sill - 0.035, hole.sill), TRIM))
    for hole, along, depth in (
        (plan.TERRACE_DOOR, "x", (0.0, 0.3)),
        (plan.FRONT_DOOR, "y", (0.0, 0.3)),
        (plan.ARCH, "y", (6.3, 6.42)),
        (plan.LIVING_DOOR, "x", (5.0, 5.12)),
        (plan.KITCHEN_DOOR, "x", (5.0, 5.12)),
    ):
        reveal(model, hole, depth, along, stuff.PAINT)
        casing(model, hole, along, (depth[0] - 0.015, depth[0]), white)
        casing(model, hole, along, (depth[1], depth[1] + 0.015), white)
    for hole, along in ((plan.TERRACE_DOOR, "x"), (plan.FRONT_DOOR, "y")):
        seen_from(model, hole, along, 0.15)
    _leaves(model)


def _leaves(model: SceneModel) -> None:
    """Add the doors that stand open."""
    door_leaf(model, (0.3, plan.FRONT_DOOR.high + 0.03, 0.0), 4.0, (0.93, 2.08), stuff.FRONT_DOOR)
    door_leaf(model, (plan.LIVING_DOOR.high, 5.0, 0.0), -100.0, (0.88, 2.08), stuff.DOOR)
    door_leaf(
        model, (plan.STAIRWELL[1][0] + 0.09, plan.CELLAR_DOOR.high, 0.0), -3.0, (0.86, 2.03), stuff.DOOR
    )
    for hinge, turn in ((plan.TERRACE_DOOR.low, 262.0), (plan.TERRACE_DOOR.high, -82.0)):
        with model.at((hinge, 0.0, 0.0), turn):
            leaf = Opening(0.0, 0.88, 0.02, 2.33)
            window(model, leaf, "x", (-0.022, 0.022), (1, 3), material=(stuff.PAINT, TRIM))
            model.box((0.05, -0.02, 0.07), (0.83, 0.02, 0.42), stuff.PAINT, tint=TRIM)


def door_leaf(
    model: SceneModel,
    hinge: tuple[float, float, float],
    turn: float,
    size: tuple[float, float],
    face: Material,
) -> None:
    """Add a door that hangs at a point and reaches along x turned by some degrees; with its handles."""
    wide, tall = size
    with model.at(hinge, turn):
        for y, order in ((-0.02, 1), (0.02, -1)):
            corners = rectangle((0.0, wide), y, (0.01, tall))
            model.quad(corners[::order], face, uvs=WHOLE[::order])
            model.cylinder(
                (wide - 0.07, y, 1.02), (wide - 0.07, 2.8 * y, 1.02), 0.011, stuff.STEEL, segments=8
            )
            model.cylinder(
                (wide - 0.07, 2.8 * y, 1.02), (wide - 0.19, 2.8 * y, 1.02), 0.01, stuff.STEEL, segments=8
            )
        model.box((0.0, -0.0199, 0.01), (wide, 0.0199, tall), stuff.PAINT, skip="yY", tint=TRIM)


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
    model.quad(rectangle(c - 0.01, (d - 0.1, b + 0.1), (top, top + 2)), stuff.DOOR, uvs=WHOLE)
    stairs = Opening(a + 0.08, c - 0.08, 0.0, 0.1)  # no skirting along them
    doors = {"x": (plan.FRONT_DOOR,), "y": (plan.LIVING_DOOR, plan.KITCHEN_DOOR), "Y": (stairs,)}
    room_edges(model, low, high, (stuff.WALNUT, (1, 1, 1), 0.0), doors)


def _basement(model: SceneModel) -> None:
    """Add the cellar: whitewashed brick, raw brick piers with a beam, concrete above and below."""
    low, high = plan.BASEMENT
    (a, b), (c, _) = plan.STAIRWELL
    walls = dict.fromkeys("xXyY", stuff.BASEMENT_BRICK)
    _room(model, plan.BASEMENT, (plan.CELLAR, plan.CELLAR_CEILING), walls, {"x": (plan.CELLAR_WINDOW,)})
    floor(model, low, high, plan.CELLAR, stuff.BASEMENT_FLOOR)
    for first, last in ((low, (high[0], b)), ((low[0], b), (a, high[1])), ((c - 0.1, b), high)):
        ceiling(model, first, last, plan.CELLAR_CEILING, stuff.BASEMENT_CEILING)
    top = plan.CELLAR_CEILING
    for y in (1.3, 5.2):
        model.box((4.2, y - 0.22, plan.CELLAR), (4.64, y + 0.22, top - 0.2), stuff.RAW_BRICK, skip="zZ")
    model.box((4.24, low[1], top - 0.2), (4.6, b, top), stuff.OLD_WOOD, skip="Z")
    for x in (1.2, 2.1, 3.0, 5.5, 6.4, 7.3):
        end = b if a < x < c else high[1]
        model.box((x, low[1], top - 0.14), (x + 0.08, end, top), stuff.OLD_WOOD, skip="Z")


def _stairs(model: SceneModel) -> None:
    """Add both flights, the wall below the upper one, the door frame of the cellar, and railings."""
    (a, b), (c, d) = plan.STAIRWELL
    top = plan.CEILING + 0.18
    flight(model, plan.UPPER_STAIRS, (stuff.OAK, stuff.PAINT))
    flight(model, plan.CELLAR_STAIRS, (stuff.OLD_WOOD, stuff.OLD_WOOD))
    # Between the flights: the slope above one's head, and the hall's panelling, seen from both sides.
    low, high = plan.CELLAR_CEILING, top - 0.22
    model.quad([(a, d, low), (c, d, high), (c, b, high), (a, b, low)], stuff.PAINT)
    hall_side = [(a, b, 0.0), (c, b, 0.0), (c, b, top - 0.02), (a, b, 0.17)]
    model.mesh(hall_side, [(0, 1, 2), (0, 2, 3)], stuff.FENCE_BOARDS)
    model.mesh([(a, b, low), (c, b, low), (c, b, high)], [(2, 1, 0)], stuff.BASEMENT_BRICK)
    lining(model, ((a, d), (c, d)), (plan.CELLAR_CEILING, 0.0), stuff.BASEMENT_BRICK)
    under = [(a - low * (c - a) / (high - low), d - 0.006, 0.0), (c, d - 0.006, 0.0), (c, d - 0.006, high)]
    model.mesh(under, [(0, 1, 2)], stuff.BASEMENT_BRICK)
    model.quad(rectangle(c - 0.1, (d, b), (low, low + 0.12)), stuff.BASEMENT_BRICK)
    model.quad(rectangle((c, c + 0.08), b, (0.0, plan.CEILING)), stuff.HALL_WALL)
    ends = ((c + 0.08, b), (c + 0.08, d))
    lining(model, ends, (0.0, plan.CEILING), stuff.HALL_WALL, (cased(plan.CELLAR_DOOR),))
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
