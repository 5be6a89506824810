"""Films of every kind and fault: frames, times and colours are what FFmpeg sees, or a refusal says why not.

`make test` has some of them, `make test-videos` all (tests/companions/odd_films.toml).
"""

import csv
import shutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from odd_films import OddFilm, Truth, left_of, made, read_table, truth_of
from optimized_videos import limit_file, optimized

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import ExportedTrack
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.square_pixels import NEARLY, square_size

FILMS, COMMON = read_table()
ROUNDED = 0.51 / 255  # half a code, and what FFmpeg's whole numbers add
# Films that all commands must take alike, what becomes of their damage, and how mpv plays them unseen.
FOLLOWED = (
    "late.mp4", "late.mkv", "edits.mp4", "varying.mp4", "paff.mkv", "open-cut.mkv", "overlap.mkv",
    "before-zero.mkv", "sound-early.mkv", "two-large.mkv", "wrapped.ts", "bit.mkv hold", "bit.mkv skip",
)  # fmt: skip
UNSEEN = "--player-arguments=--vo=null --ao=null --no-config --demuxer=lavf --loop-file=1"

RARE = pytest.mark.odd_films
pytestmark = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs the program ffmpeg")


def those(names: Iterable[str], *common: str) -> list[Any]:
    return [pytest.param(FILMS[n], marks=() if n in common else RARE, id=n) for n in names]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("films")


@pytest.mark.parametrize("film", those(FILMS, *COMMON))
def test_frames_times_and_colours_are_those_that_ffmpeg_sees(film: OddFilm, folder: Path) -> None:
    path = made(film, folder, FILMS)
    if film.refusal:
        with pytest.raises(InputError, match=film.refusal) as caught:
            list(open_video(path).frames())
        assert "\n" not in str(caught.value)
        return
    truth, video = truth_of(film, folder, FILMS), open_video(path)
    times, pixels = frames_of(video)
    require_times(times, truth)
    require_colours(pixels, truth)
    (alone,) = video.frames_at([len(times) // 2])
    np.testing.assert_array_equal(as_shares(alone.pixel_values), pixels[len(times) // 2])


def frames_of(video: Any) -> tuple[np.ndarray, np.ndarray]:
    frames = [(frame.time, as_shares(frame.pixel_values)) for frame in video.frames()]
    return np.array([time for time, _ in frames]), np.stack([shares for _, shares in frames])


def as_shares(pixels: np.ndarray) -> np.ndarray:
    return pixels / np.iinfo(pixels.dtype).max


def require_times(times: np.ndarray, truth: Truth) -> None:
    """Stamps are rounded, that of the first frame too: all are within half a tick of some common begin."""
    assert len(times) == len(truth.times)
    assert times[0] == 0
    assert np.ptp(times - truth.times) <= truth.tick + 1e-6


def require_colours(pixels: np.ndarray, truth: Truth) -> None:
    height, width = truth.pixels.shape[1:3]
    if abs(truth.aspect - 1) < NEARLY:
        assert pixels.shape == truth.pixels.shape
        assert np.abs(pixels - truth.pixels).max() <= ROUNDED
    else:  # stretched: it has its size, and the mean light of each frame
        assert pixels.shape[1:3] == square_size(width, height, truth.aspect)[::-1]
        assert np.abs(pixels.mean((1, 2)) - truth.pixels.mean((1, 2))).max() <= ROUNDED


def test_of_several_videos_that_one_is_read_that_is_asked_for(folder: Path) -> None:
    film = FILMS["two-large.mkv"]
    path = made(film, folder, FILMS)
    assert open_video(path).notes == ("of its videos [0, 1], stream 1 is taken (`stream`)",)
    require_colours(
        frames_of(open_video(path, stream=0))[1], truth_of(replace(film, stream=0), folder, FILMS)
    )
    with pytest.raises(InputError, match=r"`stream` 2: .* \[0, 1\]"):
        open_video(path, stream=2)


def test_of_cuts_that_overlap_it_is_said_what_is_left_out(folder: Path) -> None:
    (said,) = open_video(made(FILMS["overlap.mkv"], folder, FILMS)).notes
    assert said == "2 pictures are left out: time stamps fall back by up to 0.040 s"


@pytest.mark.parametrize("film", those([n for n, film in FILMS.items() if film.whole], "bit.mkv", "lost.ts"))
def test_what_is_damaged_is_refused_held_or_skipped(film: OddFilm, folder: Path) -> None:
    path, (whole, same) = made(film, folder, FILMS), left_of(film, folder, FILMS)
    with pytest.raises(InputError, match="`damaged` hold or skip goes on"):
        frames_of(open_video(path))
    skip, hold = (open_video(path, damaged=how) for how in ("skip", "hold"))
    (times, pixels), (held_times, held) = frames_of(skip), frames_of(hold)
    # Whole pictures, each at its time. FFmpeg sees one as it was though the end of its packet is lost.
    k = np.array([np.abs(whole.pixels - picture).max((1, 2, 3)).argmin() for picture in pixels])
    assert (np.diff(k) > 0).all()
    assert same[k].all()
    assert same.sum() - len(k) <= 1
    assert np.abs(pixels - whole.pixels[k]).max() <= ROUNDED
    assert np.ptp(times - whole.times[k]) <= 2 * whole.tick + 1e-6
    # Held, the same pictures at the same times, and the one before in the places of others.
    place = np.searchsorted(times, held_times + 1e-6) - 1
    np.testing.assert_array_equal(held, pixels[place])
    assert np.isin(times.round(6), held_times.round(6)).all()
    assert hold.reading.frames_held == len(held) - len(k)
    assert skip.reading.frames_skipped >= hold.reading.frames_held > -1


def as_left(film: OddFilm, folder: Path, damaged: str) -> Truth:
    """What is to be seen in a film of which damaged pictures are held or skipped."""
    if not film.whole:
        return truth_of(film, folder, FILMS)
    whole, same = left_of(film, folder, FILMS)
    assert not same.all()
    k = np.maximum.accumulate(np.where(same, np.arange(len(same)), 0))
    return replace(
        whole,
        pixels=whole.pixels[k if damaged == "hold" else same],
        times=whole.times[... if damaged == "hold" else same],
    )


def scales_of(dimmed: Truth, truth: Truth) -> np.ndarray:
    """By what the pixels of each frame are dimmed."""
    return (dimmed.pixels * truth.pixels).sum((1, 2, 3)) / (truth.pixels**2).sum((1, 2, 3))


@pytest.mark.skipif(shutil.which("mpv") is None, reason="needs the program mpv")
@pytest.mark.parametrize("name", [FOLLOWED[0], *(pytest.param(name, marks=RARE) for name in FOLLOWED[1:])])
def test_optimize_apply_export_and_follow_agree_on_frame_and_time(
    name: str, folder: Path, tmp_path: Path, command: Callable[..., Any]
) -> None:
    film, _, damaged = FILMS[name.split()[0]], *name.partition(" ")[1:]
    path, truth = made(film, folder, FILMS), as_left(film, folder, damaged)
    policy = ("--damaged", damaged) if damaged else ()
    limit = ("--rate-limit", limit_file(tmp_path / "limit.json", 30.0))
    track, _ = optimized(command, tmp_path, path, 0.8, *policy, *limit)
    result, scales = tmp_path / "out", track.factors ** (1 / track.header.display.gamma)
    require_times(track.times, truth)
    assert np.abs(np.diff(scales)).max() > 0.01  # so that a wrong frame is noticed

    def exported(to: str) -> Path:
        file = tmp_path / f"exported.{to}"
        assert command("track", "export", result, "--to", to, "--out", file, "--quiet").code == 0
        return file

    assert read_json_record(ExportedTrack, exported("json")).times == tuple(track.times)
    applied = OddFilm("applied.mkv")
    assert command("apply", path, result, "--out", tmp_path / applied.name, "--quiet").code == 0
    seen = truth_of(applied, tmp_path, {})
    require_times(track.times, seen)
    np.testing.assert_allclose(scales_of(seen, truth), scales, atol=0.003)
    if name != "overlap.mkv":  # of which FFmpeg, as it writes, drops other pictures
        call = f"-i {path} -filter_complex_script {exported('ffmpeg')} -c:v ffv1"
        seen, stored = truth_of(OddFilm("by-ffmpeg.mkv", call), tmp_path, {}), truth_of(film, folder, FILMS)
        place = np.searchsorted(track.times, stored.times - truth.times[0] + truth.tick) - 1
        np.testing.assert_allclose(scales_of(seen, stored), scales[place], atol=0.003)

    log = tmp_path / "log.csv"
    done = command("follow", path, result, "--dry-run", "--log", log, UNSEEN, *limit)
    assert (done.code, done.err) == (0, "")
    rows = [row for row in csv.DictReader(log.read_text().splitlines()) if row["frame"]]
    assert rows
    since = np.append(truth.times - truth.start, np.inf)
    for row in rows:
        k, position = int(row["frame"]), float(row["position_s"])
        assert float(row["wanted_factor"]) == pytest.approx(track.factors[k], abs=1e-5)
        assert since[k] - truth.tick <= position < since[k + 1] + truth.tick
