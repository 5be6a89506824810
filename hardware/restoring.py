"""Leaving a device as it was found: what happens when that fails."""

from __future__ import annotations

import sys
from collections.abc import Callable

from evenlight.hardware.protocols import InstrumentError


def restore_and_release(restore: Callable[[], object], release: Callable[[], None]) -> None:
    """Put a device back to how it was found, and let go of it in any case.

    A device that cannot be put back stands where nobody expects it, so that is an error once all is released.
    But where another exception is on its way already, that is the one to tell, and this one becomes a note of
    it. Whoever calls this from `finally`, `with` or a stack of callbacks need not tell the two apart.

    Parameters
    ----------
    restore : callable
        Puts the device back.
    release : callable
        Lets go of it.

    Raises
    ------
    InstrumentError
        If the device cannot be put back, and no exception is being handled.

    >>> restore_and_release(lambda: print("back to full"), lambda: print("closed"))
    back to full
    closed
    """
    under_way = sys.exception()
    try:
        restore()
    except InstrumentError as error:
        if under_way is None:
            raise
        under_way.add_note(f"And it could not be left as it was found: {error}")
    finally:
        release()
