"""Looks at what is on the monitors; pictures stay in memory, and only numbers leave this module."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.experiments.desktop.monitor_dimmer import ScreenLight
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.contrast.frame_analysis import FrameAnalysis
from evenlight.method.contrast.frame_light import FrameLight

MOST_WORK = 0.05  # of one core, that analyses may take: the next one waits for it
APART = 7  # pixels of which the light is taken meanwhile are so far apart


@contextmanager
def opened_screens() -> Iterator[Any]:
    """Yield what grabs the screen: mss, whose errors are those of each system.

    Raises
    ------
    InputError
        If there is none that can be grabbed.
    """
    try:
        import mss
    except ModuleNotFoundError:
        raise InputError("live looks at the screen by mss: pip install '.[live]' in the checkout") from None
    if os.environ.get("WAYLAND_DISPLAY") and sys.platform == "linux":
        raise InputError(
            "this is a Wayland session, where programs may not look at the whole screen: log in with Xorg"
        )
    try:
        grabber = mss.MSS()
    except Exception as error:
        raise InputError(f"the screen cannot be looked at: {in_one_line(error)}") from None
    try:
        yield grabber
    finally:
        with contextlib.suppress(Exception):  # the screen may be gone
            grabber.close()


class WatchedScreen:
    """One monitor's picture, analysed where it has changed, and no oftener than its work allows.

    Parameters
    ----------
    grabber : mss.MSS
        Looks at the screen.
    number : int
        Of the monitor, from 1.
    display : Display
        What it shows.
    model, knots : ContrastModel, array (K,)
        Of the loss.
    """

    def __init__(
        self, grabber: Any, number: int, display: Display, model: ContrastModel, knots: Array
    ) -> None:
        self._grabber, self._area = grabber, grabber.monitors[number]
        shape = (self._area["height"], self._area["width"])
        self._analysis = FrameAnalysis(shape, display, model, knots)
        self._before: bytearray | None = None
        self._waits_until = 0.0
        self._light = FrameLight(display, model.pixel_to_luminance)
        found = self._analysis.of(np.zeros((*shape, 3), np.uint8))  # compiles, which is no work of a look
        self._seen = ScreenLight(found.mean_luminance, found.loss)
        self.analyses = 0

    def look(self, now: float) -> ScreenLight:
        """Return what is on it; where it is too early to analyse, its light beside the loss of before."""
        try:
            shot = self._grabber.grab(self._area)
        except Exception as error:
            raise InstrumentError(f"the screen cannot be looked at any more: {in_one_line(error)}") from None
        if shot.raw == self._before:
            return self._seen
        pixels = np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, 4)[..., 2::-1]
        if now < self._waits_until:
            light = self._light.luminance(pixels[::APART, ::APART])
            return ScreenLight(float(light.mean()), self._seen.loss)
        self._before, began = shot.raw, time.process_time()
        found = self._analysis.of(np.ascontiguousarray(pixels))
        self.analyses += 1
        self._waits_until = now + (time.process_time() - began) / MOST_WORK
        self._seen = ScreenLight(found.mean_luminance, found.loss)
        return self._seen


def in_one_line(error: Exception) -> str:
    """Return what an error says, or of which kind it is."""
    return " ".join(str(error).split()) or type(error).__name__
