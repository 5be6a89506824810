"""A walk through a scene: keypoints with their times, and the camera at any moment.

And where a walker may go: over the walkable ground of a scene, along its edges, up and down slopes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.camera import EYE_HEIGHT, FAR, Camera
from evenlight.stimuli.scenes.engine.scene import Floats, Ground, Scene, Sky, Sun, Vector
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

TOUCHING = 0.02  # [m] rectangles this near to each other are joined
STEP_UP = 0.45  # [m] the highest step; a floor above or below is not reached by walking under or over it
STRIDE = 0.05  # [m] of which a longer step is made up, so that none leaps over a gap
LOWEST_EYE, HIGHEST_EYE = 0.6, 2.2  # [m] above the floor, of a path that stays on the ground


@dataclass(frozen=True, slots=True)
class Keypoint:
    """A moment of a path: its name, time [s], position [m] and direction of view [degrees]."""

    name: str
    time: float
    position: Vector
    azimuth: float
    altitude: float


@dataclass(frozen=True)
class CameraPath:
    """A walk through a scene.

    Attributes
    ----------
    name : str
        Of the path.
    scene : str
        Where it leads through.
    duration : float
        How long it takes [s].
    keypoints : tuple of Keypoint
        In order of time, the first at 0 and the last at the end.
    places : tuple of str
        Keypoints that suit a visual search.
    text : str
        The path as a file holds it, for its hash.
    sky, sun : Sky and Sun, or None
        In place of those of the scene.
    walkable : tuple of Ground
        Where one may walk, in place of what the scene says or is found.
    """

    name: str
    scene: str
    duration: float
    keypoints: tuple[Keypoint, ...]
    places: tuple[str, ...] = ()
    text: str = ""
    sky: Sky | None = None
    sun: Sun | None = None
    walkable: tuple[Ground, ...] = ()

    def __post_init__(self) -> None:
        if not self.scene:
            raise ValueError("need the name of a scene, got none")
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise ValueError(f"need a duration above 0 s, got {self.duration:g}")
        if len(self.keypoints) < 2:
            raise ValueError(f"need two keypoints or more, got {len(self.keypoints)}")
        for point in self.keypoints:
            _check(point, self.duration)
        times = [point.time for point in self.keypoints]
        for before, after in zip(self.keypoints, self.keypoints[1:], strict=False):
            if not before.time < after.time:
                raise ValueError(
                    f"need keypoints in order of time, got {after.name!r} at {after.time:g} s after "
                    f"{before.name!r} at {before.time:g} s"
                )
        if times[0] != 0 or times[-1] != self.duration:
            raise ValueError(
                f"need keypoints at 0 s and at the end, {self.duration:g} s, got the first at "
                f"{times[0]:g} s and the last at {times[-1]:g} s"
            )
        unknown = set(self.places) - {point.name for point in self.keypoints}
        if unknown:
            raise ValueError(f"need places that are names of keypoints, got {', '.join(sorted(unknown))}")

    def keypoint(self, name: str) -> Keypoint:
        """Return the first keypoint of a name.

        Raises
        ------
        InputError
            If the path has none.
        """
        for point in self.keypoints:
            if point.name == name:
                return point
        raise InputError(
            f"the path {self.name} has no keypoint {name!r}: there are "
            + ", ".join(dict.fromkeys(p.name for p in self.keypoints))
        )

    def position(self, time: float) -> Floats:
        """Return where the walker's eye is at a time [m]."""
        return _on_curve(self._knots, self._points, self._inner(time))

    def camera(self, time: float, field_of_view: float = FIELD_OF_VIEW) -> Camera:
        """Return the camera at a time from 0 to the duration [s]; beyond, that of the nearer end."""
        moment = min(max(time, 0.0), self.duration)
        x, y, z = self.position(moment).tolist()
        azimuth, altitude = self._angles(moment).tolist()
        return Camera((x, y, z), azimuth % 360, altitude, field_of_view)

    def _inner(self, time: float) -> float:
        return float(self._pace(min(max(time, 0.0), self.duration)))

    @cached_property
    def _times(self) -> Floats:
        return np.array([point.time for point in self.keypoints])

    @cached_property
    def _points(self) -> Floats:
        return np.array([point.position for point in self.keypoints], dtype=float)

    @cached_property
    def _knots(self) -> Floats:
        """Centripetal parameters of the keypoints: the roots of their distances, summed up."""
        steps = np.sqrt(np.linalg.norm(np.diff(self._points, axis=0), axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def _pace(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator

        # Monotone cubic: never backwards between two keypoints, at rest where a keypoint repeats.
        return PchipInterpolator(self._times, self._knots)

    @cached_property
    def _angles(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator

        azimuth = np.degrees(np.unwrap(np.radians([point.azimuth for point in self.keypoints])))
        altitude = [point.altitude for point in self.keypoints]
        return PchipInterpolator(self._times, np.column_stack([azimuth, altitude]))


def _on_curve(knots: Floats, points: Floats, at: float) -> Floats:
    """Return the point of a centripetal Catmull-Rom curve (Yuksel et al. 2011) at a parameter."""
    k = int(np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2))
    while k > 0 and knots[k + 1] == knots[k]:
        k -= 1
    width = knots[k + 1] - knots[k]
    if width == 0:
        return np.asarray(points[k])
    start, end = _slope(knots, points, k), _slope(knots, points, k + 1)
    u = (at - knots[k]) / width
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * points[k]
        + u * (1 - u) ** 2 * width * start
        + u**2 * (3 - 2 * u) * points[k + 1]
        + u**2 * (u - 1) * width * end
    )


def _slope(knots: Floats, points: Floats, k: int) -> Floats:
    """Return the curve's derivative at a keypoint: that of the parabola through it and its neighbours."""
    last = len(knots) - 1
    before = knots[k] - knots[k - 1] if k > 0 else 0.0
    after = knots[k + 1] - knots[k] if k < last else 0.0
    ahead = (points[k + 1] - points[k]) / after if after > 0 else None
    behind = (points[k] - points[k - 1]) / before if before > 0 else None
    if ahead is None or behind is None:
        # At the ends, and where the walker stands still, the curve goes straight.
        rest = ahead if behind is None else behind
        return np.zeros(3) if rest is None else rest
    return np.asarray((before * ahead + after * behind) / (before + after))


def _check(point: Keypoint, duration: float) -> None:
    if not 0 <= point.time <= duration:
        raise ValueError(
            f"keypoint {point.name!r} is outside the path: need a time from 0 to {duration:g} s, "
            f"got {point.time:g}"
        )
    if not np.isfinite([*point.position, point.azimuth]).all():
        raise ValueError(f"keypoint {point.name!r}: need a finite position and azimuth, got {point}")
    if not -90 <= point.altitude <= 90:
        raise ValueError(
            f"keypoint {point.name!r}: need an altitude from -90 to 90 degrees, got {point.altitude:g}"
        )


def walked(position: Vector, step: tuple[float, float], scene: Scene) -> Vector:
    """Return where a walker's eye is after a step, which slides along walls and follows the floor.

    Parameters
    ----------
    position : (float, float, float)
        Of the eye before [m]; its height above the floor is kept.
    step : (float, float)
        What the walker wants to go, east and north [m].
    scene : Scene
        Where.

    Returns
    -------
    (float, float, float)
        Of the eye after [m]. Outside all walkable ground there is no movement.
    """
    under = floor_under(position, scene)
    if under is None:
        return position
    x, y, z = position
    eye = z - under
    floor = z - eye
    strides = max(int(np.ceil(np.hypot(*step) / STRIDE)), 1)
    for _ in range(strides):
        for east, north in ((step[0], step[1]), (step[0], 0.0), (0.0, step[1])):
            reached = _floor_at(x + east / strides, y + north / strides, floor, scene)
            if reached is not None:
                x, y, floor = x + east / strides, y + north / strides, reached
                break
    return x, y, floor + eye


def on_ground(position: Vector, scene: Scene, margin: float = TOUCHING) -> bool:
    """Return whether an eye is over walkable ground, at a height at which people have their eyes.

    `margin` is how far beside the ground still counts [m]; walkable ground keeps about 0.3 m from walls.
    """
    return floor_under(position, scene, margin) is not None


def check_path(path: CameraPath, scene: Scene) -> None:
    """Refuse a path one of whose keypoints is not over the scene's walkable ground.

    Of a scene without walkable ground, a camera may stand anywhere near it.

    Raises
    ------
    InputError
        With the first such keypoint.
    """
    if not scene.walkable:
        _check_extent(path, scene)
        return
    for point in path.keypoints:
        if not on_ground(point.position, scene):
            x, y, z = point.position
            raise InputError(
                f"camera path {path.name}: keypoint {point.name!r} at ({x:g}, {y:g}, {z:g}) m is outside the "
                f"walkable ground of {scene.name}; need eyes {LOWEST_EYE:g} to {HIGHEST_EYE:g} m over it"
            )


def _check_extent(path: CameraPath, scene: Scene) -> None:
    """Refuse a path one of whose keypoints is so far from a scene that nothing of it is drawn."""
    corners = scene.patches.corners
    low, high = corners.min(axis=(0, 1)) - FAR, corners.max(axis=(0, 1)) + FAR
    for point in path.keypoints:
        if not ((low <= point.position) & (point.position <= high)).all():
            box = " x ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True))
            raise InputError(
                f"camera path {path.name}: keypoint {point.name!r} at {point.position} m is far from "
                f"the scene; need x, y and z in {box} m, z up (docs/scenes.md)"
            )


def floor_under(position: Vector, scene: Scene, margin: float = TOUCHING) -> float | None:
    """Return the floor that an eye is over [m], that whose distance is nearest to eye height, or None."""
    x, y, z = position
    over = [floor for floor in _floors(x, y, scene, margin) if LOWEST_EYE <= z - floor <= HIGHEST_EYE]
    return min(over, key=lambda floor: abs(z - floor - EYE_HEIGHT), default=None)


def _floor_at(x: float, y: float, floor: float, scene: Scene) -> float | None:
    near = [height for height in _floors(x, y, scene) if abs(height - floor) <= STEP_UP]
    return min(near, key=lambda height: abs(height - floor), default=None)


def _floors(x: float, y: float, scene: Scene, margin: float = TOUCHING) -> list[float]:
    return [floor for ground in scene.walkable for floor in ground.heights(x, y, margin)]
