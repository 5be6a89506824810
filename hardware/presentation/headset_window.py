"""A window in a headset: what is drawn for both eyes, with the times at which the runtime shows it.

The seam between Evenlight and a runtime: `openxr_headset.OpenXRHeadset` talks to one, and
`hardware.simulated.headset.SimulatedHeadset` stands in for it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.recordings.rig import Eye
from evenlight.hardware.presentation.headset_views import (
    HeadsetFacts,
    HeadsetFrame,
    Part,
    Pose,
    Size,
    centre_pixels_per_degree,
    forward,
    level,
    seen_pixels,
    side_by_side,
)
from evenlight.hardware.protocols import ContextDevice, KeyPress
from evenlight.hardware.simulated.clocks import RefreshClock

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl
    import numpy as np
    from numpy.typing import NDArray

    from evenlight.hardware.presentation.mirror_window import MirrorWindow

PANEL_SIZE = (1280, 960)  # [pixels] of pages, which stand before the head
BITS = 8
RECENTRE, MENU_HELD = "f4", "menu_held"  # key of the operator, and button of a controller
READINGS = 16  # parts of pictures that may be read at a time
KEPT = 1 << 17  # frames that are noted until they are asked for: 20 minutes at 100 Hz


@dataclass(frozen=True, slots=True)
class ShownFrame:
    """A frame that was handed to the runtime."""

    display_time: float  # when it appears, as the runtime predicts, on the runtime's clock [s]
    period: float  # how long a frame lasts [s]
    late: int  # refreshes that passed without a new frame before it
    head: Pose  # predicted for that time
    visible: bool  # whether the runtime showed it
    focused: bool  # whether the headset was worn, and nothing of the system in front
    tracked: bool  # whether the head's orientation was known
    recentred: bool = False  # whether the axes are others than those of the frame before
    gaze: tuple[float, float, float] | None = None  # where the eyes look: right, up, back; None if not known


class HeadsetWindow(ContextDevice, ABC):
    """A headset, open: a window whose back buffer holds the pictures of its views, side by side.

    `begin` before anything is drawn or shown. Where the head is then becomes the origin of all views, and
    where it points is straight ahead, until they are set anew (`recentre`) or the runtime moves its own. What
    a headset is asked for is abstract: what its runtime says of itself, frames between `begin_frame` and
    `end_frame`, and controllers.

    Raises
    ------
    InstrumentError
        If the runtime goes away: in `begin`, and in `flip`.
    """

    mirror: MirrorWindow | None = None  # the operator's window, if there is one
    _in_runtime: HeadsetFrame  # the one that is being drawn, in the runtime's axes
    _frame: HeadsetFrame  # and in those that begin at the origin

    def __init__(self) -> None:
        self._shown: deque[ShownFrame] = deque(maxlen=KEPT)
        self._last: float | None = None  # when the last frame appeared, on the runtime's clock [s]
        self._drawn = False  # whether the frame's image was asked for
        self._origin, self._origin_due = Pose(), True  # in the runtime's axes, and whether it is to be taken
        self._eye = Eye.LEFT
        self._readings, self._buffers = 0, dict[int, Any]()  # how many were begun, and where they go
        self._refresh_clock: RefreshClock | None = None

    def begin(self, eye: Eye, refresh_clock: RefreshClock | None = None) -> None:
        """Begin the first frame.

        Parameters
        ----------
        eye : Eye
            The one that counts.
        refresh_clock : RefreshClock, optional
            A clock that goes with the flips, for a rehearsal; else time is the runtime's.
        """
        self._eye, self._refresh_clock = eye, refresh_clock
        self._origin_due = True
        self._begin_frame()

    def recentre(self, *, noted: bool = False) -> None:
        """Take where the head is as the origin, and where it points as straight ahead, from this frame on.

        While it is not worn or not tracked the origin is due, and is taken as soon as it is. If it is in the
        midst of what is shown, the frame is to be `noted` as recentred.
        """
        self._origin_due = True
        self._place()
        self._frame = replace(self._frame, recentred=noted)

    def size(self) -> tuple[int, int]:
        """Return width and height of the panel of pages [pixels]; not those of an eye's picture."""
        return PANEL_SIZE

    def bits(self) -> int:
        """Return the bits of each colour channel of what is shown."""
        return BITS

    def now(self) -> float:
        """Return the time on the window's clock [s]."""
        return self._refresh_clock.now() if self._refresh_clock else self.runtime_time()

    def due(self, period: float) -> float:
        """Return when what is drawn now will appear, as the runtime predicts; in a rehearsal, counted [s]."""
        return self._refresh_clock.now() + period if self._refresh_clock else self._appears()

    def eyes(self) -> HeadsetFrame:
        """Return the views of the frame that is being drawn."""
        return self._frame

    def framebuffer(self) -> moderngl.Framebuffer:
        """Return what the frame is drawn to, ready for it: each view goes to its part."""
        framebuffer = self.picture()
        self._drawn = True
        framebuffer.viewport = (0, 0, *framebuffer.size)
        framebuffer.use()
        return framebuffer

    def flip(self) -> float:
        """Hand the frame to the runtime, wait for the next, and return when the one handed over appears [s].

        With a clock of refreshes that is the time counted.
        """
        if self._drawn and self.mirror is not None:
            self.mirror.take(self.picture(), self._part())
        shown = self._appears()
        self.end_frame()
        if self.mirror is not None:
            self.mirror.show()
        self._note(shown)
        self._drawn = False
        self._begin_frame()
        return self._refresh_clock.advance() if self._refresh_clock else shown

    def shown_frames(self) -> list[ShownFrame]:
        """Return the frames that were handed over since the last call, at most the last `KEPT`."""
        shown = list(self._shown)
        self._shown.clear()
        return shown

    def read_codes(self, size: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return the codes drawn before the next flip, of all views: (height, widths, 3), row 0 on top.

        It waits for the drawing: for tests, screenshots and rehearsals. `size` takes a centred part of that
        width and height of the picture of the eye that counts.
        """
        import numpy as np

        if size is not None:
            return self.codes_later(size)()
        width, height = self.picture().size
        codes = np.frombuffer(self.picture().read(components=3, alignment=1), dtype=np.uint8)
        return codes.reshape(height, width, 3)[::-1].astype(np.int64)

    def codes_later(self, size: tuple[int, int], *, top: bool = False) -> Callable[[], NDArray[np.int64]]:
        """Begin to read codes of the eye that counts, before the next flip, and return what takes them.

        Nothing is waited for until they are taken, before `READINGS` more are begun. The part, of a width and
        height at most [pixels], lies in the middle of the picture, or at the top, in its upper eighth.
        """
        import numpy as np

        left, _, width, height = self._part()
        across, down = min(size[0], width), min(size[1], max(height // 8, 1) if top else height)
        left += (width - across) // 2
        bottom = height - down if top else (height - down) - (height - down) // 2
        count = 4 * across * down
        slot, self._readings = self._readings % READINGS, self._readings + 1
        buffer = self._buffers.get(slot)
        if buffer is None or buffer.size < count:
            buffer = self._buffers[slot] = self.context().buffer(reserve=count)
        self.picture().read_into(buffer, (left, bottom, across, down), 4)

        def taken() -> NDArray[np.int64]:
            codes = np.frombuffer(buffer.read(count), dtype=np.uint8)
            return codes.reshape(down, across, 4)[::-1, :, :3].astype(np.int64)

        return taken

    def seen_pixels(self, eye: Eye | None = None) -> NDArray[np.bool_] | None:
        """Return which pixels of an eye's wide view its lens shows, of the one that counts if none is named.

        Row 0 is on top, (height, width). None where the runtime does not say, or hides all of it.
        """
        at, facts = (eye or self._eye) is Eye.RIGHT, self.facts()
        seen = seen_pixels(facts.fovs[at], facts.hidden[at], self.view_sizes()[at])
        return seen if facts.hidden[at] and seen.any() else None

    def presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call, on the window's clock, in order.

        A menu button that was held sets straight ahead anew, and is no press.
        """
        pressed = self.controller_presses()
        if any(press.name == MENU_HELD for press in pressed):
            self.recentre(noted=True)
        pressed = [press for press in pressed if press.name != MENU_HELD]
        return [KeyPress(press.name, self.now()) for press in pressed] if self._refresh_clock else pressed

    def apparatus(self) -> dict[str, str]:
        """Return what the runtime says of itself, and how large the pictures are."""
        facts, sizes = self.facts(), self.view_sizes()
        said = {
            "runtime": facts.runtime,
            "system": facts.system,
            **{
                name: "{} x {} pixels".format(*size)
                for name, size in zip(("eye_size", "focus_size"), sizes[::2], strict=False)
            },
            "eye_that_counts": self._eye.value,
            "eye_distance_mm": f"{1e3 * facts.eye_distance:.1f}",
            "refresh_rate_hz": f"{facts.refresh_rate:.3f}",
            "bits": str(BITS),
            "clock": "refreshes drawn" if self._refresh_clock else "runtime",
        }
        names = (*(eye.value for eye in Eye), *(f"focus_{eye.value}" for eye in Eye))
        for name, fov, (width, _) in zip(names, facts.fovs, sizes, strict=False):
            edges = (math.degrees(edge) for edge in (fov.left, fov.right, fov.down, fov.up))
            said[f"field_of_view_{name}_deg"] = "{:.2f} to {:.2f}, {:.2f} to {:.2f} upwards".format(*edges)
            said[f"pixels_per_degree_{name}"] = f"{centre_pixels_per_degree(fov, width):.3f} at the centre"
        for eye in Eye:
            seen = self.seen_pixels(eye)
            said[f"hidden_area_{eye.value}"] = (
                "not known: every pixel counts" if seen is None else f"{1 - seen.mean():.4f} of the picture"
            )
        return {**said, **self.versions()}

    @abstractmethod
    def facts(self) -> HeadsetFacts:
        """Return what the runtime says of the headset."""

    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Return what is behind the window, for a session's manifest: packages, graphics, controllers."""

    @abstractmethod
    def view_sizes(self) -> tuple[Size, ...]:
        """Return width and height of each view, as it is drawn [pixels]; the left one has the right one's."""

    @abstractmethod
    def context(self) -> moderngl.Context:
        """Return the graphics context."""

    @abstractmethod
    def runtime_time(self) -> float:
        """Return the time on the clock of `HeadsetFrame.display_time` [s]."""

    @abstractmethod
    def begin_frame(self) -> HeadsetFrame:
        """Wait until the next frame may be drawn, and return it.

        While the headset is idle (nobody wears it, a system menu is in front) it returns frames that are not
        visible, at about the refresh rate.

        Raises
        ------
        InstrumentError
            If the runtime went away, or ends the session.
        """

    @abstractmethod
    def picture(self) -> moderngl.Framebuffer:
        """Return the picture of the frame, in which its views lie side by side."""

    @abstractmethod
    def end_frame(self) -> None:
        """Hand the frame to the runtime, to be shown at its display time."""

    @abstractmethod
    def focused(self) -> bool:
        """Return whether the headset is worn, and nothing of the system in front: controllers act then."""

    @abstractmethod
    def controller_presses(self) -> list[KeyPress]:
        """Return what was pressed on controllers since the last call, on the runtime's clock, in order.

        Names: trigger, menu, menu_held, stick_left, stick_right, stick_up, stick_down; a stick counts once
        when it leaves the middle, and menu when it is let go before it counts as held.
        """

    @abstractmethod
    def stick(self) -> tuple[float, float]:
        """Return how far the stick of either controller is pushed now: right and up, each from -1 to 1."""

    def _part(self) -> Part:
        """Return where the wide view of the eye that counts is."""
        return side_by_side(self.view_sizes())[self._eye is Eye.RIGHT]

    def _begin_frame(self) -> None:
        self._in_runtime = self.begin_frame()
        self._origin_due |= self._in_runtime.recentred
        self._place()

    def _place(self) -> None:
        """Take the origin if it is due, and the frame in its axes."""
        if self._origin_due and self._in_runtime.tracked:
            self._origin = level(self._in_runtime.head)
            self._origin_due = not self.focused()
        self._frame = self._in_runtime.since(self._origin)

    def _appears(self) -> float:
        """Return when the frame being drawn will appear: as predicted, or, if that passed, periods later."""
        predicted, period = self._frame.display_time, self._frame.period
        missed = math.ceil((self.runtime_time() - predicted) / period)
        return predicted + max(missed, 0) * period

    def _note(self, shown: float) -> None:
        """Note the frame that was handed over; a runtime may state longer periods while drawing is slow."""
        frame = self._frame
        refresh = min(frame.period, 1 / self.facts().refresh_rate)
        missed = 0 if self._last is None else round((shown - self._last) / refresh) - 1
        self._last = shown
        gaze = None if frame.gaze is None else forward(frame.gaze)
        state = frame.visible, self.focused(), frame.tracked, frame.recentred, gaze
        self._shown.append(ShownFrame(shown, frame.period, max(missed, 0), frame.head, *state))


class OperatorKeys(ContextDevice):
    """The keyboard over a headset's mirror window, as a device that answers; without a mirror, no keys.

    Parameters
    ----------
    window : HeadsetWindow
        The window, open.
    """

    def __init__(self, window: HeadsetWindow) -> None:
        self._window = window

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order, but `RECENTRE`, which acts at once."""
        presses = self._window.mirror.pressed() if self._window.mirror is not None else []
        if any(press.name == RECENTRE for press in presses):
            self._window.recentre(noted=True)
        return [press for press in presses if press.name != RECENTRE]

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""
        return self._window.mirror.held() if self._window.mirror is not None else frozenset()

    def clear(self) -> None:
        """Forget what was pressed until now."""
        self.pressed()

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        return {"keyboard": "of the mirror window" if self._window.mirror is not None else "none"}
