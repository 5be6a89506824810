"""The firmware sketch of examples/power_board answers the driver, with stand-ins for Arduino's functions."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from evenlight.hardware.drivers.board_link import PowerBoard, board_at
from evenlight.hardware.drivers.power_board import BoardBacklight, BoardPowerMeter
from evenlight.hardware.power_average import averaged
from evenlight.hardware.protocols import InstrumentError

ROOT = Path(__file__).parents[2]
STAND_INS = Path(__file__).parent / "firmware"
ROLLOVER = 2**32 * 1e-6  # [s]

# Without a compiler it is not tested that the sketch, which boards are flashed with, compiles and answers the
# driver; the driver is tested everywhere, against an emulated board. 200 MB of compiler for one file of the
# documents are more than `make test` should install.
pytestmark = pytest.mark.skipif(
    shutil.which("g++") is None,
    reason="no C++ compiler: that the firmware sketch compiles and answers the driver is not tested; to have "
    "it tested, on Debian: apt-get install g++",
)


@pytest.fixture(scope="module")
def program(tmp_path_factory) -> Path:
    """Return the sketch, compiled for this computer with an int as narrow as an 8-bit AVR's."""
    folder = tmp_path_factory.mktemp("firmware")
    sketch = ROOT / "examples" / "power_board" / "power_board.ino"
    (folder / "sketch.cpp").write_text(sketch.read_text())
    compiler = ["g++", "-Wall", "-Wextra", "-Werror", f"-I{STAND_INS}"]
    narrow = ["-include", STAND_INS / "narrow_ints.h"]
    for command in (
        [*compiler, *narrow, "-c", "-o", folder / "sketch.o", folder / "sketch.cpp"],
        [*compiler, "-o", folder / "board", folder / "sketch.o", STAND_INS / "computer.cpp"],
    ):
        subprocess.run(command, check=True, capture_output=True, text=True)
    return folder / "board"


@pytest.fixture
def board(program) -> Iterator[PowerBoard]:
    """Return a link to the sketch, which runs on the other end of a pseudo-terminal."""
    own, other = os.openpty()
    tty.setraw(other)
    process = subprocess.Popen([program, str(own)], pass_fds=[own])
    try:
        with board_at(os.ttyname(other), time.monotonic) as link:
            yield link
    finally:
        process.kill()
        process.wait()
        os.close(own)
        os.close(other)


@pytest.mark.slow
def test_the_sketch_samples_over_the_rollover_of_its_clock(board) -> None:
    meter = BoardPowerMeter(board.url)
    assert meter.start(200.0) == 200.0
    begun, samples, offsets = time.monotonic(), [], []
    while time.monotonic() < begun + 1.5:
        time.sleep(0.05)
        samples += meter.samples()
        ping = meter.ping()
        offsets.append(ping.device_time - (ping.sent + ping.received) / 2)
    samples += meter.stop()
    times = np.array([sample.device_time for sample in samples])
    assert times[0] < ROLLOVER < times[-1] < ROLLOVER + 2
    assert np.all(np.diff(times) > 0)
    assert np.ptp(offsets) < 2.0  # a round of the clock would be 4295 s
    ended = time.monotonic()
    average = averaged(samples, begun=begun, ended=ended, seconds=1.5, sample_rate=200.0)
    # P = 0.3 + 1.5 W at full PWM; a count of the shunt is 0.125 mW
    assert average.power == pytest.approx(1.8, abs=0.0005)
    at_the_ends = average.n_samples + average.n_lost - round(average.duration * 200) - 1
    # A busy computer may hold the sketch up: as it is stopped, up to 0.3 s; at its first sample, a little.
    assert -10 < at_the_ends < 60
    assert board.corrupted_lines == 0
    assert {sample.sync for sample in samples} == {False, True}


@pytest.mark.slow
def test_the_sketch_dims_zeroes_and_refuses_in_words(board) -> None:
    meter, backlight = BoardPowerMeter(board.url), BoardBacklight(board.url)
    assert backlight.set_factor(0.5) == backlight.read_factor() == 128 / 255
    for command, words in {
        "NONE": "error 2: unknown command",
        "START": "error 3: number missing",
        "START 0.1": "error 4: out of range",
        "B 256": "error 4: out of range",
        "B 65536": "error 4: out of range",
        "B x": "error 3: number missing",
        "ZERO": "error 8: not zero",
    }.items():
        with pytest.raises(InstrumentError, match=words):
            board.ask(command)
    board.ask("B 0")
    assert meter.zero() == pytest.approx(0.0005)  # [A]
    board.ask("B 255")
    meter.start(100.0)
    with pytest.raises(InstrumentError, match="error 5: sampling"):
        board.ask("START 100")
    time.sleep(0.2)
    power = averaged(meter.stop(), begun=0.0, ended=0.2, seconds=0.2, sample_rate=100.0).power
    assert power == pytest.approx(1.8 - 5 * 0.0005, abs=0.0005)


def test_the_sketch_takes_its_zero_off_without_wrapping_at_16_bits(board) -> None:
    meter = BoardPowerMeter(board.url)
    board.ask("B 1")
    assert meter.zero() == pytest.approx(-300 * 2.5e-6 / 0.1)  # [A]
    board.ask("B 2")
    meter.start(100.0)
    time.sleep(0.1)
    # 32700 + 300 counts of 2.5 µV over 0.1 ohm at 5 V, which is above 32767 counts and no overload
    assert meter.stop()[-1].power == pytest.approx(33000 * 2.5e-6 / 0.1 * 5, abs=0.001)
