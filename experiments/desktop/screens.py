"""Looks at what is on the monitors; pictures stay in memory, and only numbers leave this module."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
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

MOST_WORK = 0.05  # of one core, that analyses may take: the next one waits for it
OFTEN = 2.0  # [s] between two looks at which monitors there are
GRIM_EVERY = 1.0  # [s] between two pictures: one takes 20 ms of a core
CONNECTORS = Path("/sys/class/drm")


class MssScreens:
    """The monitors by mss, which looks once which there are: `make` makes it anew now and then."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make, self._grabber, self._made = make, make(), time.monotonic()

    @property
    def monitors(self) -> list[dict[str, Any]]:
        """All of them together, then each."""
        if time.monotonic() - self._made > OFTEN:
            self._renew()
        return list(self._grabber.monitors)

    def grab(self, area: dict[str, Any]) -> Any:
        """Return the picture of a monitor: B, G, R and what is nothing."""
        try:
            return self._grabber.grab(area)
        except Exception:  # it may have become smaller
            self._renew()
            raise

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

    def __init__(self) -> None:
        self._grabbed: dict[str, tuple[float, Any]] = {}

    @property
    def monitors(self) -> list[dict[str, Any]]:
        """All of them together, then each, by the names of the connectors in use: a laptop's panel first."""
        files = sorted(CONNECTORS.glob("card*-*/enabled"), key=lambda file: ("eDP" not in str(file), file))
        used = [file.parent.name.partition("-")[2] for file in files if file.read_bytes() == b"enabled\n"]
        return [{}, *({"output": name} for name in used or [""])]

    def grab(self, area: dict[str, Any]) -> Any:
        """Return the picture of an output, R, G, B, as it was within the last second."""
        name = area["output"]
        if name in self._grabbed and time.monotonic() - self._grabbed[name][0] < GRIM_EVERY:
            return self._grabbed[name][1]
        which = ["-o", name] if name else []
        done = subprocess.run(["grim", *which, "-t", "ppm", "-"], capture_output=True, check=False)
        if done.returncode:
            raise OSError(done.stderr.decode(errors="replace"))
        _, size, _, raw = done.stdout.split(b"\n", 3)
        width, height = map(int, size.split())
        picture = SimpleNamespace(width=width, height=height, raw=raw)
        self._grabbed[name] = time.monotonic(), picture
        return picture

    def close(self) -> None:
        """Nothing is held."""


def opened_screens() -> contextlib.closing[MssScreens | GrimScreens]:
    """Return what grabs the monitors, in a context; raise `InputError` where nothing can."""
    wayland = sys.platform == "linux" and os.environ.get("WAYLAND_DISPLAY")
    if wayland and shutil.which("grim") is None:
        raise InputError(
            "this is a Wayland session: install grim (for sway, Hyprland and others of wlroots); GNOME and "
            "KDE show their screen to no program of this kind: log in with Xorg there"
        )
    try:
        import mss
    except ModuleNotFoundError:
        raise InputError("live looks at the screen by mss: pip install '.[live]' in the checkout") from None
    try:
        return contextlib.closing(GrimScreens() if wayland else MssScreens(mss.MSS))
    except Exception as error:
        raise InputError(f"the screen cannot be looked at: {in_one_line(str(error))}") from None


@dataclass(eq=False)
class WatchedScreen:
    """One monitor's picture, analysed where it has changed, and no oftener than its work allows."""

    grabber: Any  # MssScreens or GrimScreens
    number: int  # of the monitor, from 1
    display: Display  # what it shows
    model: ContrastModel
    knots: Array  # (K,): of the loss
    size: tuple[int, int] = (0, 0)  # width and height of the last picture
    analyses: int = 0

    def __post_init__(self) -> None:
        self._before, self._waits_until = b"", 0.0
        self._seen: ScreenLight | None = None
        names = list(self._areas())
        # By its output's name, where the system tells it, it is known when there are others before it.
        self.name = names[self.number - 1] if self.number <= len(names) else str(self.number)

    def look(self, now: float) -> ScreenLight | None:
        """Return what is on it, or was at the last analysis; None while there is no such monitor."""
        try:
            try:
                shot = self._shot()
            except Exception:  # it has become smaller, or is gone
                shot = self._shot()
        except Exception as error:
            words = str(error) or type(error).__name__
            raise InstrumentError(f"the screen cannot be looked at: {words}") from None
        if shot is None:
            return None
        if (shot.width, shot.height) != self.size:
            self._measure(shot.width, shot.height)
        elif shot.raw == self._before or now < self._waits_until:
            return self._seen
        began = time.process_time()
        pixels = np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, -1)
        rgb = pixels if pixels.shape[2] == 3 else pixels[..., 2::-1]
        found = self._analysis.of(np.ascontiguousarray(rgb))
        self._before, self.analyses = shot.raw, self.analyses + 1
        self._waits_until = now + (time.process_time() - began) / MOST_WORK
        self._seen = ScreenLight(found.mean_luminance, found.loss)
        return self._seen

    def _areas(self) -> dict[str, dict[str, Any]]:
        return {one.get("output") or str(k): one for k, one in enumerate(self.grabber.monitors) if k}

    def _shot(self) -> Any:
        area = self._areas().get(self.name)
        return None if area is None else self.grabber.grab(area)

    def _measure(self, width: int, height: int) -> None:
        """Prepare for pictures of a size; compiling is no work of a look."""
        self.size, shape = (width, height), (height, width)
        self._analysis = FrameAnalysis(shape, self.display, self.model, self.knots)
        self._analysis.of(np.zeros((*shape, 3), np.uint8))
