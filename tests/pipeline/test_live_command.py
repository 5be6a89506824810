"""`evenlight live` on a virtual screen, with a panel behind a program: dimmed, set by its user, ended."""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from stepped_panel import PROGRAM

pytestmark = pytest.mark.real_time
LONGEST = 120.0  # [s]
FOUND, SET = 900, 600  # steps of 1000


class Desktop:
    """A screen, a panel, and the program that dims it."""

    def __init__(self, folder: Path) -> None:
        self.state, self.step, program = (
            folder / name for name in ("evenlight-live.json", "panel.step", "panel.py")
        )
        program.write_text(PROGRAM)
        self.step.write_text(str(FOUND))
        self.screen = subprocess.Popen(
            ["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        assert self.screen.stdout is not None
        display = f":{self.screen.stdout.readline().strip()}"
        words = ["live", "--backlight", f"exec:{sys.executable} {program}", "--display", "laptop-lcd"]
        self.own = os.environ | {
            "DISPLAY": display,
            "XDG_RUNTIME_DIR": str(folder),
            "XDG_CACHE_HOME": str(folder),
        }
        self.own.pop("WAYLAND_DISPLAY", None)
        self.program = self.started(*words, "--other-display-ok")

    def started(self, *words: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "evenlight", *words]
        return subprocess.Popen(
            command, env=self.own, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def set_to(self, step: int) -> float:
        """Set the panel as its user does, never half; return what is full by that."""
        beside, share = self.step.with_suffix(".new"), int(self.step.read_text() or FOUND) / FOUND
        beside.write_text(str(step))
        beside.replace(self.step)
        return step / share

    def said(self) -> str | None:
        """The next line that it says; None where it says none for a while."""
        assert self.program.stdout is not None
        ready, _, _ = select.select([self.program.stdout], [], [], 3.0)
        return self.program.stdout.readline() if ready else None

    def ceiling(self) -> float:
        """The step that counts as full, by its state; before the first, that it was found at."""
        if not self.state.exists():
            return FOUND
        return float(1000 * json.loads(self.state.read_text())["monitors"][0]["ceiling"])

    def becomes(self, right: Callable[[int], bool]) -> None:
        """Wait until the panel's step is right."""
        end = time.monotonic() + LONGEST
        while not right(int(self.step.read_text() or FOUND)):
            assert time.monotonic() < end, self.step.read_text()
            time.sleep(0.02)

    def signal_others(self, number: int, named: bytes = b"") -> None:
        """Signal the processes that it has started, or those of a name among them."""
        for file in Path("/proc").glob("[0-9]*/status"):
            with contextlib.suppress(OSError):  # it has ended
                own = f"\nPPid:\t{self.program.pid}\n" in file.read_text()
                if own and named in (file.parent / "cmdline").read_bytes():
                    os.kill(int(file.parent.name), number)

    def end(self) -> None:
        for process in (self.program, self.screen):
            process.kill()
            process.communicate()


@pytest.fixture
def desktop(tmp_path: Path) -> Iterator[Desktop]:
    pytest.importorskip("mss")
    made = Desktop(tmp_path)
    yield made
    made.end()


@pytest.mark.parametrize("end", ["TERM", "HUP", "KILL", "screen", "group", "alone"])
def test_the_brightness_of_its_user_comes_back_however_it_ends(desktop: Desktop, end: str) -> None:
    """Dimmed from 900; its user sets 600, which is kept, and the ceiling goes with it.

    systemd ends all of a group at once; alone, it has lost its watchdog.
    """
    desktop.becomes(lambda step: step < FOUND - 30)
    assert (desktop.said() or "").endswith("panel.py: monitor screen, 640x480\n")
    full = desktop.set_to(SET)
    while (said := desktop.said()) is None:
        full = desktop.set_to(SET)  # again: the panel's program wrote at the same moment
    assert said.endswith(f"panel.py was set to {SET / 10:.0f}%: kept\n")
    end_of_wait = time.monotonic() + LONGEST
    while (ceiling := desktop.ceiling()) == FOUND:
        assert time.monotonic() < end_of_wait
        time.sleep(0.1)
    assert ceiling == pytest.approx(full, abs=3)
    status = desktop.started("live", "--status").communicate()[0]
    assert "of the brightness set" in status
    if end == "screen":
        desktop.screen.kill()
    else:
        if end == "group":
            desktop.signal_others(signal.SIGTERM)
        elif end == "alone":
            desktop.signal_others(signal.SIGKILL, b"watchdog")
        desktop.program.send_signal(getattr(signal, f"SIG{end}", signal.SIGTERM))
    told = desktop.program.communicate(timeout=LONGEST)[1]
    desktop.becomes(lambda step: abs(step - full) <= 4)
    if end == "screen":
        assert "the screen cannot be looked at" in told
    elif end != "KILL":
        assert told == "evenlight: interrupted; your brightness comes back\n"
