"""The online controller in a headset: nothing waits for the luminance of a picture, which is known later.

A step of the factor may be as large as the rate limit allows whatever luminance its two pictures have,
within bounds. These follow from the last picture whose luminance is known, and from how far the view has
moved since. A turn of the view lets light into the picture at its edges, and stretches it; together they
change the mean by no more than a share of the display's peak for each radian, whatever the scene, which the
picture's edges say (`turn_shares`). A step to the side counts as the turn that moves what is a metre away as
much; what is nearer may move more. So the factor goes slower while the head turns fast, and stands at a snap
turn, until its picture is known.

A refresh that is dropped makes the same step over a longer time. Of the time between two pictures a refresh
is left out wherever it is longer than one, for the earlier of them may have appeared late.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.experiments.playback.live_dimming import LiveDimmer, ShownPicture
from evenlight.experiments.playback.picture_luminance import LateLuminance
from evenlight.method.online.controller import ControllerState, FrameMeasurement
from evenlight.stimuli.scenes.engine.camera import Edges, EyeView

NEAREST = 1.0  # [m] that the scene is taken to be away, where the view moves


@dataclass(eq=False, kw_only=True)
class HeadsetDimmer(LiveDimmer):
    """Dims by the controller's answers, within the rate limit for all that the pictures may be."""

    light: LateLuminance  # of the pictures that the meter measures
    display: Display  # what shows them

    def __post_init__(self) -> None:
        super().__post_init__()
        self._views: deque[EyeView] = deque()  # from the last picture whose luminance is known on
        self._pictures: list[ShownPicture] = []  # with their true luminances, as far as these are known
        self._completed = 0

    def seen_from(self, view: EyeView) -> None:
        """Take note of the view of the picture that is about to be dimmed."""
        self._views.append(view)

    def note(self, flip_time: float) -> None:
        """Note when the picture appeared, since the first [s]."""
        super().note(flip_time)
        assert self._shown is not None
        self._pictures.append(self._shown)
        self._complete()

    def finish(self) -> None:
        """Put the luminances of the last pictures into the rows; waits for them."""
        self.light.finish()
        self._complete()

    def _allowed(self, goal: float, now: float) -> float:
        """Return the factor nearest to a goal that the step may lead to, whatever its pictures are."""
        before, limit = self._shown, self.controller.rate_limit
        if before is None:
            return goal
        while len(self._views) > len(self.rows) + 2 - len(self.light.known):
            self._views.popleft()
        (low, high), (next_low, next_high) = (self._bounds(self._views[place]) for place in (-2, -1))
        share = min(low / high, next_low / next_high)
        careful = replace(self.controller, rate_limit=lambda light: min(limit(light), limit(share * light)))
        passed = self._passed(before, now)
        state = ControllerState(before.factor, 0.0, 0.0, high, passed)
        return careful.towards(state, FrameMeasurement(0.0, next_high, passed), goal)

    def _bounds(self, view: EyeView) -> tuple[float, float]:
        """Return between what Ī at factor 1 of a picture must lie [cd/m^2]."""
        known, peak = self.light.luminance_of(self.light.known[-1]), self.display.peak_luminance
        # Where what is seen is in one piece along each row and column, no more passes its edges, or is
        # stretched in it, than in the whole picture; but the mean is over fewer pixels.
        change = largest_change(self._views[0], view) * peak / self.light.seen_share
        return max(known - change, self.display.black_level), min(known + change, peak)

    def _complete(self) -> None:
        """Put what was true into the rows of pictures whose luminance has become known."""
        for k in range(self._completed, min(len(self._pictures), len(self.light.known))):
            means = self.light.known[k]
            slope = 0.0 if self.governor is None else self.governor.slope_of(means)
            now = replace(self._pictures[k], luminance=self.light.luminance_of(means), slope=slope)
            row = replace(self.rows[k], mean_luminance=now.luminance)
            if self.governor is not None:
                used, full = (self.governor.power_at(factor, slope) for factor in (now.factor, 1.0))
                row = replace(row, power=used, full_power=full)
            if k > 0:
                rate, limit = self._rate(self._pictures[k - 1], now)
                row = replace(row, rate=rate, rate_limit=limit)
            self._pictures[k], self.rows[k] = now, row
            self._completed = k + 1


def largest_change(before: EyeView, now: EyeView) -> float:
    """Return by how much of the peak the mean may change from a view to another, by turn and parallax.

    >>> from evenlight.stimuli.scenes.engine.camera import EyeView
    >>> edges = (-1.0, 1.0, -1.0, 1.0)
    >>> north = EyeView((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), edges)
    >>> east = EyeView((0.0, 0.1, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), edges)
    >>> round(largest_change(north, east), 3)  # 2 for each of a quarter turn and a tenth of a metre
    3.342
    """
    shares = turn_shares(now.edges)
    turn = Rotation.from_matrix(now.axes() @ before.axes().T).as_rotvec()
    aside = math.dist(before.position, now.position) / NEAREST
    return float(shares @ np.abs(turn) + shares[:2].max() * aside)


def turn_shares(edges: Edges) -> Array:
    """Return by how much of the peak the mean may change for each radian of a turn, (3,) [1/rad].

    The turns are those about the axes to the right, up and forward. At (x, y) of the picture plane light then
    moves by (xy, 1 + y^2), (1 + x^2, xy) and (-y, x). What passes the edges and what is stretched, whose sum
    is nil for even light, change the mean by half of their absolute sum, at most.

    >>> turn_shares((-1.0, 1.0, -1.0, 1.0)).tolist()  # a turn aside: 1 / 2t + 3t / 2 where t is to each side
    [2.0, 2.0, 0.5]
    """
    left, right, down, up = edges
    width, height = right - left, up - down
    across, along = (right * abs(right) - left * abs(left)) / 2, (up * abs(up) - down * abs(down)) / 2
    nod = width * (2 + down**2 + up**2 + 3 * along) + (abs(left) + abs(right)) * along
    turn = height * (2 + left**2 + right**2 + 3 * across) + (abs(down) + abs(up)) * across
    return np.array([nod, turn, 2 * (across + along)]) / (2 * width * height)
