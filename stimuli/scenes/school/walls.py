"""Walls with doors and windows in them, floors and ceilings of the school."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from evenlight.stimuli.scenes.model import Material, SceneModel
from evenlight.stimuli.scenes.school.materials import CEILING, ENAMEL

XY = tuple[float, float]
THICK = 0.3  # [m] of all walls
FRAME = 0.07  # [m] of window frames, across
FRAME_DEPTH = (-0.05, 0.03)  # [m] from the middle of the wall
WHITE_FRAME = (0.86, 0.87, 0.84)


@dataclass(frozen=True, slots=True)
class WallOpening:
    """A hole in a wall: a doorway, or a window with panes.

    Attributes
    ----------
    left, right, bottom, top : float
        Its edges, along the wall and above its foot [m].
    across, up : int
        How many panes a window has; a frame without panes for 0.
    """

    left: float
    right: float
    bottom: float
    top: float
    across: int = 0
    up: int = 0


@dataclass(frozen=True, slots=True)
class Faces:
    """What the two sides of a wall are made of, as seen walking from its beginning to its end.

    Attributes
    ----------
    left, right : Material
        Of the sides.
    frame : (float, float, float)
        Colour of the frames of its openings.
    """

    left: Material
    right: Material
    frame: tuple[float, float, float] = WHITE_FRAME


def wall(
    model: SceneModel,
    ends: tuple[XY, XY],
    levels: tuple[float, float],
    faces: Faces,
    openings: Sequence[WallOpening] = (),
) -> None:
    """Put up a wall between two points of its middle line, from a lower to an upper level [m]."""
    (x, y), (to_x, to_y) = ends
    length = math.hypot(to_x - x, to_y - y)
    with model.at((x, y, 0.0), math.degrees(math.atan2(to_y - y, to_x - x))):
        for low, high, bottom, top in _solid(length, levels, openings):
            _panel(model, (low, high, bottom, top), THICK / 2, faces.left)
            _panel(model, (low, high, bottom, top), -THICK / 2, faces.right)
        for opening in openings:
            _reveal(model, opening, faces)
            _frame(model, opening, faces)


def _solid(
    length: float, levels: tuple[float, float], openings: Sequence[WallOpening]
) -> Iterator[tuple[float, float, float, float]]:
    """Yield the rectangles between the openings: left, right, bottom, top."""
    edges = sorted({0.0, length, *(edge for o in openings for edge in (o.left, o.right))})
    for low, high in itertools.pairwise(edges):
        bottom = levels[0]
        for hole in sorted(
            (o for o in openings if o.left <= low and o.right >= high), key=lambda o: o.bottom
        ):
            if hole.bottom > bottom:
                yield low, high, bottom, hole.bottom
            bottom = hole.top
        if bottom < levels[1]:
            yield low, high, bottom, levels[1]


def _panel(model: SceneModel, edges: tuple[float, float, float, float], y: float, material: Material) -> None:
    """Add a side of a wall, seen from where y goes."""
    low, high, bottom, top = edges
    first, last = (high, low) if y > 0 else (low, high)
    model.quad([(first, y, bottom), (last, y, bottom), (last, y, top), (first, y, top)], material)


def _reveal(model: SceneModel, hole: WallOpening, faces: Faces) -> None:
    """Line a window before and behind its frame, with what the wall's sides are made of, and add a sill.

    A doorway's frame covers the whole depth of the wall.
    """
    if not hole.across:
        return
    outer, inner = (-THICK / 2, FRAME_DEPTH[0]), (FRAME_DEPTH[1], THICK / 2)
    low, high = hole.bottom, hole.top
    for (front, back), material in ((outer, faces.right), (inner, faces.left)):
        left = [
            (hole.left, front, low),
            (hole.left, back, low),
            (hole.left, back, high),
            (hole.left, front, high),
        ]
        right = [
            (hole.right, back, low),
            (hole.right, front, low),
            (hole.right, front, high),
            (hole.right, back, high),
        ]
        head = [
            (hole.left, back, high),
            (hole.right, back, high),
            (hole.right, front, high),
            (hole.left, front, high),
        ]
        for corners in (left, right, head):
            model.quad(corners, material)
    sill = (hole.left, -THICK / 2 - 0.06, low), (hole.right, THICK / 2 + 0.04, low + 0.03)
    model.box(*sill, ENAMEL, tint=(0.75, 0.74, 0.7))


def _frame(model: SceneModel, hole: WallOpening, faces: Faces) -> None:
    """Put a frame into an opening, with bars between the panes of a window."""
    left, right, bottom, top = hole.left, hole.right, hole.bottom, hole.top
    if not hole.across:
        for x in (left, right - 0.05):
            model.box((x, -0.17, bottom), (x + 0.05, 0.17, top), ENAMEL, skip="zZ", tint=faces.frame)
        model.box((left, -0.17, top - 0.05), (right, 0.17, top), ENAMEL, skip="xXZ", tint=faces.frame)
        return
    for bar in range(hole.across + 1):
        x = left + (right - left - FRAME) * bar / hole.across
        model.box((x, -0.05, bottom), (x + FRAME, 0.03, top), ENAMEL, skip="zZ", tint=faces.frame)
    for bar in range(hole.up + 1):
        z = bottom + (top - bottom - FRAME) * bar / hole.up
        model.box((left, -0.04, z), (right, 0.02, z + FRAME), ENAMEL, skip="xX", tint=faces.frame)


def floor(
    model: SceneModel,
    low: XY,
    high: XY,
    material: Material,
    z: float = 0.0,
    tint: Sequence[float] = (1, 1, 1),
) -> None:
    """Lay a floor."""
    corners = [(low[0], low[1], z), (high[0], low[1], z), (high[0], high[1], z), (low[0], high[1], z)]
    model.quad(corners, material, tint=tint)


def ceiling(model: SceneModel, low: XY, high: XY, z: float, material: Material = CEILING) -> None:
    """Hang a ceiling."""
    model.quad(
        [(low[0], low[1], z), (low[0], high[1], z), (high[0], high[1], z), (high[0], low[1], z)], material
    )


def panel_lamp(model: SceneModel, centre: XY, z: float, size: XY, luminance: float) -> None:
    """Hang a luminous panel that faces down, in a tray."""
    (x, y), (a, b) = centre, (size[0] / 2, size[1] / 2)
    tray = 0.06
    model.box(
        (x - a - 0.03, y - b - 0.03, z),
        (x + a + 0.03, y + b + 0.03, z + tray),
        ENAMEL,
        skip="z",
        tint=(0.8, 0.8, 0.8),
    )
    under = z
    model.lamp(
        [(x - a, y - b, under), (x - a, y + b, under), (x + a, y + b, under), (x + a, y - b, under)],
        luminance,
        (1.0, 0.93, 0.82),
    )


def picture(model: SceneModel, material: Material, size: XY, frame: float = 0.0) -> None:
    """Hang a picture on a wall that faces -y, its middle at the origin; framed if the frame has a width."""
    a, b = size[0] / 2, size[1] / 2
    model.quad(
        [(-a, -0.012, -b), (a, -0.012, -b), (a, -0.012, b), (-a, -0.012, b)],
        material,
        uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
    )
    if frame:
        for low, high in (
            ((-a - frame, -0.03, -b - frame), (-a, 0, b + frame)),
            ((a, -0.03, -b - frame), (a + frame, 0, b + frame)),
            ((-a, -0.03, -b - frame), (a, 0, -b)), ((-a, -0.03, b), (a, 0, b + frame)),
        ):  # fmt: skip
            model.box(low, high, ENAMEL, skip="Y", tint=(0.25, 0.17, 0.1))
