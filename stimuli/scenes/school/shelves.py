"""Shelves full of books: cases for the hall, stacks for the store, the trolley between them."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.model import Material, SceneModel
from evenlight.stimuli.scenes.school.materials import DARK_OAK, ENAMEL, PAPER, SPINES, STEEL, VINYL
from evenlight.stimuli.scenes.textures.school import SPINE_ROWS

BOOK_ROW = 0.25  # [m] of height that one row of the texture shows
CASE_WIDTH = 0.925


def book_row(model: SceneModel, rng: np.random.Generator, width: float, height: float) -> None:
    """Stand books on a shelf from the origin on, spines towards -y: runs of equal height, gaps, piles."""
    x = rng.uniform(0.0, 0.02)
    while x < width - 0.05:
        run = min(rng.uniform(0.06, 0.24), width - x)
        kind = rng.random()
        if kind < 0.05:
            x += 0.6 * run
            continue
        tall = min(rng.uniform(0.18, BOOK_ROW - 0.005), height - 0.02)
        if kind < 0.12 and run > 0.15:
            _pile(model, rng, (x, run), tall * rng.uniform(0.4, 0.8))
        else:
            _books(model, rng, (x, run), tall)
        x += run + (0.004 if rng.random() < 0.5 else 0.0)


def _books(model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float) -> None:
    """Add books side by side as one block with many spines."""
    (left, run), y, back = place, rng.uniform(0.0, 0.035), 0.2
    right = left + run
    u, row = rng.random(), rng.integers(SPINE_ROWS)
    v = 1 - (row + 1) / SPINE_ROWS
    top = v + tall / BOOK_ROW / SPINE_ROWS
    spines = [(left, y, 0), (right, y, 0), (right, y, tall), (left, y, tall)]
    model.quad(spines, SPINES, uvs=[(u, v), (u + run, v), (u + run, top), (u, top)])
    model.quad([(left, y, tall), (right, y, tall), (right, back, tall), (left, back, tall)], PAPER)
    colours = rng.uniform(0.05, 0.4, (2, 3)).tolist()
    model.quad([(left, back, 0), (left, y, 0), (left, y, tall), (left, back, tall)], VINYL, tint=colours[0])
    model.quad(
        [(right, y, 0), (right, back, 0), (right, back, tall), (right, y, tall)], VINYL, tint=colours[1]
    )


def _pile(model: SceneModel, rng: np.random.Generator, place: tuple[float, float], tall: float) -> None:
    """Add books that lie on each other: the same spines, turned by a right angle."""
    (left, run), y, back = place, rng.uniform(0.0, 0.03), 0.2
    right = left + run
    u, row = rng.random(), rng.integers(SPINE_ROWS)
    v = 1 - (row + 1) / SPINE_ROWS
    top = v + min(run / BOOK_ROW, 1) / SPINE_ROWS
    spines = [(left, y, 0), (right, y, 0), (right, y, tall), (left, y, tall)]
    model.quad(spines, SPINES, uvs=[(u, v), (u, top), (u + tall, top), (u + tall, v)])
    cover = rng.uniform(0.05, 0.5, 3).tolist()
    model.quad(
        [(left, y, tall), (right, y, tall), (right, back, tall), (left, back, tall)], VINYL, tint=cover
    )
    model.quad([(right, y, 0), (right, back, 0), (right, back, tall), (right, y, tall)], PAPER)
    model.quad([(left, back, 0), (left, y, 0), (left, y, tall), (left, back, tall)], PAPER)


def bookcase(
    model: SceneModel, rng: np.random.Generator, cases: int, shelves: int, wood: Material = DARK_OAK
) -> None:
    """Add a run of wooden cases against a wall behind it, each `CASE_WIDTH` wide; it begins at the origin."""
    depth, pitch = 0.3, 0.32
    end, top = cases * CASE_WIDTH, 0.1 + shelves * pitch
    model.box((0, -depth, 0), (end, -0.02, 0.1), wood, skip="zY")
    model.box((-0.03, -depth - 0.03, top), (end + 0.03, 0, top + 0.07), wood)
    model.quad(
        [(0, -0.02, 0.1), (end, -0.02, 0.1), (end, -0.02, top), (0, -0.02, top)], wood, tint=(0.5, 0.5, 0.5)
    )
    for post in range(cases + 1):
        x = post * CASE_WIDTH
        model.box((x - 0.025, -depth - 0.012, 0.1), (x + 0.025, -0.02, top), wood, skip="zZY")
    for case in range(cases):
        for shelf in range(shelves):
            left, z = case * CASE_WIDTH + 0.025, 0.1 + shelf * pitch
            right = left + CASE_WIDTH - 0.05
            if shelf:
                model.box((left, -depth, z - 0.025), (right, -0.02, z), wood, skip="xXY")
            with model.at((left, -depth + 0.03, z)):
                book_row(model, rng, CASE_WIDTH - 0.05, pitch - 0.03)


def stack_row(model: SceneModel, rng: np.random.Generator, cases: int) -> None:
    """Add a free-standing steel rack with books on both sides, along x from the origin, 0.6 m deep."""
    end, top, pitch = cases * CASE_WIDTH, 2.15, 0.335
    grey = (0.32, 0.36, 0.33)
    model.box((0, -0.29, 0), (end, 0.29, 0.08), ENAMEL, skip="zZ", tint=grey)
    model.box((0, -0.3, top), (end, 0.3, top + 0.03), ENAMEL, tint=grey)
    for x in (-0.03, end):
        model.box((x, -0.3, 0), (x + 0.03, 0.3, top + 0.03), ENAMEL, skip="z", tint=grey)
    for side in (0, 1):
        with model.at((end * side, 0, 0), 180.0 * side):
            _rack_side(model, rng, cases, (top, pitch))


def _rack_side(model: SceneModel, rng: np.random.Generator, cases: int, sizes: tuple[float, float]) -> None:
    """Fill the side of a rack that faces -y."""
    top, pitch = sizes
    back, end = -0.01, cases * CASE_WIDTH
    grey, dark = (0.32, 0.36, 0.33), (0.12, 0.13, 0.12)
    model.quad([(0, back, 0.08), (end, back, 0.08), (end, back, top), (0, back, top)], ENAMEL, tint=dark)
    for case in range(cases):
        left = case * CASE_WIDTH
        if case:
            model.box((left - 0.015, -0.28, 0.08), (left + 0.015, back, top), ENAMEL, skip="zZY", tint=grey)
        for shelf in range(6):
            z = 0.1 + shelf * pitch
            model.box((left, -0.29, z - 0.02), (left + CASE_WIDTH, back, z), ENAMEL, skip="xXY", tint=grey)
            with model.at((left + 0.02, -0.27, z)):
                book_row(model, rng, CASE_WIDTH - 0.04, pitch - 0.04)
    for case in range(cases):
        x = case * CASE_WIDTH + 0.35
        model.box((x, -0.302, 0.085), (x + 0.22, -0.29, 0.098), STEEL, skip="Y", tint=(0.9, 0.85, 0.6))


def book_trolley(model: SceneModel, rng: np.random.Generator) -> None:
    """Add a trolley with two sloping rows of books, along x about the origin."""
    blue = (0.1, 0.22, 0.4)
    for x in (-0.42, 0.39):
        model.box((x, -0.2, 0.1), (x + 0.03, 0.2, 1.02), ENAMEL, tint=blue)
    for z in (0.2, 0.62):
        model.box((-0.4, -0.2, z), (0.4, 0.2, z + 0.03), ENAMEL, skip="xX", tint=blue)
        for side in (0, 1):
            with model.at((-0.38 + 0.76 * side, -0.2 + 0.4 * side, z + 0.03), 180.0 * side):
                book_row(model, rng, 0.74, 0.3)
    for x in (-0.37, 0.37):
        for y in (-0.15, 0.15):
            model.cylinder(
                (x, y - 0.02, 0.05), (x, y + 0.02, 0.05), 0.05, VINYL, segments=10, tint=(0.03, 0.03, 0.03)
            )
