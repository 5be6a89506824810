"""`evenlight live` on made desktops: windows, films and keys at random, and recordings dimmed again."""

import itertools
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
from evenlight.experiments.desktop.live_loop import LiveLoop
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
log, read_at = Path("{folder}", "log").open("a", buffering=1), [0.0]
look, read, write = LiveLoop._look, SysfsBacklight._read_step, SysfsBacklight._write
def looking(loop, now):
    print(time.monotonic(), 0, 0, 0, file=log)
    look(loop, now)
def reading(panel):
    read_at[0] = time.monotonic()
    print(read_at[0], 1, step := read(panel), 0, file=log)
    return step
def writing(panel, step):
    write(panel, step)
    print(now := time.monotonic(), 2, step, now - read_at[0], file=log)
LiveLoop._look, SysfsBacklight._read_step, SysfsBacklight._write = looking, reading, writing
SysfsBacklight.__init__.__defaults__ = (Path("{folder}"), 0.01)
"""


class Desk:
    """An emulated panel, the program that dims it, and its user."""

    def __init__(self, screen: VirtualScreen) -> None:
        self.keys, self.light, self.full, folder = [], [], 0.9, screen.folder
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
        step = int(np.clip(round((before := self.step()) * ratio), STEPS // 20, STEPS))
        self.full = min(self.full * step / before, 1.0)
        with (self.panel / "brightness").open("r+") as file:
            begun = time.monotonic()
            file.write(f"{step:<6}\n")
        self.keys.append([time.monotonic(), step, begun])

    def watch(self, grabber: Any, seconds: float) -> None:
        """Measure the light of the screen ten times a second."""
        end = time.monotonic() + seconds
        while (now := time.monotonic()) < end:
            shot = grabber.grab(grabber.names()[0])
            pixels = np.frombuffer(shot.raw, np.uint8).reshape(shot.height, shot.width, 4)[::7, ::7, 2::-1]
            self.light.append([now, float(EMITTED.luminance(np.ascontiguousarray(pixels)).mean())])
            time.sleep(0.1)

    def written(self) -> int:
        """Return how many bytes the program has written so far, to whatever; 0 where no system tells."""
        told = Path(f"/proc/{self.program.pid}/io")  # Linux
        words = told.read_text().split() if told.exists() else ["wchar:", "0"]
        return int(words[words.index("wchar:") + 1])

    def end(self) -> float:
        """End the program; return how far the panel is then from full, by the keys alone, as a share."""
        self.program.terminate()
        self.program.wait()
        return abs(self.step() / STEPS / self.full - 1)

    def kept(self) -> tuple[int, int, float]:
        """Return how many keys were lost, the most looks from one to its being read, and to that the time."""
        log, keys = np.loadtxt(self.log, ndmin=2), [*self.keys, [np.inf] * 3]
        looks, reads = log[log[:, 1] == 0, 0], log[log[:, 1] == 1]
        lost, late = 0, [(0, 0.0)]
        for (ended, step, begun), (_, _, following) in itertools.pairwise(keys):
            own = reads[(reads[:, 0] >= begun) & (reads[:, 0] < following)]
            found = own[own[:, 2] == step, 0]
            passed = (looks > ended) & (looks <= (found[0] if len(found) else following))
            late.append((int(passed.sum()), found[0] - ended if len(found) else 0.0))
            lost += not len(found) and passed.sum() > 1
        return lost, *map(max, zip(*late, strict=True))

    def rates(self) -> Array:
        """Return its settings' rates over the limit, by what was on the screen."""
        log, keys = np.loadtxt(self.log, ndmin=2), np.reshape(self.keys, (-1, 3))[:, :2]
        own = log[log[:, 1] == 2][:, [0, 2]]
        both = np.concatenate([own, keys])
        order = np.argsort(both[:, 0])
        times, factors = both[order, 0], both[order, 1] / STEPS
        by_user = order >= len(own)
        shown = np.interp(times[1:], *np.transpose(self.light))
        rates = over_limit(factors[:-1], factors[1:], shown, np.diff(times))
        return np.abs(rates[~by_user[1:]])


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
                begun = desk.written()
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
            written = desk.written() - begun - desk.log.stat().st_size
            rates, (lost, looks, late) = desk.rates(), desk.kept()
            left = desk.end()
        finally:
            desk.program.kill()
            desk.program.wait()
    log = np.loadtxt(desk.log)
    window = 1e6 * np.percentile(log[(log[:, 1] == 2) & (log[:, 3] < 1), 3], [50, 99, 100])
    told = desk.said.read_text().count(": kept")
    print(f"\n{len(rates)} settings, largest rate over the limit {rates.max():.3f}; {len(desk.keys)} keys, "
          f"{told} told, {lost} lost, kept after {looks} looks, {late:.2f} s; from reading "
          f"to setting {window.round()} us (median, 99 %, most); {left:.2%} off at the end")  # fmt: skip
    assert rates.max() <= 1.0
    assert (lost, looks) <= (0, 1)
    assert written < 2000 * actions * apart + 20_000  # its state, and what it asks the X server: no picture
    if actions < 100:  # among more keys, some go back by chance to where one lowered it, as a desktop does
        assert left <= 0.01


def test_a_recording_is_dimmed_to_what_it_may_lose() -> None:
    """0.1 · (1 - b) is lost, of which 0.03 at 0.7; from full brightness the way there takes 45 s."""
    curves = content(np.full(400, 0.1), np.full(400, 50.0), DISPLAY, 4.0)
    np.testing.assert_allclose(dimmed(curves), 0.7, atol=1 / 4095)
    np.testing.assert_allclose(over_limit(*np.array([[0.7], [0.71], [104.4 / 0.7], [1.0]])), 0.535, atol=1e-3)
