"""What tells its own power when asked: a sensor or battery under Linux, a phone's battery over adb.

The voltage over a sensor's shunt ends at a largest value, where current and power are cut off. A battery's
gauge tells what the whole device takes; it is smoothed, and renewed every second or every half minute.
Between, the same is read again, and counts for its time. What adb does was written from the documents of
Android and tried on a stand-in, not on a device.
"""

from __future__ import annotations

import errno
import re
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired, run

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.power_sampling import PolledMeter, split_address
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError

SYS = Path("/sys")
SENSORS, SUPPLIES = ("class/hwmon", "bus/iio/devices"), "class/power_supply"  # under it
SENSOR_RATES, GAUGE_RATES = (0.1, 1000.0), (0.05, 20.0)  # [Hz] no gauge is faster
GONE = (Fault.DISCONNECTED, "is gone; was the sensor unplugged, or its driver unloaded?")
FORBIDDEN = (Fault.NOT_FOUND, "may not be read; ask an administrator for a udev rule, or run as root")
FAULTS = {
    **dict.fromkeys((errno.ENOENT, errno.ENODEV), GONE),
    **dict.fromkeys((errno.EACCES, errno.EPERM), FORBIDDEN),
}
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?", re.ASCII)  # as the kernel prints it
# Largest voltages over the shunt that a sensor measures, in each of its ranges [mV]. Data sheets of Texas
# Instruments: INA219 SBOS448 (Linux sets PGA /8), INA226 SBOS547, INA230 SBOS601, INA228 SLYS021 and INA238
# SLYS025 (ADCRANGE 1 and 0).
FULL_SCALES = {
    **dict.fromkeys(("ina219", "ina220"), (320.0,)),
    **dict.fromkeys(("ina226", "ina230", "ina231"), (81.92,)),
    **dict.fromkeys(("ina228", "ina238"), (40.96, 163.84)),
}
GAIN_ONE = 40.0  # [mV] full scale of an INA219 or INA220 whose amplifier's gain is 1
CELLS = (2.0, 100.0)  # [V] of one lithium cell that is empty, of the batteries of cars
LEAST_CURRENT = 0.01  # [A] a device with a screen takes more, even at 20 V; so less than 10 000 "µA" are mA
VALUES = ("current_now", "voltage_now")  # files of a battery
UNITS = {1e-6: "micro", 1e-3: "milli"}  # power_supply has µA and µV; some phones have mA and mV
OPENED_WITHIN, ANSWERS_WITHIN = 20.0, 5.0  # [s] the first call of adb starts its server
WIRELESS = "; over a cable it charges: `adb tcpip 5555`, pull the cable, `adb connect ADDRESS:5555`"
# For the device's shell: status, current and voltage of the first battery whose current it may read, twice,
# so that a part of a line is never taken for a reading; then the model.
ASK = (
    "{ c=; v=; s=; for d in /sys/class/power_supply/*; do t=; read t <$d/type; [ $t = Battery ] && "
    "read c <$d/current_now && read v <$d/voltage_now && read s <$d/status && break; done; } 2>/dev/null; "
    'echo "$s,$c,$v|$s,$c,$v"; getprop ro.product.model'
)


class HwmonPowerMeter(PolledMeter, Instrument):
    """A power sensor under Linux's hwmon or iio; its samples carry the computer's time.

    The address is the name of its chip, or its folder; "?channel=" and a number after it where it has several
    inputs. Parameters as of `Instrument`.
    """

    root = SYS  # where Linux shows its devices
    _why = " (see its update_interval)"

    def _open(self, address: str) -> None:
        place, options = split_address(address, "hwmon", {"channel": "which input of the sensor, from 1"})
        channel = options.get("channel", 1.0)
        if channel != round(channel):
            raise InputError(f"hwmon:{address}: channel must be a whole number from 1, got {channel:g}")
        folder = _sensor_at(place, self.root)
        self._chip, self._factors = _chip_of(folder), _factors(folder, round(channel))
        if not self._factors:
            raise InstrumentError(
                f"{folder}: {self._chip} measures no power on channel {channel:g}, nor current with voltage",
                Fault.WRONG_INSTRUMENT,
            )
        self._shunt, self._shunt_unit, self._shunt_ends = _shunt_of(folder, self._chip)
        interval, (slowest, fastest) = folder / "update_interval", SENSOR_RATES
        if interval.exists() and (update := read_number(interval)) > 0:
            fastest = min(fastest, 1000 / update)  # [ms]
        self._name, self._rates = str(folder), (slowest, fastest)
        self._read_power()

    def apparatus(self) -> dict[str, str]:
        """Return what Linux says of the sensor."""
        files = ", ".join(str(path) for path, _ in self._factors)
        return {"power_meter": f"{self._chip}, driven by Linux", "power_meter_files": files}

    def _read_power(self) -> float:
        if self._shunt_ends:
            self._require_within_range()
        power = 1.0
        for path, unit in self._factors:
            power *= read_number(path) * unit
        require_power("hwmon", self._name, power)
        self._require_forwards(power, "swap the two ends of the shunt")
        return power

    def _require_within_range(self) -> None:
        """Refuse a power that was cut off; within the rounding of an end a voltage counts as the end."""
        voltage = abs(read_number(self._shunt) * self._shunt_unit)
        near = [end for end in self._shunt_ends if abs(voltage - end) <= self._shunt_unit]
        if near or voltage > self._shunt_ends[-1]:
            raise self._error(
                f"{voltage:.4g} mV over the shunt, the most that an {self._chip} tells is "
                f"{(near or self._shunt_ends)[-1]:g} mV; take a smaller shunt",
                Fault.OVER_RANGE,
            )


def _sensor_at(place: str, root: Path) -> Path:
    folders = [folder for name in SENSORS for folder in sorted((root / name).glob("*"))]
    sensors = [(_chip_of(folder), f"hwmon:{folder}", folder) for folder in folders if _factors(folder, 1)]
    return _only_one(place, sensors, f"hwmon:{place}".rstrip(":"))


def _only_one(place: str, devices: list[tuple[str, str, Path]], given: str) -> Path:
    """Return the folder of a path, or of the only device of a name; devices have name, address and folder."""
    if "/" in place and Path(place).is_dir():
        return Path(place)
    chosen = [(address, folder) for name, address, folder in devices if place in ("", name)]
    if len(chosen) == 1:
        return chosen[0][1]
    if chosen:
        names = ", ".join(address for address, _ in chosen)
        raise InstrumentError(f"{given}: there are several, {names}; give one of these")
    there = ", ".join(f"{address} ({name})" for name, address, _ in devices)
    raise InstrumentError(f"{given}: Linux shows no such device; there is {there or 'none'}", Fault.NOT_FOUND)


def _chip_of(folder: Path) -> str:
    name = folder / "name"
    return read_text(name) if name.exists() else folder.name


def _factors(folder: Path, channel: int) -> tuple[tuple[Path, float], ...]:
    """Return the files whose numbers, each times its unit, make the power [W] when multiplied.

    Under hwmon they are µW, else mA and mV; under iio raw numbers with scales that make mW, or mA and mV. Of
    two voltages of iio, 0 is the one over the shunt, and 1 that of the panel.
    """
    power = folder / f"power{channel}_input"
    current, voltage = folder / f"curr{channel}_input", folder / f"in{channel}_input"
    if power.exists():
        return ((power, 1e-6),)
    if current.exists() and voltage.exists():
        return ((current, 1e-3), (voltage, 1e-3))
    powers, currents, panels, voltages = (
        sorted(folder.glob(f"in_{name}_raw"))[:1] for name in ("power*", "current*", "voltage1", "voltage*")
    )
    files = powers or (currents + (panels or voltages) if currents and voltages else [])
    return tuple((file, _scale_of(file)) for file in files)


def _scale_of(raw: Path) -> float:
    """Return what makes W, A or V of a raw number of iio; its own scale makes thousandths."""
    stem = raw.name.removesuffix("_raw")
    own, shared = raw.with_name(f"{stem}_scale"), raw.with_name(f"{stem.rstrip('0123456789')}_scale")
    return read_number(own if own.exists() else shared) / 1000


def _shunt_of(folder: Path, chip: str) -> tuple[Path, float, tuple[float, ...]]:
    """Return the file of the voltage over the shunt, its unit [mV], and the ends it may have [mV].

    No ends: Linux does not show it, or the chip is not known. A limit `in0_max` beyond the narrower of two
    ranges shows that the sensor has the wider one: unless a user has set it, it is the end of the range.
    """
    ends = FULL_SCALES.get(chip, ())
    raw, gain = folder / "in_voltage0_raw", folder / "in_voltage0_hardwaregain"
    if raw.exists():
        if chip in ("ina219", "ina220") and gain.exists():
            ends = (GAIN_ONE / read_number(gain),)
        return raw, _scale_of(raw) * 1000, ends if (folder / "in_voltage1_raw").exists() else ()
    voltage, limit = folder / "in0_input", folder / "in0_max"
    if len(ends) > 1 and limit.exists() and read_number(limit) > ends[0] + 1.0:  # hwmon has whole ones
        ends = ends[1:]
    return voltage, 1.0, ends if voltage.exists() else ()


def read_number(path: Path) -> float:
    """Return the number that a file holds; an `InstrumentError` says why there is none."""
    return _number(read_text(path), str(path))


def read_text(path: Path) -> str:
    """Return what a file holds, without the line's end; an `InstrumentError` says why it cannot be read."""
    try:
        return path.read_bytes().decode("ascii", errors="replace").strip()
    except OSError as error:
        silent = Fault.NO_REPLY, f"cannot be read ({error.strerror}); does the sensor answer?"
        fault, words = FAULTS.get(error.errno or 0, silent)
        raise InstrumentError(f"{path}: {words}", fault, errno.errorcode.get(error.errno or 0, "")) from None


def _number(text: str, what: str) -> float:
    if not NUMBER.fullmatch(text):
        raise InstrumentError(f"{what}: expected a number, got {text[:60]!r}", Fault.GARBLED)
    return float(text)


class GaugePowerMeter(PolledMeter, Instrument):
    """A battery's gauge; its numbers are µA and µV, or mA and mV, by the size of the first of them."""

    driver: str  # its name, as `plausibility` has it
    _units: tuple[float, float] | None = None  # of current [A] and voltage [V], once known
    _rates, _why = GAUGE_RATES, " (a battery's gauge is slow: give --rate-hz 1)"

    def _read_power(self) -> float:
        if self._units is None:
            self._units = _gauge_units(self._values(), self._name)
        return drawn_power(self._values(), self._units, self.driver, self._name)

    @abstractmethod
    def _values(self) -> dict[str, str]:
        """Return status and power_now, or status, current_now and voltage_now, as text."""


def _gauge_units(values: Mapping[str, str], device: str) -> tuple[float, float]:
    """Return the units of a battery's current [A] and voltage [V].

    >>> _gauge_units({"current_now": "-321", "voltage_now": "4063000"}, "phone")
    (0.001, 1e-06)
    """
    if "current_now" not in values:
        return 1e-6, 1e-6
    current, voltage = (abs(_number(values[name], f"{device}: {name}")) for name in VALUES)
    return 1e-6 if current * 1e-6 >= LEAST_CURRENT else 1e-3, 1e-6 if voltage * 1e-6 >= CELLS[0] else 1e-3


def drawn_power(values: Mapping[str, str], units: tuple[float, float], driver: str, device: str) -> float:
    """Return the power that a device takes from its battery [W], by what the battery's files say.

    Gauges say the direction of the current in three ways (power_supply's documentation since Linux 5.10):
    which way it flows is taken from the status, and only what is drawn is a reading; REFUSED otherwise.

    >>> values = {"status": "Discharging", "current_now": "-500000", "voltage_now": "4000000"}
    >>> drawn_power(values, (1e-6, 1e-6), "battery", "BAT0")
    2.0
    """
    if (status := values["status"].strip()).lower() != "discharging":
        raise InstrumentError(
            f"{device}: its status is {status[:30]!r}, and only while it is 'Discharging' does the battery "
            f"give what the device takes: pull the charging cable{WIRELESS if driver == 'adb' else ''}",
            Fault.REFUSED,
        )
    if "power_now" in values:
        power = abs(_number(values["power_now"], f"{device}: power_now")) * 1e-6
    else:
        current, voltage = (
            _number(values[name], f"{device}: {name}") * unit
            for name, unit in zip(VALUES, units, strict=True)
        )
        power = abs(current) * voltage
        if not CELLS[0] <= voltage <= CELLS[1] or abs(current) < LEAST_CURRENT:
            raise InstrumentError(
                f"{device}: sent {current:g} A at {voltage:g} V, in the units of its first reading; a device "
                f"with a screen has {CELLS[0]:g} to {CELLS[1]:g} V and {LEAST_CURRENT:g} A or more",
                Fault.IMPLAUSIBLE,
            )
    require_power(driver, device, power)
    return power


class BatteryPowerMeter(GaugePowerMeter):
    """The battery of the computer: its name under power_supply, its folder, or "" for the only one."""

    driver, root = "battery", SYS

    def _open(self, address: str) -> None:
        self._folder = _battery_at(address, self.root)
        self._name = str(self._folder)
        self._files = ("power_now",) if (self._folder / "power_now").exists() else VALUES
        if not all((self._folder / name).exists() for name in self._files):
            raise InstrumentError(
                f"{self._folder}: this battery tells neither power_now nor current_now with voltage_now",
                Fault.WRONG_INSTRUMENT,
            )
        self._read_power()

    def apparatus(self) -> dict[str, str]:
        """Return what it is."""
        words = f"battery {self._folder.name}: what the whole computer takes, not the panel alone"
        return {"power_meter": words, "power_meter_files": ", ".join(self._files)}

    def _values(self) -> dict[str, str]:
        return {name: read_text(self._folder / name) for name in ("status", *self._files)}


def _battery_at(place: str, root: Path) -> Path:
    """Return the folder of one of the computer's batteries, which are not those of its mouse or pen."""
    batteries = [
        (folder.name, f"battery:{folder.name}", folder)
        for folder in sorted((root / SUPPLIES).glob("*"))
        if read_text(folder / "type") == "Battery"
        if not (folder / "scope").exists() or read_text(folder / "scope") != "Device"
    ]
    return _only_one(place, batteries, f"battery:{place}".rstrip(":"))


class AdbPowerMeter(GaugePowerMeter):
    """The battery of an Android headset or phone; each reading is a call of adb, of some 50 ms.

    The address is the device's serial number or network address in the list of `adb devices`, empty for the
    only one; then, if adb is not on the path, "@" and where it is. Parameters as of `Instrument`.
    """

    driver = "adb"
    longest = ANSWERS_WITHIN

    def _open(self, address: str) -> None:
        serial, _, program = address.partition("@")
        self._name = f"adb:{serial}".rstrip(":")  # of the only device
        self._command = [program or "adb", *(("-s", serial) if serial else ()), "shell", ASK]
        answers_within, self._timeout = self._timeout, max(self._timeout, OPENED_WITHIN)
        self._read_power()
        self._timeout = answers_within

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        current, voltage = (UNITS[unit] for unit in self._units or ())
        return {
            "power_meter": f"battery of {self._model or 'a device'} over adb: all that it takes",
            "power_meter_units": f"current in {current}ampere, voltage in {voltage}volt, by their first size",
        }

    def _values(self) -> dict[str, str]:
        line, _, self._model = self._printed().strip().partition("\n")
        one, _, other = line.strip().partition("|")
        if one != other or one.count(",") != len(VALUES):
            raise self._error(f"answered {line[:60]!r}", Fault.GARBLED)
        values = dict(zip(("status", *VALUES), one.split(","), strict=True))
        if not values["current_now"]:
            raise self._error(
                "its shell may not read current_now of a battery: the maker keeps it from adb",
                Fault.WRONG_INSTRUMENT,
            )
        return values

    def _printed(self) -> str:
        try:
            done = run(self._command, stdin=DEVNULL, capture_output=True, timeout=self._timeout, check=False)
        except OSError as error:
            raise self._error(
                f"no program {self._command[0]!r}; install it with: apt install adb ({error.strerror})",
                Fault.NOT_FOUND,
            ) from None
        except TimeoutExpired:
            raise self._error(
                f"no answer within {self._timeout:g} s; is it in reach, and awake?", Fault.NO_REPLY
            ) from None
        if done.returncode:
            said = done.stderr.decode("utf-8", "replace").strip().partition("\n")[0]
            raise self._error(
                f"adb says {said[:120] or 'nothing'!r}; does `adb devices` list it, is it "
                "awake, and is USB debugging allowed?",
                Fault.DISCONNECTED if self._units else Fault.NOT_FOUND,
            )
        return done.stdout.decode("utf-8", "replace")
