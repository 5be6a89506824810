"""The instruments' side of the line, for `simulated:example-spot` and the conformance test.

An emulated instrument is made of a simulation, whose panel it measures or dims: `receive` is given what the
driver sent and returns what is answered; `stream` returns what the instrument sends of itself.
"""

from typing import Any


class EmulatedInstrument:
    """All three instruments in one."""

    def __init__(self, simulation: Any) -> None:
        self._panel, self._came, self._step = simulation.panel, b"", 200

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a line, and return what is answered at once."""
        *lines, self._came = (self._came + data).split(b"\n")
        return b"".join(self._answer(line.decode()) for line in lines)

    def stream(self) -> bytes:
        """Return nothing: they speak when they are asked."""
        return b""

    def _answer(self, line: str) -> bytes:
        """Return the answer to a line."""
        number, command = line.split(" ", 1)
        if command.startswith("B "):
            self._step = int(command[2:])
            self._panel.set_backlight(self._step / 200)
        words = {"L?": f"{self._panel.luminance():.2f}", "W?": f"{self._panel.power():.4f}", "S?": "4711"}
        said = f"{number} {words.get(command, self._step)} "
        return f"{said}*{sum(said.encode()) % 256:02X}\n".encode()
