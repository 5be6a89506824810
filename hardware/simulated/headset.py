"""A headset that is made up: both eyes are drawn offscreen, and what its wearer does follows a script."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.hardware.presentation.headset_views import (
    SRGB8_ALPHA8,
    EyeFov,
    EyePose,
    HeadsetFacts,
    HeadsetFrame,
    Pose,
    Size,
    Triangle,
    rotation,
    side_by_side,
)
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.protocols import Fault, KeyPress

if TYPE_CHECKING:
    import moderngl

IMAGES = 3  # that are drawn to in turn, as in a swapchain
AHEAD = 2  # refreshes from the begin of a frame to when it appears
REFRESH_RATE = 90.0  # [Hz]
EYE_DISTANCE = 0.063  # [m]
EYE_SIZE = (1280, 1280)
# Edges of the left eye's picture [deg]: towards the nose less than outwards, downwards more than up.
OUTWARDS, INWARDS, UPWARDS, DOWNWARDS = 47.0, 43.0, 44.0, 46.0
FOCUS = 13.5  # [deg] to each side that the focus views see, as those of Varjo's XR-3
Span = tuple[float, float]


def gentle_motion(when: float) -> Pose:
    """Return the pose of a head that looks around a little, from straight ahead at 0 s.

    >>> gentle_motion(0.0) == Pose()
    True
    """
    yaw = math.radians(6.0) * math.sin(2 * math.pi * when / 7.0)
    pitch = math.radians(3.0) * math.sin(2 * math.pi * when / 5.0)
    sway = 0.01 * math.sin(2 * math.pi * when / 4.0)
    turn = (math.sin(yaw / 2), math.cos(yaw / 2))
    nod = (math.sin(pitch / 2), math.cos(pitch / 2))
    # first the nod about x, then the turn about y
    return Pose((sway, 0.0, 0.0), (turn[1] * nod[0], turn[0] * nod[1], -turn[0] * nod[0], turn[1] * nod[1]))


@dataclass(frozen=True, slots=True)
class HeadsetScript:
    """What happens to a simulated headset; times are on its clock [s]."""

    head: Callable[[float], Pose] = gentle_motion  # at a time
    gaze: Callable[[float], Pose | None] = lambda _: None  # from between the eyes to where they look
    stick: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0)
    presses: Sequence[KeyPress] = ()  # of controllers, in order
    unfocused: Sequence[Span] = ()  # while it is taken off, or a menu of the system is in front
    invisible: Sequence[Span] = ()
    untracked: Sequence[Span] = ()
    recentred: Sequence[float] = ()  # when the runtime says that its origin is another, as `head` has it then
    dropped: Mapping[int, int] = field(default_factory=dict)  # refreshes that pass before a frame, from 0
    # By the lenses, as `HeadsetFacts` has it.
    hidden: tuple[tuple[Triangle, ...], tuple[Triangle, ...]] = ((), ())
    lost_at: int | None = None  # the frame at which the runtime goes away
    focus_size: Size | None = None  # of the focus views, if it has any


class SimulatedHeadset(HeadsetWindow):
    """A headset on an offscreen framebuffer, in place of one at an OpenXR runtime.

    Parameters
    ----------
    eye_size : (int, int), optional
        Width and height of each eye's picture [pixels].
    refresh_rate : float, optional
        How many frames it shows [Hz].
    script : HeadsetScript, optional
        What happens to it.
    real_time : bool, optional
        Whether frames take their time; else the clock goes on by a refresh with each frame, at once.

    Raises
    ------
    InputError
        If the machine has no OpenGL 3.3.
    """

    def __init__(
        self,
        eye_size: tuple[int, int] = EYE_SIZE,
        refresh_rate: float = REFRESH_RATE,
        script: HeadsetScript | None = None,
        *,
        real_time: bool = False,
    ) -> None:
        super().__init__()
        self._name = "simulated headset"
        self.script = script or HeadsetScript()
        self._eye_size, self._rate, self._real_time = eye_size, refresh_rate, real_time
        self._started = time.perf_counter()
        self._begun = self._refresh = 0  # how many frames began, and the refresh at which the last one did
        self._open = False  # whether a frame is being drawn
        self._pressed, self._appeared = 0, 0.0  # how many presses were told, and when the last frame appears
        self._context = _offscreen()
        sizes = self.view_sizes()
        whole = sum(width for width, _ in sizes), max(height for _, height in sizes)
        self._images = [
            self._context.framebuffer(self._context.texture(whole, 4, internal_format=SRGB8_ALPHA8))
            for _ in range(IMAGES)
        ]

    def facts(self) -> HeadsetFacts:
        """Return what a runtime would say."""
        return HeadsetFacts(
            runtime="simulated",
            system="simulated headset",
            eye_size=self._eye_size,
            fovs=tuple(eye.fov for eye in self._eyes(Pose())),
            refresh_rate=self._rate,
            refresh_rates=(self._rate,),
            tracks_position=True,
            eye_distance=EYE_DISTANCE,
            hidden=self.script.hidden,
            focus_size=self.script.focus_size,
        )

    def view_sizes(self) -> tuple[Size, ...]:
        """Return width and height of each view [pixels]."""
        focus = self.script.focus_size
        return 2 * (self._eye_size,) + (() if focus is None else 2 * (focus,))

    def context(self) -> moderngl.Context:
        """Return the graphics context, current."""
        # Another one may have been made since, for scenes drawn offscreen.
        self._context.__enter__()  # type: ignore[no-untyped-call]  # moderngl does not say its types
        return self._context

    def runtime_time(self) -> float:
        """Return the time since it was opened; without real time, that of the last frame's begin [s]."""
        return time.perf_counter() - self._started if self._real_time else self._refresh / self._rate

    def begin_frame(self) -> HeadsetFrame:
        """Wait until the next frame may be drawn, and return it."""
        self._require_open()
        if self._open:
            raise self._error("a frame was begun before the last one ended")
        if self.script.lost_at is not None and self._begun >= self.script.lost_at:
            raise self._error("the runtime went away", Fault.DISCONNECTED)
        self._refresh += self.script.dropped.get(self._begun, 0) + (self._begun > 0)
        if self._real_time:
            self._wait()
        self.context()
        self._open = True
        self._begun += 1
        return self._framed((self._refresh + AHEAD) / self._rate)

    def picture(self) -> moderngl.Framebuffer:
        """Return what the frame is drawn to: all views side by side."""
        self._require_frame()
        return self._images[self._begun % IMAGES]

    def end_frame(self) -> None:
        """Show the frame to nobody."""
        self._require_open()
        self._require_frame()
        self._open = False

    def focused(self) -> bool:
        """Return whether somebody wears it."""
        return not _within(self.script.unfocused, self.runtime_time())

    def controller_presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call."""
        now, coming = self.runtime_time(), itertools.islice(self.script.presses, self._pressed, None)
        due = list(itertools.takewhile(lambda press: press.time <= now, coming))
        self._pressed += len(due)
        return due if self.focused() else []

    def stick(self) -> tuple[float, float]:
        """Return how far the stick is pushed now."""
        return self.script.stick(self.runtime_time()) if self.focused() else (0.0, 0.0)

    def versions(self) -> dict[str, str]:
        """Return what draws it."""
        info = self._context.info
        return {"headset": "simulated", "renderer": info["GL_RENDERER"], "opengl": info["GL_VERSION"]}

    def close(self) -> None:
        """Let go of its images and its graphics context."""
        if not self._closed:
            self.context()
            for image in self._images:
                image.color_attachments[0].release()
                image.release()
            self._context.release()
        super().close()

    def _framed(self, shown: float) -> HeadsetFrame:
        """Return the frame that appears at a time [s]; where the head is not tracked, it stands still."""
        tracked = not _within(self.script.untracked, shown)
        began = next((span[0] for span in self.script.untracked if span[0] <= shown < span[1]), shown)
        head = self.script.head(began)
        visible = not _within(self.script.invisible, shown)
        recentred = any(self._appeared < time <= shown for time in self.script.recentred)
        self._appeared = shown
        state = visible, tracked, recentred, self.script.gaze(shown)
        return HeadsetFrame(shown, 1 / self._rate, self._eyes(head), head, *state)

    def _eyes(self, head: Pose) -> tuple[EyePose, ...]:
        wide, narrow, up, down, focus = map(math.radians, (OUTWARDS, INWARDS, UPWARDS, DOWNWARDS, FOCUS))
        x, y, z = head.position
        dx, dy, dz = (rotation(head) @ (EYE_DISTANCE / 2, 0.0, 0.0)).tolist()
        left = Pose((x - dx, y - dy, z - dz), head.orientation)
        right = Pose((x + dx, y + dy, z + dz), head.orientation)
        fovs = EyeFov(-wide, narrow, up, -down), EyeFov(-narrow, wide, up, -down)
        sharp, parts = EyeFov(-focus, focus, focus, -focus), side_by_side(self.view_sizes())
        return tuple(map(EyePose, 2 * (left, right), (*fovs, sharp, sharp), parts))

    def _wait(self) -> None:
        """Wait for the refresh that is due, or take the next one if it has passed."""
        self._refresh = max(self._refresh, math.ceil(self.runtime_time() * self._rate))
        time.sleep(max(self._refresh / self._rate - self.runtime_time(), 0.0))

    def _require_frame(self) -> None:
        if not self._open:
            raise self._error("no frame was begun")


def _within(spans: Sequence[Span], when: float) -> bool:
    return any(begin <= when < end for begin, end in spans)


def _offscreen() -> moderngl.Context:
    import moderngl

    reasons: list[str] = []
    choices: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for options in choices:
        try:
            return moderngl.create_context(standalone=True, require=330, **options)
        except Exception as error:  # moderngl raises a bare Exception
            reasons.append((str(error).splitlines() or [type(error).__name__])[0])
    raise InputError(
        f"a simulated headset needs OpenGL 3.3, and there is none without a window ({reasons[0]}): install a "
        "graphics driver, or Mesa's software one (on Debian, libegl1 and libgl1-mesa-dri)"
    )
