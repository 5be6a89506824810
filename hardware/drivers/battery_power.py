"""The computer's own battery under Linux (power_supply): what the whole device takes, by its fuel gauge.

Gauges say the direction of the current in three ways (power_supply's documentation since Linux 5.10): which
way it flows is taken from the battery's status, and only what is drawn is a reading. A gauge renews its value
every second or every half minute, smoothed; between, the same is read again, and counts for its time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from evenlight.hardware.drivers.hwmon_power import SYS, read_text
from evenlight.hardware.drivers.power_sampling import PolledMeter
from evenlight.hardware.plausibility import POWERS, require_power
from evenlight.hardware.protocols import Fault, InstrumentError

SUPPLIES = "class/power_supply"  # under /sys
RATES = (0.05, 20.0)  # [Hz] no gauge is faster
VALUES = ("power_now", "current_now", "voltage_now")
CELLS = (2.0, 100.0)  # [V] of one lithium cell that is empty, of the batteries of cars
LEAST_CURRENT = 0.01  # [A] a device with a screen takes more, even at 20 V; so less than 10 000 "µA" are mA
DRAWN = "discharging"


@dataclass(frozen=True, slots=True)
class GaugeUnits:
    """What a battery's numbers are in: power_supply has µA and µV; some phones have mA and mV."""

    current: float  # [A]
    voltage: float  # [V]

    def in_words(self) -> str:
        """Return them as one reads them."""
        names = {1e-6: "micro", 1e-3: "milli"}
        return f"current in {names[self.current]}ampere, voltage in {names[self.voltage]}volt"


def gauge_units(values: Mapping[str, str], driver: str, device: str) -> GaugeUnits:
    """Return the units of a battery's numbers, by their size; they are the same from then on.

    >>> gauge_units({"current_now": "-321", "voltage_now": "4063000"}, "adb", "phone").in_words()
    'current in milliampere, voltage in microvolt'
    """
    if "current_now" not in values:
        return GaugeUnits(1e-6, 1e-6)
    current, voltage = (abs(_number(values, name, device)) for name in ("current_now", "voltage_now"))
    volts = 1e-6 if voltage * 1e-6 >= CELLS[0] else 1e-3
    if current * 1e-6 >= LEAST_CURRENT:
        return GaugeUnits(1e-6, volts)
    if (power := current * 1e-3 * voltage * volts) > POWERS[driver].most:
        raise InstrumentError(
            f"{device}: current_now is {current:g}, too little for microampere and too much for milliampere "
            f"({power:.3g} W): its unit cannot be told; is the screen on?",
            Fault.IMPLAUSIBLE,
        )
    return GaugeUnits(1e-3, volts)


def drawn_power(values: Mapping[str, str], units: GaugeUnits, driver: str, device: str) -> float:
    """Return the power that a device takes from its battery [W].

    Parameters
    ----------
    values : mapping of str to str
        What `status` and `VALUES` say, as text; power_now in µW, or the other two.
    units : GaugeUnits
        Of current and voltage.
    driver, device : str
        As `require_power` and messages have them.

    Raises
    ------
    InstrumentError
        REFUSED where the battery is not discharging, GARBLED or IMPLAUSIBLE where that is no reading.

    >>> values = {"status": "Discharging", "current_now": "-500000", "voltage_now": "4000000"}
    >>> drawn_power(values, GaugeUnits(1e-6, 1e-6), "battery", "BAT0")
    2.0
    """
    if (status := values["status"].strip()).lower() != DRAWN:
        raise InstrumentError(
            f"{device}: its status is {status[:30]!r}, and only while it is 'Discharging' does the battery "
            "give what the device takes: pull the charging cable",
            Fault.REFUSED,
        )
    if "power_now" in values:
        power = abs(_number(values, "power_now", device)) * 1e-6
    else:
        current = abs(_number(values, "current_now", device)) * units.current
        voltage = _number(values, "voltage_now", device) * units.voltage
        if not CELLS[0] <= voltage <= CELLS[1] or current < LEAST_CURRENT:
            raise InstrumentError(
                f"{device}: sent {current:g} A at {voltage:g} V ({units.in_words()}, by its first reading); "
                f"a battery that runs a display has {CELLS[0]:g} to {CELLS[1]:g} V and {LEAST_CURRENT:g} A "
                "or more",
                Fault.IMPLAUSIBLE,
            )
        power = current * voltage
    require_power(driver, device, power)
    return power


def _number(values: Mapping[str, str], name: str, device: str) -> float:
    """Return one of a battery's numbers, a whole one."""
    text = values[name].strip()
    if not text.removeprefix("-").isdecimal() or not text.isascii():
        raise InstrumentError(f"{device}: {name} is {text[:30]!r}, not a whole number", Fault.GARBLED)
    return float(text)


class BatteryPowerMeter(PolledMeter):
    """The battery of this computer; its samples carry the computer's time.

    Parameters
    ----------
    url : str
        Its name under /sys/class/power_supply, or its folder; empty for the only one.
    clock : callable, optional
        The computer's clock [s].
    timeout : float, optional
        Not needed: a file is there or not.
    root : Path, optional
        Where Linux shows its devices.

    Raises
    ------
    InstrumentError
        If there is no such battery, it is not discharging, or tells no power.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
        root: Path = SYS,
    ) -> None:
        self._folder = find_battery(url, root)
        super().__init__(str(self._folder), clock, RATES)
        self._files = [name for name in VALUES if (self._folder / name).exists()]
        if "power_now" in self._files:
            self._files = ["power_now"]
        elif len(self._files) < 2:
            raise InstrumentError(
                f"{self._folder}: this battery tells neither power_now nor current_now with voltage_now",
                Fault.WRONG_INSTRUMENT,
            )
        self._units = gauge_units(self._values(), "battery", self._name)
        self._read_power()  # fails at once where it is not discharging

    def apparatus(self) -> dict[str, str]:
        """Return what it is."""
        return {
            "power_meter": f"battery {self._folder.name}: what the whole computer takes, not the panel alone",
            "power_meter_files": ", ".join(self._files),
        }

    def _read_power(self) -> float:
        """Return the power that is drawn [W]."""
        return drawn_power(self._values(), self._units, "battery", self._name)

    def _values(self) -> dict[str, str]:
        """Return what the files say."""
        return {name: read_text(self._folder / name) for name in ("status", *self._files)}

    def _why_no_faster(self) -> str:
        """Return what explains the highest rate."""
        return " (a battery's gauge is slow: give --rate-hz 1)"


def find_battery(place: str, root: Path = SYS) -> Path:
    """Return the folder of a battery: the one of a name or folder, or the only one of the computer.

    Raises
    ------
    InstrumentError
        If there is no such one, or several.
    """
    if "/" in place and Path(place).is_dir():
        return Path(place)
    found = batteries(root)
    chosen = [folder for folder in found if place in ("", folder.name)]
    if len(chosen) == 1:
        return chosen[0]
    names = ", ".join(f"battery:{folder.name}" for folder in found)
    if chosen:
        raise InstrumentError(f"battery: there are several, {names}; name the one that is discharged")
    raise InstrumentError(
        f"battery:{place or ' '} is no battery that Linux shows under {root / SUPPLIES}; there is "
        f"{names or 'none'}",
        Fault.NOT_FOUND,
    )


def batteries(root: Path = SYS) -> list[Path]:
    """Return the folders of the computer's batteries, not those of its mouse or pen."""
    return [
        folder
        for folder in sorted((root / SUPPLIES).glob("*"))
        if _said(folder / "type") == "Battery" and _said(folder / "scope") != "Device"
    ]


def _said(path: Path) -> str:
    """Return what a file says; nothing where it is missing."""
    return read_text(path) if path.exists() else ""
