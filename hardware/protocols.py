"""What is asked of devices: window, keys, backlight, meters. Drivers are handed in by `hardware.rig`."""

from __future__ import annotations

import enum
import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

from evenlight.data_schema.arguments import real, text
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.printed import in_one_line

if TYPE_CHECKING:  # every command imports this module, and shows its help without numpy
    import moderngl
    import numpy as np
    from numpy.typing import NDArray

    from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
    from evenlight.hardware.presentation.headset_views import HeadsetFrame


class Fault(enum.Enum):
    """What went wrong with a device."""

    NOT_FOUND = "not_found"  # no such port, file or program
    BUSY = "busy"  # another program holds it
    WRONG_INSTRUMENT = "wrong_instrument"  # what answers is another instrument
    NO_REPLY = "no_reply"
    GARBLED = "garbled"  # a reply, or a part of one, that cannot be read
    IMPLAUSIBLE = "implausible"  # a reply that can be read, and says what cannot be
    DISCONNECTED = "disconnected"
    OVER_RANGE = "over_range"
    UNDER_RANGE = "under_range"
    LOW_BATTERY = "low_battery"
    REFUSED = "refused"  # the instrument's own error, or a value that it does not have


# what may be right at the next try, over the same link
TRANSIENT = (Fault.NO_REPLY, Fault.GARBLED, Fault.IMPLAUSIBLE)


class InstrumentError(RuntimeError):
    """A device did not do what was asked of it; the message names the device and its own reason.

    Attributes
    ----------
    fault : Fault
        What went wrong.
    code : str
        The instrument's own code for it; empty where it gave none.
    """

    def __init__(self, message: str, fault: Fault = Fault.REFUSED, code: str = "") -> None:
        super().__init__(in_one_line(message))
        self.fault, self.code = fault, code


@dataclass(frozen=True, slots=True)
class Reading:
    """One value that an instrument measured."""

    value: float  # the value, as the instrument gave it: never clipped, never a stand-in for one that failed
    unit: str  # its unit: "cd/m^2" or "W"
    # right before the instrument was asked, and right after it had answered, on the computer's clock [s]
    begun: float
    ended: float
    status: str = ""  # the instrument's own word or code on the reading, e.g. "OK00"
    chromaticity: tuple[float, float] | None = None  # CIE 1931 x and y, of instruments that measure them

    def __post_init__(self) -> None:
        for name in ("value", "begun", "ended"):
            real(name, getattr(self, name))
        text("unit", self.unit)
        text("status", self.status)
        if self.chromaticity is not None:
            if not (isinstance(self.chromaticity, tuple) and len(self.chromaticity) == 2):
                raise InputError(f"chromaticity must be two numbers, x and y, got {self.chromaticity!r}")
            for value in self.chromaticity:
                real("chromaticity", value)


@dataclass(frozen=True, slots=True)
class KeyPress:
    """A key that was pressed."""

    name: str  # its name, as in `data_schema.rig.Keys`
    time: float  # when, on the clock of the window that the device belongs to [s]


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
        """Show the back buffer, and return when it appeared, or in a headset will appear [s]."""

    def due(self, period: float) -> float:
        """Return when what is drawn now will appear [s].

        On a screen of some refresh period [s] that is a whole number of them after the last flip; in a
        headset it is when the runtime says.
        """

    def eyes(self) -> HeadsetFrame | None:
        """Return the views of the frame that is being drawn, of a headset; None of a screen."""

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


class ContextManaged(Protocol):
    """A device that is closed at the end of its context."""

    def __enter__(self) -> Self:
        """Return the device, open."""

    def __exit__(self, *_: object) -> None:
        """Close it."""

    def close(self) -> None:
        """Let go of the device; more than once does nothing."""


class Backlight(ContextManaged, Protocol):
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


class LuminanceMeter(ContextManaged, Protocol):
    """A spot meter aimed at the display.

    A luminance or power meter whose zero is set by command has besides `before_zero`, what the person at the
    bench does first, as an imperative, and `zero()`, which takes what is there now for zero and returns what
    it was, where the instrument tells it [A].
    """

    def read_luminance(self) -> Reading:
        """Return one reading [cd/m^2].

        Raises
        ------
        InstrumentError
            If there is none; the link is then fit for the next, or closed for good.
        """

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself: model, serial number, firmware, settings."""


class PowerMeter(ContextManaged, Protocol):
    """An instrument that samples the power of a panel."""

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return the one achieved: the nearest that it has.

        Raises
        ------
        InstrumentError
            If the rate is outside what the instrument has, or it refuses.
        """

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call, in order; return at once.

        Raises
        ------
        InstrumentError
            If the link is broken, or nothing came for far longer than the rate says.
        """

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""

    def ping(self) -> ClockPing | None:
        """Return one comparison of the instrument's clock with the computer's; also while it samples.

        None where the samples carry the computer's own time.
        """

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself: model, serial number, firmware, settings."""


class TriggerOutput(ContextManaged, Protocol):
    """What tells another recorder (EEG, eye tracker, oscilloscope) that something is shown."""

    def send(self, code: int, label: str) -> None:
        """Send a trigger, a code of 1 to 255 or its label, and return at once: the next frame is to be drawn.

        Raises
        ------
        InstrumentError
            If the device does not take it.
        """

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""


class ContextDevice:
    """What all drivers and simulated devices share: a context closes them, and closed they refuse to work."""

    _name: str  # as messages name the device
    _closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the device; more than once does nothing."""
        self._closed = True

    def _require_open(self) -> None:
        if self._closed:
            raise self._error("is closed", Fault.DISCONNECTED)

    def _error(self, words: str, fault: Fault = Fault.REFUSED, code: str = "") -> InstrumentError:
        return InstrumentError(f"{self._name}: {words}", fault, code)


class Instrument(ContextDevice):
    """A driver of ours, of an instrument at an address.

    Parameters
    ----------
    address : str
        Where the instrument is, as `evenlight measure list` has it, without the driver's name.
    clock : callable, optional
        The computer's clock, of readings and samples [s]; time-outs go by the computer's own.
    timeout : float, optional
        How long an answer may take, in place of what the instrument needs [s].

    Raises
    ------
    InputError
        If that is no address of such an instrument, or a library is not installed.
    InstrumentError
        If it is not there, or does not answer as it should; nothing is left open then.
    """

    longest: ClassVar = 5.0  # [s] that an answer may take

    def __init__(
        self, address: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        self._clock, self._timeout = clock, self.longest if timeout is None else timeout
        self._open(address)

    @abstractmethod
    def _open(self, address: str) -> None:
        """Find the instrument, and get it ready."""
