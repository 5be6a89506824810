"""`evenlight live` on made desktops: windows, films and keys at random, and recordings dimmed again."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.desktops.made_desktops import VirtualScreen, virtual_screen
from benchmarks.desktops.replay import dimmed, over_limit
from benchmarks.online_content import content
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.experiments.desktop.screens import opened_screens
from evenlight.method.contrast.frame_light import FrameLight
from evenlight.method.preset_files import load_display

DISPLAY = load_display("laptop-lcd")
EMITTED = FrameLight(DISPLAY, DEFAULT_MODEL.pixel_to_luminance)
STEPS = 96_000  # as current drivers have
# Has every process take a folder for /sys/class/backlight, and log its settings there.
EMULATED = """
import time
from pathlib import Path
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
log, write = Path("{folder}", "log").open("a", buffering=1), SysfsBacklight._write
def logging(panel, step):
    write(panel, step)
    print(time.monotonic(), step, file=log)
SysfsBacklight._write = logging
SysfsBacklight.__init__.__defaults__ = (Path("{folder}"), 0.01)
"""


class Desk:
    """An emulated panel, the program that dims it, and its user."""

    def __init__(self, screen: VirtualScreen) -> None:
        self.keys, self.light, self.told, folder = [], [], [], screen.folder
        names = ("panel", "log", "said", "evenlight-live.json")
        self.panel, self.log, self.said, self.state = (folder / name for name in names)
        self.panel.mkdir()
        self.log.touch()
        (folder / "sitecustomize.py").write_text(EMULATED.format(folder=folder))
        (self.panel / "max_brightness").write_text(f"{STEPS}\n")
        (self.panel / "brightness").write_text(f"{STEPS * 9 // 10}\n")
        words = ["live", "--backlight", "sysfs:panel", "--display", "laptop-lcd", "--other-display-ok"]
        paths = dict.fromkeys(("XDG_RUNTIME_DIR", "PYTHONPATH"), str(folder))
        command, own = [sys.executable, "-m", "evenlight", *words], screen.environment | paths
        with self.said.open("w") as said:
            self.program = subprocess.Popen(command, env=own, stdout=said, stderr=said)

    def step(self) -> float:
        return float((self.panel / "brightness").read_text().partition("\n")[0])

    def press(self, ratio: float) -> None:
        """Set the brightness as keys do: by a ratio of what it is; nobody sees half of a step."""
        step = int(np.clip(round(self.step() * ratio), STEPS // 20, STEPS))
        with (self.panel / "brightness").open("r+") as file:
            file.write(f"{step:<6}\n")
        self.keys.append([time.monotonic(), step])

    def watch(self, grabber: Any, seconds: float) -> None:
        """Measure the light of the screen ten times a second, and how late it is told that a key is kept."""
        end = time.monotonic() + seconds
        while (now := time.monotonic()) < end:
            shot = grabber.grab(grabber.monitors[1])
            pixels = np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, 4)[::7, ::7, 2::-1]
            self.light.append([now, float(EMITTED.luminance(np.ascontiguousarray(pixels)).mean())])
            if self.said.read_text().count(": kept") > len(self.told):
                self.told.append(time.monotonic() - self.keys[-1][0])
            time.sleep(0.1)

    def end(self) -> float:
        """End the program; return how far from what its user had set the panel is then."""
        state = json.loads(self.state.read_text())
        ceiling = STEPS * float(state["monitors"][0]["ceiling"])
        self.program.terminate()
        self.program.wait()
        end = time.monotonic() + 60
        while abs(self.step() - ceiling) > 1 and time.monotonic() < end:
            time.sleep(0.02)
        return abs(self.step() - ceiling)

    def rates(self) -> tuple[Array, int]:
        """Return its settings' rates over the limit, by what was on the screen, and how many keys it lost."""
        own, keys = np.loadtxt(self.log, ndmin=2), np.reshape(self.keys, (-1, 2))
        both = np.concatenate([own, keys])
        order = np.argsort(both[:, 0])
        times, factors = both[order, 0], both[order, 1] / STEPS
        by_user = order >= len(own)
        over = by_user[:-1] & ~by_user[1:] & (np.abs(factors[1:] / factors[:-1] - 1) > 0.01)
        shown = np.interp(times[1:], *np.transpose(self.light))
        rates = over_limit(factors[:-1], factors[1:], shown, np.diff(times))
        return np.abs(rates[~by_user[1:] & ~over]), int(over.sum())


@pytest.mark.parametrize(
    ("actions", "apart"),
    [
        pytest.param(12, 1.0, marks=pytest.mark.real_time),
        pytest.param(240, 5.0, marks=[pytest.mark.study, pytest.mark.timeout(3600)]),
    ],
)
def test_no_change_is_faster_than_the_limit_and_keys_are_kept(
    actions: int, apart: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While windows open and close, a film jumps, and keys are pressed; twenty minutes of it: a study."""
    pytest.importorskip("mss")
    if shutil.which("xterm") is None:
        pytest.skip("no xterm")
    monkeypatch.setenv("DISPLAY", "")  # put back at the end
    rng, windows = np.random.default_rng(7), []
    with virtual_screen(tmp_path / "desk") as screen:
        seek = screen.film() if actions > 100 else lambda share: None
        desk = Desk(screen)
        try:
            with opened_screens() as grabber:
                while not desk.state.exists():
                    assert desk.program.poll() is None, desk.said.read_text()
                    time.sleep(0.1)
                for _ in range(actions):
                    desk.watch(grabber, rng.exponential(apart))
                    match rng.choice(["open", "close", "seek", "key", "key"]):
                        case "open":
                            windows.append(screen.terminal(*rng.permutation(["black", "white"])))
                        case "close" if windows:
                            screen.close(windows.pop(0))
                        case "key":
                            desk.press(rng.choice([0.7, 0.9, 1 / 0.9, 1 / 0.7]))
                        case _:
                            seek(float(rng.uniform()))
                desk.watch(grabber, 3.0)  # its state is told every two seconds
            rates, over = desk.rates()
            left = desk.end()
        finally:
            desk.program.kill()
            desk.program.wait()
    print(f"\n{len(rates)} settings, largest rate over the limit {rates.max():.3f}; {len(desk.keys)} keys, "
          f"{over} set over, told within {max(desk.told):.2f} s; {left:g} steps off at the end")  # fmt: skip
    assert rates.max() <= 1.0
    assert over <= 0.02 * len(desk.keys) + 1  # pressed between its look at the panel and its setting
    assert left <= 1


def test_a_recording_is_dimmed_to_what_it_may_lose() -> None:
    """0.1 · (1 - b) is lost, of which 0.03 at 0.7; from full brightness the way there takes 45 s."""
    curves = content(np.full(400, 0.1), np.full(400, 50.0), DISPLAY, 4.0)
    np.testing.assert_allclose(dimmed(curves), 0.7, atol=1 / 4095)
    np.testing.assert_allclose(over_limit(*np.array([[0.7], [0.71], [104.4 / 0.7], [1.0]])), 0.535, atol=1e-3)
