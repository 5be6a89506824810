"""A monitor that is not there: it speaks DDC/CI (VESA DDC/CI 1.1) over a socket of the loopback.

On the host's side is the library's own control of a monitor, so that its framing, checksums and waiting run
on real reads and writes; only the opening of an I2C bus is replaced.
"""

from __future__ import annotations

import errno
import functools
import operator
import os
import select
import socket
from typing import Any
from urllib.parse import urlsplit

from evenlight.hardware.drivers.ddc_backlight import DdcBacklight
from evenlight.hardware.simulated.panel import Simulation

HOST, MONITOR = 0x51, 0x6E  # what begins a message to the monitor, and one from it
REPLY_TO = 0x50  # the host's address in a reply's checksum
GET, REPLY, SET = 0x01, 0x02, 0x03
BRIGHTNESS, CONTRAST = 0x10, 0x12
NO_ERROR, UNSUPPORTED = 0, 1
PATIENCE = 0.1  # [s] beyond the library's 40 ms: the emulator's thread may have to wait for a busy machine


class EmulatedMonitor:
    """The monitor's side: messages in, replies out, and a backlight that follows.

    Parameters
    ----------
    simulation : Simulation, optional
        Whose panel the monitor's is.
    highest : int, optional
        Steps of its brightness.
    lowest_taken : int, optional
        A lower step is taken for this one, as by monitors whose menu holds the brightness.
    has_brightness : bool, optional
        False for one that has no brightness to be set.
    """

    def __init__(
        self,
        simulation: Simulation | None = None,
        highest: int = 100,
        lowest_taken: int = 0,
        *,
        has_brightness: bool = True,
    ) -> None:
        self._simulation, self._highest, self._lowest = simulation, highest, lowest_taken
        self._has_brightness, self._came = has_brightness, b""
        self.step = highest

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a message, and return what is answered at once."""
        self._came += data
        answer = b""
        while message := self._next_message():
            answer += self._answer(message)
        return answer

    def stream(self) -> bytes:
        """Return what the monitor sends of itself: nothing."""
        return b""

    def _next_message(self) -> bytes:
        """Return the first whole message of what came, and take it away; nothing if there is none."""
        begin = self._came.find(HOST)
        self._came = self._came[begin:] if begin >= 0 else b""
        length = (self._came[1] & 0x7F) + 3 if len(self._came) > 1 else 0
        if not length or len(self._came) < length:
            return b""
        message, self._came = self._came[:length], self._came[length:]
        return message

    def _answer(self, message: bytes) -> bytes:
        """Return the reply to a message; a setting, or one whose checksum is wrong, has none."""
        if _checksum(bytes([MONITOR]) + message) != 0:
            return b""
        command, code = message[2], message[3]
        if command == SET and code == BRIGHTNESS:
            self._set(int.from_bytes(message[4:6], "big"))
        return self._reply(code) if command == GET else b""

    def _reply(self, code: int) -> bytes:
        """Return what the monitor answers when it is asked for a VCP code."""
        codes = {CONTRAST: (100, 50)} | (
            {BRIGHTNESS: (self._highest, self.step)} if self._has_brightness else {}
        )
        result = NO_ERROR if code in codes else UNSUPPORTED
        body = bytes([REPLY, result, code, 0])
        body += b"".join(value.to_bytes(2, "big") for value in codes.get(code, (0, 0)))
        reply = bytes([MONITOR, 0x80 | len(body)]) + body
        return reply + bytes([_checksum(bytes([REPLY_TO]) + reply)])

    def _set(self, step: int) -> None:
        """Take a step; a monitor ignores one that it does not have."""
        if not self._has_brightness or step > self._highest:
            return
        self.step = max(step, self._lowest)
        if self._simulation is not None:
            self._simulation.panel.set_backlight(self.step / self._highest)


def emulated_control(url: str) -> Any:
    """Return the library's control of a monitor, on the link of an emulated one instead of an I2C bus.

    Like on a bus, a reply that is not there is an error and not an endless wait, and so is a monitor that is
    gone.
    """
    from monitorcontrol.vcp.vcp_linux import LinuxVCP, VCPIOError

    class EmulatedControl(LinuxVCP):  # type: ignore[misc] # the library carries no types
        """A control whose bus is a socket."""

        def __enter__(self) -> Any:
            try:
                link = socket.create_connection((urlsplit(url).hostname, urlsplit(url).port), timeout=5)
            except ConnectionRefusedError as error:
                raise FileNotFoundError(error) from None  # as of a bus that is not there
            link.setblocking(False)
            self.fd = link.detach()
            return self

        def read_bytes(self, num_bytes: int) -> bytes:
            select.select([self.fd], [], [], PATIENCE)
            data: bytes = super().read_bytes(num_bytes)
            if not data:
                raise VCPIOError("no reply") from OSError(errno.ENODEV, os.strerror(errno.ENODEV))
            return data

    return EmulatedControl(0)


class DdcOnLink(DdcBacklight):
    """The driver at the port of an emulated monitor.

    A monitor takes its time by the computer's own clock, whatever `clock` other devices have, and the library
    has one time for a reply.
    """

    def __init__(self, port: int | str, clock: object = None, timeout: float | None = None) -> None:
        super().__init__(0, panel=emulated_control(f"socket://127.0.0.1:{port}"))


def _checksum(data: bytes) -> int:
    """Return the exclusive or of all bytes."""
    return functools.reduce(operator.xor, data, 0)
