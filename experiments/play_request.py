"""What `evenlight play` is asked for: the video, the rig, and the factors of each version."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evenlight.data_schema.brightness_track import BrightnessTrack
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rig import Rig
from evenlight.experiments.playback import Dimming, Playback
from evenlight.experiments.track_fit import LoadedTrack, frame_durations
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.commands import size_in
from evenlight.stimuli.sequences import built_in_sequence, is_sequence
from evenlight.stimuli.video_source import VideoSource, open_video, size_of

SMALLEST_WINDOW = 64  # [pixels]


def video_of(name: str, track: BrightnessTrack, size: str | None) -> tuple[VideoSource, tuple[int, int]]:
    """Return a video, and its width and height; what has no frame rate of its own gets the track's.

    Parameters
    ----------
    name : str
        A file, a folder of images, or a built-in sequence.
    track : BrightnessTrack
        Its track.
    size : str or None
        Of a built-in sequence, as 640x360.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    step = float(frame_durations(track).mean())
    path = Path(name)
    if is_sequence(name) and (path.suffix == ".json" or not path.exists()):
        sequence = built_in_sequence(name, size_in(size), len(track.times) * step, 1 / step)
        return sequence, (sequence.format.width, sequence.format.height)
    if size is not None:
        raise InputError(f"--size is for built-in sequences; {name} has a size of its own")
    video = open_video(name, 1 / step if path.is_dir() else None)
    return video, size_of(video)


def rig_of(
    name: str | None, display: str | None, otherwise: str, size: tuple[int, int]
) -> tuple[Rig, Display]:
    """Return a rig and its display; without a rig, a window of the picture's size on the first screen.

    Parameters
    ----------
    name : str or None
        Of the rig: a toml file or a preset.
    display : str or None
        A preset or a toml file; None for the rig's.
    otherwise : str
        The display where neither is given: the track's.
    size : (int, int)
        Width and height of the picture [pixels].
    """
    if name is not None:
        rig, its_display = load_rig(name)
        return rig, load_display(display or its_display)
    try:
        panel = load_display(display or otherwise)
    except InputError as error:
        raise InputError(f"{error}; say with --display or --rig what it is shown on") from None
    width, height = (max(SMALLEST_WINDOW, pixels) for pixels in size)
    window = Rig("window", panel.name, 0.6, 60.0, full_screen=False, window_size=(width, height))
    return window, panel


def playback_of(video: VideoSource, loaded: LoadedTrack, versions: Sequence[str]) -> Playback:
    """Return a video with the factors of each version, and the versions in the order in which they come."""
    factors, full = np.asarray(loaded.track.factors), np.ones(len(loaded.track.factors))
    return Playback(
        video=video,
        times=np.asarray(loaded.track.times),
        duration=float(frame_durations(loaded.track).sum() + loaded.track.times[0]),
        factors={Dimming.OURS: factors, Dimming.BASELINE: loaded.baseline * full, Dimming.FULL: full},
        order=tuple(Dimming(version) for version in versions),
    )
