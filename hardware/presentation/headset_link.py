"""What is asked of a headset: frames with the times at which they appear, the eyes' views, controllers.

The seam between Evenlight and a runtime: `openxr_link.OpenXRLink` talks to one, and
`hardware.simulated.headset.SimulatedHeadset` stands in for it. Axes are OpenXR's: x right, y up, z backwards,
in metres; the origin is where the head was when the session began.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from evenlight.hardware.protocols import ContextManaged, KeyPress

if TYPE_CHECKING:  # rig.py imports this, and shows its help without moderngl
    import moderngl
    import numpy as np
    from numpy.typing import NDArray

    from evenlight.hardware.presentation.mirror_window import MirrorWindow

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
    """Where an eye is at the time of a frame, and what it sees."""

    pose: Pose
    fov: EyeFov


@dataclass(frozen=True, slots=True)
class HeadsetFrame:
    """A frame that may be drawn now."""

    display_time: float  # when it will appear, as the runtime predicts it, on the link's clock [s]
    period: float  # how long a frame lasts [s]
    eyes: tuple[EyePose, EyePose]  # left, right
    head: Pose
    visible: bool  # whether the runtime will show it; if not, nothing need be drawn
    tracked: bool  # whether the head's orientation is known; if not, the views are the last known ones


@dataclass(frozen=True, slots=True)
class HeadsetFacts:
    """What a runtime says of its headset."""

    runtime: str
    system: str
    eye_size: tuple[int, int]  # recommended width and height of each eye's picture [pixels]
    fovs: tuple[EyeFov, EyeFov]  # left, right
    refresh_rate: float  # [Hz]
    refresh_rates: tuple[float, ...]  # that can be chosen; empty where the runtime does not say [Hz]
    tracks_position: bool  # besides the orientation
    eye_distance: float  # between the eyes' positions [m]


class HeadsetLink(ContextManaged, Protocol):
    """A headset that is open: between `begin_frame` and `end_frame` both eyes are drawn side by side."""

    @property
    def mirror(self) -> MirrorWindow | None:
        """The operator's window, if there is one."""

    def facts(self) -> HeadsetFacts:
        """Return what the runtime says."""

    def eye_size(self) -> tuple[int, int]:
        """Return width and height of the picture of one eye, as it is drawn [pixels]."""

    def context(self) -> moderngl.Context:
        """Return the graphics context."""

    def now(self) -> float:
        """Return the time on the clock of `display_time` [s]."""

    def begin_frame(self) -> HeadsetFrame:
        """Wait until the next frame may be drawn, and return it.

        While the headset is idle (nobody wears it, a system menu is in front) it returns frames that are not
        visible, at about the refresh rate.

        Raises
        ------
        InstrumentError
            If the runtime went away, or ends the session.
        """

    def framebuffer(self) -> moderngl.Framebuffer:
        """Return what the frame is drawn to: twice an eye's width, the left eye in the left half."""

    def end_frame(self) -> None:
        """Hand the frame to the runtime, to be shown at its display time."""

    def focused(self) -> bool:
        """Return whether the wearer sees this session and its controllers act on it."""

    def presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call, in order.

        Names: trigger, menu, stick_left, stick_right, stick_up, stick_down; a stick counts once when it
        leaves the middle.
        """

    def stick(self) -> tuple[float, float]:
        """Return how far the stick of either controller is pushed now: right and up, each from -1 to 1."""

    def apparatus(self) -> dict[str, str]:
        """Return what the runtime says of itself, for a session's manifest."""


def centre_pixels_per_degree(fov: EyeFov, width: int) -> float:
    """Return the pixels per degree of an eye's picture straight ahead, across [1/deg].

    The picture is flat, and each of its pixels covers the same step of the tangent; straight ahead a degree
    is pi / 180 of it, and towards the edges more.

    Parameters
    ----------
    fov : EyeFov
        The edges of the picture.
    width : int
        Its width [pixels].

    >>> quarter = math.pi / 4
    >>> round(centre_pixels_per_degree(EyeFov(-quarter, quarter, quarter, -quarter), 720), 3)  # 360 pi / 180
    6.283
    """
    left, right, _, _ = fov.tangents()
    return width / (right - left) * math.pi / 180


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
