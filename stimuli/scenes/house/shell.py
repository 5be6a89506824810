"""The shell of the house: its walls with their windows and doors, floors, ceilings, stairs, roof."""

from __future__ import annotations

from evenlight.stimuli.scenes.house import materials as stuff
from evenlight.stimuli.scenes.house import plan
from evenlight.stimuli.scenes.house.rooms import TRIM, cased, rooms, silled
from evenlight.stimuli.scenes.house.walls import Opening, casing, lining, reveal, seen_from, window
from evenlight.stimuli.scenes.model import Material, SceneModel

GREEN_TRIM = (0.16, 0.27, 0.23)
UPPER_SOUTH = tuple(Opening(x, x + 1.2, 3.5, 4.8) for x in (1.2, 3.7, 6.4, 8.9))
UPPER_WEST = tuple(Opening(y, y + 1.1, 3.5, 4.8) for y in (1.8, 5.2))


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
        span = (low, high)
        _slab(model, along, span, (depth - 0.005, depth), (hole.sill, hole.head), (stuff.GLAZED, tint))
    wide = (hole.high - hole.low) / 2
    for low in (hole.low - wide - 0.02, hole.high + 0.02):
        outer = (across[0] + 0.005, across[1])
        _slab(
            model, along, (low, low + wide), outer, (hole.sill, hole.head), (stuff.FENCE_BOARDS, GREEN_TRIM)
        )
    sill = (across[0] - 0.06, across[1])
    _slab(
        model,
        along,
        (hole.low - 0.05, hole.high + 0.05),
        sill,
        (hole.sill - 0.05, hole.sill),
        (stuff.PLINTH, (1, 1, 1)),
    )


def _slab(
    model: SceneModel, along: str, span: tuple[float, float], across: tuple[float, float],
    heights: tuple[float, float], paint: tuple[Material, tuple[float, float, float]],
) -> None:  # fmt: skip
    low, high = (span[0], across[0]), (span[1], across[1])
    if along == "y":
        low, high = low[::-1], high[::-1]
    model.box((*low, heights[0]), (*high, heights[1]), paint[0], tint=paint[1])


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
        outer = (depth[0] - 0.06, depth[0] + 0.02) if depth[0] < 5 else (depth[1] - 0.02, depth[1] + 0.06)
        _slab(
            model,
            along,
            (hole.low - 0.06, hole.high + 0.06),
            outer,
            (hole.sill - 0.05, hole.sill),
            (stuff.PLINTH, (1, 1, 1)),
        )
        inner = (depth[1] - 0.02, depth[1] + 0.07) if depth[0] < 5 else (depth[0] - 0.07, depth[0] + 0.02)
        _slab(
            model,
            along,
            (hole.low - 0.06, hole.high + 0.06),
            inner,
            (hole.sill - 0.035, hole.sill),
            (stuff.PAINT, TRIM),
        )
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
    door_leaf(model, (plan.KITCHEN_DOOR.high, 5.12, 0.0), 84.0, (0.83, 2.08), stuff.DOOR)
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
            corners = [(0.0, y, 0.01), (wide, y, 0.01), (wide, y, tall), (0.0, y, tall)]
            uvs = [(0, 0), (1, 0), (1, 1), (0, 1)]
            model.quad(corners[::order], face, uvs=uvs[::order])
            model.cylinder(
                (wide - 0.07, y, 1.02), (wide - 0.07, 2.8 * y, 1.02), 0.011, stuff.STEEL, segments=8
            )
            model.cylinder(
                (wide - 0.07, 2.8 * y, 1.02), (wide - 0.19, 2.8 * y, 1.02), 0.01, stuff.STEEL, segments=8
            )
        model.box((0.0, -0.0199, 0.01), (wide, 0.0199, tall), stuff.PAINT, skip="yY", tint=TRIM)
