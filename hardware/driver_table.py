"""The drivers that there are: one entry each, with its place and what users read of it.

A new driver is a file in `hardware.drivers` and an entry here: `hardware.rig` opens it, and `evenlight
measure list` shows it. Its emulated instrument is an entry of tests/companions/emulators/ours.py, on which
tests/conventions/test_drivers.py tries what every driver promises. Modules are imported when a device is
opened. Drivers of packages: `hardware.installed_drivers`.
"""

from __future__ import annotations

from evenlight.hardware.driver import SIMULATED, Driver

IMPORTED = "csv"  # in place of a luminance meter: a table, whose readings a sweep imports
BOARD = "board"  # one link, which a power meter and a backlight share
NO_BACKLIGHT = "none"
REMOTE_7E2 = "4800 baud, 7 data bits, even parity, 2 stop bits; hold F while switching it on"
PHOTO_RESEARCH = "9600 baud, 8N1"


def _program(place: str, instrument: str, says: str) -> Driver:
    return Driver(
        f"drivers.exec_program:{place}",
        instrument,
        "exec:PROGRAM ARGUMENTS",
        says,
        "the lines are described in docs/drivers.md",
    )


LUMINANCE_METERS = {
    "ls100": Driver("drivers.konica_minolta:Ls100", "Konica Minolta LS-100", "ls100:PORT", REMOTE_7E2),
    "ls110": Driver("drivers.konica_minolta:Ls110", "Konica Minolta LS-110", "ls110:PORT", REMOTE_7E2),
    "cs100a": Driver("drivers.konica_minolta:Cs100a", "Konica Minolta CS-100A", "cs100a:PORT", REMOTE_7E2),
    "pr655": Driver("drivers.photo_research:Pr655", "Photo Research PR-655", "pr655:PORT", PHOTO_RESEARCH),
    "pr670": Driver("drivers.photo_research:Pr670", "Photo Research PR-670", "pr670:PORT", PHOTO_RESEARCH),
    "pr650": Driver(
        "drivers.photo_research:Pr650",
        "Photo Research PR-650",
        "pr650:PORT",
        f"{PHOTO_RESEARCH}; switch it off and on, and connect within 5 s",
    ),
    "colorcal": Driver(
        "drivers.colorcal:ColorCal",
        "CRS ColorCAL II",
        "colorcal:PORT",
        "USB, any baud rate; its zero is set with the sensor covered",
        usb_ids=((0x0861, 0x1001),),  # 2145, 4097
    ),
    "spotread": Driver(
        "drivers.spotread:Spotread",
        "any colorimeter or spectrometer that ArgyllCMS knows",
        "spotread: or spotread:NUMBER",
        "the program `spotread` of ArgyllCMS; NUMBER is that of its list, 1 if left out",
        "install it with: apt install argyll",
        needs_address=False,
    ),
    "manual": Driver(
        "drivers.manual_meter:ManualMeter",
        "any meter that is read by eye",
        "manual",
        "readings are typed in, in cd/m^2; u for under range, o for over range, stop to end",
        needs_address=False,
    ),
    "exec": _program(
        "ExecLuminanceMeter",
        "any meter, read by a program of yours",
        'one line of JSON for each reading: {"id": 1, "luminance_cd_m2": 12.3}',
    ),
    IMPORTED: Driver(
        "",
        "a table of readings made elsewhere",
        "csv:FILE",
        "columns pixel_value,luminance_cd_m2 and, where the brightness was varied, factor",
        "named in a rig, and imported by `evenlight run luminance-sweep`",
    ),
    SIMULATED: Driver(
        "simulated.luminance_meter:SimulatedLuminanceMeter",
        "a simulated luminance meter, looking at the simulated panel",
        "simulated",
        "a spot meter of 4 digits",
        needs_address=False,
    ),
}
POWER_METERS = {
    BOARD: Driver(
        "drivers.power_board:BoardPowerMeter",
        "power board: an INA219, INA226 or INA228 on a microcontroller (docs/power-board.md)",
        "board:PORT, board:PORT?baud=921600",
        "115200 8N1; up to 272 Hz, or what the board states where its serial port is USB itself",
        "the same port may be the rig's backlight; its sync input marks the frames",
    ),
    "hwmon": Driver(
        "drivers.polled_power:HwmonPowerMeter",
        "a power sensor that Linux drives itself, under hwmon or iio",
        "hwmon:NAME or hwmon:FOLDER, e.g. hwmon:ina226; hwmon:NAME?channel=2",
        "files under /sys; as fast as the sensor's update_interval, at most 1000 Hz",
        "samples carry the computer's time; no sync input",
    ),
    "ppk2": Driver(
        "drivers.nordic_ppk2:Ppk2PowerMeter",
        "Nordic Power Profiler Kit II, as an ampere meter in the panel's supply",
        "ppk2:PORT?voltage=5.0, with the supply's voltage, 0.8 to 5.0 V, at most 1 A",
        "USB; 100 kHz, averaged to the rate asked for, 10 Hz to 10 kHz; frame line on D0",
        "needs the extra: pip install '.[instruments]' in the checkout (ppk2-api, GPLv2)",
        usb_ids=((0x1915, 0xC00A),),
    ),
    "scpi": Driver(
        "drivers.scpi_power:ScpiPowerMeter",
        "a bench supply, multimeter or power analyser that speaks SCPI",
        "scpi:HOST:PORT, scpi:HOST?channel=2 (port 5025), scpi:/dev/ttyUSB0?measure=current&voltage=5.0",
        "socket, or 9600 8N1; the power of an output, or a multimeter's current times a supply's voltage",
        "needs the extra: pip install '.[instruments]' in the checkout (pyvisa, pyvisa-py)",
    ),
    "visa": Driver(
        "drivers.scpi_power:VisaPowerMeter",
        "the same over USB, GPIB or VXI-11, by PyVISA's name of it",
        "visa:RESOURCE, e.g. visa:USB0::0x2A8D::0x1301::MY1::INSTR?channel=2",
        "those of the resource",
        "needs the extra: pip install '.[instruments]' in the checkout (pyvisa, pyvisa-py)",
    ),
    "battery": Driver(
        "drivers.polled_power:BatteryPowerMeter",
        "this computer's battery, by its own gauge: all that the computer takes (Linux)",
        "battery: or battery:NAME, e.g. battery:BAT0",
        "files under /sys/class/power_supply; ask for 1 Hz: gauges are slow, and smooth",
        "only while it is discharged; `evenlight measure saving` compares two versions of a film on it",
        needs_address=False,
        sample_rate=1.0,
    ),
    "adb": Driver(
        "drivers.polled_power:AdbPowerMeter",
        "the battery of an Android headset or phone: all that the device takes",
        "adb: or adb:SERIAL, as `adb devices` lists it, e.g. adb:192.168.1.20:5555",
        "the program `adb`, over the network, for over a cable it charges; ask for 1 Hz",
        "install it with: apt install adb",
        needs_address=False,
        sample_rate=1.0,
    ),
    "exec": _program(
        "ExecPowerMeter",
        "any power meter, read by a program of yours",
        'its rate, then one line of JSON for each sample: {"power_w": 1.25}',
    ),
    SIMULATED: Driver("simulated.power_meter:SimulatedPowerMeter", needs_address=False),
}
BACKLIGHTS = {
    "sysfs": Driver(
        "drivers.sysfs_backlight:SysfsBacklight",
        "the computer's own panel, as Linux drives it",
        "sysfs:NAME",
        "a folder under /sys/class/backlight; some milliseconds a setting",
        "steps that Linux calls non-linear need a measured `backlight_curve`",
    ),
    "ddc": Driver(
        "drivers.ddc_backlight:DdcBacklight",
        "a monitor over DDC/CI, in steps of about 1 %",
        "ddc:NUMBER, that of its I2C bus: ddc:5 for /dev/i2c-5",
        "50 ms between messages, 0.14 s a setting: for baselines and sweeps, not for every frame",
        "needs the extra: pip install '.[instruments]' in the checkout (monitorcontrol), and i2c-dev",
    ),
    BOARD: Driver(
        "drivers.power_board:BoardBacklight",
        "the PWM output of the power board (docs/power-board.md)",
        "board:PORT",
        "115200 8N1; the link is shared with the power meter where that names the same port",
    ),
    "exec": _program(
        "ExecBacklight",
        "any backlight, set by a program of yours",
        'one line of JSON for each setting: {"id": 2, "factor": 0.498}',
    ),
    SIMULATED: Driver(
        "simulated.panel:SimulatedBacklight",
        "a simulated backlight, in 4095 steps",
        "simulated",
        "none",
        needs_address=False,
    ),
    NO_BACKLIGHT: Driver("", "no backlight: pixels make the brightness", "none", "none"),
}
TRIGGERS = {
    "serial": Driver(
        "drivers.serial_trigger:SerialTrigger",
        "a trigger box or recorder at a serial port",
        "serial:PORT, serial:PORT?baud=115200",
        "one byte with the code; 115200 8N1",
    ),
    "rts": Driver(
        "drivers.serial_trigger:RtsTrigger",
        "a TTL input at the line RTS of a serial port",
        "rts:PORT, rts:PORT?pulse_ms=5",
        "a pulse of 5 ms for every trigger, whatever its code",
        "its levels are the port's: take a converter with TTL levels, not RS-232",
    ),
    "dtr": Driver(
        "drivers.serial_trigger:DtrTrigger",
        "the same at the line DTR",
        "dtr:PORT, dtr:PORT?pulse_ms=5",
        "as rts",
    ),
    "lsl": Driver(
        "drivers.lsl_trigger:LslTrigger",
        "recorders of the lab streaming layer, such as LabRecorder",
        "lsl:NAME, the name of the stream",
        "a marker stream of text, with the labels",
        "needs the extra: pip install '.[lsl]' in the checkout (pylsl)",
    ),
    SIMULATED: Driver(
        "simulated.trigger:SimulatedTrigger",
        "nothing: triggers are only noted in events.jsonl",
        "simulated",
        "none",
        needs_address=False,
    ),
}
