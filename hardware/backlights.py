"""Backlights: that of the computer's own panel on Linux, and a simulated one.

Where pixels make the brightness there is none, and no device is opened.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.restoring import restore_and_release

SYSFS = Path("/sys/class/backlight")
ROUNDING = 1e-9  # of a factor that was computed
GONE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
UDEV_RULE = (
    'may not be written; as root, add the udev rule SUBSYSTEM=="backlight", ACTION=="add", '
    'RUN+="/bin/chgrp video /sys/class/backlight/%k/brightness", '
    'RUN+="/bin/chmod g+w /sys/class/backlight/%k/brightness", join the group video, and restart'
)


class SysfsBacklight(AbstractContextManager["SysfsBacklight"]):
    """The backlight of a panel, as Linux has it under /sys/class/backlight.

    Parameters
    ----------
    name : str
        Its folder there, e.g. "intel_backlight".
    root : Path, optional
        Where the folders are.
    min_interval : float, optional
        Shortest time between two settings [s]; drivers take a few ms.
    curve_known : bool, optional
        Whether its luminance over steps was measured, so that steps which are not linear in light will do.

    Raises
    ------
    InputError
        If there is no such backlight, it may not be set, or its steps are not linear in light.
    InstrumentError
        If it fails, or has no steps.
    """

    def __init__(
        self, name: str, root: Path = SYSFS, min_interval: float = 0.01, *, curve_known: bool = False
    ) -> None:
        self._folder, self._min_interval, self._closed = root / name, min_interval, False
        if not (self._folder / "max_brightness").is_file():
            names = sorted(path.name for path in root.glob("*")) if root.is_dir() else []
            raise InputError(
                f"{self._folder}: no such backlight; there is {', '.join(names) or 'none'} on this computer"
            )
        scale = self._folder / "scale"
        if not curve_known and scale.is_file() and scale.read_text().strip() == "non-linear":
            raise InputError(
                f"{self._folder}: its steps are not linear in light, so they are no brightness factors; name "
                "their measured curve as `backlight_curve`, or let pixels make the brightness"
            )
        self._highest = self._read("max_brightness")
        if self._highest < 1:
            raise InstrumentError(f"{self._folder}: says that its brightness has no steps")
        self._found = self._read("brightness")
        try:
            self._write(self._found)  # tells at once whether it may be set
        except InstrumentError as error:
            if error.fault is Fault.NOT_FOUND:
                raise InputError(str(error)) from None
            raise

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such factor, or refuses.
        """
        self._require_open()
        require_factor(factor, self.smallest_factor(), str(self._folder))
        step = max(1, round(factor * self._highest))
        self._set(step)
        return step / self._highest

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        self._require_open()
        actual = (self._folder / "actual_brightness").is_file()
        return self._read("actual_brightness" if actual else "brightness") / self._highest

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return 1 / self._highest

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return 1 / self._highest

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._min_interval

    def close(self) -> None:
        """Leave the device as it was found; more than once does nothing.

        Raises
        ------
        InstrumentError
            If it cannot be left so, unless another exception is under way.
        """
        if not self._closed:
            self._closed = True
            restore_and_release(lambda: self._set(self._found), lambda: None)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _require_open(self) -> None:
        """Refuse to work after `close`."""
        if self._closed:
            raise InstrumentError(f"{self._folder}: is closed", Fault.DISCONNECTED)

    def _read(self, name: str) -> int:
        """Return the number that a file of the device holds."""
        path = self._folder / name
        try:
            return int(path.read_text())
        except OSError as error:
            raise _failed(path, "cannot be read", error) from None
        except ValueError as error:
            raise InstrumentError(f"{path}: expected a whole number, got {error}", Fault.GARBLED) from None

    def _set(self, step: int) -> None:
        """Set the device to a step, and see whether it has taken it."""
        self._write(step)
        if (taken := self._read("brightness")) != step:
            raise InstrumentError(f"{self._folder}: was set to step {step}, and took {taken}")

    def _write(self, step: int) -> None:
        """Write a step to the device."""
        path = self._folder / "brightness"
        try:
            # Not Path.write_text: the file is never to be made, only written to.
            descriptor = os.open(path, os.O_WRONLY | os.O_TRUNC)
            try:
                os.write(descriptor, f"{step}\n".encode())
            finally:
                os.close(descriptor)
        except OSError as error:
            raise _failed(path, f"cannot be set to {step}", error) from None


def _failed(path: Path, what: str, error: OSError) -> InstrumentError:
    """Return what an error of a file of a backlight says of the device."""
    code = errno.errorcode.get(error.errno or 0, "")
    if isinstance(error, PermissionError):
        return InstrumentError(f"{path}: {UDEV_RULE}", Fault.NOT_FOUND, code)
    if error.errno in GONE:
        return InstrumentError(
            f"{path}: {what}: it is gone; was the panel unplugged, or its driver unloaded?",
            Fault.DISCONNECTED,
            code,
        )
    return InstrumentError(f"{path}: {what} ({error.strerror}); is the panel switched off?", code=code)


class SimulatedBacklight(AbstractContextManager["SimulatedBacklight"]):
    """A backlight with steps that follows what is set with a first-order lag.

    Parameters
    ----------
    clock : callable
        The window's clock [s].
    steps : int, optional
        How many there are above 0.
    time_constant : float, optional
        In which 63 % of a change is made [s].
    min_interval : float, optional
        Shortest time between two settings [s].
    follow : callable, optional
        Is told each factor that is set: a simulated panel, which the light comes from.

    >>> time = [0.0]
    >>> backlight = SimulatedBacklight(lambda: time[0], steps=100, time_constant=0.01)
    >>> backlight.set_factor(0.503)
    0.5
    >>> time[0] = 0.01
    >>> round(backlight.read_factor(), 3)  # 0.5 + 0.5 / e
    0.684
    """

    def __init__(
        self,
        clock: Callable[[], float],
        steps: int = 4095,
        time_constant: float = 0.005,
        min_interval: float = 0.01,
        follow: Callable[[float], None] | None = None,
    ) -> None:
        self._clock, self._steps, self._follow = clock, steps, follow
        self._time_constant, self._min_interval, self._closed = time_constant, min_interval, False
        self._start, self._target, self._set_at = 1.0, 1.0, clock()

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such factor.
        """
        if self._closed:
            raise InstrumentError("the simulated backlight: is closed", Fault.DISCONNECTED)
        require_factor(factor, self.smallest_factor(), "the simulated backlight")
        self._start, self._set_at = self.read_factor(), self._clock()
        self._target = max(1, round(factor * self._steps)) / self._steps
        if self._follow is not None:
            self._follow(self._target)
        return self._target

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""
        left = math.exp(-(self._clock() - self._set_at) / self._time_constant)
        return self._target + (self._start - self._target) * left

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""
        return 1 / self._steps

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""
        return 1 / self._steps

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._min_interval

    def close(self) -> None:
        """Leave the device as it was found; more than once does nothing."""
        if not self._closed:
            restore_and_release(lambda: self.set_factor(1.0), self._release)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _release(self) -> None:
        """Be set no more."""
        self._closed = True


def require_factor(factor: float, smallest: float, device: str) -> None:
    """Refuse a brightness factor that a backlight has not; nothing is clipped."""
    if not smallest - ROUNDING <= factor <= 1 + ROUNDING:
        raise InstrumentError(f"{device}: has factors from {smallest:.4g} to 1, got {factor:.6g}")
