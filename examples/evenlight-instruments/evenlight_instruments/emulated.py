"""The side of the instruments, for `simulated:example-spot` and `measure conform`: no device is needed."""

import os
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

POLL = 0.01  # [s] between two looks whether it has ended


class EmulatedInstrument:
    """All three instruments in one; the panel of a simulation is what they measure or dim."""

    def __init__(self, simulation: Any) -> None:
        self._panel, self._came, self._step = simulation.panel, b"", 200

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a line, and return what is answered at once."""
        *lines, self._came = (self._came + data).split(b"\n")
        return b"".join(self._answer(line.decode()) for line in lines)

    def _answer(self, line: str) -> bytes:
        """Return the answer to a line."""
        number, command = line.split(" ", 1)
        if command.startswith("B "):
            self._step = int(command[2:])
            self._panel.set_backlight(self._step / 200)
        words = {"L?": f"{self._panel.luminance():.2f}", "W?": f"{self._panel.power():.4f}", "S?": "4711"}
        said = f"{number} {words.get(command, self._step)} "
        return f"{said}*{sum(said.encode()) % 256:02X}\n".encode()


@contextmanager
def emulated(simulation: Any) -> Iterator[str]:
    """Yield the address of an emulated instrument: a pseudo-terminal, which is a serial port of 8N1."""
    own, other = os.openpty()
    tty.setraw(other)
    instrument, ended = EmulatedInstrument(simulation), threading.Event()

    def serve() -> None:
        while not ended.is_set():
            if select.select([own], [], [], POLL)[0]:
                os.write(own, instrument.receive(os.read(own, 4096)))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(other)
    finally:
        ended.set()
        thread.join()
        os.close(own)
        os.close(other)
