"""What a session needs of its devices: window, keys, backlight. Drivers are handed in by `hardware.rig`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # every command imports this module, and shows its help without numpy
    import moderngl
    import numpy as np
    from numpy.typing import NDArray


class InstrumentError(RuntimeError):
    """A device did not do what was asked of it; the message names the device and its own reason."""


@dataclass(frozen=True, slots=True)
class KeyPress:
    """A key that was pressed.

    Attributes
    ----------
    name : str
        Its name, as in `data_schema.rig.Keys`.
    time : float
        When, on the clock of the window that the device belongs to [s].
    """

    name: str
    time: float


class Window(Protocol):
    """A window whose back buffer is drawn with moderngl and shown by `flip`."""

    def size(self) -> tuple[int, int]:
        """Return width and height of the drawable area [pixels]."""

    def bits(self) -> int:
        """Return the bits of each colour channel of what is shown."""

    def now(self) -> float:
        """Return the time on the window's clock [s]."""

    def context(self) -> moderngl.Context:
        """Return the graphics context."""

    def framebuffer(self) -> moderngl.Framebuffer:
        """Return the back buffer, ready to be drawn to."""

    def flip(self) -> float:
        """Show the back buffer, and return when it appeared [s]."""

    def read_codes(self, size: tuple[int, int] | None = None) -> NDArray[np.int64]:
        """Return the codes drawn to the back buffer before the next flip, (height, width, 3), row 0 on top.

        `size` takes a centred part of that width and height instead of the whole.
        """

    def apparatus(self) -> dict[str, str]:
        """Return what window and driver say of themselves: versions, renderer, measured refresh rate."""

    def close(self) -> None:
        """Close the window."""


class ResponseDevice(Protocol):
    """Keys, or buttons that act as keys."""

    def pressed(self) -> list[KeyPress]:
        """Return the keys pressed since the last call, in order; return at once."""

    def clear(self) -> None:
        """Forget what was pressed until now."""

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""

    def close(self) -> None:
        """Let go of the device."""


class Pointer(Protocol):
    """A mouse, or what moves like one."""

    def moved(self) -> tuple[float, float]:
        """Return how far it moved since the last call, to the right and up [pixels]; return at once."""

    def close(self) -> None:
        """Let go of the device."""


class HeldKeys(Protocol):
    """Which keys are down, for movement that lasts as long as they are."""

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are down now."""

    def close(self) -> None:
        """Let go of the device."""


class Backlight(Protocol):
    """A backlight whose brightness factor is set."""

    def set_factor(self, factor: float) -> float:
        """Set the brightness factor b, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such factor, or refuses.
        """

    def read_factor(self) -> float:
        """Return the brightness factor that the device reports."""

    def smallest_factor(self) -> float:
        """Return the lowest brightness factor above 0."""

    def step(self) -> float:
        """Return the distance between two neighbouring factors."""

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""

    def close(self) -> None:
        """Leave the device as it was found."""
