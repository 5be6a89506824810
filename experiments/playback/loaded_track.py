"""A track to be shown: read with its baseline, and what it does not go together with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.rig import Actuator, Rig
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, OptimizationSummary, read_track
from evenlight.experiments.playback.clip_feeds import LARGEST_DEVIATION, wrong_count, wrong_time
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource

TRACK, SUMMARY = "track.csv", "summary.json"
WORTH_SAYING = 0.001  # of contrast loss: what the curves are uncertain by


def track_file(path: Path) -> Path:
    """Return the file of a track, which may be given as the folder it is in."""
    file = path / TRACK if path.is_dir() else path
    if not file.is_file():
        raise InputError(
            f"{file}: no such brightness track; give a track.csv, or the folder that `evenlight optimize` "
            "wrote"
        )
    return file


@dataclass(frozen=True, slots=True, eq=False)
class LoadedTrack:
    """A track, and constant dimming of equal power."""

    track: BrightnessTrack
    baseline: float  # factor of constant dimming at equal power
    source_of_baseline: str  # where that comes from
    sha256: str = ""  # of its track.csv


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
        factor = read_json_record(OptimizationSummary, summary).baseline_factor
        return LoadedTrack(track, factor, f"as {summary} has it", digest)
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


def require_display(track: BrightnessTrack, display: Display) -> None:
    """Refuse a track that was made for another display."""
    header = track.header
    if header.display_fingerprint != display.fingerprint:
        raise InputError(
            f"the track was made for the display {header.display_name!r}, and here is {display.name!r}: make "
            "one with --display set to it, or play it all the same with --other-display-ok"
        )


def require_fit(video: VideoSource, track: BrightnessTrack) -> None:
    """Refuse a track that is none of a video: of another number of frames, or at other times.

    Of a video that does not tell its frames beforehand, the player finds it out.
    """
    known, wanted = video.n_frames, len(track.times)
    if known is not None and known != wanted:
        raise wrong_count(video.name, known, wanted)
    if isinstance(video, VideoFile):
        times = video.timeline.times[video.timeline.durations > 0]
        off = np.abs(times - track.times) > LARGEST_DEVIATION
        if off.any():
            k = int(off.argmax())
            raise wrong_time(video.name, k, float(times[k]), float(track.times[k]))


def floor_note(track: BrightnessTrack, rig: Rig) -> str:
    """Return what pixels lose beyond what a track for a backlight says; empty where that is nothing.

    Parameters
    ----------
    track, rig : BrightnessTrack, Rig
        The track, and what it is to be shown on.
    """
    added = track.header.loss_added_by_pixels or 0.0
    if rig.actuator is Actuator.BACKLIGHT or added < WORTH_SAYING:
        return ""
    return (
        f"note: the track of {track.header.video} was made for a backlight, and here pixels dim, which show "
        f"nothing below black: in some frames at least {added:.2g} more of the visible contrast is lost; "
        "optimize it with --actuator pixels"
    )
