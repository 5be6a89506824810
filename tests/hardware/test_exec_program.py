"""`exec:PROGRAM`: small programs, written here, that behave and misbehave in every way."""

import contextlib
import math
import os
import random
import re
import select
import shlex
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from emulators.link import EmulatedLink, ExtraReply, LinkFault
from emulators.ours import open_at
from emulators.program import EmulatedProgram
from line_faults import warm_white_panel

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.conformance.conform import conform, nothing_left_open
from evenlight.hardware.conformance.subject import Screen, Subject
from evenlight.hardware.drivers.exec_program import ExecBacklight, ExecLuminanceMeter, ExecPowerMeter
from evenlight.hardware.guarded_devices import GuardedBacklight, GuardedLuminanceMeter, GuardedPowerMeter
from evenlight.hardware.installed_drivers import InstrumentKind, find_driver, find_driver_of
from evenlight.hardware.protocols import Fault, InstrumentError

GUIDE = Path(evenlight.__file__).parents[1] / "docs" / "drivers.md"
EXCHANGES = int(os.environ.get("EVENLIGHT_FAULT_EXCHANGES", "60"))  # 5000 by hand
READS = "import json, sys, time\nfor line in sys.stdin:\n    q = json.loads(line); i = q['id']\n    "


@pytest.fixture(autouse=True)
def nothing_stays() -> Iterator[None]:
    """No file, thread or child is left: a program that has ended but was not waited for would be a child."""
    before = children()
    with nothing_left_open():
        yield
    assert children() <= before


def children() -> set[str]:
    """The processes that this one has started and not waited for, those that have ended included."""
    lists = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return {child for each in lists for child in each.read_text().split()}


def program(body: str) -> str:
    """The address of a Python program that does something with each question `q` of id `i`."""
    return shlex.join([sys.executable, "-I", "-S", "-u", "-c", READS + body.replace("\n", "\n    ")])


def shell(words: str) -> str:
    return shlex.join(["sh", "-c", words])


def answer(fields: str) -> str:
    return f"print(json.dumps({{'id': i, {fields}}}))"


def refused(address: str, timeout: float = 30.0) -> InstrumentError:
    """What a luminance meter says instead of a reading."""
    named = find_driver(f"exec:{address}", InstrumentKind.LUMINANCE)
    with (
        GuardedLuminanceMeter(named, lambda: ExecLuminanceMeter(address, timeout=timeout)) as meter,
        pytest.raises(InstrumentError) as error,
    ):
        meter.read_luminance()
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("exec:")
    return error.value


def test_a_reading_has_what_the_program_says() -> None:
    said = answer("'luminance_cd_m2': 12.25 * i, 'x': 0.31, 'y': 0.33, 'status': 'ok'")
    with ExecLuminanceMeter(program(said)) as meter:
        first, second = meter.read_luminance(), meter.read_luminance()
    assert (first.value, second.value) == (12.25, 24.5)  # one program for both: ids 1 and 2
    assert (first.unit, first.status, first.chromaticity) == ("cd/m^2", "ok", (0.31, 0.33))
    assert first.begun <= first.ended <= second.begun


def test_a_program_may_tell_which_instrument_it_drives() -> None:
    """By the keys by which a resumed sweep knows it again; without them, the program is all that is known."""
    tells = answer("'model': 'LX 3', 'serial_number': 77")
    with ExecLuminanceMeter(program(tells)) as light, ExecPowerMeter(program(tells)) as power:
        said, of_power = light.apparatus(), power.apparatus()
    assert (said["model"], said["serial number"]) == ("LX 3", "77")
    assert (of_power["power_meter"], of_power["power_meter_serial"]) == ("LX 3", "77")
    for silent in (answer("'luminance_cd_m2': 5"), answer("'error': 'what?'")):
        with ExecLuminanceMeter(program(silent)) as meter:
            assert set(meter.apparatus()) == {"model", "program"}


@pytest.mark.parametrize(
    ("address", "fault", "words"),
    [
        (shell("echo no lamp >&2; exit 3"), Fault.DISCONNECTED, "ended with code 3.*no lamp"),
        ("yes", Fault.GARBLED, "'y', which is no JSON object"),
        (shell("yes '{\"luminance_cd_m2\": 5}'"), Fault.GARBLED, 'without "id": 1'),
        (shell("yes '{\"id\": 0, \"luminance_cd_m2\": 5}'"), Fault.GARBLED, 'without "id": 1'),
        (shell("tr '\\\\0' x < /dev/zero"), Fault.GARBLED, "a line without an end"),
        (program("print('{\"id\": 1, \"luminance_cd_m2\": NaN}')"), Fault.GARBLED, "expected a number lumin"),
        (program(answer("'luminance_cd_m2': '12.5'")), Fault.GARBLED, "expected a number luminance_cd_m2"),
        (program(answer("'luminance_cd_m2': True")), Fault.GARBLED, "expected a number luminance_cd_m2"),
        (program(answer("'luminance_cd_m2': 10**400")), Fault.GARBLED, "expected a number lumin"),
        (program(answer("'luminance_cd_m2': -2.0")), Fault.IMPLAUSIBLE, "-2 cd/m"),
        (program(answer("'luminance_cd_m2': 1e12")), Fault.IMPLAUSIBLE, r"1e\+12 cd/m"),
        (program(answer("'luminance_cd_m2': 5, 'x': 0.3")), Fault.GARBLED, "expected a number y"),
        (program("print('[' * 100000)"), Fault.GARBLED, "no JSON|without an end"),
        (program("print('{\"id\": 7, \"luminance_cd_m2\": 5}')"), Fault.GARBLED, 'without "id": 1'),
        (program(answer("'error': 'sensor covered', 'fault': 'under_range'")), Fault.UNDER_RANGE, "covered"),
        (program(answer("'error': 'out of order'")), Fault.REFUSED, "out of order"),
    ],
)  # fmt: skip
def test_whatever_is_no_reading_is_an_error_in_words(address: str, fault: Fault, words: str) -> None:
    error = refused(address)
    assert error.fault is fault
    assert re.search(words, str(error))


@pytest.mark.slow
def test_a_program_that_never_answers_is_ended_with_what_it_has_started(tmp_path: Path) -> None:
    """It ignores the end of its input and the signal to end; so does the child that it leaves behind."""
    numbers = tmp_path / "numbers"
    stubborn = f"trap '' TERM; sleep 600 & echo $$ $! > {numbers}; while :; do sleep 600; done"
    assert refused(shell(stubborn), timeout=1.5).fault is Fault.NO_REPLY
    for number in map(int, numbers.read_text().split()):
        end = time.monotonic() + 60
        while running(number) and time.monotonic() < end:
            time.sleep(0.01)
        assert not running(number)


def running(number: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent to know does not."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_late_answer_is_never_taken_for_that_to_the_next_question() -> None:
    """The first comes 2.5 s after the question, 1.5 s too late, or would, had the program not been ended."""
    late = "time.sleep(2.5 if i == 1 else 0)\n" + answer("'luminance_cd_m2': i")
    with ExecLuminanceMeter(program(late), timeout=1.0) as meter:
        with pytest.raises(InstrumentError, match=r"no answer within 1 s"):
            meter.read_luminance()
        assert meter.read_luminance().value == 2


@pytest.mark.parametrize(
    "body",
    [
        answer("'luminance_cd_m2': i") + "\n" + answer("'luminance_cd_m2': i"),  # doubled
        answer("'luminance_cd_m2': i") + '\nprint(\'{"id": 1, "luminance_cd_m2": 99}\')',  # a stray one
    ],
)
def test_a_line_too_many_is_never_taken_for_the_next_answer(body: str) -> None:
    """The program is ended for it, and started anew for the question after that."""
    with ExecLuminanceMeter(program(body)) as meter:
        assert meter.read_luminance().value == 1
        with pytest.raises(InstrumentError, match='without "id": 2'):
            meter.read_luminance()
        assert meter.read_luminance().value == 3


class RandomPlan:
    """Half of all replies go wrong, in any way but that the program ends."""

    delay = 0.15  # [s]
    silent = (LinkFault.NO_REPLY, LinkFault.PARTIAL_LINE, LinkFault.LATE_REPLY)

    def __init__(self) -> None:
        self._rng = random.Random(21)
        self._faults = [fault for fault in (*LinkFault, *ExtraReply) if fault is not LinkFault.DISCONNECT]
        self.fault = self._faults[0]
        self.n_struck, self._struck = 0, False

    def draw(self) -> float:
        """Draw what becomes of the next exchange, and return how long to wait for its reply [s]."""
        self.fault = self._rng.choice(self._faults)
        self._struck = self._rng.random() < 0.5
        self.n_struck += self._struck
        return 0.2 if self._struck and self.fault in self.silent else 30.0

    def strikes(self, _: int) -> bool:
        return self._struck


@pytest.mark.slow
def test_no_reading_is_made_up_in_exchanges_that_go_wrong_at_random() -> None:
    """The light changes before each question, so that an old answer is told from the true one."""
    seen, plan, right = warm_white_panel(), RandomPlan(), 0
    with (
        EmulatedLink(EmulatedProgram(seen)) as link,
        open_at(InstrumentKind.LUMINANCE, "exec", link.url, time.monotonic, 30.0) as meter,
    ):
        meter.read_luminance()
        link._plan = plan
        for number in range(EXCHANGES):
            meter._timeout = plan.draw()
            seen.panel.show(0.3 + 0.1 * (number % 7))
            with contextlib.suppress(InstrumentError):
                assert meter.read_luminance().value == pytest.approx(seen.panel.luminance(), rel=1e-6)
                right += 1
    print(f"{EXCHANGES} exchanges, {plan.n_struck} went wrong: {right} right, none made up")
    assert plan.n_struck > 0.3 * EXCHANGES
    assert right > 0.3 * EXCHANGES


def test_two_answers_in_a_line_are_none() -> None:
    both = 'print(\'{"id": 1, "luminance_cd_m2": 1.0}{"id": 1, "luminance_cd_m2": 10.4}\')'
    assert refused(program(both)).fault is Fault.GARBLED


def test_a_command_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="No closing quotation"):
        ExecLuminanceMeter("meter 'a")
    for nothing in ("no-such-program --fast", " "):
        with pytest.raises(InstrumentError, match="there is no program") as error:
            ExecPowerMeter(nothing)
        assert error.value.fault is Fault.NOT_FOUND


STREAM = (
    "print(json.dumps({'id': i, 'rate_hz': 50.0}))\n"
    "for k in range(20): print(json.dumps({'power_w': 2 + k, 'time_s': k / 50, 'count': k}))"
)


def test_samples_are_a_stream_that_ends_when_it_is_stopped() -> None:
    with ExecPowerMeter(program(STREAM)) as meter:
        for _ in range(2):  # each time from the start
            assert meter.start(100.0) == 50.0
            samples: list[PowerSample] = []
            while len(samples) < 20:
                samples += meter.samples()
            samples += meter.stop()
            assert [one.power for one in samples] == [2 + k for k in range(20)]
            assert [one.sequence for one in samples] == list(range(20))
            assert [one.device_time for one in samples] == pytest.approx([k / 50 for k in range(20)])


def test_samples_without_times_come_evenly_between_two_looks() -> None:
    now = [10.0]
    bare = (
        "print(json.dumps({'id': i, 'rate_hz': 4.0}))\n"
        "sys.stdout.write((json.dumps({'power_w': 1.5}) + '\\n') * 4)"  # all at once
    )
    with ExecPowerMeter(program(bare), clock=lambda: now[0]) as meter:
        meter.start(4.0)
        lines = meter._program
        assert lines._came or select.select([lines._process.stdout], [], [], 60)[0]
        now[0] = 11.0
        assert [one.device_time for one in meter.samples()] == [10.25, 10.5, 10.75, 11.0]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("print(json.dumps({'power_w': 1.0}{'power_w': 2.0}))", "ended with code 1"),  # no Python
        ('print(\'{"power_w": 1.0}{"power_w": 2.0}\')', "no JSON object"),
        ("print('{\"power_w\": 1e30}')", "1e\\+30 W"),
        ('print(\'{"power_w": 1, "time_s": 2}\'); print(\'{"power_w": 1, "time_s": 1}\')', "go back"),
        ('print(\'{"power_w": 1, "count": 0.5}\')', "out of order"),
        ('print(\'{"error": "unplugged"}\')', "unplugged"),
        ("sys.exit('sensor gone')", "ended with code 1.*sensor gone"),
    ],
)
def test_samples_that_cannot_be_are_errors(lines: str, words: str) -> None:
    body = f"print(json.dumps({{'id': i, 'rate_hz': 10.0}}))\n{lines}"
    named = find_driver("exec:any", InstrumentKind.POWER)
    guarded = GuardedPowerMeter(named, lambda: ExecPowerMeter(program(body)))

    def sample(meter: GuardedPowerMeter) -> None:
        meter.start(10.0)
        for _ in range(5000):
            time.sleep(0.02)
            meter.samples()

    with guarded as meter, pytest.raises(InstrumentError, match=words):
        sample(meter)


@pytest.mark.parametrize("stated", ["'fast'", "0.0", "1e9", "-5"])
def test_a_rate_that_a_program_cannot_have_is_refused(stated: str) -> None:
    with ExecPowerMeter(program(answer(f"'rate_hz': {stated}"))) as meter:
        with pytest.raises(InstrumentError):
            meter.start(10.0)
        with pytest.raises(InstrumentError, match="start it first"):
            meter.samples()


LAMP = (
    "b = q.get('factor', globals().get('b', 0.8)); b = round(b * 10) / 10\n"
    "print(json.dumps({'id': i, 'factor': b, 'smallest_factor': 0.1, 'step': 0.1}))"
)


def test_a_factor_is_the_one_that_the_program_says_it_has() -> None:
    with ExecBacklight(program(LAMP)) as lamp:
        assert lamp.set_factor(0.52) == 0.5
        assert lamp.read_factor() == 0.5
        for factor in (0.05, 1.2, math.nan):
            with pytest.raises(InstrumentError, match=r"has factors from 0\.1 to 1"):
                lamp.set_factor(factor)


def test_the_lamp_is_left_as_it_was_found(tmp_path: Path) -> None:
    log = tmp_path / "log"
    noted = f"open({str(log)!r}, 'a').write(line)\n{LAMP}"
    with ExecBacklight(program(noted)) as lamp:
        lamp.set_factor(0.3)
    assert '"factor": 0.8' in log.read_text().splitlines()[-1]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ("'factor': 0.8", "expected a number smallest_factor"),
        ("'factor': 1.8, 'smallest_factor': 0.1, 'step': 0.1", "factor must lie between 0 and 1"),
        ("'factor': 0.8, 'smallest_factor': 0.1, 'step': 0.0", "must be above 0"),
    ],
)
def test_a_lamp_that_cannot_be_is_refused_when_it_is_opened(fields: str, words: str) -> None:
    with pytest.raises(InstrumentError, match=words):
        ExecBacklight(program(answer(fields)))


def test_a_lamp_that_stays_where_it_is_is_told_of() -> None:
    stuck = program(answer("'factor': 0.8, 'smallest_factor': 0.1, 'step': 0.1"))
    named = find_driver("exec:any", InstrumentKind.BACKLIGHT)
    guarded = GuardedBacklight(named, lambda: ExecBacklight(stuck))
    with guarded as lamp, pytest.raises(InstrumentError, match=r"set to 0\.3, and says 0\.8"):
        lamp.set_factor(0.3)


def test_ctrl_c_is_not_for_the_program() -> None:
    """The signal of a terminal goes to a group of processes, and the program is in one of its own."""
    group = "print(json.dumps({'id': i, 'luminance_cd_m2': __import__('os').getpgrp()}))"
    with ExecLuminanceMeter(program(group)) as meter:
        assert meter.read_luminance().value != os.getpgrp()


def test_the_program_of_the_guide_does_what_the_guide_says(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    text = next(block for block in blocks if "sys.stdin" in block)
    script = tmp_path / "meter.py"
    script.write_text(text)
    with ExecLuminanceMeter(shlex.join([sys.executable, str(script)])) as meter:
        assert [meter.read_luminance().value for _ in range(2)] == [12.3, 12.3]


def test_the_guides_program_for_a_serial_meter_conforms_before_a_screen(tmp_path: Path) -> None:
    """25 lines at most; the meter answers from 0.1 cd/m^2, and is told to be out of range below."""
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    text = next(block for block in blocks if "import serial" in block)
    assert text.count("\n") <= 25
    script, seen = tmp_path / "lx3.py", warm_white_panel()
    script.write_text(text)

    class Lx3:
        def receive(self, data: bytes) -> bytes:
            light = seen.panel.luminance()
            return f"OK {light:.4g}\r\n".encode() if light > 0.5 else b"DARK\r\n"

        def stream(self) -> bytes:
            return b""

    class Window:
        now = staticmethod(time.monotonic)
        grey = 1.0

        def framebuffer(self) -> "Window":
            return self

        def clear(self, red: float, *_: float) -> None:
            self.grey = red

        def flip(self) -> float:
            seen.panel.show(self.grey)
            return time.monotonic()

    lines: list[str] = []
    with EmulatedLink(Lx3(), pseudo_terminal=True) as link:
        address = shlex.join([sys.executable, str(script), link.url])
        kind, named = find_driver_of(f"exec:{address}", "luminance")
        found = conform(Subject(kind, named, Screen(Window())), lines.append)  # type: ignore[arg-type]
    assert found == (4, 0, 0), lines
