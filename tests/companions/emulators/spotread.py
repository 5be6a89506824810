"""An emulated colorimeter under ArgyllCMS: a real program that is run, and prints what `spotread` would."""

from __future__ import annotations

import shlex
import subprocess
import sys
import tempfile
from contextlib import AbstractContextManager
from pathlib import Path

from emulators.link import EmulatedLink, FaultPlan
from emulators.luminance_meters import WHITE, EmulatedMeter, tristimulus

from evenlight.hardware.protocols import Fault
from evenlight.hardware.simulated.luminance_meter import MeterPhysics
from evenlight.hardware.simulated.panel import Simulation

PROGRAM = Path(__file__).with_name("spotread_program.py")
NUMBER = "1"
USAGE = """Measure spot values, Version 2.3.1
Author: Graeme W. Gill, licensed under the GPL Version 2 or later
usage: spotread [-options] [logfile]
 -v                   Verbose mode
 -c listno            Set instrument port from the following list (default 1)
    1 = '/dev/bus/usb/003/008 (X-Rite i1 DisplayPro, ColorMunki Display)'
    2 = '/dev/ttyS0'
 -e                   Use emissive measurement mode (absolute results)
"""
WORDS = {
    Fault.OVER_RANGE: "Spot read failed due to misread (Light level is too high)",
    Fault.UNDER_RANGE: "Spot read failed due to misread (Light level is too low)",
    Fault.LOW_BATTERY: "Got fatal error 'Hardware failure' (Battery level too low to measure)",
    Fault.BUSY: "usb_open_port: open '/dev/bus/usb/003/008' config 1 failed (Device being used ?)",
    Fault.REFUSED: "Spot read needs a calibration before continuing",
    Fault.DISCONNECTED: "Failed to initialise communications with instrument",
    Fault.NO_REPLY: "Spot read failed due to communication problem.",
    Fault.GARBLED: "Spot read failed due to misread (Inconsistent readings)",
}
WRONG = "Unknown, inappropriate or no instrument detected"


class SpotreadDialogue(EmulatedMeter):
    """What the program prints for its options: usage and list, or one reading; as `EmulatedMeter`."""

    own_physics = MeterPhysics(
        lowest=0.02, highest=1_000.0, resolution=1e-6, significant_digits=9, reading_time=1.0
    )

    def _answer(self, command: str) -> bytes:
        """Return what is printed for a line of options."""
        options = command.split()
        if options == ["-?"]:
            return f"{USAGE}\n".encode()
        if options[:4] != ["-e", "-x", "-N", "-O"]:
            return f"Diagnostic: Unknown flag in {command}\n{USAGE}\n".encode()
        return f"\n {self._reading(options[4:])}\n\n".encode()

    def _reading(self, options: list[str]) -> str:
        """Return the line of a reading, or of why there is none."""
        if options != ["-c", NUMBER]:
            return WRONG
        shown, fault = self._look()
        if fault is not None:
            return WORDS[fault]
        X, Y, Z = tristimulus(shown)
        x, y = WHITE
        return f"Result is XYZ: {X:f} {Y:f} {Z:f}, Yxy: {Y:f} {x:f} {y:f}"


class EmulatedSpotread(AbstractContextManager["EmulatedSpotread"]):
    """The program, and the colorimeter behind it.

    Parameters
    ----------
    simulation : Simulation
        The panel that it looks at, and its noise.
    physics : MeterPhysics, optional
        What is true of the instrument.
    plan : FaultPlan, optional
        What goes wrong between the instrument and the program; its first reply is the list of instruments.

    Attributes
    ----------
    url : str
        What the driver opens.
    dialogue : SpotreadDialogue
        The instrument.
    """

    def __init__(
        self,
        simulation: Simulation,
        physics: MeterPhysics | None = None,
        plan: FaultPlan | None = None,
    ) -> None:
        self.dialogue = SpotreadDialogue(simulation, physics)
        self._link = EmulatedLink(self.dialogue, plan)
        self._folder = tempfile.TemporaryDirectory(prefix="spotread-")
        script = Path(self._folder.name) / "spotread"
        port = self._link.url.rpartition(":")[2]
        # -I -S: it needs nothing that is installed, and starts in a third of the time without.
        command = shlex.join([sys.executable, "-I", "-S", str(PROGRAM), port])
        # By a process of its own: a file that this one has open for writing may be so in a child that another
        # thread starts meanwhile, and cannot be run as long.
        write = ["sh", "-c", 'cat > "$0" && chmod 700 "$0"', str(script)]
        subprocess.run(write, input=f'#!/bin/sh\nexec {command} "$@"\n', text=True, check=True)
        self.url = f"{NUMBER}@{script}"

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()
        self._link.__exit__(None, None, None)
