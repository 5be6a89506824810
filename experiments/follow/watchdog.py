"""A process of its own that sets a backlight back if the program that dims it is killed.

It waits at a pipe. "done" says that the backlight was left as it was found; an end without it, which is what
the system makes of a killed program's pipe, says that it was not. By then the lock on the device has ended. A
number before that is the brightness to bring back in place of what was found: its user's, set meanwhile.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware.protocols import Backlight, Fault, InstrumentError
from evenlight.hardware.rig import is_simulated, open_backlight

DONE = b"done"
TRIES, PAUSE = 600, 0.1  # [s] between: the system frees a device of the dead, a monitor is switched on


class BrightnessWatchdog:
    """Watches over a backlight, found at some factor, from before its first setting until `done`.

    Raises
    ------
    InstrumentError
        If it does not start, so that nothing may be set.
    """

    def __init__(self, backlight: str, curve: str, found: float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, backlight, curve, repr(found)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C and the end of the terminal are not meant for it
        )  # fmt: skip
        assert self._process.stdout is not None
        if not self._process.stdout.readline():
            raise InstrumentError("what would bring the brightness back has ended: nothing is dimmed")

    def bring_back(self, factor: float) -> None:
        """Bring back this factor, in place of what was found or said before."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # somebody has ended it
            self._process.stdin.write(f"{factor!r}\n".encode())
            self._process.stdin.flush()

    def done(self) -> None:
        """Let it go: the backlight is as it was found."""
        with contextlib.suppress(OSError):  # somebody has ended it
            self._process.communicate(DONE)


@contextlib.contextmanager
def watched_backlight(backlight: str, curve: str) -> Iterator[Backlight]:
    """Yield a backlight, open, that is left as it was found whatever happens to this program.

    It is named, as its curve, like those of a rig; the curve is empty if the backlight is linear in light.
    """
    with _opened(backlight, curve) as device:
        if is_simulated(backlight):  # nothing is left of it when the program ends
            yield device
            return
        watchdog = BrightnessWatchdog(backlight, curve, device.read_factor())
        try:
            yield device
        finally:
            device.close()
            watchdog.done()


def kept_backlight(backlight: str, curve: str) -> tuple[Backlight, BrightnessWatchdog]:
    """Return a backlight, open, and what brings its brightness back when this program ends, however it does.

    It is not to be closed, which would bring back what it was found at, whatever its user has set since.
    """
    device = _opened(backlight, curve)
    return device, BrightnessWatchdog(backlight, curve, device.read_factor())


def require_backlight(backlight: str, curve: str) -> None:
    """Refuse one that cannot be opened, but for one that a program uses already: of a service, maybe this."""
    try:
        _opened(backlight, curve).close()
    except InstrumentError as error:
        if error.fault is not Fault.BUSY:
            raise


def _opened(backlight: str, curve: str) -> Backlight:
    try:
        rig = Rig("follow", "of the track", 0.6, 60.0, backlight=backlight, backlight_curve=curve)
    except ValueError:  # whose words are a pattern
        raise InputError(
            f"--backlight {backlight.rstrip(':')}: give DRIVER:ADDRESS, such as sysfs:intel_backlight "
            "or, for I2C bus 5, ddc:5; `evenlight measure list` shows those of this computer"
        ) from None
    device = open_backlight(rig, time.monotonic)
    if device is None:
        raise InputError("--backlight none: there is nothing that could follow; name a backlight")
    return device


def restore(backlight: str, curve: str, found: float) -> None:
    """Set a backlight to the factor that it had been found at, and leave it there."""
    device = _retried(lambda: _opened(backlight, curve))
    _retried(lambda: device.set_factor(max(found, device.smallest_factor())))
    # It is not closed, which would bring back what the killed program had set.


def _retried(attempt: Callable[[], Any]) -> Any:
    """Return what an attempt gives, at the last if need be."""
    for _ in range(TRIES - 1):
        with contextlib.suppress(InstrumentError):
            return attempt()
        time.sleep(PAUSE)
    return attempt()


if __name__ == "__main__":
    for name in ("SIGTERM", "SIGINT", "SIGHUP"):  # systemd sends them to all processes of a service
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    print("ready", flush=True)
    said = sys.stdin.buffer.read()
    if not said.endswith(DONE):
        restore(sys.argv[1], sys.argv[2], float((said.split() or [sys.argv[3]])[-1]))
        os._exit(0)  # devices are not closed on the way out
