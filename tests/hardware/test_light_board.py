"""The light board's driver against the sketch of docs/light-board.md, and against disturbed lines."""

from __future__ import annotations

import binascii
import os
import shutil
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from evenlight.hardware.drivers.light_board import LightBoard
from evenlight.hardware.protocols import Fault, InstrumentError

ROOT = Path(__file__).parents[2]
STAND_INS = Path(__file__).parent / "firmware"
# The light at A0: 5 ms bright, 5 ms dim, by the board's own clock.
LIGHT = (
    "#include <Arduino.h>\nconst int A0 = 14;\n"
    "inline int analogRead(int) { return micros() / 5000 % 2 ? 800 : 200; }\n"
)
ROLLOVER = 2**32 * 1e-6  # [s]


def line(body: str) -> bytes:
    """CRC-16/CCITT-FALSE, which the page names, by the standard library."""
    return f"{body}*{binascii.crc_hqx(body.encode(), 0xFFFF):04X}\n".encode()


@contextmanager
def terminal() -> Iterator[tuple[int, str]]:
    own, other = os.openpty()
    tty.setraw(other)
    try:
        yield own, os.ttyname(other)
    finally:
        os.close(own)
        os.close(other)


@contextmanager
def stand_in(answer: Callable[[bytes], bytes], stream: bytes = b"") -> Iterator[LightBoard]:
    """Yield the driver at a program that answers each byte, and sends a stream once it was asked twice."""
    ended = threading.Event()

    def serve(own: int) -> None:
        left, asked = stream, 0
        os.set_blocking(own, False)
        while not ended.is_set():
            try:
                question = os.read(own, 1)
                asked += 1
                os.write(own, answer(question))
            except BlockingIOError:
                if asked and left:
                    with suppress(BlockingIOError):
                        left = left[os.write(own, left[:1000]) :]
                time.sleep(0.0005)
            except OSError:
                return

    with terminal() as (own, name):
        thread = threading.Thread(target=serve, args=(own,), daemon=True)
        thread.start()
        try:
            with LightBoard(name) as board:
                yield board
        finally:
            ended.set()
            thread.join(2)


def identified(question: bytes) -> bytes:
    return line("A evenlight-light-board rate_hz=4000 bits=10") if question == b"?" else b""


def taken(board: LightBoard, span: float, seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Return samples until they span some time of the board's clock [s], or none come any more."""
    end, blocks = time.monotonic() + seconds, []
    while time.monotonic() < end and not (blocks and blocks[-1].times[-1] - blocks[0].times[0] >= span):
        blocks += board.samples()
        time.sleep(0.002)
    return np.concatenate([b.times for b in blocks]), np.concatenate([b.values for b in blocks])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler: the sketch is not tried")
def test_the_sketch_gives_the_light_of_its_own_clock_over_its_rollover(tmp_path: Path) -> None:
    sketch = (ROOT / "docs/light-board.md").read_text().split("```cpp\n")[1].split("```")[0]
    (tmp_path / "sketch.cpp").write_text(sketch)
    (tmp_path / "light.h").write_text(LIGHT)
    compiler = ["g++", "-Wall", "-Wextra", "-Werror", f"-I{STAND_INS}"]
    own = ["-include", STAND_INS / "narrow_ints.h", "-include", tmp_path / "light.h"]
    for command in (
        [*compiler, *own, "-c", "-o", tmp_path / "sketch.o", tmp_path / "sketch.cpp"],
        [*compiler, "-o", tmp_path / "board", tmp_path / "sketch.o", STAND_INS / "computer.cpp"],
    ):
        subprocess.run(command, check=True, capture_output=True, text=True)
    with terminal() as (file, name):
        process = subprocess.Popen([tmp_path / "board", str(file)], pass_fds=[file])
        try:
            with LightBoard(name) as board:
                stream = board.start(None)
                assert (stream.rate, stream.full_scale, stream.dc_coupled) == (4000.0, 1.0, True)
                with pytest.raises(InstrumentError, match="4000 Hz, got 1000 Hz"):
                    board.start(1000.0)
                first = board.ping()
                times, values = taken(board, 1.3)
                last = board.ping()
        finally:
            process.kill()
            process.wait()
    assert first is not None
    assert last is not None
    assert first.device_time < 0 < last.device_time  # its clock begins a second before it rolls over
    rounds = first.received - first.sent + last.received - last.sent  # somewhere in them it read its clock
    assert last.device_time - first.device_time == pytest.approx(last.sent - first.sent, abs=0.01 + rounds)
    assert np.all(np.diff(times) > 0)
    steps = np.diff(times) / 250e-6
    np.testing.assert_allclose(steps, np.rint(steps), atol=0.01)  # a whole number of periods, lost ones too
    # The sketch reads the input some microseconds after a sample is due, later on a busy computer.
    bright = (times % ROLLOVER * 1e6 // 5000 % 2).astype(int)
    clear = np.minimum(times * 1e6 % 5000, 5000 - times * 1e6 % 5000) > 600
    agree = values[clear] == np.where(bright[clear], 800, 200) / 1023
    assert agree.mean() > 0.95
    assert set(values.tolist()) == {200 / 1023, 800 / 1023}


def test_no_sample_is_made_up_from_5000_disturbed_lines() -> None:
    """Of each line, truth is what its count says: sample n is (n * 7919) % 1024 of 1023, at n / 4000 s."""
    rng = np.random.default_rng(21)
    parts, n_changed = [], 0
    for place in range(5000):
        codes = [(n * 7919) % 1024 for n in range(place * 5, place * 5 + 5)]
        whole = line(f"L {place * 5} {place * 1250} {''.join(f'{code:03X}' for code in codes)}")
        fault = rng.integers(5)
        at = int(rng.integers(len(whole) - 1))
        if fault == 0:  # a flipped bit
            whole = whole[:at] + bytes([whole[at] ^ 1 << int(rng.integers(7))]) + whole[at + 1 :]
        elif fault == 1:  # lost bytes
            whole = whole[:at] + whole[at + int(rng.integers(1, 4)) :]
        elif fault == 2:  # bytes from elsewhere
            whole = whole[:at] + rng.bytes(int(rng.integers(1, 4))) + whole[at:]
        elif fault == 3:  # two bytes changed places
            whole = whole[:at] + whole[at : at + 2][::-1] + whole[at + 2 :]
        n_changed += fault < 4
        parts.append(whole)
    parts.append(line("L 40000 10000000 3C0"))  # its end; 40000 * 7919 % 1024 = 0x3C0
    with stand_in(identified, b"".join(parts)) as board:
        times, values = taken(board, 9.0)
    assert 800 * 5 <= len(times) <= 5 * 5000 + 1  # the fifth that were not touched come through
    number = np.rint(times * 4000).astype(int)
    np.testing.assert_allclose(times * 4000, number, atol=1e-6)
    np.testing.assert_array_equal(values, (number * 7919 % 1024) / 1023)


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        (b"", Fault.NO_REPLY),
        (b"OK00, 12.3\n", Fault.WRONG_INSTRUMENT),
        (b"$GPGLL,4916.45,N,12311.12,W,225444,A*31\n", Fault.WRONG_INSTRUMENT),
        (line("A evenlight-power-board rate_hz=4000 bits=10"), Fault.WRONG_INSTRUMENT),
        (line("A evenlight-light-board rate_hz=nan bits=10"), Fault.WRONG_INSTRUMENT),
        (line("A evenlight-light-board rate_hz=4000 bits=16"), Fault.GARBLED),
    ],
)
def test_what_is_no_light_board_is_refused(answer: bytes, fault: Fault, monkeypatch) -> None:
    monkeypatch.setattr("evenlight.hardware.drivers.light_board.STARTING", 0.3)
    with pytest.raises(InstrumentError) as refused, stand_in(lambda _: answer):
        pass
    assert refused.value.fault is fault


@pytest.mark.parametrize(
    "body", ["L 0 0 FFF", "L 0 0 1F", "L -1 0 000", "L 0 5000000000 000", "L 0 0", "L x 0 000"]
)
def test_a_line_that_is_whole_and_says_what_cannot_be_is_an_error(body: str) -> None:
    """1023 is the highest of 10 bits: FFF is 4095."""
    with stand_in(identified, line(body)) as board, pytest.raises(InstrumentError, match="no samples"):
        taken(board, 1.0, seconds=1.0)


def test_a_board_that_falls_silent_is_told(monkeypatch) -> None:
    monkeypatch.setattr("evenlight.hardware.drivers.light_board.SILENCE", 0.2)
    with stand_in(identified) as board:
        board.start(None)
        with pytest.raises(InstrumentError, match="no sample for") as silent:
            taken(board, 1.0, seconds=1.0)
    assert silent.value.fault is Fault.NO_REPLY


def test_a_late_answer_is_not_taken_for_that_of_a_later_ping(monkeypatch) -> None:
    """Each answer comes one question late: what the letter `a` asked is told when `b` is asked."""
    monkeypatch.setattr("evenlight.hardware.drivers.light_board.REPLY", 0.1)
    late: list[bytes] = []

    def answer(question: bytes) -> bytes:
        if question == b"?":
            return identified(question)
        late.append(line(f"T {question.decode()} {1000 * len(late)}"))
        return late[-2] if len(late) > 1 else b""

    with stand_in(answer) as board:
        assert [board.ping() for _ in range(3)] == [None, None, None]


def test_an_answer_in_time_is_a_comparison_of_the_clocks() -> None:
    with stand_in(lambda question: identified(question) or line(f"T {question.decode()} 2500000")) as board:
        ping = board.ping()
    assert ping is not None
    assert ping.device_time == pytest.approx(2.5)
