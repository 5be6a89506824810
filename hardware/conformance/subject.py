"""A driver that is tried, what changes before it meanwhile, and how a broken promise is told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware import rig as rigs
from evenlight.hardware.driver import SIMULATED, NamedDriver
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.measuring import bench_for
from evenlight.hardware.protocols import Backlight, Fault, InstrumentError, Window
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel

GREY = 1 / 2.2  # exponent from a share of the light to a pixel value
WARM_WHITE = PanelPhysics(warm_up_share=0.0)  # 200 cd/m^2, 0.2945 + 0.3716 W
SHARES = PanelPhysics(1.0, 0.0, warm_up_share=0.0, lag=1e-9, base_power=0.0, power_per_luminance=1.0)
TOLERANCE = 0.015  # share of a simulated panel's light or power: what meters repeat, several times over,
FLOOR = {"cd/m^2": 0.02, "W": 0.005}  # and the last digits of a small value


class BrokenPromiseError(AssertionError):
    """A driver does not do what all drivers promise; the message says what it did."""


def promised(holds: object, words: str) -> None:
    """Refuse a driver that did something else than it promised."""
    if not holds:
        raise BrokenPromiseError(words)


class Screen(SimulatedPanel):
    """A rig's screen: what it shows, and when, is known as shares of its most light and power."""

    def __init__(self, window: Window, backlight: Backlight | None = None) -> None:
        super().__init__(SHARES, window.now)
        self._window, self._backlight, self.clock = window, backlight, window.now

    def show(self, pixel_value: float) -> None:
        """Show a grey from now on."""
        self._window.framebuffer().clear(pixel_value, pixel_value, pixel_value, 1.0)
        self._window.flip()
        super().show(pixel_value)

    def set_backlight(self, factor: float) -> None:
        """Take a share of the power: by the backlight, or by the pixels where it has none."""
        if self._backlight is None:
            self.show(factor**GREY)
        else:
            factor = self._backlight.set_factor(max(factor, self._backlight.smallest_factor()))
        super().set_backlight(factor)


@contextmanager
def opened_screen(rig: Rig, kind: InstrumentKind) -> Iterator[Screen]:
    """Yield the screen of a rig, white, for a meter of a kind."""
    from evenlight.hardware.rig_windows import open_window

    with ExitStack() as opened:
        window = open_window(rig, rehearsal=True)  # any rate will do: nothing moves
        opened.callback(window.close)
        backlight = rigs.open_backlight(rig, window.now) if kind is InstrumentKind.POWER else None
        screen = Screen(window, backlight and opened.enter_context(backlight))
        screen.show(1.0)
        yield screen


@dataclass(frozen=True, slots=True)
class Bench:
    """A device that is open, and what it measures or dims."""

    subject: Subject
    checked: Any  # its driver under guard, so that what it returns is known to be possible
    panel: SimulatedPanel | None  # None where nothing is known of what it measures
    clock: Callable[[], float] = time.monotonic  # [s]
    wait: Callable[[float], None] = time.sleep  # [s]

    @property
    def device(self) -> Any:
        """The driver itself, unguarded."""
        return self.checked.unguarded()

    @property
    def exact(self) -> SimulatedPanel | None:
        """The panel, if its light and power are known in their units."""
        return None if isinstance(self.panel, Screen) else self.panel

    def require_near(self, value: float, true: float, unit: str) -> None:
        """Refuse a value that a simulated panel does not have."""
        near = not self.exact or abs(value - true) <= TOLERANCE * true + FLOOR[unit]
        promised(near, f"gave {value:.5g} {unit} where the panel has {true:.5g} {unit}")


@dataclass(frozen=True, slots=True)
class Subject:
    """A driver that is tried."""

    kind: InstrumentKind
    named: NamedDriver
    screen: Screen | None = None  # that an instrument at an address looks at, or feeds

    @property
    def simulated(self) -> bool:
        """Whether it looks at a simulated panel."""
        return self.named.emulated or self.named.name == SIMULATED

    @contextmanager
    def bench(self) -> Iterator[Bench]:
        """Yield the driver, open."""
        seen = bench_for(f"{SIMULATED}:" * self.named.emulated + self.named.name, WARM_WHITE)
        clock = self.screen.clock if self.screen else seen.clock
        opened = partial(rigs.device_of, kind=self.kind, clock=clock, simulation=seen.simulation)
        with rigs.guarded(self.kind, self.named, opened, seen.simulation) as device:
            panel = seen.simulation.panel if seen.simulation else self.screen
            yield Bench(self, device, panel, clock, seen.wait)


def refusal(ask: Callable[[], object], what: str, *faults: Fault) -> InstrumentError:
    """Return the error that something is refused with; it must be one of some faults, in one line."""
    try:
        returned = ask()
    except InstrumentError as error:
        words = str(error)
        promised(words.strip() and "\n" not in words, f"an error must be one line of words, got {words!r}")
        promised(error.fault in faults, f"{what}: the fault is {error.fault.value}: {error}")
        return error
    except Exception as error:
        raise BrokenPromiseError(f"{what}: raised {type(error).__name__}: {error}") from error
    raise BrokenPromiseError(f"{what}: returned {returned!r:.80} in place of an error")
