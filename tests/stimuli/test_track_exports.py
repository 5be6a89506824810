"""Exported tracks: their scripts and readers give back the track's factors, at its frames."""

import shutil
import subprocess
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import STEP, ExportedTrack
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.stimuli.dimmed import track_export
from evenlight.stimuli.dimmed.dimming import pixel_scale
from evenlight.stimuli.dimmed.track_export import ffmpeg_script, mpv_script, stretches_of, write_export
from evenlight.stimuli.video.video_file import open_video_file

GAMMA = 2.2
PLAIN = FilmReading()
READERS = Path(__file__).parents[2] / "examples" / "readers"


def exported(
    times: np.ndarray, factors: np.ndarray, video: str = "made", film: FilmReading | None = PLAIN
) -> ExportedTrack:
    return ExportedTrack(
        video, None, "ours", "lab", 100.0, GAMMA, 0.5, STEP,
        tuple(times.tolist()), tuple(factors.tolist()), Provenance(), film,
    )  # fmt: skip


def wandering(frames: int, rate: float = 25.0, step: float = 0.004) -> ExportedTrack:
    """Factors that move by `step` per frame at most, up and down, between 0.3 and 0.9."""
    phase = np.cumsum(np.random.default_rng(7).uniform(0, step, frames)) / 0.6
    return exported(np.arange(frames) / rate, 0.3 + 0.6 * np.abs(1 - (phase + 0.7) % 2))


def flat(frames: int) -> ExportedTrack:
    return exported(np.arange(frames) / 25, np.full(frames, 0.5))


# --- JSON


def test_json_gives_every_number_back_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    track = exported(np.cumsum(rng.uniform(1e-3, 0.1, 500)), rng.uniform(1e-6, 1, 500))
    write_export(tmp_path / "made.json", track, "json")
    assert read_json_record(ExportedTrack, tmp_path / "made.json") == track


@pytest.mark.parametrize(
    ("times", "factors", "said"),
    [([0.0, 0.0], [0.5, 0.5], "times must rise"), ([0.0], [0.5, 0.5], "equally long, got 1 and 2")],
)
def test_a_track_that_contradicts_itself_is_refused(
    times: list[float], factors: list[float], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        exported(np.array(times), np.array(factors))


# --- Stretches


def test_stretches_hold_each_frame_once_and_stay_within_the_tolerance() -> None:
    track = wandering(2000)
    scales = np.array(track.factors) ** (1 / GAMMA)
    stretches = stretches_of(track, 0.002)
    assert [s.first for s in stretches] == [0, *(s.last + 1 for s in stretches[:-1])]
    assert stretches[-1].last == 1999
    for first, last, scale in stretches:
        assert np.abs(scales[first : last + 1] - scale).max() <= 0.002 + 1e-12
    for this, following in pairwise(stretches):  # none could be longer
        assert np.ptp(scales[this.first : following.first + 1]) > 0.004


# --- FFmpeg


def clip(path: Path, times_ms: np.ndarray, first_ms: int = 0, size: tuple[int, int] = (64, 36)) -> Path:
    """A lossless clip of colourful noise, its frames at some times; sound from 0 on, if the video is late."""
    rng = np.random.default_rng(3)
    with av.open(str(path), "w") as out:
        stream = out.add_stream("ffv1", rate=1000, width=size[0], height=size[1], pix_fmt="yuv420p")
        stream.codec_context.time_base = Fraction(1, 1000)
        sound = out.add_stream("pcm_s16le", rate=8000, layout="mono") if first_ms else None
        if sound is not None:
            samples = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), "s16", "mono")
            samples.rate, samples.pts = 8000, 0
            out.mux(sound.encode(samples))
        for time in times_ms:
            y = rng.integers(16, 236, (size[1], size[0]))
            uv = rng.integers(16, 241, (size[1] // 2, size[0]))
            frame = av.VideoFrame.from_ndarray(np.vstack([y, uv]).astype(np.uint8), "yuv420p")
            frame.pts, frame.time_base = int(time + first_ms), Fraction(1, 1000)
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return path


def planes(path: Path) -> tuple[list[float], np.ndarray]:
    """Times of a video's frames, and its samples in 8-bit code values, (N, 3/2 H, W)."""
    times, frames = [], []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            times.append(float(frame.time))
            kind = np.uint16 if "16" in frame.format.name else np.uint8
            parts = [np.frombuffer(p, kind).reshape(p.height, -1)[:, : p.width].ravel() for p in frame.planes]
            frames.append(np.concatenate(parts) / (256 if kind is np.uint16 else 1))
    return times, np.array(frames)


def by_ffmpeg(source: Path, script: str, *more: str) -> Path:
    if shutil.which("ffmpeg") is None:
        pytest.skip("needs ffmpeg: on Debian, apt-get install ffmpeg")
    (source.parent / "dim.ffmpeg").write_text(script)
    out = source.with_name("dimmed.mkv")
    call = ["ffmpeg", "-v", "error", "-y", "-i", source.name, "-filter_complex_script", "dim.ffmpeg"]
    done = subprocess.run(
        [*call, *more, "-acodec", "copy", "-vcodec", "ffv1", out.name],
        cwd=source.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return out


KEEP_TIMES = ("-fps_mode", "passthrough", "-enc_time_base", "-1")
EVEN = 40 * np.arange(60)  # [ms]
UNEVEN = np.concatenate([[0], np.cumsum(np.random.default_rng(5).integers(17, 90, 59))])


@pytest.mark.parametrize(("times", "late"), [(EVEN, 23), (UNEVEN, 0), (UNEVEN, 333)])
def test_ffmpeg_dims_each_frame_by_its_own_factor(
    times: np.ndarray, late: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(track_export, "COMMANDS_AT_ONCE", 25)
    factors = 0.3 + 0.6 * (np.arange(60) * 7 % 60) / 59  # a neighbour's would be 8 code values off, or more
    source = clip(tmp_path / "made.mkv", times, late)
    film = open_video_file(source)
    np.testing.assert_allclose(film.timeline.times, times / 1000, atol=5e-4)
    script = ffmpeg_script(exported(film.timeline.times, factors, film=film.reading))
    out = by_ffmpeg(source, script, "-pix_fmt", "yuv420p16le", *KEEP_TIMES)
    (shown, before), (dimmed_at, after) = planes(source), planes(out)
    assert dimmed_at == shown
    gray = 64 * 36  # as many samples of Y', and half as many of colour differences
    luma = [
        16 + 219 * np.minimum((y - 16) / 219, 1) * pixel_scale(b, GAMMA)
        for y, b in zip(before[:, :gray], factors, strict=True)
    ]
    colour = 128 + (before[:, gray:] - 128) * factors[:, None] ** (1 / GAMMA)
    np.testing.assert_allclose(after, np.hstack([luma, colour]), atol=220 / 2040 + 1 / 256 + 1e-3)


def test_ffmpeg_at_eight_bits_is_a_dither_away(tmp_path: Path) -> None:
    source = clip(tmp_path / "made.mkv", EVEN[:10])
    before, after = (
        planes(source)[1],
        planes(by_ffmpeg(source, ffmpeg_script(flat(10)), "-pix_fmt", "yuv420p"))[1],
    )
    neutral = np.repeat([16.0, 128.0], [64 * 36, 64 * 36 // 2])
    before[:, : 64 * 36] = np.minimum(before[:, : 64 * 36], 235)  # above white is white
    wanted = neutral + (before - neutral) * 0.5 ** (1 / GAMMA)
    assert np.abs(after - wanted).max() <= 1 + 1 / 256
    assert np.abs((after - wanted).mean()) <= 0.3  # FFmpeg 5.1 ends a quarter of a code value low


@pytest.mark.parametrize("pix_fmt", ["yuvj420p", "yuv422p10le", "gbrp10le", "bgr0"])
def test_ffmpeg_dims_videos_of_other_formats(pix_fmt: str, tmp_path: Path) -> None:
    """By R'G'B' as FFmpeg itself makes them of the film and of the dimmed film."""
    source = tmp_path / "made.mkv"
    picture = np.full((36, 64, 3), (200, 120, 60), np.uint8)
    with av.open(str(source), "w") as out:
        stream = out.add_stream("ffv1", rate=25, width=64, height=36, pix_fmt=pix_fmt.replace("yuvj", "yuv"))
        if "yuvj" in pix_fmt:
            stream.codec_context.color_range = 2
        for _ in range(3):
            out.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24").reformat(format=pix_fmt)))
        out.mux(stream.encode(None))
    shown, dimmed = (
        np.array(
            [
                f.to_ndarray(format="rgb24").reshape(-1, 3).mean(axis=0)
                for f in av.open(str(p)).decode(video=0)
            ]
        )
        for p in (source, by_ffmpeg(source, ffmpeg_script(flat(3)), "-pix_fmt", "yuv444p10le"))
    )
    np.testing.assert_allclose(dimmed, 255 * shown / 255 * pixel_scale(0.5, GAMMA), atol=2)


def test_the_script_of_mpv_goes_by_the_clock_of_a_late_film_and_knows_how_long_its_sound_is() -> None:
    film = FilmReading(picture_start=0.5, file_duration=7.0)
    lua = mpv_script(exported(np.arange(50) / 25, np.linspace(0.3, 0.9, 50), film=film))
    assert "\n0.500000 " in lua and "DURATION, FRAME = 7.000000" in lua  # noqa: PT018 - of one script


def test_the_script_for_mpv_writes_no_file_whose_name_others_can_guess() -> None:
    video = "a\nos.execute('x') @TRACK@.mp4"
    lua = mpv_script(exported(np.arange(2) / 25, np.array([0.3, 0.9]), video))
    assert "os.tmpname()" in lua
    assert "/tmp" not in lua
    assert lua.startswith("-- Dims a_os.execute(_x_) _TRACK_.mp4 (")


@pytest.mark.parametrize("script", [mpv_script, ffmpeg_script])
def test_a_track_that_does_not_tell_its_films_clock_is_to_be_made_again(script: Callable) -> None:
    with pytest.raises(InputError, match=r"an earlier version made it.*`optimize`"):
        script(exported(np.arange(2) / 25, np.array([0.5, 0.6]), film=None))


# --- Readers


NODE = """
import { readFileSync } from "fs";
import { Track } from "./track.mjs";
const track = new Track(JSON.parse(readFileSync("made.json", "utf8")));
for (const t of process.argv.slice(2)) console.log(track.factorAt(+t), track.scaleAt(+t));
"""
CPP = """
#include "track.hpp"
#include <cstdio>
int main(int n, char** t) {
    Track track(std::ifstream("made.json"));
    for (int i = 1; i < n; ++i) {
        const double time = std::atof(t[i]);
        std::printf("%.17g %.17g\\n", track.factor_at(time), track.scale_at(time));
    }
}
"""
C_SHARP = """
using System;
class Ask {
    static void Main(string[] times) {
        var track = Track.Read("made.json");
        foreach (var text in times) {
            var time = double.Parse(text, System.Globalization.CultureInfo.InvariantCulture);
            Console.WriteLine(track.FactorAt(time).ToString("R") + " " + track.ScaleAt(time).ToString("R"));
        }
    }
}
"""
PROGRAMS = {
    "node": ("ask.mjs", NODE, "", "node ask.mjs"),
    "g++": ("ask.cpp", CPP, "g++ -std=c++14 -Wall -Wextra -Werror -o ask ask.cpp", "./ask"),
    "mcs": ("Ask.cs", C_SHARP, "mcs -r:System.Runtime.Serialization Ask.cs Track.cs", "mono Ask.exe"),
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_reader_gives_the_factor_of_any_time(program: str, tmp_path: Path) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"needs {program}")
    rng = np.random.default_rng(2)
    track = exported(np.cumsum(rng.uniform(0.01, 0.1, 50)) + 0.1, rng.uniform(0.2, 1, 50))
    write_export(tmp_path / "made.json", track, "json")
    name, text, build, call = PROGRAMS[program]
    (tmp_path / name).write_text(text)
    for reader in READERS.iterdir():
        shutil.copy(reader, tmp_path)
    if build:
        subprocess.run(build.split(), cwd=tmp_path, check=True, capture_output=True)
    times = np.concatenate([track.times, np.add(track.times, 1e-3), [-1.0, 0.0, 1e6]])
    done = subprocess.run(
        [*call.split(), *map(str, times.tolist())], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    got = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    last = [max(sum(start <= time for start in track.times) - 1, 0) for time in times]  # counted one by one
    wanted = np.array(track.factors)[last]
    assert got[:, 0].tolist() == wanted.tolist()
    np.testing.assert_allclose(got[:, 1], wanted ** (1 / GAMMA), rtol=1e-14)
