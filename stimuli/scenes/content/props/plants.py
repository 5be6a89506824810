"""Plants: trees and shrubs of leafy cards, hedges, flower beds, plants in pots with single leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.shapes import at_right_angles

ROUND = 0.75  # share of a ball's normal in that of a sprig, against its own
CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])  # of a card


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
    """Add a ball of leaves: sprigs that look outwards, `cards` outside and half as many, larger, inside."""
    for number in range(cards + cards // 2):
        outside = number < cards
        out = rng.normal(size=3)
        out /= np.linalg.norm(out)
        away = radius * ((0.72 if outside else 0.3) + 0.3 * rng.random())
        middle = np.asarray(centre) + out * away * [1, 1, 0.8]
        facing = out + 0.4 * rng.normal(size=3) + [0, 0, 0.25]
        size = radius * ((0.54 if outside else 0.85) + 0.3 * rng.random())
        shade = 1.0 if outside else 0.8
        card(
            model, Sprig(middle, facing, size, middle - away * out - [0, 0, 0.3 * radius], shade), leafy, rng
        )


@dataclass(frozen=True)
class Sprig:
    """Where one square of foliage is: its middle and the centre of its plant, its direction, its size [m].

    It is lit like a part of a ball around that centre. `shade` is the most of its albedo.
    """

    middle: Array
    facing: Array
    size: float
    centre: Array
    shade: float = 1.0


def card(model: SceneModel, sprig: Sprig, leafy: Material, rng: np.random.Generator) -> None:
    """Add one square of foliage; each has a green of its own."""
    normal = sprig.facing / np.linalg.norm(sprig.facing)
    first = at_right_angles(normal, rng.normal(size=3))
    first /= np.linalg.norm(first)
    second = at_right_angles(normal, first)
    corners = sprig.middle + sprig.size / 2 * CORNERS @ np.array([first, second])
    outwards = corners - sprig.centre
    normals = ROUND * outwards / np.linalg.norm(outwards, axis=1, keepdims=True) + (1 - ROUND) * normal
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    red, shade, blue = rng.random(3)
    tint = sprig.shade * (0.6 + 0.35 * shade) * np.array([0.84 + 0.16 * red, 1.0, 0.7 + 0.3 * blue])
    uvs = (CORNERS * [rng.choice([-1, 1]), 1] + 1) / 2
    model.quad(corners, leafy, uvs=uvs, normals=normals, tint=tint.tolist())


def hedge(
    model: SceneModel, low: Sequence[float], high: Sequence[float],
    kinds: tuple[Material, Material], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Add a clipped hedge: a dense body, and sprigs that stand out of it all around."""
    body, leafy = kinds
    lower, upper = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    size = upper - lower
    along = 0 if size[0] > size[1] else 1
    inset = 0.1 * (1 - np.eye(3)[along])
    model.box(lower + inset * [1, 1, 0], upper - inset, body, skip="z")
    for _ in range(int(size[along] * size[2] * 10)):
        place = lower + size * rng.random(3)
        side = rng.integers(3)
        out = np.zeros(3)
        if side == 2:
            out[2] = 1.0
            place[2] = upper[2] - 0.06
        else:
            out[1 - along] = 1.0 if side else -1.0
            place[1 - along] = (lower, upper)[side][1 - along] - 0.06 * out[1 - along]
        long = 0.32 + 0.25 * rng.random()
        facing = out + 0.45 * rng.normal(size=3)
        card(model, Sprig(place, facing, long, place - 0.5 * out), leafy, rng)


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
        middle = np.array([x, y, low[2] + 0.5 * tall])
        card(model, Sprig(middle, facing, 1.2 * tall, middle - [0, 0, tall]), kind, rng)


def leaf_blade(
    model: SceneModel,
    base: Sequence[float] | Array,
    length: float,
    wide: float,
    bend: tuple[float, float],
    stuff: Material,
    tint: Sequence[float],
) -> None:
    """Add one leaf that arches outwards: direction and droop [radians] in `bend`; seen from both sides.

    It is folded along its middle, so that nobody sees it edge on.
    """
    turn, droop = bend
    steps = 4
    out, side = np.array([math.cos(turn), math.sin(turn), 0]), np.array([-math.sin(turn), math.cos(turn), 0])
    points = []
    place, rise = np.asarray(base, dtype=float), 0.5 * math.pi - 0.25
    for step in range(steps + 1):
        share = step / steps
        half = 0.5 * wide * math.sin(math.pi * min(0.96, 0.12 + 0.86 * share)) * (1 if step else 0.3)
        fold = 0.4 * half * (math.cos(rise) * np.array([0, 0, 1.0]) - math.sin(rise) * out)
        points += [place - half * side + fold, place, place + half * side + fold]
        place = place + length / steps * (math.cos(rise) * out + math.sin(rise) * np.array([0, 0, 1.0]))
        rise -= droop / steps
    triangles = []
    for a in (3 * step + half for step in range(steps) for half in range(2)):
        triangles += [(a, a + 1, a + 4), (a, a + 4, a + 3)]
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
