"""The plan of the house: x east, y north, the ground floor at z = 0 [m].

South lies the terrace with the garden, west the porch with the street. The living room takes the south-west,
the kitchen the south-east, the hall the north; stairs run along the north wall, up to the first floor and,
below them, down to the basement. The walls with their holes are built by what is here: linings, reveals,
casings, windows, skirting, stairs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import BOX_SIDES

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Opening:
    """A hole in a wall.

    Attributes
    ----------
    low, high : float
        From where to where it reaches along the wall: x of a wall along x, y of one along y [m].
    sill, head : float
        Heights of its lower and upper edge [m].
    """

    low: float
    high: float
    sill: float
    head: float


@dataclass(frozen=True, slots=True)
class Stairs:
    """A straight flight of stairs.

    Attributes
    ----------
    low, high : (float, float)
        Corners of the ground that it covers [m].
    along : "x" or "y"
        The axis along which it climbs, towards larger numbers.
    heights : (float, float)
        Of the floors below and above [m]; the uppermost tread is level with the latter.
    steps : int
        How many treads.
    """

    low: Point
    high: Point
    along: Literal["x", "y"]
    heights: tuple[float, float]
    steps: int

    @property
    def rise(self) -> float:
        """Height of a step [m]."""
        return (self.heights[1] - self.heights[0]) / self.steps

    @property
    def axis(self) -> int:
        """Index of the axis along which it climbs."""
        return "xy".index(self.along)

    @property
    def depth(self) -> float:
        """Depth of a tread, from riser to riser [m]."""
        return (self.high[self.axis] - self.low[self.axis]) / self.steps

    def walk(self, model: SceneModel, beside: float) -> None:
        """Let people walk up the middles of the treads, some distance from the sides [m]."""
        low, high, slope = list(self.low), list(self.high), [0.0, 0.0]
        for corner, inwards in ((low, beside), (high, -beside)):
            corner[self.axis] -= self.depth / 2
            corner[1 - self.axis] += inwards
        slope[self.axis] = self.rise / self.depth
        model.walkable(low, high, self.heights[0], slope=(slope[0], slope[1]))


GROUND = -0.75  # the lawn; the cellar windows look out just above it
CEILING, EAVES, RIDGE = 2.7, 5.5, 8.3
CELLAR, CELLAR_CEILING = -2.6, -0.28
OUTER_LOW, OUTER_HIGH = (0.0, 0.0), (11.0, 8.0)  # outside of the walls, 0.3 m thick

LIVING = (0.3, 0.3), (6.3, 5.0)
KITCHEN = (6.42, 0.3), (10.7, 5.0)
HALL = (0.3, 5.12), (7.5, 7.7)
BASEMENT = (0.3, 0.3), (8.0, 7.7)
STAIRWELL = (2.4, 6.65), (6.3, 7.7)
UPPER_STAIRS = Stairs(*STAIRWELL, "x", (0.0, CEILING + 0.18), 15)
CELLAR_STAIRS = Stairs(STAIRWELL[0], (6.2, 7.7), "x", (CELLAR, 0.0), 14)

GARDEN_WINDOW = Opening(0.8, 3.0, 0.45, 2.35)  # living room, south
TERRACE_DOOR = Opening(3.4, 5.2, 0.0, 2.35)  # living room, south
WEST_WINDOW = Opening(1.5, 3.4, 0.85, 2.2)  # living room, west
SINK_WINDOW = Opening(7.5, 9.6, 1.1, 2.2)  # kitchen, south
EAST_WINDOW = Opening(1.7, 3.7, 0.85, 2.2)  # kitchen, east
FRONT_DOOR = Opening(5.6, 6.55, 0.0, 2.1)  # hall, west
HALL_WINDOW = Opening(6.95, 7.45, 1.0, 2.0)  # hall, west, beside the door
CELLAR_WINDOW = Opening(1.4, 2.7, -0.7, -0.34)  # basement, west
LANDING_WINDOW = Opening(3.9, 5.2, 3.7, 4.8)  # over the stairs, north
ARCH = Opening(2.0, 3.9, 0.0, 2.3)  # between living room and kitchen, along y
LIVING_DOOR = Opening(5.1, 6.0, 0.0, 2.1)  # between living room and hall, along x
KITCHEN_DOOR = Opening(6.55, 7.4, 0.0, 2.1)  # between kitchen and hall, along x
CELLAR_DOOR = Opening(6.72, 7.62, 0.0, 2.05)  # at the head of the cellar stairs, along y

DECK_LOW, DECK_HIGH = (0.6, -3.2), (7.0, 0.0)
GARDEN_STEPS = Stairs((3.4, -4.4), (5.2, -3.2), "y", (GROUND, -0.02), 4)
PORCH_LOW, PORCH_HIGH = (-1.9, 5.1), (0.0, 7.1)
PORCH_STEPS = Stairs((-3.1, 5.5), (-1.9, 6.7), "x", (GROUND, 0.0), 4)


def lining(
    model: SceneModel,
    ends: tuple[Point, Point],
    heights: tuple[float, float],
    material: Material,
    openings: Sequence[Opening] = (),
) -> None:
    """Add one visible side of a wall, with holes: it is seen from the right hand of who walks along it.

    Parameters
    ----------
    model : SceneModel
        Where to add it.
    ends : ((float, float), (float, float))
        Where the wall begins and ends, along x or y [m].
    heights : (float, float)
        Of its lower and upper edge [m].
    material : Material
        What one sees.
    openings : sequence of Opening
        Holes; none overlaps another, and what lies beyond the wall's ends does not count.
    """
    (x0, y0), (x1, y1) = ends
    along_x = abs(x1 - x0) > abs(y1 - y0)
    start, stop = (x0, x1) if along_x else (y0, y1)
    low, high = min(start, stop), max(start, stop)
    inside = [
        Opening(max(hole.low, low), min(hole.high, high), hole.sill, hole.head)
        for hole in openings
        if hole.low < high and hole.high > low
    ]
    cuts = sorted({low, high, *(hole.low for hole in inside), *(hole.high for hole in inside)})
    for left, right in pairwise(cuts):
        middle = (left + right) / 2
        holes = [hole for hole in inside if hole.low < middle < hole.high]
        levels = [
            heights[0],
            *(z for hole in sorted(holes, key=_sill) for z in (hole.sill, hole.head)),
            heights[1],
        ]
        first, last = (left, right) if stop > start else (right, left)
        for bottom, top in zip(levels[::2], levels[1::2], strict=True):
            if top - bottom > 1e-6:
                corners = [(first, bottom), (last, bottom), (last, top), (first, top)]
                model.quad([(a, y0, z) if along_x else (x0, a, z) for a, z in corners], material)


def _sill(opening: Opening) -> float:
    return opening.sill


def hollow(
    model: SceneModel, low: Sequence[float], high: Sequence[float], material: Material, skip: str = ""
) -> None:
    """Add a box that is seen from inside: a shaft, a recess, the reveal of a window."""
    lower, size = np.asarray(low, dtype=float), np.subtract(high, low)
    for side, corners in BOX_SIDES.items():
        if side not in skip:
            model.quad((lower + np.array(corners) * size)[::-1], material)


def reveal(
    model: SceneModel, opening: Opening, depth: tuple[float, float], along: str, material: Material
) -> None:
    """Line the hole through a wall that runs along "x" or "y" and lies from depth[0] to depth[1]."""
    skip = "yY" if along == "x" else "xX"
    if along == "x":
        low, high = (opening.low, depth[0]), (opening.high, depth[1])
    else:
        low, high = (depth[0], opening.low), (depth[1], opening.high)
    hollow(model, (*low, opening.sill), (*high, opening.head), material, skip=skip)


def bar(
    model: SceneModel, along: str, span: tuple[float, float], across: tuple[float, float],
    material: tuple[Material, tuple[float, float], Sequence[float]],
) -> None:  # fmt: skip
    """Add a box along a wall: `span` along it, `across` through it; material with its heights and tint."""
    stuff, (bottom, top), tint = material
    if along == "x":
        model.box((span[0], across[0], bottom), (span[1], across[1], top), stuff, tint=tint)
    else:
        model.box((across[0], span[0], bottom), (across[1], span[1], top), stuff, tint=tint)


def casing(
    model: SceneModel, opening: Opening, along: str, across: tuple[float, float],
    material: tuple[Material, Sequence[float]],
) -> None:  # fmt: skip
    """Add the frame around an opening, 8 cm wide, as thick as `across` says; none along the floor."""
    stuff, tint = material
    low, high, wide = opening.low, opening.high, 0.08
    for span in ((low - wide, low), (high, high + wide)):
        bar(model, along, span, across, (stuff, (opening.sill, opening.head), tint))
    bar(model, along, (low - wide, high + wide), across, (stuff, (opening.head, opening.head + wide), tint))


def window(
    model: SceneModel, opening: Opening, along: str, across: tuple[float, float],
    panes: tuple[int, int] = (2, 2), *, material: tuple[Material, Sequence[float]],
) -> None:  # fmt: skip
    """Add a window's frame and its glazing bars, `panes` across and up."""
    stuff, tint = material
    low, high, sill, head = opening.low, opening.high, opening.sill, opening.head
    frame = 0.05
    for span in ((low, low + frame), (high - frame, high)):
        bar(model, along, span, across, (stuff, (sill, head), tint))
    for edge in (sill, head - frame):
        bar(model, along, (low + frame, high - frame), across, (stuff, (edge, edge + frame), tint))
    for part in range(1, panes[0]):
        middle = low + (high - low) * part / panes[0]
        upright = (stuff, (sill + frame, head - frame), tint)
        bar(model, along, (middle - 0.022, middle + 0.022), across, upright)
    for part in range(1, panes[1]):
        middle = sill + (head - sill) * part / panes[1]
        bar(
            model, along, (low + frame, high - frame), across, (stuff, (middle - 0.018, middle + 0.018), tint)
        )


def seen_from(model: SceneModel, opening: Opening, along: str, depth: float) -> None:
    """Tell the bake that light comes in through an opening."""
    corners = [(opening.low, opening.sill), (opening.high, opening.sill), (opening.high, opening.head)]
    corners.append((opening.low, opening.head))
    model.window([(a, depth, z) if along == "x" else (depth, a, z) for a, z in corners])


def room_edges(
    model: SceneModel, low: Point, high: Point, material: tuple[Material, Sequence[float], float],
    doors: Mapping[str, Sequence[Opening]],
) -> None:  # fmt: skip
    """Add a skirting board around a room, broken at its doors; doors are listed by side: "xXyY"."""
    stuff, tint, floor = material
    thick, tall = 0.018, 0.11
    for side in "xXyY":
        along = "y" if side in "xX" else "x"
        index = 1 if along == "y" else 0
        wall = (low if side.islower() else high)[1 - index]
        across = (wall, wall + thick) if side.islower() else (wall - thick, wall)
        place = low[index]
        for door in sorted(doors.get(side, ()), key=_low):
            bar(model, along, (place, door.low - 0.08), across, (stuff, (floor, floor + tall), tint))
            place = door.high + 0.08
        bar(model, along, (place, high[index]), across, (stuff, (floor, floor + tall), tint))


def _low(opening: Opening) -> float:
    return opening.low


def flight(
    model: SceneModel, stairs: Stairs, material: tuple[Material, Material], *, solid: bool = False
) -> None:
    """Add stairs of treads and risers, as `material` names them; solid ones stand on the ground, closed."""
    treads, risers = material
    for step in range(stairs.steps):
        top = stairs.heights[0] + stairs.rise * (step + 1)
        bottom = stairs.heights[0] - 0.05 if solid else top - stairs.rise
        start = stairs.low[stairs.axis] + stairs.depth * step
        stop = start + stairs.depth
        for stuff, span, heights in (
            (risers, (start, stop), (bottom, top - 0.035)),
            (treads, (start - 0.025, stop), (top - 0.035, top)),
        ):
            low, high = [*stairs.low, heights[0]], [*stairs.high, heights[1]]
            low[stairs.axis], high[stairs.axis] = span
            model.box(low, high, stuff)
