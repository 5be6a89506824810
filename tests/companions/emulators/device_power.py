"""Emulated devices that tell their own power: a battery's gauge, a phone over adb."""

from __future__ import annotations

import subprocess

from emulators.power_meters import PipedFiles

from evenlight.hardware.simulated.panel import Simulation

CELL = 3.9  # [V]
BATTERY = "class/power_supply/battery"
PHONE = "EMULATED0"
# What `adb` does as far as the driver asks; the device's shell is this computer's, files lie in the folder.
ADB = r"""#!/bin/sh
if [ "$1" = devices ]; then
    printf 'List of devices attached\n%s\tdevice\n\n' PHONE
    exit 0
fi
if [ "$1 $2 $3" != "-s PHONE shell" ]; then
    echo "adb: device '$2' not found" >&2
    exit 1
fi
shift 3
exec sh -c "getprop() { echo 'Emulated phone'; }; $(printf '%s' "$*" | sed 's#/sys/#FOLDER/#g')"
"""


class BatteryEmulator(PipedFiles):
    """A battery with a simulated panel as its only load; its gauge is always up to date.

    Parameters
    ----------
    simulation : Simulation
        The panel.

    Attributes
    ----------
    url : str
        The folder, which a driver opens.
    """

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(
            {
                f"{BATTERY}/type": "Battery",
                f"{BATTERY}/status": "Discharging",
                f"{BATTERY}/voltage_now": f"{CELL * 1e6:.0f}",
            },
            {f"{BATTERY}/current_now": lambda: -simulation.panel.power() / CELL * 1e6},
        )
        self.url = str(self.folder / BATTERY)


class AdbEmulator(BatteryEmulator):
    """A program `adb`, and a phone with a simulated panel as its only load; as `BatteryEmulator`."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        program = self.folder / "adb"
        text = ADB.replace("PHONE", PHONE).replace("FOLDER", str(self.folder))
        # By another process: a child that a thread of this one forks meanwhile would hold it open, and what
        # is open for writing cannot be run.
        write = ["sh", "-c", 'cat > "$1" && chmod 700 "$1"', "sh", str(program)]
        subprocess.run(write, input=text.encode(), check=True)
        self.url = f"{PHONE}@{program}"
