"""How fast a film is dimmed in a file, and how far its pixels lie from the definition, by codec."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.decoding_points import encoded
from benchmarks.measured import Approach, Chart, RunSettings, SubjectResults, claim, point
from benchmarks.records import BenchmarkPoint, Role
from benchmarks.stopwatch import timed_in_turn
from benchmarks.video_points import film
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, BudgetUnit, TrackHeader
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.method.preset_files import load_display
from evenlight.stimuli.dimmed.apply_options import Codec, DimmedFile
from evenlight.stimuli.dimmed.apply_video import apply_track
from evenlight.stimuli.dimmed.dimmed_samples import luma_chroma_codings
from evenlight.stimuli.dimmed.dimming import pixel_scale
from evenlight.stimuli.dimmed.matched_track import MatchedTrack
from evenlight.stimuli.video.frame_conversion import LUMA_WEIGHTS, matrix_of, planes_of
from evenlight.stimuli.video.video_file import VideoFile, open_video_file
from evenlight.stimuli.video.video_source import size_of

DEFINITION = "the definition, in float64, not encoded"
ERROR = "root mean square of R', G', B' from b^(1/gamma) times those of the film, in 1/255 of white"
LOSSLESS_TARGET = 0.5  # 1/255: half a code of 8 bits
SIZE, FRAMES = (1920, 1080), 24
QUICK_SIZE, QUICK_FRAMES = (320, 180), 6
NAMES = {
    Codec.H264: "H.264, 8 bits",
    Codec.HEVC10: "HEVC, 10 bits",
    Codec.AV1: "AV1, 10 bits",
    Codec.FFV1: "FFV1, 10 bits, without loss",
}

ROLES = {NAMES[Codec.H264]: Role.DEFAULT, DEFINITION: Role.REFERENCE}


def measure(settings: RunSettings) -> SubjectResults:
    """Return the speed and the errors of dimmed files."""
    (width, height), count = (QUICK_SIZE, QUICK_FRAMES) if settings.quick else (SIZE, FRAMES)
    settings.say(f"dimmed files of {width} x {height}")
    task = f"a frame of {width} x {height}, read from H.264, dimmed and written"
    with tempfile.TemporaryDirectory() as folder:
        source = encoded(Path(folder) / "film.mp4", film(width, height, count, settings.seed))
        points = _points(source, Path(folder), task, settings)
    errors = {p.approach: p.error for p in points}
    lossless = errors[NAMES[Codec.FFV1]]
    assert lossless is not None
    usual = points[0]
    return SubjectResults(
        name="apply",
        title="Dimmed files",
        lead=f"`evenlight apply` writes a frame of {width} x {height} in {usual.time * 1e3:.0f} ms as "
        f"H.264, with an error of {usual.error:.2g}/255 (root mean square); without loss {lossless:.2g}/255.",
        points=tuple(points),
        charts=(Chart("apply", f"Dimmed files: {task}", (task,)),),
        claims=(
            claim(
                "error of a dimmed file without loss",
                LOSSLESS_TARGET,
                lossless,
                "1/255",
                "half a code of 8 bits",
            ),
        ),
        notes=(
            "Film and dimmed film become R', G', B' in the same way, in float64 with chroma repeated, and "
            "what is above white is cut off in both. Dithering is part of the error: it is noise, not bias.",
        ),
    )


def _points(source: Path, folder: Path, task: str, settings: RunSettings) -> list[BenchmarkPoint]:
    """Return the points of all codecs, and of the definition; times are of one frame."""
    video = open_video_file(source)
    matched = _track_of(video)
    files = {name: folder / f"{codec.value}.mkv" for codec, name in NAMES.items()}

    def write(codec: Codec, name: str) -> Callable[[], object]:
        return lambda: apply_track(video, matched, DimmedFile(files[name], codec))

    runs = {name: write(codec, name) for codec, name in NAMES.items()}
    runs[DEFINITION] = lambda: [None for _ in _dimmed_as_defined(video, matched)]
    points = []
    for name, times in timed_in_turn(runs, settings.repeats(3)).items():
        of_one = replace(times, wall=times.wall / video.n_frames, processor=times.processor / video.n_frames)
        approach = Approach(task, name, ROLES.get(name, Role.VARIANT), _pixels_of(video), "pixels")
        error: tuple[Any, ...] = (None,)
        if name in files:
            rms, highest = _errors(files[name], video, matched)
            larger = files[name].stat().st_size / source.stat().st_size
            error = rms, ERROR, f"99.9 % within {highest:.2g}/255; {larger:.2g} times as large as the film"
        points.append(point(approach, of_one, *error))
    return points


def _pixels_of(video: VideoFile) -> int:
    """Return how many pixels a picture has."""
    width, height = size_of(video)
    return width * height


def _errors(file: Path, video: VideoFile, matched: MatchedTrack) -> tuple[float, float]:
    """Return the root mean square, and what 99.9 % of the errors of a file are within [1/255]."""
    squares, some = [], []
    for after, wanted in zip(_rgb(file), _dimmed_as_defined(video, matched), strict=True):
        error = 255 * (after - wanted)
        squares.append(np.mean(error**2))
        some.append(np.abs(error[:, ::4, ::4]))
    return float(np.sqrt(np.mean(squares))), float(np.quantile(some, 0.999))


def _dimmed_as_defined(video: VideoFile, matched: MatchedTrack) -> Iterator[Array]:
    """Yield R', G', B' of a dimmed film (3, height, width), in float64."""
    factors = np.asarray(matched.loaded.track.factors)
    for rgb, factor in zip(_rgb(Path(str(video.path))), factors, strict=True):
        yield rgb * pixel_scale(factor, matched.display.gamma)


def _rgb(file: Path) -> Iterator[Array]:
    """Yield R', G', B' of a file (3, height, width) in [0, 1], chroma repeated (ITU-T H.273, 8.3)."""
    for _, picture in open_video_file(file).pictures():
        weight_red, weight_blue = LUMA_WEIGHTS[matrix_of(picture)]
        codings = luma_chroma_codings(picture.format.components[0].bits, full=False)
        luma, blue, red = (
            (plane - coding.zero) / coding.span
            for plane, coding in zip(planes_of(picture), codings, strict=True)
        )
        blue, red = (np.repeat(np.repeat(chroma, 2, 0), 2, 1) for chroma in (blue, red))
        r, b = luma + 2 * (1 - weight_red) * red, luma + 2 * (1 - weight_blue) * blue
        g = (luma - weight_red * r - weight_blue * b) / (1 - weight_red - weight_blue)
        yield np.clip(np.stack([r, g, b]), 0, 1)


def _track_of(video: VideoFile) -> MatchedTrack:
    """Return a track of a film that goes from a factor of 0.3 to 0.8."""
    times, display = video.timeline.times, load_display("varjo-xr3")
    nothing = np.zeros(len(times))
    header = TrackHeader(
        video.name, display.name, display.fingerprint, "none", "none", 0.5, BudgetUnit.FACTOR, "none",
        provenance_now(), display=display,
    )  # fmt: skip
    factors = np.linspace(0.3, 0.8, len(times))
    track = BrightnessTrack(times, factors, nothing, nothing, nothing, nothing, nothing, header)
    return MatchedTrack(LoadedTrack(track, float(factors.mean()), "its mean"), display)
