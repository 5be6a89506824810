"""Tracks for other programs: a filter script for FFmpeg, a Lua script for mpv, JSON for all else.

Decision (docs/decisions/dimming-in-files.md). FFmpeg: gamma-encoded R'G'B' times one scale is Y' and the
colour differences times that scale, about black and about gray. So each frame is blended with a black one of
the same Y'CbCr format, in 16 bits. Y' above white is white before; colours above white are not cut off, as
`apply` does. mpv dims while it plays, on the GPU.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.brightness_track import STEP, ExportedTrack
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.stimuli.dimmed.apply_options import DimmedVersion
from evenlight.stimuli.dimmed.dimming import pixel_scale, version_factors

TOLERANCE = 1 / 2040  # an eighth of white's 8-bit code value
COMMANDS_AT_ONCE = 200  # FFmpeg 5.1 keeps, for each word of a list, as much memory as the rest of the list


def exported_track(loaded: LoadedTrack, display: Display, version: DimmedVersion) -> ExportedTrack:
    """Return what other programs need of a track.

    Parameters
    ----------
    loaded, display : LoadedTrack, Display
        The track, and the display that it was made for.
    version : DimmedVersion
        By what the video is to be dimmed.
    """
    header = loaded.track.header
    made_of = header.provenance.inputs
    return ExportedTrack(
        video=header.video,
        video_sha256=next((sha for key, sha in made_of.items() if key.startswith("video")), None),
        version=version.value,
        display_name=display.name,
        peak_luminance=display.peak_luminance,
        gamma=display.gamma,
        baseline=loaded.baseline,
        interpolation=STEP,
        times=tuple(loaded.track.times.tolist()),
        factors=tuple(version_factors(loaded, version).tolist()),
        provenance=provenance_now(inputs={"track": loaded.sha256}),
        film=header.film,
    )


def write_export(path: Path, track: ExportedTrack, to: str) -> None:
    """Write a track for a program: "ffmpeg", "mpv" or "json"."""
    if to == "json":
        write_json_record(path, track)
    else:
        write_whole(path, {"ffmpeg": ffmpeg_script, "mpv": mpv_script}[to](track))


class Stretch(NamedTuple):
    """Frames `first` to `last`, both included, whose pixel values take one scale."""

    first: int
    last: int
    scale: float  # b^(1/γ)


def stretches_of(track: ExportedTrack, tolerance: float = TOLERANCE) -> list[Stretch]:
    """Return the longest stretches from the first frame on in which one scale is right within a tolerance.

    Parameters
    ----------
    track : ExportedTrack
        Factors and γ.
    tolerance : float
        How far the scale may be off: as a share of white's pixel value.
    """
    scales = pixel_scale(track.factors, track.gamma).tolist()
    found, first, low, high = [], 0, scales[0], scales[0]
    for frame, scale in enumerate(scales):
        lower, higher = min(low, scale), max(high, scale)
        if higher - lower > 2 * tolerance:
            found.append(Stretch(first, frame - 1, (low + high) / 2))
            first, low, high = frame, scale, scale
        else:
            low, high = lower, higher
    return [*found, Stretch(first, len(scales) - 1, (low + high) / 2)]


def _film_of(track: ExportedTrack) -> FilmReading:
    if track.film is None:
        said = "an earlier version made it, or it is of loss curves alone: make it again with `optimize`"
        raise InputError(f"the track does not tell when its film begins, for {said}")
    return track.film


def ffmpeg_script(track: ExportedTrack) -> str:
    """Return a filter script: `ffmpeg -filter_complex_script FILE`.

    The clock is the file's, which FFmpeg begins at 0. A command holds from half a frame before its frame on.
    """
    stretches, film = stretches_of(track), _film_of(track)
    # Not from the middle between two frames of the track: of a damaged film, FFmpeg shows more.
    begin = film.picture_start - float(min(np.diff(track.times), default=0.0)) / 2
    commands = [f"{begin + track.times[k]:.6f} blend@dim all_opacity {s:.7f}" for k, _, s in stretches[1:]]
    stream = "" if film.stream is None else f"[0:{film.stream}]"
    lists = [
        "sendcmd=c='" + ";\n".join(commands[k : k + COMMANDS_AT_ONCE]) + "',"
        for k in range(0, len(commands), COMMANDS_AT_ONCE)
    ]
    first = stretches[0].scale
    said = f"Dims {track.video} ({track.version}, gamma {track.gamma:g}), {len(track.times)} frames"
    return "\n".join(
        [
            f"{stream}sendcmd=c='# {_plain(said)}",
            "# ffmpeg -i VIDEO -filter_complex_script FILE -acodec copy -pix_fmt yuv420p OUT",
            "# In FFmpeg 7 and later, -/filter_complex FILE. For whole videos in SDR, by their own clock.",
            "# Luma above white is cut off, colours above white are not.",
            f"0 blend@dim all_opacity {first:.7f}',",
            "scale=out_range=tv, format=yuv420p16le|yuv422p16le|yuv444p16le, limiter=max=60160:planes=1,",
            *lists,
            "split[film][copy];",
            "[copy]limiter=4096:4096:planes=1, limiter=32768:32768:planes=6[black];",
            f"[film][black]blend@dim=all_mode=normal:all_opacity={first:.7f}",
            "",
        ]
    )


def _plain(words: str) -> str:
    """Return words without the characters that mean something in a script."""
    return "".join(letter if letter.isalnum() or letter in " .,()-_" else "_" for letter in words)


def mpv_script(track: ExportedTrack) -> str:
    """Return a Lua script: `mpv --script=FILE VIDEO`; the template `dim.lua` says how it works."""
    frame = float(np.median(np.diff(track.times))) if len(track.times) > 1 else 0.04
    film = _film_of(track)
    lines = (f"{film.picture_start + track.times[s.first]:.6f} {s.scale:.7f}" for s in stretches_of(track))
    duration = film.picture_start + track.times[-1] + frame
    script = (resources.files("evenlight.stimuli.dimmed") / "dim.lua").read_text(encoding="utf-8")
    for name, text in (
        ("VIDEO", _plain(track.video)),
        ("VERSION", track.version),
        ("GAMMA", f"{track.gamma:g}"),
        ("DURATION", f"{max(duration, film.file_duration or 0.0):.6f}"),
        ("FRAME", f"{frame:.6f}"),
        ("START", f"{film.file_start:.6f}"),
        ("STREAM", "nil" if film.stream is None else str(film.stream)),
        ("TRACK", "\n".join(lines)),
    ):
        script = script.replace(f"@{name}@", text)
    return script
