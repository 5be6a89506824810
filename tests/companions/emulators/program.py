"""An emulated program as `exec:` runs one: it answers JSON lines for the simulated panel, over a link.

What is run is this file, `program.py PORT`, which hands lines on between its own input and output and the
link; so faults of a link are faults of the program's lines.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # run as a program, it needs nothing that is installed
    from evenlight.hardware.simulated.panel import Simulation

WHITE = (0.3127, 0.329)
STEPS = 1000  # of its backlight above 0
FASTEST = 500.0  # [Hz] samples of power
AT_ONCE = 65536  # bytes


class EmulatedProgram:
    """What the program answers.

    Parameters
    ----------
    simulation : Simulation
        The panel that it reads and dims.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._came, self._factor = simulation, b"", 1.0
        self._rate, self._begun, self._count = 0.0, 0.0, 0

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a line, and return what is answered at once."""
        *lines, self._came = (self._came + data).split(b"\n")
        self._rate = self._rate if all(lines) else 0.0  # an empty one: the program has ended
        answers = (self._answer(json.loads(line)) for line in lines if line)
        return b"".join(json.dumps(answer).encode() + b"\n" for answer in answers)

    def stream(self) -> bytes:
        """Return the samples since the last call."""
        panel, lines = self._simulation.panel, b""
        while self._rate and (at := self._begun + self._count / self._rate) <= self._simulation.clock():
            sample = {"power_w": panel.power(at), "time_s": at, "count": self._count}
            lines += json.dumps(sample).encode() + b"\n"
            self._count += 1
        return lines

    def _answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a question."""
        panel, answer = self._simulation.panel, {"id": question["id"]}
        if question.get("read") == "apparatus":
            return answer | {"model": "an emulated program's", "serial_number": "4711"}
        if question.get("read") == "luminance":
            x, y = WHITE
            return answer | {"luminance_cd_m2": panel.luminance(), "x": x, "y": y, "status": "ok"}
        if "rate_hz" in question:
            self._rate, self._begun = min(question["rate_hz"], FASTEST), self._simulation.clock()
            self._count = 0
            return answer | {"rate_hz": self._rate}
        if "factor" in question:
            self._factor = round(question["factor"] * STEPS) / STEPS
            panel.set_backlight(self._factor)
        return answer | {"factor": self._factor, "smallest_factor": 1 / STEPS, "step": 1 / STEPS}


def relay(port: int) -> None:
    """Hand bytes on between standard input and output and a port, until one of them ends."""
    with socket.create_connection(("127.0.0.1", port)) as link:
        ends = {sys.stdin.fileno(): link.fileno(), link.fileno(): sys.stdout.fileno()}
        try:
            while True:
                for source in select.select(list(ends), [], [])[0]:
                    if not (data := os.read(source, AT_ONCE)):
                        sys.exit("the instrument is gone" if source == link.fileno() else 0)
                    os.write(ends[source], data)
        finally:
            with contextlib.suppress(OSError):
                link.sendall(b"\n")  # no more samples


if __name__ == "__main__":
    relay(int(sys.argv[1]))
