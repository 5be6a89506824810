"""The link to an emulated instrument: a socket or pseudo-terminal, with faults on request."""

from __future__ import annotations

import enum
import os
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from evenlight.hardware.operating_system import require_unix

POLL = 0.002  # [s] between two looks at the link, and at what the instrument sends of itself
ENOUGH = 4096  # bytes read at once
AT_ONCE = 1024  # bytes written to a pseudo-terminal at once: fewer than it holds
GARBAGE = bytes([0x80, 0xFF, 0x00, 0x9C, 0x1B, 0x7F])  # neither text nor a number, whatever the protocol


class Emulator(Protocol):
    """The instrument's side of a dialogue."""

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a command, and return what is answered at once."""

    def stream(self) -> bytes:
        """Return what the instrument sends of itself since the last call."""


class LinkFault(enum.Enum):
    """What can go wrong between an instrument and the computer."""

    NO_REPLY = "no_reply"
    LATE_REPLY = "late_reply"
    PARTIAL_LINE = "partial_line"  # the first half, and no more
    GARBAGE = "garbage"  # bytes that are no reply, with the reply's end
    DISCONNECT = "disconnect"  # half of the reply, then the link is gone


class ExtraReply(enum.Enum):
    """What can come besides a reply, which a driver may but need not notice."""

    DOUBLED = "doubled"  # the reply, and at once the same again
    MERGED = "merged"  # the reply without its end, and at once the same again
    STRAY_LINE = "stray_line"  # the reply, and after it the one before it, which nobody asked for


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """Which replies go wrong, and how."""

    fault: LinkFault | ExtraReply  # how
    first: int = 1  # the first reply that does, from 1; what is streamed counts as replies, too
    count: int = 1  # how many do, from there on
    delay: float = 0.5  # of a late reply [s]

    def strikes(self, reply: int) -> bool:
        """Return whether a reply, counted from 1, goes wrong."""
        return self.first <= reply < self.first + self.count


class EmulatedLink(AbstractContextManager["EmulatedLink"]):
    """Serves an emulated instrument on the loopback, in a thread that ends with the context.

    Parameters
    ----------
    emulator : Emulator
        The instrument.
    plan : FaultPlan, optional
        What goes wrong.
    spoil : callable, optional
        In place of a plan: what arrives of some bytes, each part with the pause before it [s].
    pseudo_terminal : bool, optional
        On a pseudo-terminal, which is a serial port of 8N1, instead of a socket, which is one of any setting.

    Attributes
    ----------
    url : str
        What a driver opens.
    """

    def __init__(
        self,
        emulator: Emulator,
        plan: FaultPlan | None = None,
        spoil: Callable[[bytes], list[tuple[float, bytes]]] = lambda sent: [(0.0, sent)],
        *,
        pseudo_terminal: bool = False,
    ) -> None:
        self._emulator, self._plan, self._spoil, self._replies = emulator, plan, spoil, 0
        self._reply_before = b""
        self._ended = threading.Event()
        self._server: _Server = _TerminalServer() if pseudo_terminal else _SocketServer()
        self.url = self._server.url
        self.errors: list[Exception] = []  # of the emulator: a driver sees only silence then
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def replies(self) -> int:
        """Return how many replies there were so far, those that went wrong too."""
        return self._replies

    def unplug(self) -> None:
        """Break the connection, as when the cable is pulled; the thread ends."""
        self._ended.set()
        self._thread.join(timeout=5)

    def __exit__(self, *_: object) -> None:
        self.unplug()
        if self.errors:
            raise self.errors[0]

    def _serve(self) -> None:
        """Answer until the end."""
        try:
            while not self._ended.is_set():
                if (data := self._server.receive()) and (answer := self._emulator.receive(data)):
                    self._reply(answer)
                if streamed := self._emulator.stream():
                    self._reply(streamed)
        except OSError:
            pass  # the client is gone, or the link was broken on purpose
        except Exception as error:  # what a test is to see
            self.errors.append(error)
        finally:
            self._server.close()

    def _reply(self, data: bytes) -> None:
        """Send some bytes, or what a fault makes of them."""
        self._replies += 1
        plan, (before, self._reply_before) = self._plan, (self._reply_before, data)
        if plan is None or not plan.strikes(self._replies):
            for pause, part in self._spoil(data):
                time.sleep(pause)
                self._send(part)
            return
        half = data[: max(1, len(data) // 2)]
        match plan.fault:
            case LinkFault.NO_REPLY:
                pass
            case LinkFault.LATE_REPLY:
                time.sleep(plan.delay)  # a slow instrument reads no commands in the meantime, either
                self._send(data)
            case LinkFault.PARTIAL_LINE:
                self._send(half)
            case LinkFault.GARBAGE:
                ending = data[len(data.rstrip(b"\r\n")) :]
                self._send(GARBAGE + ending)
            case ExtraReply.DOUBLED:
                self._send(data + data)
            case ExtraReply.MERGED:
                self._send(data.rstrip(b"\r\n") + data)
            case ExtraReply.STRAY_LINE:
                self._send(data + before)
            case LinkFault.DISCONNECT:
                self._send(half)
                self._ended.set()

    def _send(self, data: bytes) -> None:
        """Send all of some bytes, as fast as they are read; what is not read ends with the link."""
        while data and not self._ended.is_set():
            data = data[self._server.send(data) :]


class _Server(Protocol):
    """One end of a link."""

    url: str

    def receive(self) -> bytes:
        """Return what came within `POLL`."""

    def send(self, data: bytes) -> int:
        """Send some bytes, as many as the link takes within `POLL`, and return how many."""

    def close(self) -> None:
        """Break the link."""


class _SocketServer:
    """A port on the loopback that serves one client; a second is turned away while the first is there."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._client: socket.socket | None = None
        self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def receive(self) -> bytes:
        waiting = [self._listener] + ([self._client] if self._client else [])
        ready, _, _ = select.select(waiting, [], [], POLL)
        if self._listener in ready:
            client, _ = self._listener.accept()
            if self._client is None:
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                client.settimeout(POLL)
                self._client = client
            else:
                client.close()
        if self._client not in ready or self._client is None:
            return b""
        try:
            data = self._client.recv(ENOUGH)
        except ConnectionError:
            data = b""
        if not data:
            self._client.close()
            self._client = None
        return data

    def send(self, data: bytes) -> int:
        if self._client is not None:
            try:
                return self._client.send(data)
            except TimeoutError:
                return 0
            except ConnectionError:
                pass
        return len(data)  # a client that left wants no answer

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
        self._listener.close()


class _TerminalServer:
    """A pseudo-terminal: what a USB instrument of 8 data bits looks like."""

    def __init__(self) -> None:
        require_unix("an emulated USB instrument")
        import tty

        self._own, self._other = os.openpty()
        tty.setraw(self._other)
        os.set_blocking(self._own, False)
        self.url = os.ttyname(self._other)

    def receive(self) -> bytes:
        ready, _, _ = select.select([self._own], [], [], POLL)
        return os.read(self._own, ENOUGH) if ready else b""

    def send(self, data: bytes) -> int:
        _, ready, _ = select.select([], [self._own], [], POLL)
        return os.write(self._own, data[:AT_ONCE]) if ready else 0

    def close(self) -> None:
        # The other end stays open until here, so that a port may be closed and opened again.
        os.close(self._own)
        os.close(self._other)
