"""Furniture that holds things: bookcases full of books, sideboards, shelves with jars, boxes, coat racks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from evenlight.stimuli.scenes.content.props.furniture import WHITE, Tint
from evenlight.stimuli.scenes.content.textures.printed import SHELVES, SPINES, spine_cell
from evenlight.stimuli.scenes.content.textures.tileable import linear
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle

GLASS_TINTS = tuple(
    linear(code) for code in ["a83a2a", "d89a2e", "5f7a34", "7a3f5a", "c8b060", "8a4a22", "4a5a6a", "d8d0b0"]
)


def book(
    model: SceneModel, size: tuple[float, float, float], kinds: tuple[Material, Material], number: int
) -> None:
    """Add a standing book, its spine towards -y, its lower left front corner at the origin.

    Parameters
    ----------
    model : SceneModel
        Where to add it.
    size : (float, float, float)
        Thickness, depth and height [m].
    kinds : (Material, Material)
        Spines, and the paper inside.
    number : int
        Which of the spines.
    """
    thick, deep, tall = size
    spines, pages = kinds
    u0, v0, u1, v1 = spine_cell(number)
    model.quad(rectangle((0, thick), 0, (0, tall)), spines,
               uvs=[(u0, v0), (u1, v0), (u1, v1), (u0, v1)])  # fmt: skip
    # The covers are the middle of the spine's colour, stretched.
    cover = [(u0 + 0.2 * (u1 - u0), v) for v in (v0, v0, v0 + 0.05, v0 + 0.05)]
    model.quad(rectangle(0, (deep, 0), (0, tall)), spines, uvs=cover)
    model.quad(rectangle(thick, (0, deep), (0, tall)), spines, uvs=cover)
    inset = 0.004
    model.quad(rectangle((0, thick), (inset, deep), tall - inset), pages)


def row_of_books(
    model: SceneModel, wide: float, tall: float, kinds: tuple[Material, Material], rng: np.random.Generator
) -> None:
    """Fill a shelf of some width and clear height with books from the left, with gaps at times."""
    x = 0.005
    while True:
        thick, height = 0.018 + 0.03 * rng.random() ** 1.5, tall * (0.62 + 0.32 * rng.random())
        deep = 0.13 + 0.06 * rng.random()
        number, gap, back = int(rng.integers(SPINES * SHELVES)), rng.random(), 0.015 * rng.random()
        if gap < 0.03:
            x += 0.05 + 0.1 * rng.random()
        if x + thick > wide - 0.005:
            return
        lean = 8.0 if gap < 0.03 and x + thick + 0.06 < wide else 0.0
        with model.at((x, back, 0.0), tilt=lean):
            book(model, (thick, deep, height), kinds, number)
        x += thick + 0.001


def lying_books(
    model: SceneModel, number: int, kinds: tuple[Material, Material], rng: np.random.Generator
) -> None:
    """Add a pile of books, lying, around the origin."""
    z = 0.0
    for _ in range(number):
        thick, long = 0.015 + 0.025 * rng.random(), 0.2 + 0.07 * rng.random()
        u0, v0, u1, v1 = spine_cell(int(rng.integers(SPINES * SHELVES)))
        with model.at((0, 0, z), 24 * (rng.random() - 0.5)):
            a, b = long / 2, long * 0.36
            model.box((-a, -b + 0.006, 0.002), (a - 0.004, b - 0.004, thick - 0.002), kinds[1])
            cover = [(u0 + 0.2 * (u1 - u0), v) for v in (v0, v0, v0 + 0.05, v0 + 0.05)]
            model.quad(rectangle((-a, a), (-b, b), thick), kinds[0], uvs=cover)
            model.quad(rectangle((-a, a), -b, (0, thick)), kinds[0],
                       uvs=[(u1, v0), (u1, v1), (u0, v1), (u0, v0)])  # fmt: skip
        z += thick + 0.001


def bookcase(
    model: SceneModel, size: tuple[float, float, float], stuff: Material,
    kinds: tuple[Material, Material], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Add a bookcase full of books, some lying, a few things between; size in x, y, z; front -y."""
    wide, deep, tall = size
    shelves, bays = max(2, round(tall / 0.36)), max(1, round(wide / 0.9))
    y0, y1, board = -deep / 2, deep / 2, 0.022
    model.box((-wide / 2, y1 - 0.012, 0), (wide / 2, y1, tall), stuff, skip="Y")
    for side in range(bays + 1):
        x = -wide / 2 + (wide - board) * side / bays
        model.box((x, y0, 0), (x + board, y1 - 0.012, tall), stuff, skip="Y")
    for shelf in range(shelves + 1):
        z = 0.07 + (tall - board - 0.07) * shelf / shelves
        model.box(
            (-wide / 2 + board, y0 + 0.004, z), (wide / 2 - board, y1 - 0.012, z + board), stuff, skip="YxX"
        )
    model.box((-wide / 2, y0 + 0.03, 0), (wide / 2, y0 + 0.04, 0.07), stuff, skip="Y")
    clear = (tall - 0.09) / shelves - board
    inner = (wide - board) / bays - board
    for shelf in range(shelves):
        z = 0.07 + (tall - board - 0.07) * shelf / shelves + board
        for bay in range(bays):
            x = -wide / 2 + board + (wide - board) * bay / bays
            _shelf(model, (x, y0 + 0.02, z), (inner, clear), kinds, rng)


def _shelf(
    model: SceneModel, corner: Sequence[float], space: tuple[float, float],
    kinds: tuple[Material, Material], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Fill one compartment: mostly books, at its right end sometimes a pile or a vase."""
    wide, tall = space
    extra = rng.random()
    used = wide if extra < 0.5 else wide * (0.62 + 0.15 * rng.random())
    with model.at(corner):
        row_of_books(model, used, tall, kinds, rng)
        if 0.5 <= extra < 0.75:
            with model.at(((used + wide) / 2, 0.1, 0.0), 90):
                lying_books(model, int(rng.integers(2, 6)), kinds, rng)
        elif extra >= 0.75:
            tint = GLASS_TINTS[rng.integers(len(GLASS_TINTS))]
            with model.at(((used + wide) / 2, 0.1, 0.0)):
                vase(model, min(0.2, 0.7 * tall), kinds[1], tint)


def vase(model: SceneModel, tall: float, stuff: Material, tint: Tint = WHITE) -> None:
    """Add a vase with a belly and a neck."""
    profile = ((0.0, 0.24), (0.25, 0.36), (0.5, 0.34), (0.78, 0.16), (1.0, 0.22))
    for (low, first), (high, second) in pairwise(profile):
        model.cylinder((0, 0, tall * low), (0, 0, tall * high), (tall * first, tall * second), stuff,
                       segments=16, caps=False, tint=tint)  # fmt: skip


def cabinet(
    model: SceneModel,
    size: tuple[float, float, float],
    stuff: Material,
    doors: tuple[int, int],
    tint: Tint = WHITE,
) -> None:
    """Add a cabinet: a body on a plinth, doors or drawers (columns, rows) with gaps between and knobs."""
    wide, deep, tall = size
    plinth = 0.08
    foot, dark = (-wide / 2 + 0.02, -deep / 2 + 0.05, 0), [0.25 * t for t in tint]
    model.box(foot, (wide / 2 - 0.02, deep / 2, plinth), stuff, tint=dark)
    model.box((-wide / 2, -deep / 2, plinth), (wide / 2, deep / 2, tall), stuff, skip="", tint=tint)
    columns, rows = doors
    each, high = wide / columns, (tall - plinth - 0.01) / rows
    for column in range(columns):
        for row in range(rows):
            x, z = -wide / 2 + each * column, plinth + high * row
            low, top = (
                (x + 0.006, -deep / 2 - 0.02, z + 0.006),
                (x + each - 0.006, -deep / 2, z + high - 0.006),
            )
            model.box(low, top, stuff, skip="Y", tint=tint)
            knob = (
                x + each * (0.5 if rows > 1 else 0.88 if column % 2 == 0 else 0.12),
                z + high * (0.5 if rows > 1 else 0.7),
            )
            model.sphere(
                (knob[0], -deep / 2 - 0.033, knob[1]), 0.014, stuff, segments=8, tint=[0.35 * t for t in tint]
            )


def panelled_front(model: SceneModel, size: tuple[float, float], stuff: Material, tint: Tint) -> None:
    """Add a cupboard door before a plane of x by z at y = 0: four boards, a panel set back between."""
    wide, tall = size
    rail = min(0.06, wide / 4, tall / 4)
    for low, high in (
        ((0, 0), (rail, tall)), ((wide - rail, 0), (wide, tall)),
        ((rail, 0), (wide - rail, rail)), ((rail, tall - rail), (wide - rail, tall)),
    ):  # fmt: skip
        model.box((low[0], -0.022, low[1]), (high[0], 0.0, high[1]), stuff, skip="Y", tint=tint)
    corners = rectangle((rail, wide - rail), -0.012, (rail, tall - rail))
    model.quad(corners, stuff, tint=tint)


def jar(model: SceneModel, tall: float, glass: Material, lid: Material, tint: Tint) -> None:
    """Add a preserving jar with something in it."""
    radius = 0.32 * tall
    model.cylinder(
        (0, 0, 0), (0, 0, 0.88 * tall), (radius, 0.92 * radius), glass, segments=9, caps=False, tint=tint
    )
    radii = (0.96 * radius, 0.9 * radius)
    model.cylinder((0, 0, 0.88 * tall), (0, 0, tall), radii, lid, segments=9, tint=(0.75, 0.6, 0.3))


def bottle(model: SceneModel, tall: float, stuff: Material, tint: Tint) -> None:
    """Add a bottle."""
    radius = 0.13 * tall
    model.cylinder((0, 0, 0), (0, 0, 0.6 * tall), radius, stuff, segments=12, caps=False, tint=tint)
    low, high, radii = (0, 0, 0.6 * tall), (0, 0, 0.75 * tall), (radius, 0.35 * radius)
    model.cylinder(low, high, radii, stuff, segments=12, caps=False, tint=tint)
    model.cylinder((0, 0, 0.75 * tall), (0, 0, tall), 0.35 * radius, stuff, segments=10, tint=tint)


def open_shelf(
    model: SceneModel, size: tuple[float, float, float], levels: int, stuff: Material, tint: Tint = WHITE
) -> list[float]:
    """Add a rack of posts and boards; return the heights of its boards' upper sides [m]."""
    wide, deep, tall = size
    for x in (-wide / 2, wide / 2 - 0.04):
        for y in (-deep / 2, deep / 2 - 0.04):
            model.box((x, y, 0), (x + 0.04, y + 0.04, tall), stuff, tint=tint)
    heights = [0.12 + (tall - 0.16) * level / (levels - 1) for level in range(levels)]
    for z in heights:
        x, y = wide / 2 - 0.01, deep / 2 - 0.005
        model.box((-x, -y, z - 0.025), (x, y, z), stuff, tint=tint)
    return heights


def carton(
    model: SceneModel, size: tuple[float, float, float], kinds: tuple[Material, Material], tint: Tint = WHITE
) -> None:
    """Add a carton whose sides bear a label each, its lid taped; kinds: labelled side, plain top."""
    wide, deep, tall = size
    low, high = np.array([-wide / 2, -deep / 2, 0.0]), np.array([wide / 2, deep / 2, tall])
    model.box(low, high, kinds[1], skip="xXyY", tint=tint)
    (x0, y0, z0), (x1, y1, z1) = low, high
    for a, b in (((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)), ((x1, y1), (x0, y1)), ((x0, y1), (x0, y0))):
        model.quad([(*a, z0), (*b, z0), (*b, z1), (*a, z1)], kinds[0], uvs=WHOLE, tint=tint)
    under, over = (x0 - 0.001, -0.025, 0.7 * tall), (x1 + 0.001, 0.025, tall + 0.001)
    model.box(under, over, kinds[1], skip="zyY", tint=(0.9, 0.75, 0.5))
