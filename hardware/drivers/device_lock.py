"""Locks that keep two programs from one backlight: on the device's own file, so that nothing is left over.

A lock ends with its process, however that ends, and holds for all users: the file is only opened to read.
Windows has no such locks; a backlight is not locked there.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from evenlight.hardware.protocols import Fault, InstrumentError

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None  # type: ignore[assignment] # where there is none

LOCKS = Path("/proc/locks")  # Linux's list: number, kind, mode, access, process, device and inode, range


class DeviceLock:
    """A lock on a device, held until it is released or the process ends.

    Parameters
    ----------
    file : Path
        Of the device; where it cannot be opened there is no lock, and whoever reads it says why.
    device : str
        The device, as messages name it.

    Raises
    ------
    InstrumentError
        BUSY if it is locked, with the process that holds it where Linux tells.
    """

    def __init__(self, file: Path, device: str) -> None:
        self._descriptor = -1
        with contextlib.suppress(OSError):
            self._descriptor = os.open(file, os.O_RDONLY)
        if fcntl is None or self._descriptor < 0:
            return
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = _holder(os.fstat(self._descriptor))
            self.release()
            raise InstrumentError(f"{device}: is in use by {holder}; end that first", Fault.BUSY) from None

    def release(self) -> None:
        """Let go of the device; more than once does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _holder(file: os.stat_result) -> str:
    place = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
    with contextlib.suppress(OSError):
        for line in LOCKS.read_text(encoding="utf-8").splitlines():
            words = line.split()
            if place in words and words[1] == "FLOCK" and words[4].isdecimal():
                if int(words[4]) == os.getpid():
                    return "this program already"
                return f"process {words[4]} ({_name_of(words[4])})"
    return "another program"


def _name_of(process: str) -> str:
    try:
        return Path("/proc", process, "comm").read_text(encoding="utf-8").strip()
    except OSError:  # Linux may hide those of other users
        return "of another user"
