"""What the school is built of: materials; walls with doors and windows in them, floors, ceilings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.stimuli.scenes.content.textures.garden import bark, grass, leaves, thicket
from evenlight.stimuli.scenes.content.textures.interior import (
    asphalt,
    brick,
    concrete,
    fabric,
    metal,
    paving,
    planks,
    plaster,
    terrazzo,
    tiles,
    wood,
)
from evenlight.stimuli.scenes.content.textures.printed import landscape_painting
from evenlight.stimuli.scenes.content.textures.school import (
    basketball_net,
    catalogue_drawers,
    ceiling_tiles,
    chain_link,
    clock_face,
    cork,
    drawn,
    faded_spines,
    gym_floor,
    library_spines,
    locker_fronts,
    plain,
    spokes,
)
from evenlight.stimuli.scenes.content.textures.school_pictures import (
    POSTERS,
    basketball,
    dim_classroom,
    exit_sign,
    four_square,
    globe_map,
    hopscotch,
    keyboard,
    name_board,
    number_snail,
    on_the_ground,
    paper_sheets,
    scoreboard,
    screen,
    shelf_marks,
)
from evenlight.stimuli.scenes.content.textures.tileable import linear
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

# Surfaces of the building.
BRICK = Material("brick", brick(linear("a2553c"), linear("7f3f2e"), linear("b8ae9e")), 0.9)
CONCRETE = Material("concrete", concrete(linear("b5b0a6")), 2.5)
HALL_WALL = Material("hall wall", plaster(linear("e2d6b8")), 2.0)
CORRIDOR_WALL = Material("corridor wall", plaster(linear("e6e0cc")), 2.0)
DADO = Material("dado", plain("4f7f86", 0.1), 1.0, gloss=0.35)
STACKS_WALL = Material("stacks wall", plaster(linear("c2bba9"), 0.1), 2.0)
GYM_WALL = Material("gym wall", plaster(linear("dcd8cc")), 2.0)
GYM_PANELS = Material("gym panels", planks(linear("c79a62"), linear("a87a45"), 10), 1.2, gloss=0.3)
TERRAZZO = Material(
    "terrazzo",
    terrazzo(linear("b5ad9d"), tuple(linear(c) for c in ("6e6459", "e8e2d4", "8c7b66", "4a4a48", "a58467"))),
    1.2,
    gloss=0.8,
)
PARQUET = Material("parquet", planks(linear("b2865a"), linear("8a6340")), 1.2, gloss=0.5)
STACKS_FLOOR = Material("linoleum", plain("a59c8b", 0.2, 24), 1.0, gloss=0.4)
WALL_TILES = Material("wall tiles", tiles(linear("d8e2dc"), linear("9aa09a"), 8), 1.2, gloss=0.65)
FLOOR_TILES = Material("floor tiles", tiles(linear("94877a"), linear("6a6258"), 6, 0.15), 1.2, gloss=0.4)
CEILING = Material("ceiling tiles", ceiling_tiles, 1.2)
GYM_FLOOR = Material("gym floor", gym_floor, 2.4, gloss=0.85)
ASPHALT = Material("asphalt", asphalt(linear("7b7977")), 2.0)
GRASS = Material("grass", grass(linear("7d9a45"), linear("3f5a22")), 1.5)
PAVING = Material("paving", paving(linear("a8a196"), 4), 2.0)
HEDGE = Material("hedge", thicket(linear("5c7a38"), linear("2c421c")), 0.8)
GLASS = Material("pane", plain("3a4650", 0.3, 3), 3.0, gloss=1.0)
# Things are tinted, so that one coat of paint serves for all colours.
PAINT = Material("paint", plain("f4f4f4", 0.06), 0.8)
ENAMEL = Material("enamel", plain("f4f4f4", 0.05), 0.8, gloss=0.7)
VINYL = Material("vinyl", plain("f0f0f0", 0.14, 12), 0.7, gloss=0.3)
CLOTH = Material("cloth", fabric(linear("e8e8e8")), 0.4)
OAK = Material("oak", wood(linear("b5875a"), linear("85603f")), 0.8, gloss=0.3)
DARK_OAK = Material("dark oak", wood(linear("8a6848"), linear("6a4f3a")), 0.8, gloss=0.35)
BEECH = Material("beech", wood(linear("d8b078"), linear("b98a52")), 0.8, gloss=0.3)
STEEL = Material("steel", metal(linear("9aa0a4")), 1.0, gloss=0.6, metal=1.0)
BRASS = Material("brass", plain("b3924c", 0.1), 0.5, gloss=0.7, metal=1.0)
MIRROR = Material("mirror", plain("f4f4f4", 0.0), 1.0, gloss=1.0, metal=1.0)
PAPER = Material("book edges", plain("d9cfb6", 0.2, 32), 0.3)
# Drawn things: one tile is the whole.
SPINES = Material("spines", library_spines, 1.0)
FADED_SPINES = Material("faded spines", faded_spines, 1.0)
LOCKERS = Material("lockers", locker_fronts(("#3f6f8f", "#3f6f8f", "#39647f", "#477a99")), 1.2, gloss=0.5)
RED_LOCKERS = Material(
    "red lockers", locker_fronts(("#a8483a", "#b8523f", "#9f4236", "#a8483a")), 1.2, gloss=0.5
)
CATALOGUE = Material("catalogue", catalogue_drawers, 1.0)
SHELF_MARKS = Material("shelf marks", drawn("#e8e2cc", shelf_marks), 1.0)
CLOCK = Material("clock", clock_face, 1.0)
CORK = Material("cork", cork, 0.6)
PAPERS = Material("papers", paper_sheets, 1.0)
GLOBE = Material("globe", globe_map, 1.0, gloss=0.5)
SCREEN = Material("screen", drawn("#111111", screen, 0.0), 1.0)
KEYBOARD = Material("keyboard", drawn("#191a1c", keyboard), 1.0)
SCOREBOARD = Material("scoreboard", drawn("#000000", scoreboard, 0.0), 1.0)
EXIT_SIGN = Material("exit sign", drawn("#1f8a4c", exit_sign, 0.0), 1.0)
CLASSROOM = Material("classroom", drawn("#1d2226", dim_classroom), 1.0, gloss=1.0)
SIGN = Material("sign", drawn("#1f3d38", name_board, 0.02), 1.0)
BASKETBALL = Material("basketball", basketball, 1.0)
WALL_POSTERS = {kind: Material(f"{kind} poster", texture, 1.0) for kind, texture in POSTERS.items()}
PAINTING = Material(
    "painting", landscape_painting(linear("9fb8cc"), linear("4f5f38"), linear("e8c98a")), 1.0, gloss=0.2
)
HOPSCOTCH = Material("hopscotch", on_the_ground(hopscotch), 1.0, cutout=True)
SNAIL = Material("number snail", on_the_ground(number_snail), 1.0, cutout=True)
FOUR_SQUARE = Material("four square", on_the_ground(four_square), 1.0, cutout=True)
# With holes.
FENCE = Material("chain link", chain_link, 0.6, cutout=True)
NET = Material("net", basketball_net, 1.0, cutout=True)
SPOKES = Material("spokes", spokes, 1.0, cutout=True)
LEAVES = Material("leaves", leaves(linear("8fae4a"), linear("3c5a24")), 0.9, cutout=True)
BARK = Material("bark", bark(linear("6a5a48")), 0.6)
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
    model.quad(rectangle((first, last), y, (bottom, top)), material)


def _reveal(model: SceneModel, hole: WallOpening, faces: Faces) -> None:
    """Line a window before and behind its frame, with what the wall's sides are made of, and add a sill.

    A doorway's frame covers the whole depth of the wall.
    """
    if not hole.across:
        return
    outer, inner = (-THICK / 2, FRAME_DEPTH[0] + 0.01), (FRAME_DEPTH[1] - 0.01, THICK / 2)  # up to its bars
    low, high = hole.bottom, hole.top
    for (front, back), material in ((outer, faces.right), (inner, faces.left)):
        left = rectangle(hole.left, (front, back), (low, high))
        right = rectangle(hole.right, (back, front), (low, high))
        head = rectangle((hole.left, hole.right), (back, front), high)
        for corners in (left, right, head):
            model.quad(corners, material)
    sill = (
        (hole.left - 0.04, -THICK / 2 - 0.06, low - 0.01),
        (hole.right + 0.04, THICK / 2 + 0.04, low + 0.03),
    )
    model.box(*sill, ENAMEL, tint=(0.75, 0.74, 0.7))


def _frame(model: SceneModel, hole: WallOpening, faces: Faces) -> None:
    """Put a frame into an opening, with bars between the panes of a window."""
    left, right, bottom, top = hole.left, hole.right, hole.bottom, hole.top
    if not hole.across:
        for x in (left, right - 0.05):
            model.box((x, -0.17, bottom), (x + 0.05, 0.17, top), ENAMEL, skip="zZ", tint=faces.frame)
        model.box((left, -0.17, top - 0.05), (right, 0.17, top), ENAMEL, skip="xXZ", tint=faces.frame)
        return
    uprights = np.linspace(left, right - FRAME, hole.across + 1).tolist()
    for x in uprights:
        model.box((x, -0.05, bottom), (x + FRAME, 0.03, top), ENAMEL, skip="zZ", tint=faces.frame)
    # Bars end where uprights begin: what is inside them would be dark.
    for z in np.linspace(bottom, top - FRAME, hole.up + 1).tolist():
        for x, end in itertools.pairwise(uprights):
            model.box((x + FRAME, -0.04, z), (end, 0.02, z + FRAME), ENAMEL, skip="xX", tint=faces.frame)


def floor(
    model: SceneModel,
    low: XY,
    high: XY,
    material: Material,
    z: float = 0.0,
    tint: Sequence[float] = (1, 1, 1),
) -> None:
    """Lay a floor."""
    corners = rectangle((low[0], high[0]), (low[1], high[1]), z)
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
    low, high = (x - a - 0.03, y - b - 0.03, z), (x + a + 0.03, y + b + 0.03, z + tray)
    model.box(low, high, ENAMEL, skip="z", tint=(0.8, 0.8, 0.8))
    under = z
    corners = [(x - a, y - b, under), (x - a, y + b, under), (x + a, y + b, under), (x + a, y - b, under)]
    model.lamp(corners, luminance, (1.0, 0.93, 0.82))


def picture(model: SceneModel, material: Material, size: XY, frame: float = 0.0) -> None:
    """Hang a picture on a wall that faces -y, its middle at the origin; framed if the frame has a width."""
    a, b = size[0] / 2, size[1] / 2
    model.quad(rectangle((-a, a), -0.012, (-b, b)), material, uvs=WHOLE)
    if frame:
        for low, high in (
            ((-a - frame, -0.03, -b - frame), (-a, 0, b + frame)),
            ((a, -0.03, -b - frame), (a + frame, 0, b + frame)),
            ((-a, -0.03, -b - frame), (a, 0, -b)), ((-a, -0.03, b), (a, 0, b + frame)),
        ):  # fmt: skip
            model.box(low, high, ENAMEL, skip="Y", tint=(0.25, 0.17, 0.1))
