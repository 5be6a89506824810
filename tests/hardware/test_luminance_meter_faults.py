"""Random faults between a luminance meter and its driver make an error, and never a made-up number.

The instruments here are written from their manuals and from what public drivers say of them, not from our
drivers: CS-100A manual p. 6 and a MATLAB class that quotes it (Minolta), PR-655/670 manual p. 126, a MATLAB
class that quotes the PR-650's manual, CRS's own example (ColorCAL II), printf of ArgyllCMS's spotread. They
answer in this process, on a clock that passes only while a driver waits. By hand, with more exchanges:

    EVENLIGHT_FAULT_EXCHANGES=5000 python -m pytest -s -n 0 tests/hardware/test_luminance_meter_faults.py
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import accumulate, count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import serial
from emulators.ours import OURS, LinkKind
from spoilt_replies import Spoiler, Tally

from evenlight.hardware.drivers import serial_link, serial_meter
from evenlight.hardware.drivers.colorcal import ColorCal
from evenlight.hardware.drivers.konica_minolta import Cs100a, Ls100, Ls110
from evenlight.hardware.drivers.photo_research import Pr650, Pr655, Pr670
from evenlight.hardware.drivers.spotread import Spotread
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import InstrumentError, LuminanceMeter, Reading

EXCHANGES = int(os.environ.get("EVENLIGHT_FAULT_EXCHANGES", "200"))
TIMEOUT = 0.2  # [s] on the clock below
FAULTY = 0.6  # share of exchanges that a fault strikes: one of the replies in it
N_REPLIES = 3  # among which it is chosen
LATE, AFTER = (0.1, 0.9), (0.0, 0.004, 0.02, 0.3)  # [s]
SESSION = 50  # readings between one opening and the next
FAULTS = (
    "lost bytes",
    "cut",
    "merged",
    "doubled",
    "late",
    "stray before",
    "stray after",
    "unasked",
    "garbage",
    "flipped bit",
    "silence",
)
Value = tuple[float, float, float]  # luminance, x, y; x and y are 0 where there are none


@dataclass
class PassingTime:
    """In place of the module `time`: it passes while somebody waits."""

    now: float = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@dataclass
class StandIn:
    """An instrument at the other end; what it measured, as it sent it, is kept."""

    rng: np.random.Generator
    measured: list[Value] = field(default_factory=list)
    came: bytes = b""
    parity = False  # whether its bytes have one, on top
    flips = True  # whether a flipped bit reaches the driver: not over USB, nor through a pipe
    end = b"\r\n"
    ends_of_commands = b"\n"

    def take(self, data: bytes) -> list[tuple[float, bytes]]:
        """Take bytes, and return how long each answer takes [s], and the answers."""
        self.came += data
        answers = []
        while self.ends_of_commands in self.came:
            command, _, self.came = self.came.partition(self.ends_of_commands)
            answers += self.answers(command.decode("latin-1").strip())
        return answers

    def answers(self, command: str) -> list[tuple[float, bytes]]:
        raise NotImplementedError

    def reading(self) -> tuple[bytes, Value]:
        """A reading as it is sent, and its values."""
        raise NotImplementedError

    def measure(self) -> bytes:
        """Measure, and return what is sent of it."""
        sent, value = self.reading()
        self.measured.append(value)
        return sent

    def on_the_line(self, sent: bytes) -> bytes:
        """What a port that knows no parity hands over: seven bits with even parity on top."""
        return bytes(byte | (byte.bit_count() % 2) << 7 for byte in sent) if self.parity else sent

    def light(self, highest: float = 3000.0) -> Value:
        """Some light: never the same again, so that an old value is told from a new one."""
        luminance = float(10 ** self.rng.uniform(0.0, np.log10(highest)))
        return luminance, float(self.rng.uniform(0.25, 0.40)), float(self.rng.uniform(0.28, 0.40))


class StandInLs100(StandIn):
    """Sign and six characters, the decimal point among them; 7E2."""

    parity = True
    ends_of_commands = b"\r\n"

    def answers(self, command: str) -> list[tuple[float, bytes]]:
        if command == "MES":
            if self.rng.random() < 0.03:
                return [(0.05, b"ER10\r\n")]
            return [(float(self.rng.uniform(0.01, 0.1)), self.measure())]
        return [(0.005, b"OK00\r\n" if command in ("MDS,04", "CLE") else b"ER00\r\n")]

    def luminance(self) -> tuple[str, Value]:
        luminance, x, y = self.light()
        text = f"{luminance:#.4g}"
        return f" {text:>6}", (float(text), x, y)

    def reading(self) -> tuple[bytes, Value]:
        text, (luminance, _, _) = self.luminance()
        return f"OK00,{text}\r\n".encode(), (luminance, 0.0, 0.0)


class StandInCs100a(StandInLs100):
    """28 bytes: Y in columns 6 to 12, x in 14 to 19, y in 21 to 26."""

    def reading(self) -> tuple[bytes, Value]:
        text, (luminance, x, y) = self.luminance()
        sent = f"OK00,{text}, {x:.4f}, {y:.4f}\r\n".replace(" 0.", " .").encode()
        assert len(sent) == 28
        return sent, (luminance, round(x, 4), round(y, 4))


class StandInPr655(StandIn):
    """qqqqq,UUUU,Y.YYYe+ee,x.xxxx,y.yyyy; commands end with CR, but for those that enter and leave."""

    model, remote, last = "PR-655", False, b"-2000\r\n"
    ends_of_commands = b"\r"

    def take(self, data: bytes) -> list[tuple[float, bytes]]:
        if not self.remote:
            self.came += data
            if b"PHOTO" not in self.came:
                return []
            self.remote, self.came = True, b""
            return [(0.05, b" REMOTE MODE\r\n")]
        if not self.came and data == b"Q":
            self.remote = False
            return []
        return super().take(data)

    def answers(self, command: str) -> list[tuple[float, bytes]]:
        if command == "M1":
            self.last = b"-8\r\n" if self.rng.random() < 0.03 else self.measure()
        facts = {"D111": self.model, "D110": "60102905", "D114": "2.02"}
        if command in ("M1", "D1"):
            return [(0.1 if command == "M1" else 0.005, self.last)]
        if command in facts:
            return [(0.005, f"00000,{facts[command]}\r\n".encode())]
        return [(0.005, b"0000\r\n" if command.startswith("S") else b"-1000\r\n")]

    def reading(self) -> tuple[bytes, Value]:
        luminance, x, y = self.light()
        text = f"{luminance:.3e},{x:.4f},{y:.4f}"
        return f"00000,0,{text}\r\n".encode(), (float(f"{luminance:.3e}"), round(x, 4), round(y, 4))


class StandInPr670(StandInPr655):
    """As the PR-655."""

    model = "PR-670"


class StandInPr650(StandIn):
    """qq,U,X.XXXEsee,Y.YYYEsee,Z.ZZZEsee of the last measurement."""

    last = b"00,0,0.000E+00,0.000E+00,0.000E+00\r\n"

    def answers(self, command: str) -> list[tuple[float, bytes]]:
        if command == "m0":
            self.last = self.measure()
            return [(0.1, b"000\r\n")]
        return [(0.005, self.last if command == "d2" else b"000\r\n")]

    def reading(self) -> tuple[bytes, Value]:
        luminance, x, y = self.light()
        sent = [f"{value:.3E}" for value in (luminance * x / y, luminance, luminance * (1 - x - y) / y)]
        X, Y, Z = (float(text) for text in sent)
        return f"00,0,{','.join(sent)}\r\n".encode(), (Y, X / (X + Y + Z), Y / (X + Y + Z))


COLORCAL_ROWS = {
    "r01": "OK00, 8053,52040,50642",
    "r02": "OK00,  310, 9120,50120",
    "r03": "OK00,50220,   40,11250",
}
COLORCAL_MATRIX = np.array([[0.8053, -0.2040, -0.0642], [0.0310, 0.9120, -0.0120], [-0.0220, 0.0040, 1.1250]])


class StandInColorCal(StandIn):
    """Three fields of six characters, to be corrected with the matrix; LF CR, then a prompt."""

    end, flips = b"\n\r", False

    def answers(self, command: str) -> list[tuple[float, bytes]]:
        if command == "MES":
            return [(0.1, self.measure())]
        text = COLORCAL_ROWS.get(command, "ER00")
        return [(0.005, self.line("OK00,1,8096,100.10,3100042,1.24" if command == "IDR" else text))]

    def line(self, text: str) -> bytes:
        return f"\n\r{text}\n\r>".encode()

    def reading(self) -> tuple[bytes, Value]:
        luminance, x, y = self.light(highest=300.0)
        wanted = np.array([luminance * x / y, luminance, luminance * (1 - x - y) / y])
        raw = [f"{value:6.2f}" for value in np.linalg.solve(COLORCAL_MATRIX, wanted)]
        X, Y, Z = (COLORCAL_MATRIX @ np.array([float(text) for text in raw])).tolist()
        return self.line(f"OK00,{','.join(raw)}"), (Y, X / (X + Y + Z), Y / (X + Y + Z))


class StandInSpotread(StandIn):
    """Prints X, Y, Z and Y, x, y with printf's %f."""

    end, flips = b"\n", False
    listed = (
        b"Measure spot values, Version 2.3.1\n -c listno\n    1 = '/dev/bus/usb/003/008 (i1 DisplayPro)'\n"
    )

    def reading(self) -> tuple[bytes, Value]:
        luminance, x, y = (float(f"{value:f}") for value in self.light())
        X, Z = luminance * x / y, luminance * (1 - x - y) / y
        text = f" Result is XYZ: {X:f} {luminance:f} {Z:f}, Yxy: {luminance:f} {x:f} {y:f}"
        return f"\n{text}\n\n".encode(), (luminance, x, y)


class Faults:
    """Strikes one reply of an exchange, or none: of two at once nothing can be told.

    A second instrument's answer, say, where one's own is lost.
    """

    def __init__(self, stand_in: StandIn) -> None:
        self._rng, self._stand_in = stand_in.rng, stand_in
        kinds = tuple(kind for kind in FAULTS if stand_in.flips or kind != "flipped bit")
        self.spoiler = Spoiler(stand_in.rng, kinds, self._stray, LATE, AFTER)
        self.on, self.until = True, 0.0  # when what the last one made has come [s]
        self.left = 0  # replies until one is struck

    def begin_exchange(self, now: float) -> None:
        """Choose the reply that is struck, if one is."""
        strikes = self.on and now >= self.until and self._rng.random() < FAULTY
        self.left = int(self._rng.integers(1, N_REPLIES + 1)) if strikes else 0

    def arrivals(self, begun: float, sent: bytes) -> list[tuple[float, bytes]]:
        """What comes of a reply that is complete at a time, and when [s]."""
        self.left -= 1
        if self.left != 0:
            return [(begun, sent)]
        spoilt = self.spoiler.spoil(sent)
        times = accumulate((pause for pause, _ in spoilt), initial=begun)
        next(times)
        return [(when, part) for when, (_, part) in zip(times, spoilt, strict=True)]

    def _stray(self) -> bytes:
        """What a second instrument sends, of another model now and then."""
        if isinstance(self._stand_in, StandInSpotread):  # a program has its output for itself
            return b""
        other = b"OK00,   77.7\r\n" if self._rng.random() < 0.2 else self._stand_in.reading()[0]
        return self._stand_in.on_the_line(other)


class Wire:
    """A serial port in this process, with an instrument behind it."""

    def __init__(self, stand_in: StandIn, faults: Faults, clock: PassingTime) -> None:
        self._stand_in, self._faults, self._clock = stand_in, faults, clock
        self._free = 0.0  # when the instrument has answered everything [s]
        self._on_its_way: list[tuple[float, int, bytes]] = []
        self._numbers = count()

    def write(self, data: bytes) -> None:
        for duration, answer in self._stand_in.take(data):
            sent = self._stand_in.on_the_line(answer)
            self._free = max(self._free, self._clock.now) + duration
            arrivals = self._faults.arrivals(self._free, sent)
            self._free = min((when for when, part in arrivals if part == sent), default=self._free)
            if self._faults.left == 0:
                self._faults.until = max((when for when, _ in arrivals), default=self._free)
            self._on_its_way += [(when, next(self._numbers), part) for when, part in arrivals]

    def flush(self) -> None: ...

    def close(self) -> None: ...

    def read(self, size: int) -> bytes:
        assert size > 0
        due = sorted(each for each in self._on_its_way if each[0] <= self._clock.now)
        self._on_its_way = [each for each in self._on_its_way if each[0] > self._clock.now]
        return b"".join(part for *_, part in due)


METERS: dict[str, tuple[type[StandIn], Callable[..., LuminanceMeter]]] = {
    "ls100": (StandInLs100, Ls100),
    "ls110": (StandInLs100, Ls110),
    "cs100a": (StandInCs100a, Cs100a),
    "pr655": (StandInPr655, Pr655),
    "pr670": (StandInPr670, Pr670),
    "pr650": (StandInPr650, Pr650),
    "colorcal": (StandInColorCal, ColorCal),
    "spotread": (StandInSpotread, Spotread),
}


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[PassingTime]:
    """The drivers' time."""
    passing = PassingTime()
    monkeypatch.setattr(serial_link, "time", passing)
    monkeypatch.setattr(serial_meter, "time", passing)
    monkeypatch.setattr(Pr655, "interval", 0.001)
    return passing


def put_behind_spotread(monkeypatch: pytest.MonkeyPatch, stand_in: StandInSpotread, faults: Faults) -> None:
    """Have the driver run the stand-in in place of a program."""

    def run(arguments: list[str], **_: Any) -> SimpleNamespace:
        if "-?" in arguments:
            return SimpleNamespace(stdout=stand_in.listed)
        arrived = faults.arrivals(0.0, stand_in.measure())
        if not arrived:
            raise subprocess.TimeoutExpired(arguments, TIMEOUT)
        return SimpleNamespace(stdout=b"".join(part for _, part in arrived))

    monkeypatch.setattr("shutil.which", lambda program: program)
    monkeypatch.setattr(subprocess, "run", run)


def tried(meter: LuminanceMeter, stand_in: StandIn, faults: Faults, tally: Tally, now: float = 0.0) -> bool:
    """One exchange; whether it made a reading."""
    del stand_in.measured[:]
    faults.begin_exchange(now)

    def is_true(reading: Reading) -> bool:
        found = (reading.value, *(reading.chromaticity or (0.0, 0.0)))
        return any(found == pytest.approx(value, rel=1e-9) for value in stand_in.measured)

    return tally.count(meter.read_luminance, is_true)


def opened(
    open_meter: Callable[[], LuminanceMeter],
    faults: Faults,
    tally: Tally,
    now: Callable[[], float],
) -> AbstractContextManager[LuminanceMeter]:
    """The driver, opened as often as it takes."""
    for _ in range(50):
        faults.begin_exchange(now())
        try:
            return open_meter()
        except InstrumentError as error:
            tally.errors[f"opening: {error.fault.value}"] += 1
    raise AssertionError("is not opened in 50 tries")


@pytest.mark.parametrize("name", METERS)
def test_no_fault_on_the_way_makes_up_a_number(
    name: str, clock: PassingTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reading is one of those that the instrument made for that question, as it sent it."""
    kind, driver = METERS[name]
    rng = np.random.default_rng(sum(name.encode()))
    stand_in, tally = kind(rng), Tally()
    faults = Faults(stand_in)
    begun = time.monotonic()
    if isinstance(stand_in, StandInSpotread):
        put_behind_spotread(monkeypatch, stand_in, faults)
    else:
        wire = Wire(stand_in, faults, clock)
        monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: wire)

    def open_meter() -> LuminanceMeter:
        return driver("1" if kind is StandInSpotread else "wire://", clock.monotonic, TIMEOUT)

    done = 0
    while done < EXCHANGES:
        with opened(open_meter, faults, tally, clock.monotonic) as meter:
            for _ in range(min(SESSION, EXCHANGES - done)):
                tried(meter, stand_in, faults, tally, clock.now)
                done += 1
    faults.on = False
    with opened(open_meter, faults, Tally(), clock.monotonic) as meter:
        assert any(tried(meter, stand_in, faults, Tally()) for _ in range(3)), "is not itself again"
    print(
        f"\n{name}: {EXCHANGES} exchanges, {sum(faults.spoiler.struck.values())} faults, "
        f"{tally.right} right, {len(tally.made_up)} made up, errors {dict(tally.errors)}, "
        f"{time.monotonic() - begun:.1f} s"
    )
    assert not tally.made_up, tally.made_up[:3]
    assert tally.right > 0.3 * EXCHANGES
    assert len(faults.spoiler.struck) >= len(faults.spoiler.kinds) - 1


def test_every_luminance_meter_that_answers_by_itself_is_among_them() -> None:
    serial_ones = {
        name
        for (kind, name), emulated in OURS.items()
        if kind is InstrumentKind.LUMINANCE and emulated.link is not LinkKind.OWN
    }
    assert serial_ones - {"exec"} < set(METERS)  # a program: tests/hardware/test_exec_program.py
