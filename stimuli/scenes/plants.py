"""Plants: trees and shrubs of leafy cards, hedges, flower beds, plants in pots with single leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.stimuli.scenes.model import Material, SceneModel


def tree(
    model: SceneModel, size: tuple[float, float], kinds: tuple[Material, Material], rng: np.random.Generator
) -> None:
    """Add a tree with its trunk at the origin.

    Parameters
    ----------
    model : SceneModel
        Where to add it.
    size : (float, float)
        Height, and radius of the crown [m].
    kinds : (Material, Material)
        Bark and foliage (a cut-out).
    rng : Generator
        Shapes the branches and the crown.
    """
    tall, spread = size
    trunk, leafy = kinds
    fork = 0.42 * tall
    thick = 0.022 * tall + 0.05
    model.cylinder((0, 0, -0.1), (0, 0, 0.35), (1.5 * thick, thick), trunk, segments=12, caps=False)
    model.cylinder((0, 0, 0.35), (0, 0, fork), (thick, 0.75 * thick), trunk, segments=12, caps=False)
    tips = []
    for branch in range(7):
        turn = 2 * math.pi * (branch + 0.6 * rng.random()) / 7
        reach = spread * (0.45 + 0.3 * rng.random()) * (branch > 0)
        start = np.array([0, 0, fork * (0.85 + 0.15 * rng.random())])
        stop = np.array([reach * math.cos(turn), reach * math.sin(turn), tall * (0.62 + 0.2 * rng.random())])
        model.cylinder(start, stop, (0.5 * thick, 0.15 * thick), trunk, segments=7, caps=False)
        tips.append(stop)
    for tip in tips:
        clump(model, tip, spread * (0.48 + 0.12 * rng.random()), leafy, rng)
    clump(model, (0.0, 0.0, 0.82 * tall), 0.6 * spread, leafy, rng)


def clump(
    model: SceneModel,
    centre: Sequence[float] | Array,
    radius: float,
    leafy: Material,
    rng: np.random.Generator,
    cards: int = 26,
) -> None:
    """Add a ball of leaves: cards that look outwards, each turned and tilted by chance."""
    for _ in range(cards):
        out = rng.normal(size=3)
        out /= np.linalg.norm(out)
        middle = np.asarray(centre) + out * radius * (0.55 + 0.45 * rng.random()) * [1, 1, 0.8]
        facing = out + 0.7 * rng.normal(size=3) + [0, 0, 0.35]
        card(model, middle, facing, radius * (0.75 + 0.4 * rng.random()), leafy, rng)


def card(
    model: SceneModel, middle: Array, facing: Array, size: float, leafy: Material, rng: np.random.Generator
) -> None:
    """Add one square of foliage of some size [m] that looks along `facing`."""
    normal = facing / np.linalg.norm(facing)
    first = np.cross(normal, rng.normal(size=3))
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    half, part = size / 2, size / leafy.tile
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    u, v = rng.random(2)
    shade = 0.72 + 0.28 * rng.random()
    model.quad(
        [middle + half * (a * first + b * second) for a, b in signs], leafy,
        uvs=[(u + part * (a + 1) / 2, v + part * (b + 1) / 2) for a, b in signs], tint=(shade, shade, shade),
    )  # fmt: skip


def hedge(
    model: SceneModel, low: Sequence[float], high: Sequence[float],
    kinds: tuple[Material, Material], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Add a clipped hedge: a dense body, and leaves that stand out of it."""
    body, leafy = kinds
    lower, upper = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    model.box(lower, upper, body, skip="z")
    size = upper - lower
    along = 0 if size[0] > size[1] else 1
    for _ in range(int(size[along] * size[2] * 5)):
        place = lower + size * rng.random(3)
        side = rng.integers(3)
        facing = 0.35 * rng.normal(size=3)
        if side == 2:
            place[2], facing[2] = upper[2], 1.0
        else:
            place[1 - along] = (lower, upper)[side][1 - along]
            facing[1 - along] = 1.0 if side else -1.0
        card(model, place, facing, 0.4 + 0.25 * rng.random(), leafy, rng)


def shrub(
    model: SceneModel, radius: float, leafy: Material, rng: np.random.Generator, cards: int = 34
) -> None:
    """Add a round shrub that stands on the origin."""
    clump(model, (0, 0, 0.75 * radius), radius, leafy, rng, cards)


def flower_bed(
    model: SceneModel, low: Sequence[float], high: Sequence[float], height: float,
    kinds: Sequence[Material], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Add rows of upright flowering cards over a rectangle; low and high are (x, y), with z as low[2]."""
    area = (high[0] - low[0]) * (high[1] - low[1])
    for _ in range(int(area * 11) + 3):
        x, y = (low[k] + (high[k] - low[k]) * rng.random() for k in range(2))
        tall = height * (0.6 + 0.7 * rng.random())
        turn = 2 * math.pi * rng.random()
        facing = np.array([math.cos(turn), math.sin(turn), 0.4])
        kind = kinds[int(rng.integers(len(kinds)))]
        card(model, np.array([x, y, low[2] + 0.5 * tall]), facing, 1.1 * tall, kind, rng)


def leaf_blade(
    model: SceneModel,
    base: Sequence[float] | Array,
    length: float,
    wide: float,
    bend: tuple[float, float],
    stuff: Material,
    tint: Sequence[float],
) -> None:
    """Add one leaf that arches outwards: direction and droop [radians] in `bend`; seen from both sides."""
    turn, droop = bend
    steps = 4
    out, side = np.array([math.cos(turn), math.sin(turn), 0]), np.array([-math.sin(turn), math.cos(turn), 0])
    points = []
    place, rise = np.asarray(base, dtype=float), 0.5 * math.pi - 0.25
    for step in range(steps + 1):
        share = step / steps
        half = 0.5 * wide * math.sin(math.pi * min(0.96, 0.12 + 0.86 * share)) * (1 if step else 0.3)
        points += [place - half * side, place + half * side]
        place = place + length / steps * (math.cos(rise) * out + math.sin(rise) * np.array([0, 0, 1.0]))
        rise -= droop / steps
    triangles = []
    for step in range(steps):
        a = 2 * step
        triangles += [(a, a + 1, a + 3), (a, a + 3, a + 2)]
    model.mesh(points, triangles, stuff, tint=tint)
    model.mesh(points, [(p, r, q) for p, q, r in triangles], stuff, tint=[0.8 * part for part in tint])


def potted(
    model: SceneModel, size: tuple[float, float], kinds: tuple[Material, Material, Material],
    colours: tuple[Sequence[float], Sequence[float]], rng: np.random.Generator, number: int = 22,
) -> None:  # fmt: skip
    """Add a plant in a pot: radius of the pot and height of the plant; kinds are pot, soil, leaf.

    `colours` tint the pot and the leaves.
    """
    radius, tall = size
    pot, soil, leaf = kinds
    high = 1.5 * radius
    model.cylinder(
        (0, 0, 0), (0, 0, high), (0.75 * radius, radius), pot, segments=20, caps=False, tint=colours[0]
    )
    model.cylinder(
        (0, 0, high - 0.03), (0, 0, high), 1.06 * radius, pot, segments=20, caps=False, tint=colours[0]
    )
    model.cylinder((0, 0, high - 0.06), (0, 0, high - 0.025), 0.95 * radius, soil, segments=16)
    for blade in range(number):
        turn = 2.4 * blade + 0.5 * rng.random()  # the golden angle, as plants do
        length = (tall - high) * (0.65 + 0.5 * rng.random())
        base = 0.35 * radius * np.array([math.cos(turn), math.sin(turn), 0]) + [0, 0, high - 0.03]
        tint = np.asarray(colours[1]) * (0.75 + 0.35 * rng.random())
        leaf_blade(
            model,
            base,
            length,
            0.16 * length + 0.02,
            (turn, 0.6 + 1.9 * rng.random()),
            leaf,
            np.clip(tint, 0, 1).tolist(),
        )
