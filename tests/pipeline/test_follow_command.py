"""`evenlight follow`: with the real mpv and an emulated panel of Linux; killed in every way; refusals."""

import contextlib
import csv
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track, header_of

import evenlight
from evenlight.data_schema.provenance import Provenance, sha256_of_file
from evenlight.data_schema.tracks.brightness_track import (
    write_track,
)
from evenlight.experiments.follow import mpv_player, watchdog
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.preset_files import load_display

ROOT = Path(evenlight.__file__).parents[1]
N, RATE = 100, 25.0
STEPS, FOUND = 10_000, 8000  # of the emulated panel
FACTORS = 0.8 - 0.001 * np.arange(N) / RATE  # 0.1 % a second: slower than any limit
# Of FFV1 in Matroska mpv itself plays only what FFmpeg demuxes.
WITHOUT_SCREEN = "--vo=null --ao=null --no-config --demuxer=lavf"
# 64 s of film: it is still on when the panel has moved, and ends if that never happens.
ON_AND_ON = f"--player-arguments={WITHOUT_SCREEN} --loop-file=15"
LONGEST = 60.0  # [s] that anything may take before a test fails
needs_mpv = pytest.mark.skipif(shutil.which("mpv") is None, reason="mpv is missing: apt-get install mpv")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory, make_video: Callable[..., None]) -> Path:
    """A folder with a gray film of 4 s, film.mkv, and its track, which falls from 0.8 by 0.001 a second."""
    folder = tmp_path_factory.mktemp("film")
    make_video(folder / "film.mkv", np.full(N, 0.7), (32, 24), RATE)
    display = load_display("varjo-xr3")
    made = Provenance(inputs={"video": sha256_of_file(folder / "film.mkv")})
    header = header_of(display, video="film", budget=0.8, provenance=made, display=display)
    header = replace(header, power_model="surace2025", rate_limit="surace2025")
    columns = {"mean_luminance": 52.0 * FACTORS, "rate": np.append(np.diff(FACTORS) * 52.0 * RATE, 0.0)}
    track = example_track(FACTORS, RATE, header, rate_limit=1.0, power=52.0, **columns)
    write_track(folder / "track.csv", track)
    return folder


class Panel:
    """A backlight of Linux in files, as its driver shows it."""

    def __init__(self, folder: Path) -> None:
        self.over = threading.Event()
        self._folder = folder / "panel"
        self._folder.mkdir(parents=True)
        for name, step in (("max_brightness", STEPS), ("brightness", FOUND)):
            (self._folder / name).write_text(f"{step}\n")

    def step(self) -> int | None:
        with contextlib.suppress(OSError):
            return int((self._folder / "brightness").read_text())
        return None

    def vanish(self) -> None:
        shutil.rmtree(self._folder)

    def becomes(self, right: Callable[[int], bool]) -> bool:
        """Wait until its step is right; say whether it was before all was over."""
        end = time.monotonic() + LONGEST
        while (step := self.step()) is None or not right(step):
            assert time.monotonic() < end, f"stays at step {step}"
            if self.over.wait(0.005):
                return False
        return True


@pytest.fixture
def panel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Panel:
    """An emulated panel, in the place of those of this computer."""
    monkeypatch.setattr(SysfsBacklight.__init__, "__defaults__", (tmp_path / "sys", 0.01))
    return Panel(tmp_path / "sys")


@pytest.fixture
def players(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The players that are started."""
    started: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def noted(*given: Any, **more: Any) -> subprocess.Popen[bytes]:
        started.append(popen(*given, **more))
        return started[-1]

    monkeypatch.setattr(mpv_player.subprocess, "Popen", noted)
    return started


def words(film: Path, *more: object) -> list[str]:
    video, track = film / "film.mkv", film / "track.csv"
    return ["follow", str(video), str(track), "--backlight", "sysfs:panel", *map(str, more)]


@contextlib.contextmanager
def once(panel: Panel, right: Callable[[int], bool], act: Callable[[], object]) -> Iterator[None]:
    """Act once the panel's step is right, beside what the main thread does with it."""
    thread = threading.Thread(target=lambda: panel.becomes(right) and act())
    thread.start()
    try:
        yield
    finally:
        panel.over.set()
        thread.join()


@contextlib.contextmanager
def ended(process: subprocess.Popen[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is ended with the test, however that ends."""
    with process:
        try:
            yield process
        finally:
            process.kill()


def connected(path: Path, process: subprocess.Popen[bytes]) -> socket.socket:
    """A connection to a player that a process starts, or is."""
    end = time.monotonic() + LONGEST
    while process.poll() is None and time.monotonic() < end:
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.connect(str(path))
        except OSError:
            connection.close()
            time.sleep(0.005)
        else:
            connection.settimeout(LONGEST)
            return connection
    raise AssertionError(f"no player at {path}")


def dimmed(step: int) -> bool:
    return step < FOUND


@needs_mpv
@pytest.mark.real_time  # a real mpv plays to its end
def test_the_backlight_follows_the_film_and_is_left_as_it_was_found(
    film: Path, panel: Panel, command, tmp_path: Path
) -> None:
    log = tmp_path / "log.csv"
    at_the_end = f"--player-arguments=--start=3 {WITHOUT_SCREEN}"
    done = command(*words(film, at_the_end, "--log", log, "--wait"))
    assert (done.code, done.err) == (0, "")
    assert panel.step() == FOUND
    begun, *_, last = done.out.splitlines()
    assert begun == "film.mkv with sysfs:panel, found at factor 0.800"
    assert "backlight behind the picture by" in last
    with log.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"]]
    assert int(rows[-1]["frame"]) > int(rows[0]["frame"])
    for row in rows:
        frame, position = int(row["frame"]), float(row["position_s"])
        assert float(row["wanted_factor"]) == FACTORS[frame]
        assert frame == int(position * RATE + 1e-6)
        assert abs(float(row["achieved_factor"]) - float(row["set_factor"])) <= 0.5 / STEPS + 1e-9
    off = [abs(float(row["set_factor"]) - float(row["wanted_factor"])) for row in rows]
    on_target = next(k for k, difference in enumerate(off) if difference <= 1e-4)
    assert {row["frame"] for row in rows[: on_target + 1]} == {"75"}  # it waited for the light
    delays = [float(row["behind_picture_s"]) for row in rows if row["behind_picture_s"]]
    assert min(delays) >= 0


@needs_mpv
def test_a_player_that_dies_is_one_line_and_the_brightness_comes_back(
    film: Path, panel: Panel, players: list[subprocess.Popen[bytes]], command
) -> None:
    with once(panel, dimmed, lambda: players[-1].kill()):
        done = command(*words(film, "--quiet", ON_AND_ON))
    assert (done.code, done.out) == (1, "")
    assert done.err == "evenlight: the player died (signal 9) while it played\n"
    assert panel.step() == FOUND


@needs_mpv
def test_a_backlight_that_vanishes_is_one_line_and_ends_the_player(
    film: Path, panel: Panel, players: list[subprocess.Popen[bytes]], command
) -> None:
    with once(panel, dimmed, panel.vanish):
        done = command(*words(film, "--quiet", ON_AND_ON))
    assert done.code == 1
    assert "is gone; was the panel unplugged" in done.err
    assert done.err.count("\n") == 1
    assert players[-1].poll() is not None


@needs_mpv
# An interruption may come between the opening of a file and the block that closes it.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_brings_the_brightness_back_first_and_keeps_the_log(
    number: int, film: Path, panel: Panel, command, tmp_path: Path, monkeypatch
) -> None:
    at_the_end: list[int | None] = []
    end_process = mpv_player.end_process

    def noted(process: subprocess.Popen[bytes]) -> None:
        at_the_end.append(panel.step())
        end_process(process)

    monkeypatch.setattr(mpv_player, "end_process", noted)
    with once(panel, dimmed, lambda: os.kill(os.getpid(), number)):
        done = command(*words(film, "--log", tmp_path / "log.csv", ON_AND_ON))
    assert done.code == (130 if number == signal.SIGINT else 143)
    assert done.err == "evenlight: interrupted; the backlight is as it was found\n"
    assert [*at_the_end, panel.step()] == [FOUND, FOUND]
    assert len((tmp_path / "log.csv").read_text().splitlines()) > 1


@needs_mpv
def test_killed_without_a_word_the_watchdog_brings_the_brightness_back_and_the_player_quits(
    film: Path, panel: Panel, tmp_path: Path
) -> None:
    """The film stands at frame 50; the test, too, has a connection to the player."""
    (tmp_path / "sitecustomize.py").write_text(
        "from pathlib import Path\n"
        "from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight\n"
        f"SysfsBacklight.__init__.__defaults__ = (Path({str(tmp_path / 'sys')!r}), 0.01)\n"
    )
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    path = tmp_path / "socket"
    still = f"--player-arguments={WITHOUT_SCREEN} --pause --start=2 --input-ipc-server={path}"
    program = [sys.executable, "-m", "evenlight", *words(film, still)]
    with ended(subprocess.Popen(program, env=environment, cwd=ROOT)) as process:
        with connected(path, process) as player:
            assert panel.becomes(lambda step: step == round(STEPS * FACTORS[50]))
            process.kill()
            assert process.wait() == -signal.SIGKILL
            while player.recv(65536):  # until it quits
                pass
        assert panel.becomes(lambda step: step == FOUND)


def test_the_watchdog_tries_to_set_again_on_the_backlight_that_it_has_open(panel: Panel, monkeypatch) -> None:
    """Its lock keeps a second opening out."""
    given: list[int] = []
    set_step = SysfsBacklight._set

    def busy_once(backlight: SysfsBacklight, step: int) -> None:
        given.append(step)
        if len(given) == 1:
            raise InstrumentError("busy")
        set_step(backlight, step)

    monkeypatch.setattr(SysfsBacklight, "_set", busy_once)
    monkeypatch.setattr(watchdog, "PAUSE", 0.0)
    watchdog.restore("sysfs:panel", "", 0.5)
    assert given == [STEPS // 2, STEPS // 2]
    assert panel.step() == STEPS // 2


@needs_mpv
def test_a_player_that_runs_is_joined_and_left_alone(
    film: Path, panel: Panel, command, tmp_path: Path
) -> None:
    """It stands at frame 50 of the film, whose factor is set; the user ends it."""
    path = tmp_path / "socket"
    arguments = [
        *WITHOUT_SCREEN.split(),
        f"--input-ipc-server={path}",
        "--pause",
        "--start=2",
        "--no-terminal",
        "film.mkv",
    ]
    environment = os.environ | {"PWD": str(film)}  # by which mpv knows its folder
    with (
        ended(subprocess.Popen(["mpv", *arguments], cwd=film, env=environment)) as player,
        connected(path, player) as user,
    ):
        there = round(STEPS * FACTORS[50])
        with once(panel, lambda step: step == there, lambda: user.sendall(b'{"command": ["quit"]}\n')):
            done = command(*words(film, "--socket", path))
        assert (done.code, done.err) == (0, "")
        assert player.wait(LONGEST) == 0
    assert panel.step() == FOUND


@needs_mpv
def test_a_dry_run_prints_and_sets_nothing(film: Path, panel: Panel, command) -> None:
    done = command(*words(film, "--dry-run", f"--player-arguments=--start=3.5 {WITHOUT_SCREEN} --length=0.2"))
    assert done.code == 0
    assert "with a simulated backlight (nothing is set), found at factor 1.000" in done.out
    assert re.search(r"0:03\.\d frame [89]\d: factor [01]\.\d{4} of 0\.79\d\d wanted", done.out)
    assert "the player has ended" not in done.out  # there is no brightness to go back to
    assert panel.step() == FOUND


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (["--backlight", "none"], "there is nothing that could follow"),
        (["--backlight", "lamp"], "--backlight lamp: give DRIVER:ADDRESS, such as "),
        (["--backlight", "ddc:"], "--backlight ddc: give DRIVER:ADDRESS, such as "),
        (["--backlight", "lamp", "--dry-run"], "there is no backlight 'lamp'; there is sysfs, ddc"),
        (["--backlight-curve", "no.csv"], "no.csv"),
        (["--rig", "simulated"], "give it, or --backlight"),
        (["--display", "nowhere"], "nowhere: no such display"),
        (["--rate-limit", "nowhere"], "nowhere: no such rate limit"),
        (["--socket", "no-socket"], "no player listens there"),
        (["--socket", "s", "--player-arguments", "--fs"], "are for an mpv that is started"),
        (["--socket", "s", "--wait"], "are for an mpv that is started"),
        (["--player-arguments", "'"], "quote words as a shell takes them"),
        (["--log", "log.txt"], "--log log.txt: give a new file that ends in .csv"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    changes: list[str], line: str, film: Path, panel: Panel, command
) -> None:
    given = words(film)[: 3 if "--rig" not in changes and "--backlight" in changes else None]
    done = command(*given, *changes)
    assert (done.code, done.out) == (2, "")
    assert line in done.err
    assert done.err.count("\n") == 1
    assert panel.step() == FOUND


@needs_mpv
def test_options_that_mpv_does_not_take_are_refused_in_one_line(film: Path, panel: Panel, command) -> None:
    done = command(*words(film, "--player-arguments", "--nosuchoption"))
    assert (done.code, done.out) == (2, "")
    assert done.err == (
        "evenlight: mpv refuses its options: see --player-arguments; or it is older than 0.33\n"
    )
    assert panel.step() == FOUND


@pytest.mark.parametrize(
    ("backlight", "line"),
    [
        ("sysfs:acpi_video0", "no such backlight; there is panel on this computer"),
        ("ddc:999999", "monitor ddc:999999: "),
    ],
)
def test_a_backlight_that_is_absent_is_a_device_that_fails(
    backlight: str, line: str, film: Path, panel: Panel, command
) -> None:
    done = command(*words(film)[:3], "--backlight", backlight)
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    assert line in done.err


def test_a_track_of_another_video_is_refused(
    film: Path, panel: Panel, command, tmp_path: Path, make_video: Callable[..., None]
) -> None:
    for n, line in ((N - 1, "has other content"),):
        make_video(tmp_path / "other.mkv", np.full(n, 0.5), (32, 24), RATE)
        done = command("follow", tmp_path / "other.mkv", film / "track.csv", "--backlight", "sysfs:panel")
        assert done.code == 2
        assert line in done.err
    done = command("follow", tmp_path / "other.mkv", film / "track.csv", "--other-video-ok", "--dry-run")
    assert done.code == 2
    assert "has 99 frames, and its brightness track 100" in done.err
    for video, line in (("sunrise", "no such video file"), (film / "track.csv", "track.csv")):
        done = command("follow", video, film / "track.csv", "--dry-run")
        assert (done.code, done.err.count("\n")) == (2, 1)
        assert line in done.err


def test_a_program_without_mpv_says_how_to_get_it(film: Path, panel: Panel, command, monkeypatch) -> None:
    monkeypatch.setattr(mpv_player.shutil, "which", lambda name: None)
    done = command(*words(film, "--quiet"))
    assert (done.code, done.out) == (2, "")
    assert "mpv is not installed (on Debian: apt install mpv)" in done.err
    assert panel.step() == FOUND
