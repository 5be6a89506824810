"""Power meters and backlights that fail at random, written from their protocols and not from our drivers.

Each knows what it truly measured. An exchange ends with a reading, which must be that, or with an error:

    python tests/companions/faulty_power_devices.py 5000

prints a table over all drivers: exchanges, right readings, errors by fault, readings made up.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from emulators.link import EmulatedLink
from spoilt_replies import NowAndThen, Spoiler, Tally

from evenlight.hardware.drivers import scpi_dialogue
from evenlight.hardware.drivers.ddc_backlight import DdcBacklight
from evenlight.hardware.drivers.nordic_ppk2 import Ppk2PowerMeter
from evenlight.hardware.drivers.polled_power import HwmonPowerMeter
from evenlight.hardware.drivers.power_board import BoardBacklight, BoardPowerMeter
from evenlight.hardware.drivers.scpi_power import ScpiPowerMeter, VisaPowerMeter
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
from evenlight.hardware.protocols import InstrumentError

SHARE = 0.4  # of the replies that are spoilt
TIMEOUT, PATIENT = 0.025, 30.0  # [s] while replies are spoilt, and before
LATE, AFTER = (0.03, 0.08), (0.0, 0.001, 0.004)  # [s]
ON_A_LINE = (
    "lost bytes", "cut", "without its end", "doubled", "late",
    "stray before", "stray after", "garbage", "silence",
)  # fmt: skip
FLIPPED = "flipped bit"  # only where a checksum tells it


def spoiling(
    rng: np.random.Generator, kinds: tuple[str, ...], strays: tuple[bytes, ...], *, lines: bool = True
) -> NowAndThen:
    """Return what spoils replies, once its share is set."""
    spoiler = Spoiler(rng, kinds, lambda: strays[int(rng.integers(len(strays)))], LATE, AFTER)
    return NowAndThen(spoiler, lines=lines)


class BenchSupply:
    """A supply or analyser of IEEE 488.2 and SCPI-99, one question a line; `written` formats a power."""

    def __init__(self, written: str, power: float) -> None:
        self._written, self._power = written, power
        self._came, self._count = b"", 0
        self.measured = ""  # last

    def receive(self, data: bytes) -> bytes:
        *lines, self._came = (self._came + data).split(b"\n")
        answers = [self._unit(line.decode("ascii").strip()) for line in lines]
        return "".join(f"{answer}\n" for answer in answers if answer).encode("ascii")

    def stream(self) -> bytes:
        return b""

    def _unit(self, unit: str) -> str:
        match unit.upper():
            case "*IDN?":
                return "MAKER,MODEL 12,SN00042,1.07"
            case "MEAS:POW?" | "MEASURE:POWER?":
                self._count += 1  # no two neighbouring powers are alike
                self.measured = self._written.format(self._power * (1 + 0.0011 * (self._count % 97)))
                return self.measured
            case "SYST:ERR?":
                return "0  No Error"
        return ""


def crc(text: bytes) -> str:
    """CRC-16/CCITT-FALSE, bit by bit."""
    value = 0xFFFF
    for byte in text:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return f"{value:04X}"


class Board:
    """The board of docs/power-board.md: numbered commands, samples in between, a CRC on each line."""

    def __init__(self) -> None:
        self._came, self._next, self._count = b"", 0.0, 0
        self._begun = time.monotonic()
        self.step, self.sampling = 4095, False
        self.measured: dict[int, int] = {}  # [µW] by the number of the sample, since START
        self.bursts = 4  # samples at once

    def receive(self, data: bytes) -> bytes:
        *lines, self._came = (self._came + data).split(b"\n")
        return b"".join(self._sent(self._answer(line)) for line in lines)

    def stream(self) -> bytes:
        if not self.sampling or time.monotonic() < self._next:
            return b""
        self._next = time.monotonic() + 0.002
        return b"".join(self._sample() for _ in range(self.bursts))

    def _sample(self) -> bytes:
        number = len(self.measured)
        self._count += 1
        self.measured[number] = 600_000 + self._count * 37 % 99_991
        clock = self._clock()
        return self._sent(f"P {number % 65536} {clock % 2**32} {self.measured[number]} {number % 2}")

    def _clock(self) -> int:
        return round((time.monotonic() - self._begun) * 1e6) + 10 + self._count

    def _answer(self, line: bytes) -> str:
        body, _, check = line.rpartition(b"*")
        if check.decode("ascii", "replace") != crc(body):
            return "ERR 0 1 checksum"
        tag, name, *rest = body.decode("ascii").split(" ")
        if name == "START":
            self.sampling, self.measured = True, {}
        elif name == "STOP":
            self.sampling = False
        elif name == "B":
            self.step = int(rest[0])
        words = {
            "ID?": "evenlight-power-board protocol=1 chip=INA226 serial=9 firmware=2.0 max_rate_hz=1000 "
            "line=usb max_power_uw=4096000 pwm_steps=4095",
            "START": "1000",
            "CLOCK?": str(self._clock()),
            "B": str(self.step),
            "B?": str(self.step),
        }
        return f"OK {tag} {name} {words.get(name, '')}".rstrip()

    @staticmethod
    def _sent(body: str) -> bytes:
        return f"{body}*{crc(body.encode())}\n".encode("ascii")


class Profiler:
    """A PPK2: a calibration in text, then words of 32 bits at 100 kHz; its current rises slowly."""

    GAINS = (1000.0, 100.0, 10.0, 1.0, 0.05)

    def __init__(self) -> None:
        self._came, self.sampling, self.sent = b"", False, 0

    def receive(self, data: bytes) -> bytes:
        replies = b""
        for code in data:  # parameters of commands are no codes that matter here
            if code == 0x19:
                replies += self._calibration()
            elif code == 0x06:
                self.sampling, self.sent = True, 0
            elif code == 0x07:
                self.sampling = False
        return replies

    def stream(self) -> bytes:
        if not self.sampling:
            return b""
        numbers = np.arange(self.sent, self.sent + 160)
        self.sent += 160
        words = self.converter(numbers) | 4 << 14 | (numbers % 64) << 18
        time.sleep(0.001)
        return bytes(words.astype("<u4").tobytes())

    @staticmethod
    def converter(numbers: Any) -> Any:
        """What the converter shows of a word by its number: between 400 and 1000, up and down."""
        rising = numbers // 100 % 1200
        return 400 + np.minimum(rising, 1200 - rising)

    def power(self, counts: float) -> float:
        """The power at 5 V, by the calibration, of a count of the converter."""
        return counts * 4 * 1.8 / 163840 / self.GAINS[4] * 5.0

    def _calibration(self) -> bytes:
        values = {"R": self.GAINS, "GS": [0.0] * 5, "GI": [1.0] * 5, "O": [0.0] * 5}
        values |= {"S": [0.0] * 5, "I": [0.0] * 5, "UG": [1.0] * 5}
        lines = [f"{key}{i}: {value[i]:.4f}" for key, value in values.items() for i in range(5)]
        text = "\n".join(["Calibrated: 1", *lines, "VDD: 5000", "HW: 9173", "mode: 1", "IA: 56", "END", ""])
        return text.encode("ascii")


def monitor(rng: np.random.Generator) -> Any:
    """A monitor on an I2C bus: the host clocks out as many bytes as it wants, of the last reply."""
    from monitorcontrol.vcp.vcp_linux import LinuxVCP

    class Monitor(LinuxVCP):
        GET_VCP_TIMEOUT = 0.0
        share, step, _reply, _place = 0.0, 80, b"", 0

        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def write_bytes(self, data: bytes) -> None:
            data = bytes(data)
            if data[2] == 0x03:
                self.step = int.from_bytes(data[4:6], "big")
                return
            value = {0x10: self.step, 0x12: 50}[data[3]]
            body = bytes([0x6E, 0x88, 0x02, 0x00, data[3], 0x00, 0x00, 100]) + value.to_bytes(2, "big")
            check = 0x50
            for byte in body:
                check ^= byte
            self._reply, self._place = self._spoilt(body + bytes([check])), 0

        def read_bytes(self, num_bytes: int) -> bytes:
            whole = self._reply + b"\xff" * 80
            part = whole[self._place : self._place + num_bytes]
            self._place += num_bytes
            return part

        def _spoilt(self, reply: bytes) -> bytes:
            if rng.random() >= self.share:
                return reply
            place = int(rng.integers(len(reply)))
            flipped = bytes([reply[place] ^ 1 << int(rng.integers(8))])
            return {
                0: reply[:place] + reply[place + 1 :],
                1: reply[:place],
                2: reply[:place] + flipped + reply[place + 1 :],
                3: bytes.fromhex("6e 80 be"),  # not ready
                4: b"\x00" + reply,
                5: bytes.fromhex("6e 88 02 00 12 00 00 64 00 32 f0"),  # to another question
                6: reply[:place] + reply[:place] + reply[place:],
            }[int(rng.integers(7))]

    return Monitor(0)


def scpi(n: int, rng: np.random.Generator, form: str, power: float, *, visa: bool = False) -> Tally:
    """Samples of a SCPI instrument over a socket, or over a socket of VISA."""
    supply, tally = BenchSupply(form, power), Tally()
    strays = (b"49.5\n", b"0.7003\n", b"+6.10000E-01\n", b"1\n", b'0,"No error"\n', b"\n")
    spoiler = spoiling(rng, ON_A_LINE, strays)
    with EmulatedLink(supply, spoil=spoiler) as link:
        place = f"TCPIP::127.0.0.1::{urlsplit(link.url).port}::SOCKET" if visa else link.url
        with (VisaPowerMeter if visa else ScpiPowerMeter)(place, timeout=PATIENT) as meter:
            meter.start(1000.0)
            meter._period = 1e-6  # always due
            # A line too much and one too few in the same exchange pass: answers carry no number.
            spoiler.share, spoiler.apart = SHARE, 3
            meter._dialogue._timeout = TIMEOUT

            def read() -> Any:
                samples = meter.samples()
                return samples[0].power if samples else None

            while tally.exchanges < n:
                tally.count(read, lambda power: power == float(supply.measured.removesuffix("W")))
            spoiler.share = 0.0
    return tally


def board_power(n: int, rng: np.random.Generator) -> Tally:
    """Samples that a board streams, started anew after an error."""
    board, tally = Board(), Tally()
    strays = (b"P 3 5000000 49500000 0\n", b"49.5\n", board._sent("OK 1 B 7"), b"\n", b"*\n")
    spoiler = spoiling(rng, (*ON_A_LINE, FLIPPED), strays)

    def is_true(sample: Any) -> bool:
        return board.measured.get(sample.sequence) == round(sample.power * 1e6)

    with EmulatedLink(board, spoil=spoiler) as link, BoardPowerMeter(link.url, timeout=PATIENT) as meter:
        meter._board._timeout = 0.2
        while tally.exchanges < n:
            stream(meter, spoiler, SHARE, tally, is_true)
    return tally


def stream(
    meter: Any, spoiler: NowAndThen, share: float, tally: Tally, is_true: Callable[[Any], bool]
) -> None:
    """Start a meter, and count its samples until it fails, or for a while."""
    spoiler.share = 0.0
    try:
        meter.start(1000.0)
        spoiler.share = share
        for _ in range(20):
            time.sleep(0.004)
            for sample in meter.samples():
                tally.count(lambda sample=sample: sample, is_true)
        for sample in meter.stop():
            tally.count(lambda sample=sample: sample, is_true)
    except InstrumentError as error:
        tally.fail(error)


def board_backlight(n: int, rng: np.random.Generator) -> Tally:
    """Settings and readings of a board's PWM."""
    board, tally = Board(), Tally()
    strays = (board._sent("OK 7 B 7"), board._sent("OK 999 B? 9"), b"B 7\n", b"\n")
    spoiler = spoiling(rng, (*ON_A_LINE, FLIPPED), strays)
    with (
        EmulatedLink(board, spoil=spoiler) as link,
        BoardBacklight(link.url, timeout=PATIENT) as backlight,
    ):
        spoiler.share, backlight._board._timeout = SHARE, TIMEOUT
        while tally.exchanges < n:
            factor = float(rng.uniform(0.1, 1.0))
            tally.count(
                lambda factor=factor: backlight.set_factor(factor), lambda got: got == board.step / 4095
            )
            tally.count(backlight.read_factor, lambda got: got == board.step / 4095)
        spoiler.share, backlight._board._timeout = 0.0, PATIENT
    return tally


def profiler(n: int, rng: np.random.Generator) -> Tally:
    """Averages of a PPK2's words, started anew after an error."""
    device, tally = Profiler(), Tally()
    kinds = ("lost bytes", "cut", "doubled", "garbage", "silence", "stray before")
    spoiler = spoiling(rng, kinds, (b"\x00\x80", b"OK\r\n"), lines=False)

    def is_true(sample: Any) -> bool:
        expected = device.power(float(device.converter(np.array(sample.sequence * 100 + 50))))
        return abs(sample.power - expected) < device.power(10)  # 1000 words sooner or later

    with (
        EmulatedLink(device, spoil=spoiler, pseudo_terminal=True) as link,
        Ppk2PowerMeter(f"{link.url}?voltage=5.0", timeout=0.3) as meter,
    ):
        while tally.exchanges < n:
            stream(meter, spoiler, SHARE / 8, tally, is_true)
    return tally


def linux_file(n: int, rng: np.random.Generator, kind: str) -> Tally:
    """A sensor under hwmon, or a panel under sysfs, whose file holds what it should not."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        panel = Path(folder, "panel")
        panel.mkdir()
        for name, text in (("name", "ina226"), ("max_brightness", "4095"), ("brightness", "4095")):
            (panel / name).write_text(f"{text}\n")
        file = panel / ("power1_input" if kind == "hwmon" else "brightness")
        file.write_text("600000\n" if kind == "hwmon" else "4000\n")
        if kind == "hwmon":
            meter = stack.enter_context(HwmonPowerMeter(str(panel)))
            meter.start(1000.0)
            meter._period, meter._due = 1e-6, 0.0

            def read() -> int:
                return round(meter.samples()[0].power * 1e6)
        else:
            backlight = stack.enter_context(SysfsBacklight("panel", Path(folder)))

            def read() -> int:
                return round(backlight.read_factor() * 4095)

        for _ in range(n):
            true = int(rng.integers(500_000, 999_999) if kind == "hwmon" else rng.integers(1000, 4095))
            text = f"{true}\n"
            # The kernel hands such a file over as a whole: nothing is cut off.
            wrong = ("", "nan\n", "1e30\n", f"-{true}\n", f"{true}{true}\n", f"{true} W\n")
            wrong += (f"{10**30}\n", text + text, "\x00\x00\n", f"{text[:2]}_{text[2:]}")
            file.write_text(wrong[int(rng.integers(len(wrong)))] if rng.random() < SHARE else text)
            tally.count(read, lambda got, true=true: got == true)
    return tally


def ddc(n: int, rng: np.random.Generator) -> Tally:
    """Settings and readings of a monitor."""
    panel, tally, clock = monitor(rng), Tally(), [0.0]

    def wait(seconds: float) -> None:
        clock[0] += seconds

    with DdcBacklight(0, lambda: clock[0], wait, panel) as backlight:
        panel.share = SHARE
        while tally.exchanges < n:
            factor = float(rng.uniform(0.1, 1.0))
            tally.count(
                lambda factor=factor: backlight.set_factor(factor), lambda got: got == panel.step / 100
            )
            tally.count(backlight.read_factor, lambda got: got == panel.step / 100)
        panel.share = 0.0
    return tally


DEVICES: dict[str, Callable[[int, np.random.Generator], Tally]] = {
    "scpi, NR3": lambda n, rng: scpi(n, rng, "{:+.5E}", 0.66),
    "scpi, 12.345W": lambda n, rng: scpi(n, rng, "{:.3f}W", 12.3),
    "visa": lambda n, rng: scpi(n, rng, "{:.4f}", 0.66, visa=True),
    "board": board_power,
    "board's backlight": board_backlight,
    "ppk2": profiler,
    "hwmon": lambda n, rng: linux_file(n, rng, "hwmon"),
    "sysfs": lambda n, rng: linux_file(n, rng, "sysfs"),
    "ddc": ddc,
}


@contextlib.contextmanager
def short_silences() -> Iterator[None]:
    """Let SCPI lines count as quiet sooner, so that thousands of faults take minutes."""
    quiet, scpi_dialogue.QUIET = scpi_dialogue.QUIET, 0.004
    try:
        yield
    finally:
        scpi_dialogue.QUIET = quiet


def main(n: int, seed: int, names: list[str]) -> None:
    """Print the table."""
    print("| device | exchanges | right | errors | made up | s |\n|---|---|---|---|---|---|")
    for name, run in DEVICES.items():
        if names and name not in names:
            continue
        begun = time.monotonic()
        with short_silences():
            tally = run(n, np.random.default_rng(seed))
        errors = ", ".join(f"{fault} {count}" for fault, count in tally.errors.most_common())
        took = time.monotonic() - begun
        print(
            f"| {name} | {tally.exchanges} | {tally.right} | {errors} | {len(tally.made_up)} | {took:.0f} |",
            *tally.made_up[:5],
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1, sys.argv[3:])
