"""One reading of a sweep: the level is shown, settles, and is read; what fails on its way is tried again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from evenlight.data_schema.session import EventKind
from evenlight.data_schema.sweep import (
    LuminanceReading,
    PowerReading,
    PowerSweepDesign,
    ReadingStatus,
    SweepDesign,
)
from evenlight.experiments.sweep_devices import SweepDevices
from evenlight.experiments.sweep_schedule import PlannedReading
from evenlight.experiments.sweep_screen import Shown
from evenlight.experiments.sweep_store import SweepReading, SweepStore
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import (
    TRANSIENT,
    Fault,
    InstrumentError,
    LuminanceMeter,
    PowerMeter,
    Reading,
)

Result = TypeVar("Result")
TIME_DECIMALS = 6


class Reader:
    """Makes the readings of a sweep.

    Parameters
    ----------
    store : SweepStore
        Where failures are noted, and whose time counts.
    devices : SweepDevices
        Screen and instruments.
    """

    def __init__(self, store: SweepStore, devices: SweepDevices) -> None:
        self._store, self._devices = store, devices
        self._design: SweepDesign = store.manifest.design
        self._attempts = 1  # that the last reading took

    def read(self, planned: PlannedReading) -> SweepReading:
        """Return a reading.

        Raises
        ------
        InstrumentError
            If it failed for good, or more often than the design allows.
        PausePressed
            If the pause key was pressed while the level settled.
        """
        screen = self._devices.screen
        shown = screen.show(planned.level)
        screen.wait(self._design.settle)
        if isinstance(self._design, PowerSweepDesign):
            return self._power(planned, shown, self._design)
        return self._luminance(planned, shown)

    def _luminance(self, planned: PlannedReading, shown: Shown) -> LuminanceReading:
        """Return a reading of the luminance meter."""
        meter = self._devices.luminance_meter
        assert meter is not None
        begun = self._store.now()
        reading, status, attempts = self._read_luminance(meter, planned)
        x, y = reading.chromaticity if reading and reading.chromaticity else (None, None)
        return LuminanceReading(
            index=planned.index,
            phase=planned.phase,
            repeat=planned.repeat,
            pixel_value=shown.pixel_value,
            factor=planned.level.factor,
            achieved_factor=shown.achieved_factor,
            luminance=reading.value if reading else None,
            status=ReadingStatus.OK if reading else ReadingStatus.UNDER_RANGE,
            meter_status=status,
            begun=self._time(reading.begun) if reading else round(begun, TIME_DECIMALS),
            ended=self._time(reading.ended) if reading else round(self._store.now(), TIME_DECIMALS),
            chromaticity_x=x,
            chromaticity_y=y,
            attempts=attempts,
            utc=self._store.utc(),
        )

    def _power(self, planned: PlannedReading, shown: Shown, design: PowerSweepDesign) -> PowerReading:
        """Return a reading of the power meter, and of the luminance meter if there is one."""
        meter, screen = self._devices.power_meter, self._devices.screen
        assert meter is not None
        power_meter: PowerMeter = meter
        average, attempts = self._tried(
            planned,
            lambda: average_power(power_meter, design.average, design.sample_rate, screen.now, screen.wait),
        )
        luminance: float | None = None
        status: ReadingStatus | None = None
        if self._devices.luminance_meter is not None:
            reading, _, more = self._read_luminance(self._devices.luminance_meter, planned)
            luminance = reading.value if reading else None
            status = ReadingStatus.OK if reading else ReadingStatus.UNDER_RANGE
            attempts = max(attempts, more)
        return PowerReading(
            index=planned.index,
            phase=planned.phase,
            repeat=planned.repeat,
            factor=planned.level.factor or 1.0,
            achieved_factor=shown.achieved_factor,
            luminance=luminance,
            luminance_status=status,
            power=average.power,
            power_sd=average.power_sd,
            duration=average.duration,
            n_samples=average.n_samples,
            n_lost=average.n_lost,
            n_duplicated=average.n_duplicated,
            meter_status=average.status,
            begun=self._time(average.begun),
            ended=self._time(average.ended),
            attempts=attempts,
            utc=self._store.utc(),
        )

    def _read_luminance(
        self, meter: LuminanceMeter, planned: PlannedReading
    ) -> tuple[Reading | None, str, int]:
        """Return what a meter reads, None where the screen is too dark for it; its status; and the tries."""
        try:
            reading, attempts = self._tried(planned, meter.read_luminance)
        except InstrumentError as error:
            if error.fault is not Fault.UNDER_RANGE:
                raise
            return None, error.code or str(error), self._attempts
        return reading, reading.status, attempts

    def _tried(self, planned: PlannedReading, read: Callable[[], Result]) -> tuple[Result, int]:
        """Return a result, and how many tries it took: what fails on its way may come at the next try."""
        attempt = 1
        while True:
            self._attempts = attempt
            try:
                return read(), attempt
            except InstrumentError as error:
                if error.fault is Fault.UNDER_RANGE:
                    raise
                again = error.fault in TRANSIENT and attempt <= self._design.retries
                outcome = "tried again" if again else "given up"
                detail = f"{error.fault.value}: {error}; {outcome}"
                self._store.note(EventKind.READING_FAILED, detail, planned.index, attempt)
                if not again:
                    raise
                attempt += 1

    def _time(self, time: float) -> float:
        """Return a time on the devices' clock as that since the sweep began [s]."""
        return round(self._store.since_beginning(time), TIME_DECIMALS)
