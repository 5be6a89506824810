"""The backlight of the computer's own panel on Linux."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.hardware.backlights import SteppedBacklight
from evenlight.hardware.drivers.device_lock import DeviceLock
from evenlight.hardware.protocols import Fault, InstrumentError

SYSFS = Path("/sys/class/backlight")
NUMBER = re.compile(r"-?\d{1,9}")
GONE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
UDEV_RULE = (
    'may not be written; as root, add the udev rule SUBSYSTEM=="backlight", ACTION=="add", '
    'RUN+="/bin/chgrp video /sys/class/backlight/%k/brightness", '
    'RUN+="/bin/chmod g+w /sys/class/backlight/%k/brightness", join the group video, and restart'
)


class SysfsBacklight(SteppedBacklight):
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
        If its steps are not linear in light.
    InstrumentError
        If there is no such backlight, it may not be set, it fails, has no steps, or another program uses it.
    """

    def __init__(
        self, name: str, root: Path = SYSFS, min_interval: float = 0.01, *, curve_known: bool = False
    ) -> None:
        self._folder = root / name
        self._name, self._min_interval = str(self._folder), min_interval
        if not (self._folder / "max_brightness").is_file():
            names = sorted(path.name for path in root.glob("*")) if root.is_dir() else []
            raise InstrumentError(
                f"{self._folder}: no such backlight; there is {', '.join(names) or 'none'} on this computer",
                Fault.NOT_FOUND,
            )
        scale = self._folder / "scale"
        if not curve_known and scale.is_file() and scale.read_text(encoding="utf-8").strip() == "non-linear":
            raise InputError(
                f"{self._folder}: its steps are not linear in light, so they are no brightness factors; name "
                "their measured curve as `backlight_curve`, or let pixels make the brightness"
            )
        self._lock = DeviceLock(self._folder / "max_brightness", self._name)
        try:
            self._steps = self._read("max_brightness")
            if self._steps < 1:
                raise InstrumentError(f"{self._folder}: says that its brightness has no steps")
            self._found = self._possible(self._read("brightness"))
            self._write(self._found)  # fails at once where it may not be set
        except BaseException:
            self._release()
            raise

    def _set(self, step: int) -> None:
        self._write(step)
        if (taken := self._read("brightness")) != step:
            raise InstrumentError(f"{self._folder}: was set to step {step}, and took {taken}")

    def _read_step(self) -> int:
        # Not actual_brightness: drivers have another scale there, what they make of this, or 0 while the
        # screen is blank (systemd reads it no more: its pull request 36881).
        return self._read("brightness")

    def _release(self) -> None:
        self._lock.release()

    def _read(self, name: str) -> int:
        path = self._folder / name
        try:
            text = path.read_bytes().decode("ascii", errors="replace").partition("\n")[0].strip()
        except OSError as error:
            raise _failed(path, "cannot be read", error) from None
        if not NUMBER.fullmatch(text):
            raise InstrumentError(f"{path}: expected a whole number, got {text[:60]!r}", Fault.GARBLED)
        return int(text)

    def _write(self, step: int) -> None:
        path = self._folder / "brightness"
        try:
            # Not Path.write_text: the file is never to be made, only written to. Cut after the step, not
            # before it, so that an emulated file's first line is a step at any moment. Linux ignores the
            # cut of its own, and reads one write as one number (`kstrtoul` of base 0: no padding).
            descriptor = os.open(path, os.O_WRONLY)
            try:
                os.ftruncate(descriptor, os.write(descriptor, f"{step}\n".encode()))
            finally:
                os.close(descriptor)
        except OSError as error:
            raise _failed(path, f"cannot be set to {step}", error) from None


def _failed(path: Path, what: str, error: OSError) -> InstrumentError:
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
