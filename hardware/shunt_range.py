"""The voltage over a sensor's shunt, and the largest that it tells: at it, current and power are cut off.

Under hwmon it comes in whole millivolts, under iio in steps of the sensor's register.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

# Largest voltage over the shunt that a sensor tells, in each of its ranges [mV].
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
GAIN_ONE = 40.0  # [mV] full scale of an INA219 or INA220 whose amplifier's gain is 1
ROUNDING = 1.0  # [mV] hwmon tells whole ones


@dataclass(frozen=True, slots=True)
class ShuntRange:
    """Where the voltage over a shunt is read, and where it ends.

    Attributes
    ----------
    file : Path
        Of the voltage.
    unit : float
        That makes millivolts of its number.
    rounding : float
        By which the number may be off [mV].
    full_scales : tuple of float
        Largest voltages that may be the sensor's; more than one where its range is not told [mV].
    """

    file: Path
    unit: float
    rounding: float
    full_scales: tuple[float, ...]

    def end_reached(self, voltage: float) -> float | None:
        """Return the end at which a voltage stands, None if at none, all of them [mV].

        Within the rounding of the smaller of two ranges nobody can tell a true voltage from the end of the
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

    `read` returns the number in a file. A limit `in0_max` beyond the narrower of two ranges tells that the
    sensor has the wider one: unless somebody has set it, it is the end of the range itself.
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
