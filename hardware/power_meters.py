"""The power meters that there are drivers for, as `evenlight measure list` shows them.

`hardware.rig` maps the names to the classes: `BoardPowerMeter` (hardware.power_board), `HwmonPowerMeter`
(hardware.hwmon_power), `Ppk2PowerMeter` (hardware.nordic_ppk2), `ScpiPowerMeter` and `VisaPowerMeter`
(hardware.scpi_power), `SimulatedPowerMeter` (hardware.simulated_power_meter). None was tried on a device:
each was tested against an emulator that speaks the same bytes.
"""

from __future__ import annotations

from evenlight.hardware.driver_notes import DriverNote

POWER_METERS: tuple[DriverNote, ...] = (
    DriverNote(
        name="board",
        instrument="power board: an INA219, INA226 or INA228 on a microcontroller (docs/power-board.md)",
        address="board:PORT, board:PORT?baud=921600",
        settings="115200 8N1; up to 272 Hz, or what the board states where its serial port is USB itself",
        note="the same port may be the rig's backlight; its sync input marks the frames",
    ),
    DriverNote(
        name="hwmon",
        instrument="a power sensor that Linux drives itself, under hwmon or iio",
        address="hwmon:NAME or hwmon:FOLDER, e.g. hwmon:ina226; hwmon:NAME?channel=2",
        settings="files under /sys; as fast as the sensor's update_interval, at most 1000 Hz",
        note="samples carry the computer's time; no sync input",
    ),
    DriverNote(
        name="ppk2",
        instrument="Nordic Power Profiler Kit II, as an ampere meter in the panel's supply",
        address="ppk2:PORT?voltage=5.0, with the supply's voltage, 0.8 to 5.0 V, at most 1 A",
        settings="USB; 100 kHz, averaged to the rate asked for, 10 Hz to 10 kHz; frame line on D0",
        usb_ids=((0x1915, 0xC00A),),
        note="needs the extra: pip install 'evenlight[instruments]' (ppk2-api, GPLv2)",
    ),
    DriverNote(
        name="scpi",
        instrument="a bench supply, multimeter or power analyser that speaks SCPI",
        address="scpi:HOST:PORT, scpi:HOST (port 5025) or scpi:/dev/ttyUSB0; ?voltage=5.0 for an ammeter",
        settings="raw socket, or 9600 8N1; MEAS:POW?, else MEAS:VOLT? times MEAS:CURR?",
        note="samples carry the computer's time; as fast as the instrument answers",
    ),
    DriverNote(
        name="visa",
        instrument="the same over USB, GPIB or VXI-11, through PyVISA",
        address="visa:RESOURCE, e.g. visa:USB0::0x2A8D::0x1301::MY1::INSTR; ?voltage=5.0 for an ammeter",
        settings="those of the resource",
        note="needs the extra: pip install 'evenlight[instruments]' (pyvisa, pyvisa-py)",
    ),
)
