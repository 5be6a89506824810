"""A window that marks what it shows for other recorders: triggers at its flips, a corner for a photodiode.

Decision (docs/decisions/frame-timing.md): an onset is the flip that first shows a stimulus, an offset the
flip that first shows something else; the corner is white from onset to offset, and black otherwise.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.showing import draw_patch
from evenlight.experiments.stage import SentTrigger
from evenlight.hardware.protocols import InstrumentError, TriggerOutput, Window

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

STIMULI = ("ramp", "video", "search")  # what the corner is white for; a question has triggers only
DELAY_DECIMALS = 6  # [s]


class MarkedWindow:
    """A window with marks.

    Parameters
    ----------
    window : Window
        The window.
    rig : Rig
        Which corner, which codes.
    outputs : mapping of str to TriggerOutput, optional
        What takes triggers, open, by name.
    timer : callable, optional
        Times how long a trigger takes to be sent [s].
    """

    def __init__(
        self,
        window: Window,
        rig: Rig,
        outputs: Mapping[str, TriggerOutput] | None = None,
        timer: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._window, self._rig, self._outputs, self._timer = window, rig, dict(outputs or {}), timer
        self._said = {f"trigger output {name}": _words(output) for name, output in self._outputs.items()}
        self.size, self.bits, self.now, self.close = window.size, window.bits, window.now, window.close
        self.context, self.framebuffer = window.context, window.framebuffer
        self.due, self.eyes = window.due, window.eyes
        self._next = self._shown = ""  # what the next flip shows, and what the last one showed
        self._sent: list[SentTrigger] = []

    def mark(self, stimulus: str) -> None:
        """Say what the next flip shows: ramp, video, search or question; it is nothing of these otherwise."""
        self._next = stimulus

    def flip(self) -> float:
        """Show the back buffer, send the triggers that belong to it, and return when it appeared [s]."""
        self._draw_patch()
        flip, begun = self._window.flip(), self._timer()
        before, self._shown, self._next = self._shown, self._next, ""
        if before != self._shown:
            self._send(f"{before}_offset", flip, begun)
            self._send(f"{self._shown}_onset", flip, begun)
        return flip

    def send(self, label: str) -> None:
        """Send a trigger of something that no flip shows, now."""
        self._send(label, self.now(), self._timer())

    def triggers_sent(self) -> list[SentTrigger]:
        """Return the triggers sent since the last call."""
        sent, self._sent = self._sent, []
        return sent

    def read_codes(self, size: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return the codes drawn to the back buffer; the whole has the corner in it."""
        if size is None:
            self._draw_patch()
        return self._window.read_codes(size)

    def apparatus(self) -> dict[str, str]:
        """Return what window and trigger outputs say of themselves, and where the corner is."""
        patch = self._rig.photodiode_patch
        corner = {"photodiode_patch": f"{patch.corner.value}, {patch.size} pixels"} if patch else {}
        return {**self._window.apparatus(), **self._said, **corner}

    def _draw_patch(self) -> None:
        """Draw the corner over what the next flip shows."""
        if self._rig.photodiode_patch is not None:
            lit = self._next in STIMULI
            draw_patch(self.framebuffer(), self.size(), self._rig.photodiode_patch, lit=lit)

    def _send(self, label: str, appeared: float, begun: float) -> None:
        """Send a trigger, unless it has no code; an output that fails is not tried again."""
        code = getattr(self._rig.trigger_codes, label, 0)
        failures: list[str] = []
        if not code or not self._outputs:
            return
        for name, output in list(self._outputs.items()):
            try:
                output.send(code, label)
            except InstrumentError as error:
                del self._outputs[name]
                failures.append(str(error))
        delay = round(self._timer() - begun, DELAY_DECIMALS) if self._outputs else None
        self._sent.append(SentTrigger(label, code, appeared, delay, tuple(failures)))


def _words(output: TriggerOutput) -> str:
    """Return what an output says of itself, in one line."""
    return ", ".join(f"{key}: {value}" for key, value in output.apparatus().items())
