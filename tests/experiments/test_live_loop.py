"""`evenlight live`: what it looks at, when it rests, what it tells and leaves behind."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
from stepped_panel import PROGRAM, SteppedPanel

from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.experiments.desktop import live_loop, live_state, resting, screens, user_service
from evenlight.experiments.desktop.live_loop import LiveLoop, Monitor
from evenlight.experiments.desktop.live_state import (
    DayTotal,
    LiveState,
    MonitorState,
    earlier,
    only_one,
    running,
    write_state,
)
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer
from evenlight.experiments.desktop.screens import WatchedScreen
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.preset_files import load_display

DISPLAY, KNOTS = load_display("laptop-lcd"), brightness_factors(0.05)
WIDE, HIGH = 64, 48
BORROWED = ["--backlight", "sysfs:none_such", "--display", "laptop-lcd", "--other-display-ok"]
STATE = LiveState(
    os.getpid(),
    DayTotal("2026-11-29", 7200.0, 4320.0, 0.0, 72.0),
    saves=False,
    monitors=(MonitorState("sysfs:panel", 0.9, 0.5, 0.031, "rests: paused"),),
)


class Grabber:
    """A screen of noise that is shown anew when told; BGRX, as systems have it."""

    def __init__(self) -> None:
        self.rng, self.gone = np.random.default_rng(1), False
        self.resize(WIDE, HIGH)

    def resize(self, width: int, height: int) -> None:
        self.pixels = self.rng.integers(0, 256, (height, width, 4), dtype=np.uint8)

    def change(self) -> None:
        self.resize(*self.pixels.shape[1::-1])

    def grab(self, name: str) -> Any:
        assert name == "eDP-1"
        if self.gone:
            raise OSError("connection\nlost")
        high, wide, _ = self.pixels.shape
        shot = SimpleNamespace(raw=bytearray(self.pixels.tobytes()), width=wide, height=high)
        return shot if wide else None


class Desktop:
    """A loop on a clock of its own."""

    def __init__(self, today: DayTotal | None = None) -> None:
        self.now, self.said, self.kept, self.why = 0.0, list[str](), list[LiveState](), ""
        self.grabber = Grabber()
        self.screen = WatchedScreen(self.grabber, "eDP-1", DISPLAY, DEFAULT_MODEL, KNOTS)
        self.backlight = SteppedPanel()
        self.brought_back: list[float] = []
        white = DISPLAY.peak_luminance
        dimmer = MonitorDimmer(self.backlight, self.clock, lambda _: 50.0, white, KNOTS, 0.05, 0.3)
        monitor = Monitor("panel", self.screen, dimmer, self.brought_back.append)
        tell, keep = self.said.append, self.kept.append
        self.loop = LiveLoop([monitor], self.clock, self.wait, lambda now: self.why, tell, keep, 2.0)
        self.loop.today = today or self.loop.today

    def clock(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += max(seconds, 1e-3)

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.loop.run_once()


def test_a_picture_is_analysed_once_and_as_any_frame_is() -> None:
    desk = Desktop()
    seen = desk.screen.look(0.0)
    rgb = np.ascontiguousarray(desk.grabber.pixels[..., 2::-1])
    known = analyze_frames([Frame(0.0, 1.0, rgb)], "screen", DISPLAY, factors=KNOTS)
    np.testing.assert_array_equal(seen.loss, known.loss[0])
    assert seen.luminance == known.mean_luminance[0]
    assert all(desk.screen.look(100.0 + 9 * k) is seen for k in range(3))
    desk.grabber.change()
    assert desk.screen.look(200.0) is not seen
    assert desk.screen.analyses == 2


def test_the_next_analysis_waits_for_the_work_of_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a second of work at 5 % of a core: ten seconds; unchanged, 0.075 at 1.5 %: five."""
    desk, work = Desktop(), iter([0.0, 0.0, 0.5, 0.5, 0.575, 0.6, 0.7])
    monkeypatch.setattr(screens, "processor_time", lambda: next(work))
    before = desk.screen.look(0.0)
    assert desk.screen.look(10.1) is before
    desk.grabber.pixels = np.full_like(desk.grabber.pixels, 255)
    assert desk.screen.look(15.0) is before
    assert desk.screen.analyses == 1
    seen = desk.screen.look(15.2)
    assert seen is not None
    assert not seen.loss.any()  # white has nothing to lose
    assert desk.screen.analyses == 2


def test_a_monitor_may_change_its_size_go_and_come_back() -> None:
    """Its user's brightness comes back while it is away."""
    desk = Desktop()
    desk.run(5.0)
    assert desk.backlight.read_factor() < 0.95
    desk.grabber.resize(32, 24)
    desk.run(1.0)
    assert desk.screen.size == (32, 24)
    desk.grabber.resize(0, 0)
    desk.run(20.0)
    assert desk.said == ["panel rests: there is no picture of its monitor"]
    assert desk.backlight.read_factor() == 1.0
    desk.grabber.resize(32, 24)
    desk.run(5.0)
    assert desk.said[1:] == ["panel is dimmed again"]
    dimmed = desk.backlight.read_factor()
    assert dimmed < 0.95
    desk.backlight._at = 0
    desk.run(5.0)
    desk.backlight.set_factor(dimmed)
    desk.run(5.0)
    assert desk.said[2:] == ["panel rests: it is off", "panel is dimmed again"]
    assert desk.brought_back == []


def test_it_dims_rests_and_tells_what_its_user_has_set() -> None:
    desk = Desktop()
    desk.run(6.0)
    dimmed = desk.backlight.read_factor()
    assert dimmed < 0.95
    desk.why = "gimp runs"
    desk.run(6.0)
    assert desk.backlight.read_factor() == 1.0
    assert desk.said == ["panel rests: gimp runs"]
    desk.why = ""
    desk.run(6.0)
    assert desk.backlight.read_factor() == pytest.approx(dimmed, abs=2e-3)
    desk.loop.paused = True
    desk.run(6.0)
    desk.backlight.set_factor(0.5)
    desk.run(1.0)
    assert desk.said[1:] == ["panel is dimmed again", "panel rests: paused", "panel was set to 50%: kept"]
    assert desk.brought_back == [pytest.approx(0.5, abs=0.01)]


@pytest.mark.slow
def test_each_of_a_thousand_keys_is_kept_at_the_next_look_and_none_is_set_over() -> None:
    """Pressed whenever time passes: while it waits, looks, reads the panel or the clock."""
    desk, rng = Desktop(), np.random.default_rng(3)
    panel, moments = desk.backlight, list(np.cumsum(rng.exponential(0.15, 1000)))
    dimmer = desk.loop.monitors[0].dimmer
    looks, pressed, kept, read_after = list[float](), list[int](), list[int](), list[int]()

    def passes(seconds: float) -> float:
        desk.now += seconds
        while moments and moments[0] <= desk.now:
            moments.pop(0)
            panel._at = 51 + (panel._at - 51 + int(rng.integers(1, 950))) % 950
            pressed.append(len(looks))
        return desk.now

    def read() -> int:
        passes(1e-3)
        changed = panel._at != round(1000 * dimmer.set_to)  # two keys may come to nothing
        read_after.extend([panel._at] * changed)
        kept.extend(len(looks) - at for at in pressed)
        pressed.clear()
        return panel._at

    def set_to(step: int) -> None:
        assert not pressed
        panel._at = step

    def grab(name: str) -> Any:
        passes(float(rng.uniform(0, 0.1)))
        return Grabber.grab(desk.grabber, name)

    panel._read_step, panel._set, desk.grabber.grab = read, set_to, grab
    desk.loop.clock, desk.loop.sleep = lambda: passes(1e-4), passes
    desk.loop.resting = lambda now: looks.append(now) or ""
    dimmer.clock = desk.loop.clock
    while len(kept) < 1000:
        if rng.random() < 0.02:
            desk.grabber.pixels[:] = rng.integers(0, 256, (HIGH, WIDE, 4)) * int(rng.integers(2))
        desk.loop.run_once()
    assert max(kept) == 1
    assert desk.said == [f"panel was set to {step / 1000:.0%}: kept" for step in read_after]


def test_what_was_saved_is_that_of_the_factors_over_time() -> None:
    """2 W at full backlight: the mean below what the user has set, times hours."""
    desk = Desktop()
    desk.run(20.0)
    today = desk.loop.state().today
    assert today.seconds == pytest.approx(20.0, abs=0.3)
    assert today.saved_wh == pytest.approx(2.0 * (today.seconds - today.dimmed) / 3600)
    assert today.dimmed < 0.95 * today.seconds
    assert 8 <= len(desk.kept) <= 11  # every two seconds


def test_today_counts_on_when_it_is_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    today = DayTotal(live_state.day(), 3600.0, 1800.0, 0.5, 36.0)
    write_state(replace(STATE, today=today))
    assert earlier() == (today, {})  # and the session's state is gone
    assert earlier()[1] == {"sysfs:panel": 0.9}  # the power was cut
    write_state(replace(STATE, today=today, monitors=()))  # it has ended
    assert [earlier(), earlier()] == [(today, {})] * 2
    desk = Desktop(earlier()[0])
    desk.run(10.0)
    assert desk.loop.state().today.seconds == pytest.approx(3610.0, abs=0.3)
    monkeypatch.setattr(live_state, "day", lambda: "2030-01-01")
    monkeypatch.setattr(live_loop, "day", lambda: "2030-01-01")
    desk.run(1.0)
    assert desk.loop.state().today.seconds <= 1.0


def test_no_picture_leaves_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing but the state is opened to be written, no run of the picture's bytes is in it; none gets it."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    desk, opened, watching = Desktop(), list[str](), [True]
    desk.loop.keep = write_state

    def audit(event: str, given: tuple[Any, ...]) -> None:
        if watching[0] and event == "open" and given[2] & (os.O_WRONLY | os.O_RDWR):
            opened.append(str(given[0]))
        others = ("socket.", "subprocess.", "os.exec", "os.posix_spawn", "os.fork", "mmap.", "ctypes.")
        assert not (watching[0] and event.startswith(others)), event

    sys.addaudithook(audit)
    for _ in range(6):
        desk.grabber.change()
        desk.run(1.0)
    watching[0] = False
    assert opened
    assert {Path(name).parent for name in opened} == {tmp_path, tmp_path / "evenlight"}
    written = b"".join(path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())
    assert len(written) < 2000
    last = desk.grabber.pixels.tobytes()
    assert not any(last[k : k + 8] in written for k in range(0, len(last), 8))


def test_a_screen_that_goes_is_told_in_a_line() -> None:
    desk = Desktop()
    desk.grabber.gone = True
    with pytest.raises(InstrumentError, match=r"^the screen cannot be looked at: connection lost$"):
        desk.run(1.0)


def test_the_state_is_found_while_its_program_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(InputError, match="live does not run"):
        running()
    lock = only_one()
    with pytest.raises(InputError, match="live does not run"):  # so far it has looked at nothing
        running()
    write_state(STATE)
    assert running() == STATE
    with pytest.raises(InstrumentError, match="evenlight live: is in use by this program already"):
        only_one()
    assert STATE.in_words().splitlines() == [
        "sysfs:panel: factor 0.50 of the brightness set (90%), rests: paused",
        "today, in 2.0 h: savings unknown (no power model), mean factor 0.60",
        "its own work: 1.0% of one core, about 0.1 Wh at 5 W",
    ]
    poor = replace(STATE, saves=True, today=replace(STATE.today, saved_wh=0.09), measured_w=8.5)
    assert poor.in_words().splitlines()[1:] == [
        "today, in 2.0 h: 0.09 Wh saved, mean factor 0.60",
        "its own work: 1.0% of one core, about 0.1 Wh at 5 W",
        "measured since it began: 8.50 W on average",
        "that is no less than it saved: it is not worth it here",
    ]
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(live_state.os, "kill", lambda *given: sent.append(given))
    assert live_state.toggle_pause() == "it goes on"
    assert sent[-1] == (os.getpid(), signal.SIGUSR1)
    (tmp_path / "evenlight-live.json").write_text('{"pid": "x"')
    with pytest.raises(InputError, match="live does not run"):
        running()
    write_state(STATE)
    lock.release()  # its number is that of a process that runs, and no longer one of ours
    with pytest.raises(InputError, match="live does not run"):
        live_state.toggle_pause()


def test_it_rests_with_programs_on_mains_power_and_for_another_session(tmp_path: Path, monkeypatch) -> None:
    battery = SimpleNamespace(power_plugged=False)
    seen = [SimpleNamespace(info={"name": name}) for name in ("gimp-2.10", "wluma", "xterm", None)]
    monkeypatch.setattr(psutil, "process_iter", lambda asked: seen)
    monkeypatch.setattr(psutil, "sensors_battery", lambda: battery)
    monkeypatch.setattr(resting, "USERS", tmp_path)
    assert resting.others_at_work() == "wluma runs: a brightness that it sets counts as set by you"
    assert resting.reasons(["krita", "gimp"], False)(0.0) == "gimp-2.10 runs"
    assert resting.reasons(["krita"], False)(0.0) == ""
    why = resting.reasons([], True)
    assert why(0.0) == ""
    battery.power_plugged = True
    assert why(1.0) == ""  # looked at every five seconds
    assert why(6.0) == "mains power"
    monkeypatch.setattr(psutil, "sensors_battery", lambda: None)
    assert why(12.0) == "mains power"
    user = tmp_path / str(os.getuid())
    user.write_text("# This is private data.\nNAME=me\nSTATE=active\nSTOPPING=no\n")
    why = resting.reasons([], False)
    assert why(0.0) == ""
    user.write_text("# This is private data.\nNAME=me\nSTATE=online\nSTOPPING=no\n")
    assert why(6.0) == "another session is on the screen"


def test_a_service_is_shown_installed_and_removed(tmp_path: Path, monkeypatch, command, capsys) -> None:
    """systemctl is a script here, which notes what it is asked."""
    program = tmp_path / "bin" / "systemctl"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(user_service.typer, "confirm", lambda question: True)
    assert user_service.installed(["--backlight", "sysfs:my panel", "--rate-limit", "$5%.json"])
    text = user_service.unit_file().read_text()
    assert "-P -m evenlight live --backlight 'sysfs:my panel' --rate-limit '$$5%%.json'\n" in text
    assert f"\nWorkingDirectory={Path.cwd()}\n" in text  # where the files are that it names
    assert text in capsys.readouterr().out
    done = command("live", "--uninstall")
    assert (done.code, done.err) == (0, "")
    assert not user_service.unit_file().exists()
    assert (tmp_path / "asked").read_text().splitlines() == [
        "--user daemon-reload",
        "--user enable evenlight-live.service",
        "--user restart evenlight-live.service",
        "--user disable --now evenlight-live.service",
        "--user daemon-reload",
    ]
    assert "nothing is installed" in command("live", "--uninstall").err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "live needs --backlight"),
        (["--install"], "live needs --backlight"),
        ([*BORROWED, "--budget", "0.2"], "asks for the factor 0.20 on average, and the lowest is 0.3"),
        ([*BORROWED, "--target-loss", "0.1", "--budget", "0.5"], "not both"),
        (
            ["--backlight", "a:", "--backlight", "b:", "--backlight-curve", "c.csv"],
            "is that of one backlight",
        ),
        ([*BORROWED, "--target-loss", "2"], "--target-loss must lie in 0 to 1, got 2"),
        (["--backlight", "sysfs:none_such", "--display", "laptop-lcd"], "fitted on"),
        (["--install", *BORROWED], "none_such: no such backlight"),  # before it asks
        ([*BORROWED, "--power-meter", "none_such:"], "there is no power meter"),
        (["--status"], "live does not run"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(words, told, command, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    done = command("live", *words)
    assert done.code == (1 if "no such" in told else 2)
    assert told in done.err
    assert done.err.count("\n") == 1


def test_a_killed_program_leaves_the_brightness_that_its_user_has_set(tmp_path: Path, monkeypatch) -> None:
    """Found at 900, dimmed, set to 600 by its user, dimmed further, killed; all were told to end before.

    Modules of the current folder are none of its own.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "platform.py").write_text("raise SystemExit")
    program = tmp_path / "panel.py"
    program.write_text(PROGRAM)
    step = tmp_path / "panel.step"
    step.write_text("900")
    code = (
        "import sys, time\n"
        "from evenlight.experiments.follow.watchdog import kept_backlight\n"
        f"device, watchdog = kept_backlight('exec:{sys.executable} {program}', '')\n"
        "device.set_factor(0.7); watchdog.bring_back(0.6); device.set_factor(0.4)\n"
        "print(watchdog._process.pid, flush=True); time.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-P", "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        watchdog = int(process.stdout.readline())
        for one in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
            os.kill(watchdog, one)
        assert step.read_text() == "400"
        process.kill()
    end = time.monotonic() + 120
    while step.read_text() != "600":
        assert time.monotonic() < end, step.read_text()
        time.sleep(0.02)
