"""The backlight of a monitor, over DDC/CI: slow, in steps of about 1 %, and not always honest.

The library `monitorcontrol` frames the messages. Three things are not left to its version 4.2: it keeps no
time between messages (it subtracts the last one's time where it means to add it), it takes replies whose
checksum is wrong, and told not to, it refuses those whose checksum is right (see `checksum`). The driver was
tested against an emulated monitor that speaks DDC/CI, not against monitors.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import operator
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evenlight.hardware.backlights import SteppedBacklight
from evenlight.hardware.drivers.device_lock import DeviceLock
from evenlight.hardware.protocols import Fault, InstrumentError

BRIGHTNESS = 0x10  # VCP code "luminance"
CONTRAST = 0x12  # VCP code "contrast": any answer to it differs from one to BRIGHTNESS
REPLY_TO = 0x50  # the host's address as a reply's checksum begins with it, DDC/CI 1.1
HOST = 0x51  # as it begins what is sent
COMMAND_INTERVAL = 0.05  # [s] between two messages, DDC/CI 1.1
LONGEST = 64  # bytes: more than any message has
REPLY_DELAY = 0.04  # [s] that the library gives the monitor for a reply, DDC/CI 1.1
GONE = (errno.ENODEV, errno.EBADF, errno.EPIPE, errno.ECONNRESET)  # the bus is no longer there
UNANSWERED = (
    errno.ENXIO,
    getattr(errno, "EREMOTEIO", errno.EIO),  # Linux alone has it
    errno.EAGAIN,
    errno.EIO,
    errno.ETIMEDOUT,
)  # nothing at the address
INSTALL = "the library monitorcontrol is not installed: pip install '.[instruments]' in the checkout"


class DdcBacklight(SteppedBacklight):
    """A monitor that is set over DDC/CI.

    Parameters
    ----------
    number : int
        On Linux, that of its I2C bus: 5 for /dev/i2c-5. Elsewhere, its place in the library's list, from 0.
    clock : callable, optional
        For the time between messages [s].
    wait : callable, optional
        Waits for some time [s].
    panel : optional
        The library's control of a monitor (`LinuxVCP` or one like it), in place of the number's.
    bus : Path, optional
        The file of its I2C bus, which is locked; on Linux the number's.

    Raises
    ------
    InstrumentError
        If there is no such monitor, it may not be opened, does not answer, or has no brightness to set.
    """

    _min_interval = 2 * COMMAND_INTERVAL + REPLY_DELAY  # each setting is read back

    def __init__(
        self,
        number: int,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
        panel: Any = None,
        bus: Path | None = None,
    ) -> None:
        self._name = f"monitor ddc:{number}"
        self._clock, self._wait, self._next, self._in_doubt = clock, wait, -float("inf"), False
        control = panel if panel is not None else _control(number, self._name)
        control.CHECKSUM_ERRORS, control.get_checksum = "strict", checksum
        self._attempt(control.__enter__)
        self._control: Any = control
        self._lock: DeviceLock | None = None
        try:
            if bus is not None or (panel is None and sys.platform.startswith("linux")):
                self._lock = DeviceLock(bus or Path(f"/dev/i2c-{number}"), self._name)
            self._found, self._steps = self._ask(BRIGHTNESS)
            if self._steps < 1:
                raise self._error("says that its brightness has no steps")
        except BaseException:
            self._release()
            raise

    def _set(self, step: int) -> None:
        control = self._open_control()
        self._pace()
        self._attempt(lambda: control.set_vcp_feature(BRIGHTNESS, step))
        if (taken := self._read_step()) != step:
            raise self._error(
                f"was set to step {step}, and says {taken}; does a power saving or ambient "
                "light mode of its menu hold the brightness?"
            )

    def _read_step(self) -> int:
        step, steps = self._ask(BRIGHTNESS)
        if steps != self._steps:
            raise self._error(f"says that it has {steps} steps, and said {self._steps} before", Fault.GARBLED)
        return step

    def _ask(self, code: int) -> tuple[int, int]:
        """Return the value of a VCP code, and the highest that it may have."""
        control = self._open_control()
        if self._in_doubt:
            self._resynchronise()
        self._pace()
        try:
            value, highest = self._attempt(lambda: control.get_vcp_feature(code))
        except InstrumentError:
            self._in_doubt = True
            raise
        if value > highest:
            raise self._error(f"says step {value} of {highest}, which is no answer", Fault.GARBLED)
        return value, highest

    def _resynchronise(self) -> None:
        """Read away what may still come, and go on only when the monitor answers what is asked."""
        from monitorcontrol.vcp import VCPError

        control = self._open_control()
        self._pace()
        if hasattr(control, "read_bytes"):  # Windows reads and forgets by itself
            with contextlib.suppress(VCPError, OSError):  # nothing was waiting
                control.read_bytes(LONGEST)
        self._pace()
        try:
            self._attempt(lambda: control.get_vcp_feature(CONTRAST))
        except InstrumentError as error:
            if not error.code:  # a monitor without contrast has answered, too
                raise
        self._in_doubt = False

    def _pace(self) -> None:
        if (due := self._next - self._clock()) > 0:
            self._wait(due)

    def _attempt(self, message: Callable[[], Any]) -> Any:
        from monitorcontrol.vcp import VCPError

        try:
            return message()
        except (VCPError, OSError, struct.error) as error:
            raise self._fault(error) from None
        finally:
            self._next = self._clock() + COMMAND_INTERVAL

    def _fault(self, error: Exception) -> InstrumentError:
        cause = error.__cause__ if isinstance(error.__cause__, OSError) else error
        number = getattr(cause, "errno", None)
        if isinstance(cause, PermissionError):
            return self._error(
                "may not be opened; on Linux, join the group i2c and log in again", Fault.NOT_FOUND
            )
        if isinstance(cause, FileNotFoundError):
            return self._error(
                "no such I2C bus; on Linux load the module i2c-dev, and see with "
                "`evenlight measure list` which there are",
                Fault.NOT_FOUND,
            )
        if number in GONE:
            self._release()
            return self._error(f"the connection broke ({cause})", Fault.DISCONNECTED)
        if number in UNANSWERED:
            return self._error(
                "no reply; is it switched on, and is DDC/CI enabled in its menu?", Fault.NO_REPLY
            )
        if "Unsupported VCP code" in str(error):
            return self._error(
                "has no brightness that is set over DDC/CI (Unsupported VCP code)",
                code="Unsupported VCP code",
            )
        return self._error(f"sent what is no reply ({error})", Fault.GARBLED)

    def _require_open(self) -> None:
        self._open_control()

    def _open_control(self) -> Any:
        if self._control is None:
            raise self._error("is no longer connected", Fault.DISCONNECTED)
        return self._control

    def _release(self) -> None:
        control, self._control = getattr(self, "_control", None), None
        if control is not None:
            try:
                control.__exit__(None, None, None)
            except Exception:  # the library's own; a bus that is gone may not even close
                control.fd = None
        if (lock := getattr(self, "_lock", None)) is not None:
            lock.release()


def checksum(data: bytes) -> int:
    """Return the checksum of a message that the library sends, or of a reply without its own.

    Both begin with the monitor's address 0x6E. A reply's sum begins with the host's virtual address, which
    version 4.2 of the library leaves out.

    >>> hex(checksum(bytes.fromhex("6e 88 02 00 10 00 00 64 00 32")))  # brightness 50 of 100
    '0xf2'
    >>> hex(checksum(bytes.fromhex("6e 51 82 01 10")))  # the question that it answers
    '0xac'
    """
    sent = len(data) > 1 and data[1] == HOST
    return functools.reduce(operator.xor, data, 0 if sent else REPLY_TO)


def _control(number: int, name: str) -> Any:
    try:
        if sys.platform.startswith("linux"):
            from monitorcontrol.vcp.vcp_linux import LinuxVCP

            return LinuxVCP(number)
        from monitorcontrol.vcp import get_vcps
    except ImportError:
        raise InstrumentError(f"{name}: {INSTALL}", Fault.NOT_FOUND) from None
    controls = get_vcps()
    if not 0 <= number < len(controls):
        raise InstrumentError(f"{name}: there are {len(controls)} monitors, from 0", Fault.NOT_FOUND)
    return controls[number]
