"""The backlights that there are drivers for, as `evenlight measure list` shows them."""

from __future__ import annotations

from evenlight.hardware.driver_notes import DriverNote

BACKLIGHTS: tuple[DriverNote, ...] = (
    DriverNote(
        "sysfs",
        "the computer's own panel, as Linux drives it",
        "sysfs:NAME",
        "a folder under /sys/class/backlight; some milliseconds a setting",
        note="steps that Linux calls non-linear need a measured `backlight_curve`",
    ),
    DriverNote(
        "ddc",
        "a monitor over DDC/CI, in steps of about 1 %",
        "ddc:NUMBER, that of its I2C bus: ddc:5 for /dev/i2c-5",
        "50 ms between messages, 0.14 s a setting: for baselines and sweeps, not for every frame",
        note="needs the extra: pip install 'evenlight[instruments]' (monitorcontrol), and the module i2c-dev",
    ),
    DriverNote(
        "board",
        "the PWM output of the power board (docs/power-board.md)",
        "board:PORT",
        "115200 8N1; the link is shared with the power meter where that names the same port",
    ),
    DriverNote(
        "simulated",
        "a simulated backlight, in 4095 steps",
        "simulated, or simulated:DRIVER for a driver on its emulated instrument",
        "none",
    ),
    DriverNote(
        "none",
        "no backlight: pixels make the brightness",
        "none",
        "none",
    ),
)
