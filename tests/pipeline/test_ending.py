"""How the command ends when it is stopped, or nobody reads what it says."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from evenlight import command as command_line

EVENLIGHT = [sys.executable, "-c", "from evenlight.command import main; main()"]
LONG_RUN = ["optimize", "sunrise", "--budget", "0.4", "--fps", "25", "--quiet"]  # of half a minute or more


def stopped(signal_number: int, out: Path) -> tuple[int, str]:
    """Exit code and error stream of a run that gets a signal as soon as it has begun to work."""
    with subprocess.Popen([*EVENLIGHT, *LONG_RUN, "--out", str(out)], stderr=subprocess.PIPE) as process:
        try:
            deadline = time.monotonic() + 200
            while not list(out.parent.glob(".partial.*")):
                assert process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.02)
            process.send_signal(signal_number)
            _, err = process.communicate(timeout=200)
        finally:
            process.kill()
    return process.returncode, err.decode()


@pytest.mark.parametrize(
    ("signal_number", "code", "line"),
    [
        (signal.SIGTERM, 143, "evenlight: terminated; nothing half-written is left\n"),
        (signal.SIGINT, 130, "evenlight: interrupted; nothing half-written is left\n"),
    ],
)
def test_a_run_that_is_stopped_says_so_in_one_line_and_leaves_nothing(
    signal_number: int, code: int, line: str, tmp_path: Path
) -> None:
    assert stopped(signal_number, tmp_path / "new" / "out") == (code, line)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("cause", "code", "word"),
    [(KeyboardInterrupt, 130, "interrupted"), (command_line._Terminated, 143, "terminated")],
)
def test_a_stop_that_comes_while_a_class_is_made_is_told_alike(
    cause: type[BaseException], code: int, word: str, command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python 3.11 makes a RuntimeError of what comes in `__set_name__`."""

    def stopped_there(*_: object, **__: object) -> None:
        raise RuntimeError("Error calling __set_name__ on 'Column'") from cause()

    monkeypatch.setattr(command_line, "app", stopped_there)
    ended = command("--version")
    assert (ended.code, ended.err) == (code, f"evenlight: {word}; nothing half-written is left\n")


def test_another_error_that_has_a_cause_is_none_of_these(command, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("broken") from ValueError()

    monkeypatch.setattr(command_line, "app", broken)
    with pytest.raises(RuntimeError, match="broken"):
        command("--version")


def test_what_a_signal_does_is_as_before_when_the_command_has_ended(command) -> None:
    before = signal.getsignal(signal.SIGTERM)
    assert command("--version").code == 0
    assert signal.getsignal(signal.SIGTERM) is before


def test_the_command_runs_beside_the_main_thread_too() -> None:
    """Python refuses to set a handler there."""
    codes: list[object] = []

    def run() -> None:
        with pytest.raises(SystemExit) as ended:
            command_line.main(["--version"])
        codes.append(ended.value.code)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join(timeout=200)
    assert codes == [0]


def without_reader(stream: str, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    """The command with one of its streams going into a pipe whose other end is closed: `| head -0`."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, stream: writing}
        return subprocess.run([*EVENLIGHT, *arguments], **streams, timeout=200, check=False)
    finally:
        os.close(writing)


@pytest.mark.parametrize(
    "arguments",
    [("--version",), ("--help",), ("optimize", "--help"), ("validate", str(Path(__file__).parent))],
)
def test_output_that_nobody_reads_is_no_reason_for_a_traceback(arguments: tuple[str, ...]) -> None:
    ended = without_reader("stdout", *arguments)
    assert ended.stderr.count(b"\n") <= 1
    assert b"Error" not in ended.stderr


def test_bad_input_ends_with_2_even_if_nobody_reads_why() -> None:
    assert without_reader("stderr", "optimize", "x", "--buget", "1").returncode == 2
