"""A bicycle."""

from __future__ import annotations

import itertools

import numpy as np

from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.school_materials import ENAMEL, SPOKES, STEEL, VINYL
from evenlight.stimuli.scenes.shapes import ring

RADIUS = 0.34  # [m] of the wheels
BLACK = (0.03, 0.03, 0.03)
Point = tuple[float, float, float]


def bicycle(model: SceneModel, colour: list[float]) -> None:
    """Add a bicycle that stands along x, its front towards +x."""
    rear, front = (-0.52, 0.0, RADIUS), (0.52, 0.0, RADIUS)
    for centre in (rear, front):
        _wheel(model, centre)
    crank, saddle, head = (-0.08, 0.0, 0.3), (-0.24, 0.0, 0.78), (0.36, 0.0, 0.82)
    low_head = (0.39, 0.0, 0.66)
    for start, end in ((crank, saddle), (saddle, head), (crank, low_head), (head, low_head)):
        model.cylinder(start, end, 0.019, ENAMEL, segments=7, caps=False, tint=colour)
    for side in (-0.05, 0.05):
        for start, end in ((rear, crank), (rear, saddle), (front, low_head)):
            model.cylinder(
                (start[0], side, start[2]),
                (end[0], 0.4 * side, end[2]),
                0.011,
                ENAMEL,
                segments=6,
                caps=False,
                tint=colour,
            )
    _seat_and_bars(model, saddle, head)
    model.cylinder((crank[0], 0.045, crank[2]), (crank[0], 0.055, crank[2]), 0.09, STEEL, segments=14)
    for side, up in ((0.08, 0.16), (-0.08, -0.16)):
        model.cylinder(
            crank, (crank[0] + up * 0.4, side, crank[2] + up), 0.012, STEEL, segments=6, caps=False
        )
        model.box(
            (crank[0] + up * 0.4 - 0.04, min(side, 1.9 * side), crank[2] + up - 0.01),
            (crank[0] + up * 0.4 + 0.04, max(side, 1.9 * side), crank[2] + up + 0.015),
            VINYL,
            tint=BLACK,
        )
    model.box((-0.72, -0.07, 0.72), (-0.36, 0.07, 0.735), STEEL)


def _wheel(model: SceneModel, centre: Point) -> None:
    """Add a wheel in the plane of x and z: a tyre, and its spokes."""
    circle = ring(18)
    for a, b in itertools.pairwise(circle):
        ends = [(centre[0] + RADIUS * p[0], 0.0, centre[2] + RADIUS * p[1]) for p in (a, b)]
        model.cylinder(ends[0], ends[1], 0.019, VINYL, segments=5, caps=False, tint=BLACK)
    r = RADIUS - 0.01
    corners = np.add([(-r, 0, -r), (r, 0, -r), (r, 0, r), (-r, 0, r)], centre)
    model.quad(corners, SPOKES, uvs=[(0, 0), (1, 0), (1, 1), (0, 1)])


def _seat_and_bars(model: SceneModel, saddle: Point, head: Point) -> None:
    """Add saddle, handlebars with grips, and a lamp."""
    model.cylinder(saddle, (saddle[0] - 0.03, 0, 0.92), 0.013, STEEL, segments=6, caps=False)
    model.sphere((saddle[0] - 0.04, 0, 0.94), (0.13, 0.07, 0.035), VINYL, segments=10, tint=BLACK)
    model.cylinder(head, (head[0] - 0.02, 0, 0.96), 0.014, STEEL, segments=6, caps=False)
    model.cylinder((head[0] - 0.02, -0.28, 0.99), (head[0] - 0.02, 0.28, 0.99), 0.013, STEEL, segments=6)
    for side in (-1, 1):
        model.cylinder(
            (head[0] - 0.02, 0.18 * side, 0.99),
            (head[0] - 0.06, 0.3 * side, 0.99),
            0.018,
            VINYL,
            segments=7,
            tint=BLACK,
        )
    model.sphere((head[0] + 0.07, 0, 0.88), 0.04, ENAMEL, segments=10)
