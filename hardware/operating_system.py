"""What Linux and macOS have and Windows has not: devices that need it say so in one line there."""

from __future__ import annotations

import os

from evenlight.hardware.protocols import Fault, InstrumentError

HAS_UNIX = hasattr(os, "openpty")  # pipes to wait at, named pipes, pseudo-terminals, groups of processes


def require_unix(name: str) -> None:
    """Refuse a device on a system that cannot have it.

    Raises
    ------
    InstrumentError
        NOT_FOUND on Windows, with the `name` of the device.
    """
    if not HAS_UNIX:
        raise InstrumentError(f"{name}: works on Linux and macOS only", Fault.NOT_FOUND)
