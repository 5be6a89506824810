"""A driver that is tried: opened on what a package tries it on, or at its address."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from evenlight.hardware import rig
from evenlight.hardware.driver import SIMULATED, NamedDriver
from evenlight.hardware.guarded_devices import GUARDS
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

SEED = 5  # of the emulated instrument's noise
SETTLED = 0.05  # [s] ten times the lag of the panel's light
TOLERANCE = 0.05  # share: the worst class of meters


class BrokenPromiseError(AssertionError):
    """A driver does not do what all drivers promise; the message says what it did."""


def promised(holds: object, words: str) -> None:
    """Refuse a driver that did something else than it promised."""
    if not holds:
        raise BrokenPromiseError(words)


@dataclass(frozen=True, slots=True)
class Bench:
    """A device that is open, and what it looks at."""

    checked: Any  # its driver under guard, so that what it returns is known to be possible
    simulation: Simulation | None  # a warm white panel, in real time; None on a real instrument

    @property
    def device(self) -> Any:
        """The driver itself, unguarded."""
        return self.checked.unguarded()

    def show(self, share: float, kind: InstrumentKind) -> float | None:
        """Change the panel, and return its luminance [cd/m^2] or power [W]; None on a real instrument."""
        if self.simulation is None:
            return None
        panel = self.simulation.panel
        if kind is InstrumentKind.LUMINANCE:
            panel.show(share)
            return panel.luminance()
        panel.set_backlight(share)
        time.sleep(SETTLED)
        return panel.power()


@dataclass(frozen=True, slots=True)
class Subject:
    """A driver that is tried."""

    kind: InstrumentKind
    named: NamedDriver

    @property
    def emulated(self) -> bool:
        """Whether it is tried on its emulated instrument."""
        return self.named.emulated

    @contextmanager
    def bench(self) -> Iterator[Bench]:
        """Yield the driver, open; whoever asks closes it."""
        simulation = warm_white_panel() if self.emulated or self.named.name == SIMULATED else None
        seen = simulation or warm_white_panel()
        device = rig.guarded(
            GUARDS[self.kind], self.named, lambda named: self._opened(named, simulation), seen
        )
        with device.link:
            yield Bench(device, simulation)

    def _opened(self, named: NamedDriver, simulation: Simulation | None) -> Any:
        """Return the driver at its address, or the simulated device."""
        if self.kind is InstrumentKind.LUMINANCE:
            return rig.luminance_meter_of(named, time.monotonic, simulation, None)
        if self.kind is InstrumentKind.POWER:
            return rig.power_meter_of(named, time.monotonic, simulation)
        return rig.backlight_of(named, time.monotonic, simulation, curve_known=True)

    def use(self, device: Any, rate: float = 20.0) -> object:
        """Ask a device once what its kind is for."""
        if self.kind is InstrumentKind.LUMINANCE:
            return device.read_luminance()
        return device.start(rate) if self.kind is InstrumentKind.POWER else device.set_factor(0.5)


def warm_white_panel() -> Simulation:
    """Return a panel in real time; its luminance is 200 cd/m^2, and its power 0.2945 + 0.3716 W."""
    import numpy as np

    panel = SimulatedPanel(PanelPhysics(warm_up_share=0.0), time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(SEED), time.monotonic, time.sleep)


def refusal(ask: Callable[[], object], what: str, *faults: Fault) -> InstrumentError:
    """Return the error that something is refused with; it must be one of some faults, in one line."""
    try:
        returned = ask()
    except InstrumentError as error:
        require_told(error)
        promised(error.fault in faults, f"{what}: the fault is {error.fault.value}: {error}")
        return error
    except Exception as error:
        raise BrokenPromiseError(f"{what}: raised {type(error).__name__}: {error}") from error
    raise BrokenPromiseError(f"{what}: returned {returned!r:.80} in place of an error")


def require_told(error: InstrumentError) -> None:
    """Refuse an error that says nothing, or more than one line."""
    words = str(error)
    promised(words.strip() and "\n" not in words, f"an error must be one line of words, got {words!r}")
