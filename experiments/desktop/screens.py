"""Looks at what is on the monitors; pictures stay in memory, and only numbers leave this module."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.printed import in_one_line
from evenlight.experiments.desktop.monitor_dimmer import ScreenLight
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.contrast.frame_analysis import FrameAnalysis

# Shares of one core that looks at a picture may take, as it was and changed: the next look waits for it.
STILL, CHANGED = 0.015, 0.05
OFTEN = 2.0  # [s] between two looks at which monitors there are
PATIENCE = 1.0  # [s] that grim may take: of an output that is off, a compositor sends nothing
CONNECTORS = Path("/sys/class/drm")


class MssScreens:
    """The monitors by mss, which looks once which there are: `make` makes it anew now and then."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make, self._grabber, self._made = make, make(), time.monotonic()

    def names(self) -> list[str]:
        """Return the monitors' outputs, or numbers where the system tells none."""
        if time.monotonic() - self._made > OFTEN:
            self._renew()
        return list(self._areas())

    def grab(self, name: str) -> Any:
        """Return the picture of a monitor, B, G, R and what is nothing; None while it is not there."""
        try:
            return self._grabber.grab(self._areas()[name]) if name in self.names() else None
        except Exception:  # it may have become smaller
            self._renew()
            return self._grabber.grab(self._areas()[name]) if name in self._areas() else None

    def _areas(self) -> dict[str, dict[str, Any]]:
        return {one.get("output") or str(k): one for k, one in enumerate(self._grabber.monitors) if k}

    def _renew(self) -> None:
        before, self._grabber, self._made = self._grabber, self._make(), time.monotonic()
        with contextlib.suppress(Exception):
            before.close()

    def close(self) -> None:
        """Let go of the screen."""
        with contextlib.suppress(Exception):  # it may be gone
            self._grabber.close()


class GrimScreens:
    """The outputs of a Wayland compositor that lets the program grim look at them: sway, Hyprland, river."""

    def names(self) -> list[str]:
        """Return the names of the connectors in use."""
        used = [file.parent for file in CONNECTORS.glob("card*-*/enabled") if file.read_bytes()[:2] == b"en"]
        return sorted(folder.name.partition("-")[2] for folder in used) or [""]

    def grab(self, name: str) -> Any:
        """Return the picture of an output, R, G, B; None while it is not there, or off."""
        words = ["grim", *(["-o", name] if name else []), "-t", "ppm", "-"]
        try:
            done = subprocess.run(words, capture_output=True, check=True, timeout=PATIENCE)
        except subprocess.SubprocessError:
            Path(os.environ["XDG_RUNTIME_DIR"], os.environ["WAYLAND_DISPLAY"]).stat()  # is the session there?
            return None
        _, size, _, raw = done.stdout.split(b"\n", 3)
        width, height = map(int, size.split())
        return SimpleNamespace(width=width, height=height, raw=raw)


def opened_screens() -> AbstractContextManager[MssScreens | GrimScreens]:
    """Return what grabs the monitors, in a context; raise `InputError` where nothing can."""
    if not all(map(importlib.util.find_spec, ("mss", "psutil"))):
        raise InputError("live needs its extra: pip install '.[live]' in the checkout")
    if sys.platform == "linux" and os.environ.get("WAYLAND_DISPLAY"):
        if shutil.which("grim"):
            return contextlib.nullcontext(GrimScreens())
        raise InputError(
            "this is a Wayland session: install grim (for sway, Hyprland and others of wlroots); GNOME and "
            "KDE show their screen to no program of this kind: log in with Xorg there"
        )
    try:
        import mss

        return contextlib.closing(MssScreens(mss.MSS))
    except Exception as error:
        raise InputError(f"the screen cannot be looked at: {in_one_line(str(error))}") from None


@dataclass(eq=False)
class WatchedScreen:
    """One monitor's picture, analysed where it has changed, and looked at no oftener than its work allows."""

    grabber: Any  # MssScreens or GrimScreens
    name: str  # of the monitor's output
    display: Display  # what it shows
    model: ContrastModel
    knots: Array  # (K,): of the loss
    size: tuple[int, int] = (0, 0)  # width and height of the last picture
    analyses: int = 0

    def __post_init__(self) -> None:
        self._before, self._waits_until = b"", -np.inf
        self._seen: ScreenLight | None = None

    def look(self, now: float) -> ScreenLight | None:
        """Return what is on it, or was at the last look; None while there is no picture of it."""
        if now < self._waits_until:
            return self._seen
        began, share = processor_time(), STILL
        try:
            shot = self.grabber.grab(self.name)
        except Exception as error:
            words = str(error) or type(error).__name__
            raise InstrumentError(f"the screen cannot be looked at: {words}") from None
        if shot is None:
            self._seen, self._before = None, b""
        elif (shot.width, shot.height) != self.size:
            self._measure(shot.width, shot.height)
            began = processor_time()
        if shot is not None and shot.raw != self._before:
            pixels = np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, -1)
            rgb = pixels if pixels.shape[2] == 3 else pixels[..., 2::-1]
            found = self._analysis.of(np.ascontiguousarray(rgb))
            self._seen = ScreenLight(found.mean_luminance, found.loss)
            self._before, share, self.analyses = shot.raw, CHANGED, self.analyses + 1
        self._waits_until = now + (processor_time() - began) / share
        return self._seen

    def _measure(self, width: int, height: int) -> None:
        """Prepare for pictures of a size; compiling is no work of a look."""
        self.size, shape, self._before = (width, height), (height, width), b""
        self._analysis = FrameAnalysis(shape, self.display, self.model, self.knots)
        self._analysis.of(np.zeros((*shape, 3), np.uint8))


def processor_time() -> float:
    """Return what this process and those that it has waited for have taken of the processor [s]."""
    return time.process_time() + sum(os.times()[2:4])
