"""A track that was made, read with its baseline: constant dimming of equal power."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, read_track
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

TRACK, SUMMARY = "track.csv", "summary.json"


def track_file(path: Path) -> Path:
    """Return the file of a track, which may be given as the folder it is in."""
    file = path / TRACK if path.is_dir() else path
    if not file.is_file():
        if clips := sorted(one.parent.name for one in path.glob(f"*/{TRACK}")):
            raise InputError(
                f"{path}: holds the tracks of {', '.join(clips)}; give the folder of one, {path / clips[0]}"
            )
        raise InputError(
            f"{file}: no such brightness track; give a track.csv with its track.json beside it, or the "
            "folder that `evenlight optimize` wrote"
        )
    return file


@dataclass(frozen=True, slots=True, eq=False)
class LoadedTrack:
    """A track, and constant dimming of equal power."""

    track: BrightnessTrack
    baseline: float  # factor of constant dimming at equal power
    source_of_baseline: str  # where that comes from
    sha256: str = ""  # of its track.csv
    modulated: str = "frame_mean"  # luminance that its rate limit was about, as its summary.json has it


def load_track(path: Path) -> LoadedTrack:
    """Return a track and its baseline.

    Parameters
    ----------
    path : Path
        A track.csv, or the folder it is in.
    """
    file = track_file(path)
    track, digest = read_track(file), sha256_of_file(file)
    summary = file.with_name(SUMMARY)
    if summary.is_file():
        made = read_json_record(OptimizationSummary, summary)
        return LoadedTrack(track, made.baseline_factor, f"as {summary} has it", digest, made.modulated)
    said = f"the track's mean, for there is no {summary}: of equal power where a backlight makes the light"
    return LoadedTrack(track, mean_factor(track), said, digest)


def mean_factor(track: BrightnessTrack) -> float:
    """Return the mean factor over time: constant dimming by it takes a backlight as much power (linear)."""
    durations = frame_durations(track)
    return float(np.average(track.factors, weights=durations))


def frame_durations(track: BrightnessTrack) -> NDArray[np.float64]:
    """Return how long each frame of a track is shown, the last one as long as most [s]."""
    steps = np.diff(track.times)
    return np.append(steps, np.median(steps) if len(steps) else 0.04)
