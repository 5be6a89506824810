"""Apparatus of the gym, at the origin of the placement, a wall behind it at +y, its front towards -y.

And a bicycle for the yard.
"""

from __future__ import annotations

import itertools

import numpy as np

from evenlight.stimuli.scenes.content.school import building as stuff
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.shapes import WHOLE, rectangle, ring, sphere

WHITE, ORANGE = (0.92, 0.92, 0.9), (0.75, 0.2, 0.04)
RIM = 3.05  # [m] above the floor
RADIUS = 0.34  # [m] of the wheels
BLACK = (0.03, 0.03, 0.03)
Point = tuple[float, float, float]


def basket(model: SceneModel) -> None:
    """Add a board on arms from the wall, with a ring and its net, 1.4 m in front of the wall."""
    reach = 1.05
    model.box((-0.9, -reach - 0.04, 2.9), (0.9, -reach, 3.95), stuff.ENAMEL, tint=WHITE)
    front = -reach - 0.046
    for low, high in (
        ((-0.9, 2.9), (0.9, 2.95)),
        ((-0.9, 3.9), (0.9, 3.95)),
        ((-0.9, 2.9), (-0.85, 3.95)),
        ((0.85, 2.9), (0.9, 3.95)),
        ((-0.3, 3.1), (0.3, 3.15)),
        ((-0.3, 3.5), (0.3, 3.55)),
        ((-0.3, 3.1), (-0.25, 3.55)),
        ((0.25, 3.1), (0.3, 3.55)),
    ):
        near, far = (low[0], front, low[1]), (high[0], front + 0.006, high[1])
        model.box(near, far, stuff.ENAMEL, skip="Y", tint=(0.6, 0.05, 0.04))
    for x in (-0.6, 0.6):
        for z in (3.05, 3.8):
            model.cylinder((x, 0, z), (x, -reach, z), 0.03, stuff.STEEL, segments=8, caps=False)
        model.cylinder((x, 0, 3.05), (x, -reach, 3.8), 0.02, stuff.STEEL, segments=8, caps=False)
    centre = np.array([0.0, -reach - 0.38, RIM])
    model.box(
        (-0.06, -reach - 0.16, RIM - 0.02), (0.06, -reach - 0.02, RIM + 0.02), stuff.ENAMEL, tint=ORANGE
    )
    circle = ring(20)
    for a, b in itertools.pairwise(circle):
        ends = [centre + 0.225 * np.array([*p, 0.0]) for p in (a, b)]
        model.cylinder(ends[0], ends[1], 0.012, stuff.ENAMEL, segments=6, caps=False, tint=ORANGE)
    _net(model, centre)


def _net(model: SceneModel, centre: np.ndarray) -> None:
    """Hang the net from the ring: a tube that narrows."""
    circle, levels, radii = ring(16), (0.0, -0.2, -0.42), (0.22, 0.15, 0.12)
    points = np.concatenate(
        [centre + np.column_stack([r * circle, np.full(17, z)]) for r, z in zip(radii, levels, strict=True)]
    )
    uvs = np.concatenate([np.column_stack([np.linspace(0, 2, 17), np.full(17, v)]) for v in (1.0, 0.5, 0.0)])
    k = np.concatenate([np.arange(16), 17 + np.arange(16)])
    triangles = np.concatenate([np.stack([k + 17, k + 18, k + 1], 1), np.stack([k + 17, k + 1, k], 1)])
    model.mesh(points, triangles, stuff.NET, uvs=uvs)


def wall_bars(model: SceneModel) -> None:
    """Add a field of wall bars, 0.95 m wide."""
    for x in (-0.475, 0.435):
        model.box((x, -0.14, 0.0), (x + 0.04, 0, 2.5), stuff.BEECH, skip="zY")
    for z in np.arange(0.18, 2.5, 0.165):
        left, right, pale = (-0.44, -0.1, float(z)), (0.44, -0.1, float(z)), (0.9, 0.85, 0.8)
        model.cylinder(left, right, 0.018, stuff.BEECH, segments=6, caps=False, tint=pale)


def vaulting_box(model: SceneModel) -> None:
    """Add a vaulting box of five frames, narrower above, with a leather top."""
    tall, half = 0.2, 0.75
    for k in range(5):
        lower, upper = 0.36 - 0.035 * k, 0.36 - 0.035 * (k + 1) + 0.006
        z = k * tall
        corners = {
            s: [
                (-half, s * lower, z + 0.005),
                (half, s * lower, z + 0.005),
                (half, s * upper, z + tall - 0.008),
                (-half, s * upper, z + tall - 0.008),
            ]
            for s in (-1, 1)
        }
        model.quad(corners[-1], stuff.OAK)
        model.quad(corners[1][::-1], stuff.OAK)
        for x, order in ((-half, -1), (half, 1)):
            foot, head = z + 0.005, z + tall - 0.008
            end = [(x, -lower, foot), (x, lower, foot), (x, upper, head), (x, -upper, head)]
            model.quad(end[::order], stuff.OAK)
        model.box(
            (-half, -lower + 0.01, z), (half, lower - 0.01, z + 0.006), stuff.VINYL, tint=(0.02, 0.015, 0.01)
        )
        low, high = (-0.12, -lower - 0.004, z + 0.09), (0.12, -lower + 0.03, z + 0.13)
        model.box(low, high, stuff.VINYL, tint=(0.03, 0.02, 0.015))
    model.box((-half - 0.02, -0.2, 1.0), (half + 0.02, 0.2, 1.06), stuff.VINYL, tint=(0.33, 0.14, 0.06))
    left, right = (-half - 0.02, 0, 0.98), (half + 0.02, 0, 0.98)
    model.cylinder(left, right, 0.185, stuff.VINYL, segments=20, tint=(0.36, 0.16, 0.07))


def crash_mat(
    model: SceneModel, size: tuple[float, float, float], colour: tuple[float, float, float]
) -> None:
    """Add a mat that lies on the floor, its edges in a darker colour, with handles."""
    a, b, tall = size[0] / 2, size[1] / 2, size[2]
    model.box((-a, -b, 0.0), (a, b, tall), stuff.VINYL, skip="z", tint=colour)
    for y in (-b - 0.012, b):
        for x in (-0.6, 0.35):
            model.box((x, y, 0.3 * tall), (x + 0.22, y + 0.012, 0.7 * tall), stuff.VINYL, tint=WHITE)


def ball(model: SceneModel, kind: int) -> None:
    """Add a ball on the floor: a basketball (0), a volleyball (1) or a small soft one (2)."""
    if kind == 0:
        points, triangles, uvs = sphere(16)
        model.mesh(0.12 * points + [0, 0, 0.12], triangles, stuff.BASKETBALL, uvs=uvs, normals=points)
    else:
        radius, colour = ((0.105, (0.85, 0.8, 0.55)), (0.08, (0.1, 0.4, 0.7)))[kind - 1]
        model.sphere((0, 0, radius), radius, stuff.VINYL, segments=14, tint=colour)


def ball_rack(model: SceneModel, rng: np.random.Generator) -> None:
    """Add a wheeled rack with two shelves of balls, along x."""
    for x in (-0.75, 0.75):
        for y in (-0.2, 0.2):
            model.cylinder((x, y, 0), (x, y, 1.0), 0.018, stuff.STEEL, segments=8)
    for z in (0.25, 0.65, 1.0):
        for y in (-0.2, -0.08, 0.08, 0.2):
            model.cylinder((-0.75, y, z), (0.75, y, z), 0.01, stuff.STEEL, segments=6, caps=False)
    for z in (0.26, 0.66):
        for k in range(6):
            with model.at((-0.62 + 0.25 * k, 0.0, z), rng.uniform(0, 360)):
                ball(model, int(rng.choice([0, 0, 0, 1, 2])))


def rope(model: SceneModel, tall: float) -> None:
    """Add a climbing rope that ends above the floor."""
    model.cylinder(
        (0, 0, 0.5), (0, 0, tall), 0.02, stuff.VINYL, segments=8, caps=False, tint=(0.62, 0.5, 0.32)
    )
    model.cylinder((0, 0, 0.42), (0, 0, 0.54), 0.04, stuff.VINYL, segments=10, tint=(0.08, 0.06, 0.04))


def rings(model: SceneModel, tall: float) -> None:
    """Add a pair of gymnastic rings."""
    circle = ring(16)
    for x in (-0.25, 0.25):
        model.box((x - 0.015, -0.003, 2.2), (x + 0.015, 0.003, tall), stuff.VINYL, tint=(0.7, 0.66, 0.5))
        for a, b in itertools.pairwise(circle):
            ends = [(x + 0.1 * p[0], 0.0, 2.1 + 0.1 * p[1]) for p in (a, b)]
            model.cylinder(ends[0], ends[1], 0.015, stuff.BEECH, segments=6, caps=False)


def bicycle(model: SceneModel, colour: list[float]) -> None:
    """Add a bicycle that stands along x, its front towards +x."""
    rear, front = (-0.52, 0.0, RADIUS), (0.52, 0.0, RADIUS)
    for centre in (rear, front):
        _wheel(model, centre)
    crank, saddle, head = (-0.08, 0.0, 0.3), (-0.24, 0.0, 0.78), (0.36, 0.0, 0.82)
    low_head = (0.39, 0.0, 0.66)
    for start, end in ((crank, saddle), (saddle, head), (crank, low_head), (head, low_head)):
        model.cylinder(start, end, 0.019, stuff.ENAMEL, segments=7, caps=False, tint=colour)
    for side in (-0.05, 0.05):
        for start, end in ((rear, crank), (rear, saddle), (front, low_head)):
            near, far = (start[0], side, start[2]), (end[0], 0.4 * side, end[2])
            model.cylinder(near, far, 0.011, stuff.ENAMEL, segments=6, caps=False, tint=colour)
    _seat_and_bars(model, saddle, head)
    model.cylinder((crank[0], 0.045, crank[2]), (crank[0], 0.055, crank[2]), 0.09, stuff.STEEL, segments=14)
    for side, up in ((0.08, 0.16), (-0.08, -0.16)):
        model.cylinder(
            crank, (crank[0] + up * 0.4, side, crank[2] + up), 0.012, stuff.STEEL, segments=6, caps=False
        )
        model.box(
            (crank[0] + up * 0.4 - 0.04, min(side, 1.9 * side), crank[2] + up - 0.01),
            (crank[0] + up * 0.4 + 0.04, max(side, 1.9 * side), crank[2] + up + 0.015),
            stuff.VINYL,
            tint=BLACK,
        )
    model.box((-0.72, -0.07, 0.72), (-0.36, 0.07, 0.735), stuff.STEEL)


def _wheel(model: SceneModel, centre: Point) -> None:
    """Add a wheel in the plane of x and z: a tyre, and its spokes."""
    circle = ring(18)
    for a, b in itertools.pairwise(circle):
        ends = [(centre[0] + RADIUS * p[0], 0.0, centre[2] + RADIUS * p[1]) for p in (a, b)]
        model.cylinder(ends[0], ends[1], 0.019, stuff.VINYL, segments=5, caps=False, tint=BLACK)
    r = RADIUS - 0.01
    corners = np.add(rectangle((-r, r), 0, (-r, r)), centre)
    model.quad(corners, stuff.SPOKES, uvs=WHOLE)


def _seat_and_bars(model: SceneModel, saddle: Point, head: Point) -> None:
    """Add saddle, handlebars with grips, and a lamp."""
    model.cylinder(saddle, (saddle[0] - 0.03, 0, 0.92), 0.013, stuff.STEEL, segments=6, caps=False)
    model.sphere((saddle[0] - 0.04, 0, 0.94), (0.13, 0.07, 0.035), stuff.VINYL, segments=10, tint=BLACK)
    model.cylinder(head, (head[0] - 0.02, 0, 0.96), 0.014, stuff.STEEL, segments=6, caps=False)
    model.cylinder(
        (head[0] - 0.02, -0.28, 0.99), (head[0] - 0.02, 0.28, 0.99), 0.013, stuff.STEEL, segments=6
    )
    for side in (-1, 1):
        inner, outer = (head[0] - 0.02, 0.18 * side, 0.99), (head[0] - 0.06, 0.3 * side, 0.99)
        model.cylinder(inner, outer, 0.018, stuff.VINYL, segments=7, tint=BLACK)
    model.sphere((head[0] + 0.07, 0, 0.88), 0.04, stuff.ENAMEL, segments=10)
