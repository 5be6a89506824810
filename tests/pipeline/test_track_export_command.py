"""`evenlight track export` in use: what it writes, what it refuses in one line, and mpv with its script."""

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from evenlight.data_schema.mapping import plain_value
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import ExportedTrack
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import film_reading

FRAMES, RATE = 60, 10.0
GRAY = 255 * (188 - 16) / 219
FACTORS = 0.4 + 0.5 * np.arange(FRAMES) / FRAMES
GAMMA = 1.95  # of the display that these tracks are made for, varjo-xr3
NAMES = {"ffmpeg": "film.ffmpeg", "mpv": "film.lua", "json": "film.exported_track.json"}


# What FFmpeg adds to a film: nothing; sound that begins before it and ends after it; a first, smaller video.
ALONE = "-c copy"
SOUND = "-f lavfi -i sine=d=9:r=8000 -c:a aac -ac 1 -c:v copy"
SMALLER = "-f lavfi -i color=s=32x32:r=10:d=6 -map 1 -map 0 -c:v copy -c:v:0 libx264 -disposition:v 0"


@pytest.fixture
def track(tmp_path: Path, make_stimulus: Callable[..., Any]) -> Path:
    """The folder of a track of six seconds, whose factors rise."""
    make_stimulus(tmp_path / "film-track", FACTORS, frames_per_second=RATE)
    return tmp_path / "film-track"


@pytest.mark.parametrize("to", NAMES)
def test_a_file_is_written_whole_and_replaced_only_by_force(
    command: Any, track: Path, tmp_path: Path, to: str
) -> None:
    out = tmp_path / NAMES[to]
    made = command("track", "export", track, "--to", to, "--out", out)
    assert (made.code, made.err) == (0, "")
    assert made.out.startswith(f"{out}: 60 frames of film-track; ")
    first = out.read_text()
    again = command("track", "export", track / "track.csv", "--to", to, "--out", out, "--version", "constant")
    assert (again.code, again.err.count("\n")) == (2, 1)
    assert f"--out {out}: is there already; give --force" in again.err
    assert out.read_text() == first
    more = ("--version", "constant", "--force", "--quiet")
    assert command("track", "export", track, "--to", to, "--out", out, *more) == type(made)(0, "", "")
    scale = FACTORS.mean() ** (1 / GAMMA)  # the constant factor of a backlight is the mean
    assert f"{FACTORS.mean() if to == 'json' else scale:.6f}"[:-1] in out.read_text()


def test_json_holds_the_factors_of_the_track_bit_for_bit(command: Any, track: Path, tmp_path: Path) -> None:
    out = tmp_path / NAMES["json"]
    command("track", "export", track, "--to", "json", "--out", out)
    made = read_json_record(ExportedTrack, out)
    assert made.factors == tuple(FACTORS)
    assert made.times == tuple(np.arange(FRAMES) / RATE)
    assert (made.video, made.gamma, made.display_name) == ("film-track", GAMMA, "varjo-xr3")
    assert command("validate", out).code == 0


def test_bad_input_ends_in_one_line(command: Any, track: Path, tmp_path: Path) -> None:
    def refused(*options: object, of: Path = track) -> str:
        ended = command("track", "export", of, *options)
        assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
        return str(ended.err)

    out, file = tmp_path / "x.ffmpeg", tmp_path / "file"
    assert "'vlc' is not one of" in refused("--to", "vlc", "--out", out)
    assert "no such brightness track" in refused("--to", "ffmpeg", "--out", out, of=tmp_path / "none")
    assert "mpv knows scripts by their ending; give a name in .lua" in refused("--to", "mpv", "--out", out)
    assert "give the name of a file" in refused("--to", "json", "--out", tmp_path)
    file.write_text("")
    assert f"cannot write {file / 'x.ffmpeg'}" in refused("--to", "ffmpeg", "--out", file / "x.ffmpeg")
    header = json.loads((track / "track.json").read_text())
    (track / "track.json").write_text(
        json.dumps(header | {"display_fingerprint": "other", "display_name": "oled"})
    )
    assert "does not hold its display 'oled'" in refused("--to", "ffmpeg", "--out", out)
    said = refused("--to", "ffmpeg", "--out", out, "--display", "varjo-xr3")
    assert "made for the display 'oled', and here is 'varjo-xr3'" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "film-track"]


class Mpv:
    """A real mpv that is paused at the beginning of a video, told by its socket what to do."""

    def __init__(self, folder: Path, display: str, *arguments: object) -> None:
        self.folder, self.said = folder, folder / "said.txt"
        options = "--no-config --gpu-sw --vo=gpu --ao=null --pause --keep-open=yes --no-osc --osd-level=0"
        with self.said.open("w") as said:  # a pipe that nobody reads would stop it
            self.process = subprocess.Popen(
                ["mpv", *options.split(), "--input-ipc-server=mpv.socket", *map(str, arguments)],
                cwd=folder,
                env=os.environ | {"DISPLAY": display, "TMPDIR": str(folder)},
                stdout=said,
                stderr=subprocess.STDOUT,
            )
        self.socket = socket.socket(socket.AF_UNIX)
        self.until(self._connected)
        self.stream = self.socket.makefile("rw")

    def _connected(self) -> bool:
        assert self.process.poll() is None
        try:
            self.socket.connect(str(self.folder / "mpv.socket"))
        except OSError:
            return False
        return True

    def __call__(self, *command: object) -> Any:
        """Return what mpv answers to a command: data, or None where it fails."""
        self.stream.write(json.dumps({"command": command, "request_id": 7}) + "\n")
        self.stream.flush()
        while True:
            answer = json.loads(self.stream.readline())
            if answer.get("request_id") == 7:
                return answer.get("data")

    def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds."""
        end = time.monotonic() + 200
        while not holds():
            assert time.monotonic() < end, self.process.poll()
            time.sleep(0.02)

    def close(self) -> None:
        """End mpv, and the link to it."""
        self.process.terminate()
        self.process.wait(timeout=200)
        with suppress(OSError):  # mpv is gone, and what was not sent is of no use
            self.stream.close()
        self.socket.close()

    def picture(self) -> Any:
        """Return the code values in the window, (H, W, 3); NaN as long as it shows nothing."""
        window = self.folder / "window.png"
        window.unlink(missing_ok=True)
        self("screenshot-to-file", str(window), "window")
        if not window.exists():
            return np.full((1, 1, 3), np.nan)
        with av.open(str(window)) as picture:
            return next(picture.decode(video=0)).to_ndarray(format="rgb24")

    def dims_by(self, frame: int) -> bool:
        """Return whether the window shows gray as the factor of a frame dims it."""
        return bool(np.abs(self.picture() - GRAY * FACTORS[frame] ** (1 / GAMMA)).max() < 1)


@pytest.fixture
def films(tmp_path: Path) -> None:
    """film.mp4, which is gray and as long as the track, and short.mp4."""
    if shutil.which("mpv") is None:
        pytest.skip("needs mpv: on Debian, apt-get install mpv")
    planes = np.full((96 * 3 // 2, 128), 128, np.uint8)
    planes[:96] = 188  # Y' of that gray
    for name, frames in (("film.mp4", FRAMES), ("short.mp4", 20)):
        with av.open(str(tmp_path / name), "w") as out:
            stream = out.add_stream("libx264", rate=10, width=128, height=96, pix_fmt="yuv420p")
            for _ in range(frames):
                out.mux(stream.encode(av.VideoFrame.from_ndarray(planes, "yuv420p")))
            out.mux(stream.encode(None))


@pytest.mark.usefixtures("films")
@pytest.mark.real_time  # a real mpv plays, and is paused
def test_mpv_dims_the_window_through_seeks_pauses_and_speed_and_refuses_another_video(
    command: Any, track: Path, tmp_path: Path, bare_screen: Callable[..., str]
) -> None:
    assert command("track", "export", track, "--to", "mpv", "--out", tmp_path / "film.lua").code == 0
    with closing(Mpv(tmp_path, bare_screen(), "--script=film.lua", "film.mp4")) as mpv:
        mpv.until(lambda: mpv.dims_by(0))
        mpv("seek", 4.5, "absolute+exact")
        mpv.until(lambda: mpv.dims_by(45))
        mpv("seek", 1.2, "absolute+exact")
        mpv.until(lambda: mpv.dims_by(12) and not mpv("get_property", "seeking"))  # else it takes no step
        mpv("frame-step")
        mpv.until(lambda: mpv.dims_by(13))
        mpv("set_property", "speed", 3)
        mpv("set_property", "pause", False)
        mpv.until(lambda: mpv("get_property", "time-pos") > 2.5)
        mpv("set_property", "pause", True)
        mpv.until(lambda: mpv.dims_by(round(mpv("get_property", "time-pos") * RATE)))
        mpv("loadfile", "short.mp4")
        mpv.until(lambda: np.ptp(mpv.picture()) > 100)  # white letters on the gray picture
        assert mpv("get_property", "glsl-shaders") == []
        assert abs(np.median(mpv.picture()) - GRAY) < 1
    assert "not dimmed: this video takes 2.0 s, the track 6.0 s" in mpv.said.read_text()
    assert not list(tmp_path.glob("evenlight-*"))


@pytest.mark.usefixtures("films")
@pytest.mark.real_time
@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("late.mp4", ALONE),
        ("late.mp4", SOUND),
        ("late.mkv", ALONE),
        ("late.ts", SOUND),
        ("late.mkv", SMALLER),
    ],
)
def test_mpv_dims_a_film_that_begins_late_by_the_clock_of_its_file(
    command: Any, track: Path, tmp_path: Path, bare_screen: Callable[..., str], name: str, more: str
) -> None:
    """Of an MP4, mpv's 0 is the stamp 0, of others the first one; of two videos, the larger is the film."""
    call = ["ffmpeg", "-v", "error", "-itsoffset", "0.7", "-i", "film.mp4", *more.split(), name]
    subprocess.run(call, cwd=tmp_path, check=True)
    header = json.loads((track / "track.json").read_text())
    header["film"] = plain_value(film_reading(open_video(tmp_path / name)))
    (track / "track.json").write_text(json.dumps(header))
    assert command("track", "export", track, "--to", "mpv", "--out", tmp_path / "film.lua").code == 0
    with closing(Mpv(tmp_path, bare_screen(), "--script=film.lua", name)) as mpv:
        mpv.until(lambda: mpv.dims_by(0))
        first = mpv("get_property", "time-pos")
        mpv("seek", first + 4.5, "absolute+exact")
        mpv.until(lambda: not mpv("get_property", "seeking") and mpv("get_property", "time-pos") > first)
        mpv.until(lambda: mpv.dims_by(round((mpv("get_property", "time-pos") - first) * RATE)))
    assert "not dimmed" not in mpv.said.read_text()
