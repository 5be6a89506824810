"""Whether a brightness track is one of a video: of as many frames, at the same times."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource

LARGEST_DEVIATION = 1e-3  # [s] of a frame's time from its track's


def require_fit(video: VideoSource, track: BrightnessTrack) -> None:
    """Refuse a track that is none of a video: of another number of frames, or at other times.

    Of a video that does not tell its frames beforehand, the player finds it out.
    """
    known, wanted = video.n_frames, len(track.times)
    if known is not None and known != wanted:
        raise wrong_count(video.name, known, wanted)
    if isinstance(video, VideoFile):
        require_times(video.name, video.timeline.times[video.timeline.durations > 0], track)


def require_times(video: str, times: Array, track: BrightnessTrack) -> None:
    """Refuse a track whose frames are not those that a video shows at some times [s]."""
    if len(times) != len(track.times):
        raise wrong_count(video, len(times), len(track.times))
    off = np.abs(times - track.times) > LARGEST_DEVIATION
    if off.any():
        k = int(off.argmax())
        raise wrong_time(video, k, float(times[k]), float(track.times[k]))


def wrong_count(name: str, frames: int, wanted: int) -> InputError:
    """Return what is said of a video that has not as many frames as its track."""
    return InputError(
        f"the video {name!r} has {frames} frames, and its brightness track {wanted}: they must be one video's"
    )


def wrong_time(name: str, frame: int, time: float, wanted: float) -> InputError:
    """Return what is said of a video whose frames appear at other times than its track's [s]."""
    return InputError(
        f"frame {frame} of the video {name!r} appears at {time:.4f} s, and its brightness track says "
        f"{wanted:.4f} s: they must have one frame rate"
    )
