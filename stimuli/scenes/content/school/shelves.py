"""Shelves full of books: cases for the library's hall, stacks for the store, the trolley between them."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.content.textures.school import SPINE_ROWS
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import rectangle

BOOK_ROW = 0.25  # [m] of height that one row of the texture shows
CASE_WIDTH = 0.925


def book_row(
    model: SceneModel,
    rng: np.random.Generator,
    width: float,
    height: float,
    spines: Material = stuff.SPINES,
) -> None:
    """Stand books on a shelf from the origin on, spines towards -y: runs of equal height, gaps, piles."""
    x, last = rng.uniform(0.0, 0.02), 0.0  # and how tall the books are that end there
    loose = spines is stuff.SPINES  # volumes of a store are bound alike
    while x < width - 0.05:
        run, kind = min(rng.uniform(0.06, 0.24), width - x), rng.random()
        if not loose and width - x - run < 0.06:  # they fill their shelf
            run = width - x
        tall = min(rng.uniform(0.2 if loose else 0.225, BOOK_ROW - 0.005), height - 0.02)
        gap, pile = loose and kind < 0.05, loose and 0.05 <= kind < 0.12 and run > 0.15
        # Covers show only where no other books stand beside them.
        if last and (gap or pile):
            _cover(model, rng, (x, x - 1), last)
        elif not (last or gap or pile):
            _cover(model, rng, (x, x + 1), tall)
        if pile:
            _pile(model, rng, (x, run), tall * rng.uniform(0.4, 0.8), spines)
        elif not gap:
            _books(model, rng, (x, run), tall, spines)
        last = 0.0 if gap or pile else tall
        x += 0.6 * run if gap else run
    if last:
        _cover(model, rng, (x, x - 1), last)


def _cover(model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float) -> None:
    """Add the cover of the outermost book at a place, seen from the side away from another place."""
    x, inside = place
    deep = (0.2, 0.01) if inside > x else (0.01, 0.2)
    model.quad(rectangle(x, deep, (0, tall)), stuff.VINYL, tint=rng.uniform(0.12, 0.42, 3).tolist())


def _books(
    model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float, spines: Material
) -> None:
    """Add books side by side as one block with many spines."""
    (left, run), y, back = place, rng.uniform(0.0, 0.015 if spines is stuff.SPINES else 0.001), 0.2
    right = left + run
    u, row = rng.random(), rng.integers(SPINE_ROWS)
    v = 1 - (row + 1) / SPINE_ROWS
    top = v + tall / BOOK_ROW / SPINE_ROWS
    front = rectangle((left, right), y, (0, tall))
    model.quad(front, spines, uvs=[(u, v), (u + run, v), (u + run, top), (u, top)])
    model.quad(rectangle((left, right), (y, back), tall), stuff.PAPER)


def _pile(
    model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float, spines: Material
) -> None:
    """Add books that lie on each other: the same spines, turned by a right angle."""
    (left, run), y, back = place, rng.uniform(0.0, 0.03), 0.2
    right = left + run
    u, row = rng.random(), rng.integers(SPINE_ROWS)
    v = 1 - (row + 1) / SPINE_ROWS
    top = v + min(run / BOOK_ROW, 1) / SPINE_ROWS
    front = rectangle((left, right), y, (0, tall))
    model.quad(front, spines, uvs=[(u, v), (u, top), (u + tall, top), (u + tall, v)])
    cover = rng.uniform(0.1, 0.5, 3).tolist()
    model.quad(rectangle((left, right), (y, back), tall), stuff.VINYL, tint=cover)
    model.quad(rectangle(right, (y, back), (0, tall)), stuff.PAPER)
    model.quad(rectangle(left, (back, y), (0, tall)), stuff.PAPER)


def bookcase(
    model: SceneModel, rng: np.random.Generator, cases: int, shelves: int, wood: Material = stuff.DARK_OAK
) -> None:
    """Add a run of wooden cases against a wall behind it, each `CASE_WIDTH` wide; it begins at the origin."""
    depth, pitch = 0.3, 0.29
    end, top = cases * CASE_WIDTH, 0.1 + shelves * pitch
    model.box((0, -depth, 0), (end, -0.02, 0.1), wood, skip="zY")
    model.box((-0.03, -depth - 0.03, top), (end + 0.03, 0, top + 0.07), wood)
    for post in range(cases + 1):
        x = post * CASE_WIDTH
        model.box((x - 0.025, -depth - 0.012, 0.1), (x + 0.025, -0.02, top), wood, skip="zZY")
    for case in range(cases):
        for shelf in range(shelves):
            left, z = case * CASE_WIDTH + 0.025, 0.1 + shelf * pitch
            right = left + CASE_WIDTH - 0.05
            model.quad(rectangle((left, right), -0.02, (z, z + pitch - 0.035)), wood)
            if shelf:
                model.box((left, -depth, z - 0.025), (right, -0.02, z), wood, skip="xXY")
            with model.at((left, -depth + 0.03, z)):
                book_row(model, rng, CASE_WIDTH - 0.05, pitch - 0.03)


def stack_row(model: SceneModel, rng: np.random.Generator, cases: int) -> None:
    """Add a free-standing steel rack with books on both sides, along x from the origin, 0.6 m deep."""
    end, top, pitch = cases * CASE_WIDTH, 1.88, 0.29
    grey = (0.34, 0.36, 0.33)
    model.box((0, -0.29, 0), (end, 0.29, 0.08), stuff.ENAMEL, skip="zZ", tint=grey)
    model.box((0, -0.3, top), (end, 0.3, top + 0.03), stuff.ENAMEL, tint=grey)
    for x in (-0.03, end):
        model.box((x, -0.3, 0), (x + 0.03, 0.3, top + 0.03), stuff.ENAMEL, skip="z", tint=grey)
    for side in (0, 1):
        with model.at((end * side, 0, 0), 180.0 * side):
            _rack_side(model, rng, cases, (top, pitch))


def _rack_side(model: SceneModel, rng: np.random.Generator, cases: int, sizes: tuple[float, float]) -> None:
    """Fill the side of a rack that faces -y."""
    top, pitch = sizes
    back = -0.01
    grey, dark = (0.34, 0.36, 0.33), (0.36, 0.38, 0.36)
    for case in range(cases):
        left = case * CASE_WIDTH
        if case:
            model.box(
                (left - 0.015, -0.28, 0.08), (left + 0.015, back, top), stuff.ENAMEL, skip="zZY", tint=grey
            )
        for shelf in range(6):
            z = 0.1 + shelf * pitch
            behind = rectangle((left, left + CASE_WIDTH), back, (z, z + pitch - 0.03))
            model.quad(behind, stuff.ENAMEL, tint=dark)
            model.box(
                (left, -0.29, z - 0.02), (left + CASE_WIDTH, back, z), stuff.ENAMEL, skip="xXY", tint=grey
            )
            with model.at((left + 0.02, -0.27, z)):
                book_row(model, rng, CASE_WIDTH - 0.04, pitch - 0.04, stuff.FADED_SPINES)
    for case in range(cases):
        x = case * CASE_WIDTH + 0.35
        model.box((x, -0.302, 0.085), (x + 0.22, -0.29, 0.098), stuff.STEEL, skip="Y", tint=(0.9, 0.85, 0.6))


def book_trolley(model: SceneModel, rng: np.random.Generator) -> None:
    """Add a trolley with two sloping rows of books, along x about the origin."""
    blue = (0.1, 0.22, 0.4)
    for x in (-0.42, 0.39):
        model.box((x, -0.2, 0.1), (x + 0.03, 0.2, 1.02), stuff.ENAMEL, tint=blue)
    for z in (0.2, 0.62):
        model.box((-0.4, -0.2, z), (0.4, 0.2, z + 0.03), stuff.ENAMEL, skip="xX", tint=blue)
        for side in (0, 1):
            with model.at((-0.38 + 0.76 * side, -0.2 + 0.4 * side, z + 0.03), 180.0 * side):
                book_row(model, rng, 0.74, 0.3)
    for x in (-0.37, 0.37):
        for y in (-0.15, 0.15):
            near, far = (x, y - 0.02, 0.05), (x, y + 0.02, 0.05)
            model.cylinder(near, far, 0.05, stuff.VINYL, segments=10, tint=(0.03, 0.03, 0.03))
