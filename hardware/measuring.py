"""Readings at the bench: luminance one by one, power over some seconds, and the zero of a meter."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import MeterReading, PowerSample
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.hardware.driver import SIMULATED, Driver, NamedDriver, named_driver
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver, known_drivers
from evenlight.hardware.power_average import PowerAverage, averaged, sampled
from evenlight.hardware.protocols import Reading
from evenlight.hardware.rig import is_simulated, open_luminance_meter, open_power_meter
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

WARM = 3600.0  # [s] since a simulated panel was switched on: nine times its warm-up time
SEED = 1  # of simulated noise
SHOWN_EVERY = 1.0  # [s]
SAVED_EVERY = 0.25  # [s] samples are brought to the disk
ShowLine = Callable[[str], None]
OFF = PanelPhysics(peak_luminance=0.0, black_level=0.0, base_power=0.0, power_per_luminance=0.0)


@dataclass(frozen=True, slots=True)
class Bench:
    """Time, and what simulated instruments look at."""

    clock: Callable[[], float]  # the computer's clock [s]
    wait: Callable[[float], None]  # waits for some time [s]
    simulation: Simulation | None  # a warm white panel; None where the instrument is a real one
    timed: bool  # whether time is the world's

    def utc(self) -> str:
        """Return the time of day; empty where time passes only while the program waits."""
        return datetime.now(UTC).isoformat(timespec="milliseconds") if self.timed else ""


def bench_for(name: str, panel: PanelPhysics | None = None) -> Bench:
    """Return the bench for an instrument: waiting takes no time where the instrument is in this process.

    `panel` is what a simulated instrument looks at, white; else one of 200 cd/m^2.
    """
    panel = panel or PanelPhysics()
    if name == SIMULATED:
        waiting = WaitingClock()
        waiting.wait(WARM)
        return Bench(waiting.now, waiting.wait, _simulation(panel, waiting.now, waiting.wait), timed=False)
    if not is_simulated(name):
        return Bench(time.monotonic, time.sleep, None, timed=True)
    begun = time.monotonic()

    def since_switched_on() -> float:
        return time.monotonic() - begun + WARM

    simulation = _simulation(panel, since_switched_on, time.sleep)
    return Bench(since_switched_on, time.sleep, simulation, timed=True)


def measure_luminance(name: str, count: int, interval: float, out: Path | None, show: ShowLine) -> str:
    """Read a luminance meter some times, and return the closing line.

    Parameters
    ----------
    name : str
        The instrument.
    count : int
        How many readings.
    interval : float
        From the begin of one to that of the next, if the meter is fast enough [s].
    out : Path or None
        A new table of `MeterReading`.
    show : callable
        Shows a line for each reading.
    """
    bench = bench_for(name)
    with ExitStack() as stack:
        rows = _rows(stack, out, MeterReading)
        meter = stack.enter_context(open_luminance_meter(name, bench.clock, bench.simulation))
        _introduce(meter.apparatus(), show)
        readings: list[Reading] = []
        for index in range(1, count + 1):
            if readings:
                bench.wait(max(0.0, readings[-1].begun + interval - bench.clock()))
            reading = meter.read_luminance()
            readings.append(reading)
            rows([_row(index, reading, readings[0].begun, name, bench.utc())])
            show(_shown(index, reading, readings[0].begun))
    return _closing([reading.value for reading in readings], name)


def measure_power(name: str, seconds: float, rate: float | None, out: Path | None, show: ShowLine) -> str:
    """Average the power of a meter over some seconds, and return the closing line.

    Parameters
    ----------
    name : str
        The instrument.
    seconds : float
        How long [s].
    rate : float or None
        Samples each second [Hz]; None for those that the driver is for.
    out : Path or None
        A new table of `PowerSample`.
    show : callable
        Shows the mean so far, once a second.
    """
    if rate is None:
        rate = find_driver(name, InstrumentKind.POWER).driver.sample_rate
    if rate <= 0 or seconds * rate < 2:
        raise InputError(
            f"an average needs at least 2 samples; {seconds:g} s at {rate:g} Hz have {seconds * rate:g}: "
            "give more --seconds or --rate-hz"
        )
    if out and is_simulated(name) and SIMULATED not in out.name:
        raise InputError(
            f"--out {out}: these samples are simulated, so their file says so: simulated-{out.name}"
        )
    bench = bench_for(name)
    with ExitStack() as stack:
        rows = _rows(stack, out, PowerSample)
        meter = stack.enter_context(open_power_meter(name, bench.clock, bench.simulation))
        _introduce(meter.apparatus(), show)
        begun = bench.clock()
        achieved = meter.start(rate)
        show(f"{achieved:g} samples a second" + ("" if achieved == rate else f" instead of {rate:g}"))
        log = _SampleLog(rows, show, bench.clock)
        try:
            for samples in sampled(meter, seconds, achieved, bench.clock, bench.wait):
                log.add(samples)
        finally:
            log.keep()
        ended = bench.clock()
    average = averaged(log.samples, begun=begun, ended=ended, seconds=seconds, sample_rate=achieved)
    return _average_line(average, name)


class _SampleLog:
    """The samples of a power meter so far, brought to the disk and summed up on the screen now and then."""

    def __init__(
        self, rows: Callable[[Iterable[Any]], None], show: ShowLine, clock: Callable[[], float]
    ) -> None:
        self._rows, self._show, self._clock = rows, show, clock
        self.samples: list[PowerSample] = []
        self._kept, self._sum = 0, 0.0
        self._begun = self._kept_at = self._shown_at = clock()

    def add(self, samples: Iterable[PowerSample]) -> None:
        """Take in the samples that came."""
        for sample in samples:
            self.samples.append(sample)
            self._sum += sample.power
        now = self._clock()
        if now - self._kept_at >= SAVED_EVERY:
            self._kept_at = now
            self.keep()
        if now - self._shown_at >= SHOWN_EVERY and self.samples:
            self._shown_at = now
            mean, count = self._sum / len(self.samples), len(self.samples)
            self._show(f"{now - self._begun:7.1f} s  {mean:.4f} W  mean so far, {count} samples")

    def keep(self) -> None:
        """Bring what came to the disk."""
        new, self._kept = self.samples[self._kept :], len(self.samples)
        self._rows(new)


def _simulation(
    physics: PanelPhysics, clock: Callable[[], float], wait: Callable[[float], None]
) -> Simulation:
    import numpy as np

    panel = SimulatedPanel(physics, clock)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(SEED), clock, wait)


def _rows(stack: ExitStack, out: Path | None, cls: type[Any]) -> Callable[[Iterable[Any]], None]:
    """Return what keeps records in a table, if there is to be one; it is made with the first of them."""
    if out is None:
        return lambda _: None
    if out.suffix != ".csv":
        raise InputError(f"--out {out}: give a file that ends in .csv")
    if out.exists():
        raise InputError(f"--out {out}: is there already, and measured data are never overwritten")
    if not out.absolute().parent.is_dir():
        raise InputError(f"--out {out}: there is no folder {out.parent}")
    opened: list[AppendedRows] = []

    def keep(records: Iterable[Any]) -> None:
        if not (records := list(records)):
            return
        if not opened:
            opened.append(stack.enter_context(AppendedRows(out, cls)))
        opened[0].append(records)

    return keep


def _introduce(apparatus: dict[str, str], show: ShowLine) -> None:
    if apparatus:
        show(", ".join(f"{key.replace('_', ' ')}: {value}" for key, value in apparatus.items()))


def _row(index: int, reading: Reading, first: float, name: str, utc: str) -> MeterReading:
    x, y = reading.chromaticity or (None, None)
    begun, ended = reading.begun - first, reading.ended - first
    return MeterReading(index, utc, begun, ended, reading.value, name, reading.status, x, y)


def _shown(index: int, reading: Reading, first: float) -> str:
    colour = "" if reading.chromaticity is None else "  x {:.4f}  y {:.4f}".format(*reading.chromaticity)
    took = f"{reading.begun - first:8.1f} s  (took {reading.ended - reading.begun:.1f} s)"
    return f"{index:4d}  {took}  {reading.value:10.4g} {reading.unit}{colour}  {reading.status}".rstrip()


def _closing(values: list[float], name: str) -> str:
    spread = f", standard deviation {statistics.stdev(values):.3g} cd/m^2" if len(values) > 1 else ""
    plural = "s" if len(values) > 1 else ""
    return _labelled(f"{statistics.fmean(values):.5g} cd/m^2, {len(values)} reading{plural}{spread}", name)


def _average_line(average: PowerAverage, name: str) -> str:
    lost = average.n_lost / (average.n_samples + average.n_lost)
    return _labelled(
        f"{average.power:.5g} W over {average.duration:.3g} s, weighted by time; standard deviation of the "
        f"{average.n_samples} samples {average.power_sd:.3g} W; {average.n_lost} lost ({lost:.1%}), "
        f"{average.n_duplicated} came twice",
        name,
    )


def _labelled(line: str, name: str) -> str:
    return f"SIMULATED: {line}" if is_simulated(name) else line


def measure_zero(name: str, ask: Callable[[str], str] | None, show: ShowLine) -> str:
    """Set the zero of an instrument, and return the closing line.

    Parameters
    ----------
    name : str
        The instrument.
    ask : callable or None
        Shows a question, and returns the line that was typed once all is ready; None where it is already.
    show : callable
        Shows a line.

    Raises
    ------
    InputError
        If there is no such instrument, it has no zero to set, or no one answers.
    InstrumentError
        If it is not there, or refuses.
    """
    before = _preparation(name)
    if ask is not None:
        try:
            ask(f"{name}: {before}, then press Enter: ")
        except EOFError:
            raise InputError("no one has pressed Enter; where all is ready, give --yes") from None
    with _opened(name) as meter:
        _introduce(meter.apparatus(), show)
        found = meter.zero()
    what = "" if found is None else f"; it was {found * 1e3:.3g} mA"
    return f"{'SIMULATED: ' if is_simulated(name) else ''}zero set{what}"


def _preparation(name: str) -> str:
    """Return what has to be done before the zero of an instrument is set; refuse one that has none."""
    driver = _named(name).driver.load()
    if not hasattr(driver, "zero"):
        having = ", ".join(each for each, meter in _meters().items() if hasattr(meter.load(), "zero"))
        raise InputError(f"{name}: has no zero that is set by command; these have: {having}")
    return str(driver.before_zero)


def _meters() -> dict[str, Driver]:
    both = known_drivers(InstrumentKind.LUMINANCE) | known_drivers(InstrumentKind.POWER)
    return {name: driver for name, driver in both.items() if driver.place}


def _named(name: str) -> NamedDriver:
    return named_driver(name, _meters(), "luminance or power meter")


def _opened(name: str) -> Any:
    """Return a meter, open; a simulated one looks at a panel that is off."""
    bench = bench_for(name, OFF)
    if _named(name).name in known_drivers(InstrumentKind.POWER):
        return open_power_meter(name, bench.clock, bench.simulation)
    return open_luminance_meter(name, bench.clock, bench.simulation)
