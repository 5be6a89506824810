"""A power sensor that Linux drives itself, read from its files under /sys (hwmon or iio)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.hwmon_files import SYS, find_sensor, read_number
from evenlight.hardware.drivers.power_sampling import (
    BACKWARDS,
    PolledSampling,
    require_sample_rate,
    split_address,
)
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError

SLOWEST, FASTEST = 0.1, 1000.0  # [Hz]
OPTIONS = {"channel": "which input of the sensor, from 1"}


class HwmonPowerMeter(ContextDevice):
    """A power sensor under Linux's hwmon or iio; its samples carry the computer's time.

    A value is read when `samples` is called and one is due, which takes less than a millisecond.

    Parameters
    ----------
    url : str
        The name of its chip, or its folder; "?channel=" and a number after it where it has several inputs.
    clock : callable, optional
        The computer's clock [s].
    timeout : float, optional
        Not needed: a file is there or not.
    root : Path, optional
        Where Linux shows its devices.

    Raises
    ------
    InstrumentError
        If there is no such sensor, or it cannot be read.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
        root: Path = SYS,
    ) -> None:
        place, options = split_address(url, "hwmon", OPTIONS)
        channel = options.get("channel", 1.0)
        if channel != round(channel):
            raise InputError(f"hwmon:{url}: channel must be a whole number from 1, got {channel:g}")
        self._files, self._clock = find_sensor(place, round(channel), root), clock
        self._name, self._sampling = str(self._files.folder), PolledSampling()
        self._read_power()  # fails at once where it may not be read

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return it.

        Raises
        ------
        InstrumentError
            If the sensor has no new value that often.
        """
        self._require_open()
        update = self._files.slowest_update
        highest = min(FASTEST, 1 / update) if update else FASTEST
        require_sample_rate(rate, SLOWEST, highest, f"{self._name} (see its update_interval)")
        self._sampling.begin(rate, self._clock())
        return rate

    def samples(self) -> Sequence[PowerSample]:
        """Return a sample if one is due.

        Raises
        ------
        InstrumentError
            If the sensor cannot be read, or its power is no measurement.
        """
        self._require_open()
        if not self._sampling.is_running:
            raise InstrumentError(f"{self._name}: is not sampling; start it first")
        sent = self._clock()
        if not self._sampling.is_due(sent):
            return []
        power = self._read_power()
        return [self._sampling.sample(power, sent, self._clock())]

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling; no sample waits to be taken."""
        self._sampling.end()
        return []

    def ping(self) -> None:
        """Return None: the samples carry the computer's own time."""
        self._require_open()

    def apparatus(self) -> dict[str, str]:
        """Return what Linux says of the sensor."""
        return {
            "power_meter": f"{self._files.name}, driven by Linux",
            "power_meter_files": ", ".join(str(path) for path, _ in self._files.factors),
        }

    def close(self) -> None:
        """Let go of the sensor; more than once does nothing."""
        self._sampling.end()
        self._closed = True

    def _read_power(self) -> float:
        """Return the power now [W]."""
        self._require_within_range()
        power = 1.0
        for path, unit in self._files.factors:
            power *= read_number(path) * unit
        if power < BACKWARDS:
            raise InstrumentError(
                f"{self._name}: the power is {power:.3f} W, so the current flows backwards; swap the "
                "two ends of the shunt"
            )
        return power

    def _require_within_range(self) -> None:
        """Refuse a power that was cut off where the voltage over the shunt is."""
        shunt = self._files.shunt
        if shunt is None:
            return
        voltage = abs(read_number(shunt.file) * shunt.unit)
        if (end := shunt.end_reached(voltage)) is not None:
            raise InstrumentError(
                f"{self._name}: {voltage:.4g} mV over the shunt, the most that an {self._files.name} "
                f"tells is {end:g} mV; take a smaller shunt",
                Fault.OVER_RANGE,
            )
