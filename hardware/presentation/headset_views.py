"""What a headset says: when a frame appears, where head and eyes are then, and what the eyes see.

Axes are OpenXR's: x right, y up, z backwards, in metres. A runtime's begin anywhere; a `HeadsetWindow` gives
those that begin at the head, and point where it pointed, when they were set.

A headset has two views, left and right, or four: besides those a focus view of each eye, left and right, of a
small part of what the eye sees, with more pixels per degree. What it shows is in the wide view, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # rig.py imports this, and shows its help without numpy
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

Size = tuple[int, int]
Part = tuple[int, int, int, int]  # of a picture: left, bottom, width, height [pixels]
Triangle = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
# Of OpenGL: pictures keep the codes that are written to them while the conversion is off.
SRGB8_ALPHA8, FRAMEBUFFER_SRGB = 0x8C43, 0x8DB9


@dataclass(frozen=True, slots=True)
class Pose:
    """Where something is, and how it is turned."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # x right, y up, z backwards [m]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)  # unit quaternion x, y, z, w


@dataclass(frozen=True, slots=True)
class EyeFov:
    """The four edges of an eye's picture, as angles from straight ahead; left and down are negative [rad]."""

    left: float
    right: float
    up: float
    down: float

    def tangents(self) -> tuple[float, float, float, float]:
        """Return the tangents of the edges: left, right, down, up."""
        return math.tan(self.left), math.tan(self.right), math.tan(self.down), math.tan(self.up)


@dataclass(frozen=True, slots=True)
class EyePose:
    """Where an eye is at the time of a frame, what a view of it sees, and where that view is drawn."""

    pose: Pose
    fov: EyeFov
    part: Part = (0, 0, 0, 0)  # of the frame's picture


@dataclass(frozen=True, slots=True)
class HeadsetFrame:
    """A frame that may be drawn now."""

    display_time: float  # when it will appear, as the runtime predicts it, on the runtime's clock [s]
    period: float  # how long a frame lasts [s]
    eyes: tuple[EyePose, ...]  # left, right; then, if there are focus views, these
    head: Pose
    visible: bool  # whether the runtime will show it; if not, nothing need be drawn
    tracked: bool  # whether the head's orientation is known; if not, the views are the last known ones
    recentred: bool = False  # whether the axes are others than those of the frame before
    gaze: Pose | None = None  # from between the eyes to where they look, if that is known

    def since(self, origin: Pose) -> HeadsetFrame:
        """Return the frame in the axes of an origin that `level` gave."""
        eyes = tuple(replace(eye, pose=_since(eye.pose, origin)) for eye in self.eyes)
        gaze = None if self.gaze is None else _since(self.gaze, origin)
        return replace(self, eyes=eyes, head=_since(self.head, origin), gaze=gaze)


@dataclass(frozen=True, slots=True)
class HeadsetFacts:
    """What a runtime says of its headset."""

    runtime: str
    system: str
    eye_size: Size  # recommended width and height of each eye's picture [pixels]
    fovs: tuple[EyeFov, ...]  # of the views, as `HeadsetFrame.eyes` has them
    refresh_rate: float  # [Hz]
    refresh_rates: tuple[float, ...]  # that can be chosen; empty where the runtime does not say [Hz]
    tracks_position: bool  # besides the orientation
    eye_distance: float  # between the eyes' positions [m]
    # What the lenses never show of each eye's picture, left and right, as tangents from straight ahead to the
    # right and up; empty where the runtime does not say.
    hidden: tuple[tuple[Triangle, ...], ...] = ((), ())
    focus_size: Size | None = None  # recommended for each focus view, if there are any [pixels]

    def sharpest(self, right: bool) -> tuple[EyeFov, Size]:
        """Return edges and recommended size of an eye's view of most pixels per degree: its focus view."""
        return self.fovs[right - 2], self.focus_size or self.eye_size


def side_by_side(sizes: Sequence[Size]) -> tuple[Part, ...]:
    """Return where views of some widths and heights are drawn: one beside the other, on one lower edge.

    >>> side_by_side([(30, 20), (30, 20), (12, 12)])
    ((0, 0, 30, 20), (30, 0, 30, 20), (60, 0, 12, 12))
    """
    edges = accumulate((width for width, _ in sizes), initial=0)
    return tuple((left, 0, *size) for left, size in zip(edges, sizes, strict=False))


def centre_pixels_per_degree(fov: EyeFov, width: int) -> float:
    """Return the pixels per degree of an eye's picture straight ahead, across [1/deg].

    The picture is flat, and each of its pixels covers the same step of the tangent; straight ahead a degree
    is pi / 180 of it, and towards the edges more. `fov` are its edges, `width` is in pixels.

    >>> quarter = math.pi / 4
    >>> round(centre_pixels_per_degree(EyeFov(-quarter, quarter, quarter, -quarter), 720), 3)  # 360 pi / 180
    6.283
    """
    left, right, _, _ = fov.tangents()
    return width / (right - left) * math.pi / 180


def seen_pixels(fov: EyeFov, hidden: Sequence[Triangle], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which pixels of an eye's picture a lens shows, by their middles: (height, width), row 0 on top.

    `fov` are the edges of the picture, `hidden` what the lens never shows, `size` width and height [pixels].

    >>> quarter = math.pi / 4
    >>> corner = ((-1.0, 1.0), (0.5, 1.0), (-1.0, -0.5))
    >>> seen_pixels(EyeFov(-quarter, quarter, quarter, -quarter), [corner], (3, 3)).astype(int).tolist()
    [[0, 0, 1], [0, 1, 1], [1, 1, 1]]
    """
    import numpy as np

    (width, height), (left, right, down, up) = size, fov.tangents()
    x = np.linspace(left, right, 2 * width + 1)[1::2]
    y = np.linspace(up, down, 2 * height + 1)[1::2]
    seen = np.ones((height, width), dtype=bool)
    for corners in hidden:
        across, above = zip(*corners, strict=True)
        columns = slice(*np.searchsorted(x, (min(across), max(across))))
        rows = slice(*np.searchsorted(-y, (-max(above), -min(above))))
        sides = [
            (x[columns] - x1) * (y2 - y1) - (y[rows, None] - y1) * (x2 - x1)
            for (x1, y1), (x2, y2) in pairwise((*corners, corners[0]))
        ]
        seen[rows, columns] &= np.min(sides, axis=0) * np.max(sides, axis=0) < 0
    return seen


def rotation(pose: Pose) -> NDArray[np.float64]:
    """Return the matrix of how something is turned, for columns, (3, 3).

    >>> half = math.sqrt(0.5)
    >>> (rotation(Pose(orientation=(0.0, half, 0.0, half))) @ [0, 0, -1]).round(9).tolist()  # to the left
    [-1.0, 0.0, 0.0]
    """
    import numpy as np

    x, y, z, w = np.array(pose.orientation) / math.hypot(*pose.orientation)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def forward(pose: Pose) -> tuple[float, float, float]:
    """Return where something points, as a unit vector: right, up, back."""
    right, up, back = (rotation(pose) @ [0.0, 0.0, -1.0] + 0.0).tolist()  # no minus zero
    return right, up, back


def level(head: Pose) -> Pose:
    """Return where a head is and the direction that it points in, without its nod and its tilt.

    >>> nodding = Pose((0.1, 1.6, 0.2), (math.sin(0.2), 0.0, 0.0, math.cos(0.2)))
    >>> level(nodding)
    Pose(position=(0.1, 1.6, 0.2), orientation=(0.0, 0.0, 0.0, 1.0))
    """
    right, _, back = forward(head)
    half = math.atan2(-right, -back) / 2
    return Pose(head.position, (0.0, math.sin(half) + 0.0, 0.0, math.cos(half)))  # no minus zero


def _since(pose: Pose, origin: Pose) -> Pose:
    """Return a pose in the axes of an origin that is turned about the vertical only."""
    _, sine, _, cosine = origin.orientation  # of half the angle
    along, across = cosine**2 - sine**2, 2 * sine * cosine
    right, up, back = (here - there for here, there in zip(pose.position, origin.position, strict=True))
    x, y, z, w = pose.orientation
    return Pose(
        (along * right - across * back, up, across * right + along * back),
        (cosine * x - sine * z, cosine * y - sine * w, cosine * z + sine * x, cosine * w + sine * y),
    )
