"""A power sensor that Linux drives itself, read from its files under /sys (hwmon or iio), in their units.

The voltage over the shunt ends at a largest value, where current and power are cut off. Under hwmon it
comes in whole millivolts, under iio in steps of the sensor's register.
"""

from __future__ import annotations

import errno
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.power_sampling import PolledMeter, split_address
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

SLOWEST, FASTEST = 0.1, 1000.0  # [Hz]
OPTIONS = {"channel": "which input of the sensor, from 1"}
SYS = Path("/sys")
FOLDERS = ("class/hwmon", "bus/iio/devices")  # under /sys
FAULTS = {
    errno.ENOENT: (Fault.DISCONNECTED, "is gone; was the sensor unplugged, or its driver unloaded?"),
    errno.ENODEV: (Fault.DISCONNECTED, "is gone; was the sensor unplugged, or its driver unloaded?"),
    errno.EACCES: (Fault.NOT_FOUND, "may not be read; ask an administrator for a udev rule, or run as root"),
    errno.EPERM: (Fault.NOT_FOUND, "may not be read; ask an administrator for a udev rule, or run as root"),
    errno.EBUSY: (Fault.BUSY, "is in use by another program"),
}
# Largest voltage over the shunt that a sensor measures, in each of its ranges [mV].
# Data sheets of Texas Instruments: INA219 SBOS448 (Linux sets PGA /8), INA226 SBOS547, INA230 SBOS601,
# INA228 SLYS021 and INA238 SLYS025 (ADCRANGE 1 and 0).
FULL_SCALES = {
    "ina219": (320.0,),
    "ina220": (320.0,),
    "ina226": (81.92,),
    "ina230": (81.92,),
    "ina231": (81.92,),
    "ina228": (40.96, 163.84),
    "ina238": (40.96, 163.84),
}
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?")  # as the kernel prints it
GAIN_ONE = 40.0  # [mV] full scale of an INA219 or INA220 whose amplifier's gain is 1
ROUNDING = 1.0  # [mV] hwmon has whole ones


class HwmonPowerMeter(PolledMeter):
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
        self._files = find_sensor(place, round(channel), root)
        update = self._files.slowest_update
        super().__init__(
            str(self._files.folder), clock, (SLOWEST, min(FASTEST, 1 / update) if update else FASTEST)
        )
        self._read_power()  # fails at once where it may not be read

    def apparatus(self) -> dict[str, str]:
        """Return what Linux says of the sensor."""
        return {
            "power_meter": f"{self._files.name}, driven by Linux",
            "power_meter_files": ", ".join(str(path) for path, _ in self._files.factors),
        }

    def _why_no_faster(self) -> str:
        """Return what explains the highest rate."""
        return " (see its update_interval)"

    def _read_power(self) -> float:
        """Return the power now [W]."""
        self._require_within_range()
        power = 1.0
        for path, unit in self._files.factors:
            power *= read_number(path) * unit
        require_power("hwmon", self._name, power)
        self._require_forwards(power, "swap the two ends of the shunt")
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


@dataclass(frozen=True, slots=True)
class SensorFiles:
    """The files that a sensor's power is read from."""

    folder: Path  # of the sensor
    name: str  # of its chip
    # files whose numbers, each times its unit, make the power [W] when multiplied
    factors: tuple[tuple[Path, float], ...]
    shunt: ShuntRange | None  # voltage over the shunt and its end, where both are known
    slowest_update: float  # time between two conversions of the sensor [s]; 0 where it is not known


def find_sensor(place: str, channel: int, root: Path = SYS) -> SensorFiles:
    """Return the files of a sensor.

    Parameters
    ----------
    place : str
        Its folder, or the name of its chip.
    channel : int
        Which of its inputs, from 1.
    root : Path, optional
        Where Linux shows its devices.

    Raises
    ------
    InstrumentError
        If there is no such sensor, more than one of the name, or it measures no power.
    """
    folder = Path(place) if "/" in place else _named(place, root)
    if not folder.is_dir():
        raise InstrumentError(f"{folder}: there is no such sensor; {_there_is(root)}", Fault.NOT_FOUND)
    name = read_text(folder / "name") if (folder / "name").exists() else folder.name
    factors = _hwmon_factors(folder, channel) or _iio_factors(folder)
    if not factors:
        raise InstrumentError(
            f"{folder}: {name} measures no power on channel {channel}: there is neither power{channel}_input "
            f"nor curr{channel}_input with in{channel}_input, nor the like of iio",
            Fault.WRONG_INSTRUMENT,
        )
    interval = folder / "update_interval"
    return SensorFiles(
        folder,
        name,
        factors,
        _shunt(folder, name),
        read_number(interval) / 1000 if interval.exists() else 0.0,
    )


def sensors(root: Path = SYS) -> list[Path]:
    """Return the folders of all sensors that have a power, or current and voltage, to read."""
    folders = [folder for place in FOLDERS for folder in sorted((root / place).glob("*"))]
    return [folder for folder in folders if _hwmon_factors(folder, 1) or _iio_factors(folder)]


def read_number(path: Path) -> float:
    """Return the number that a file of a sensor holds.

    Raises
    ------
    InstrumentError
        If it cannot be read, or holds none; in words.
    """
    text = read_text(path)
    if not NUMBER.fullmatch(text):
        raise InstrumentError(f"{path}: expected a number, got {text[:60]!r}", Fault.GARBLED)
    return float(text)


def read_text(path: Path) -> str:
    """Return what a file of a sensor holds, without the line's end."""
    try:
        return path.read_bytes().decode("ascii", errors="replace").strip()
    except OSError as error:
        fault, words = FAULTS.get(
            error.errno or 0, (Fault.NO_REPLY, f"cannot be read ({error.strerror}); does the sensor answer?")
        )
        raise InstrumentError(f"{path}: {words}", fault, errno.errorcode.get(error.errno or 0, "")) from None


def _named(name: str, root: Path) -> Path:
    """Return the folder of the one sensor whose chip has a name."""
    found = [folder for folder in sensors(root) if _name_of(folder) == name]
    if len(found) == 1:
        return found[0]
    if found:
        folders = ", ".join(str(folder) for folder in found)
        raise InstrumentError(f"{name}: there are {len(found)} of them; name one's folder: {folders}")
    raise InstrumentError(f"{name}: there is no such power sensor; {_there_is(root)}", Fault.NOT_FOUND)


def _name_of(folder: Path) -> str:
    """Return the name of a sensor's chip; its folder's where it has none."""
    name = folder / "name"
    return read_text(name) if name.exists() else folder.name


def _there_is(root: Path) -> str:
    """Return which sensors there are, in words."""
    found = [f"{_name_of(folder)} ({folder})" for folder in sensors(root)]
    return f"there is {', '.join(found)}" if found else "Linux shows none on this computer"


def _hwmon_factors(folder: Path, channel: int) -> tuple[tuple[Path, float], ...]:
    """Return the files of hwmon: power in µW, else current in mA and voltage in mV."""
    power = folder / f"power{channel}_input"
    if power.exists():
        return ((power, 1e-6),)
    current, voltage = folder / f"curr{channel}_input", folder / f"in{channel}_input"
    return ((current, 1e-3), (voltage, 1e-3)) if current.exists() and voltage.exists() else ()


def _iio_factors(folder: Path) -> tuple[tuple[Path, float], ...]:
    """Return the files of iio: raw numbers, whose scales make mW, or mA and mV."""
    if power := _first(folder, "in_power*_raw"):
        return ((power, _scale_of(power)),)
    current = _first(folder, "in_current*_raw")
    # Of two voltages, 0 is the one over the shunt, and 1 that of the panel.
    voltage = _first(folder, "in_voltage1_raw") or _first(folder, "in_voltage*_raw")
    if current is None or voltage is None:
        return ()
    return ((current, _scale_of(current)), (voltage, _scale_of(voltage)))


def _shunt(folder: Path, name: str) -> ShuntRange | None:
    """Return the shunt of a sensor, if Linux shows its voltage."""
    raw = folder / "in_voltage0_raw"
    if raw.exists():
        return iio_shunt(folder, name, _scale_of(raw) * 1000, read_number)
    return hwmon_shunt(folder, name, read_number)


def _first(folder: Path, pattern: str) -> Path | None:
    """Return the first file of a pattern."""
    return next(iter(sorted(folder.glob(pattern))), None)


def _scale_of(raw: Path) -> float:
    """Return what makes W, A or V of a raw number of iio; its own scale makes thousandths."""
    stem = raw.name.removesuffix("_raw")
    own, shared = raw.with_name(f"{stem}_scale"), raw.with_name(f"{stem.rstrip('0123456789')}_scale")
    return read_number(own if own.exists() else shared) / 1000


@dataclass(frozen=True, slots=True)
class ShuntRange:
    """Where the voltage over a shunt is read, and where it ends."""

    file: Path  # of the voltage
    unit: float  # that makes millivolts of its number
    rounding: float  # by which the number may be off [mV]
    # largest voltages that may be the sensor's; more than one where its range is not known [mV]
    full_scales: tuple[float, ...]

    def end_reached(self, voltage: float) -> float | None:
        """Return the end at which a voltage stands, None if at none, all of them [mV].

        Within the rounding of the smaller of two ranges a true voltage cannot be told from the end of the
        range, and it counts as the end. Above the last everything does.

        >>> two = ShuntRange(Path("in0_input"), 1.0, 1.0, (40.96, 163.84))
        >>> [two.end_reached(voltage) for voltage in (39.0, 40.0, -41.0, 43.0, 163.0, 170.0)]
        [None, 40.96, 40.96, None, 163.84, 163.84]
        """
        size = abs(voltage)
        for end in self.full_scales:
            if abs(size - end) <= self.rounding:
                return end
        return self.full_scales[-1] if size > self.full_scales[-1] else None


def hwmon_shunt(folder: Path, name: str, read: Callable[[Path], float]) -> ShuntRange | None:
    """Return the shunt of a sensor under hwmon, None where it is not shown or the sensor is not known.

    `read` returns the number in a file. A limit `in0_max` beyond the narrower of two ranges shows that the
    sensor has the wider one: unless a user has set it, it is the end of the range itself.
    """
    voltage, limit = folder / "in0_input", folder / "in0_max"
    ends = FULL_SCALES.get(name, ())
    if not ends or not voltage.exists():
        return None
    if len(ends) > 1 and limit.exists() and read(limit) > ends[0] + ROUNDING:
        ends = ends[1:]
    return ShuntRange(voltage, 1.0, ROUNDING, ends)


def iio_shunt(folder: Path, name: str, scale: float, read: Callable[[Path], float]) -> ShuntRange | None:
    """Return the shunt of a sensor under iio, whose voltage 0 it is where there is a voltage 1, the panel's.

    `scale` makes millivolts of the numbers of voltage 0.
    """
    ends = FULL_SCALES.get(name, ())
    if not ends or not (folder / "in_voltage1_raw").exists():
        return None
    gain = folder / "in_voltage0_hardwaregain"
    if name in ("ina219", "ina220") and gain.exists():
        ends = (GAIN_ONE / read(gain),)
    return ShuntRange(folder / "in_voltage0_raw", scale, scale, ends)
