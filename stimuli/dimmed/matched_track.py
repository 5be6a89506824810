"""A track that is to be applied to a video on a display: refused where they do not belong together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, require_display_of
from evenlight.data_schema.tracks.loaded_track import LoadedTrack, load_track
from evenlight.method.preset_files import load_display
from evenlight.stimuli.dimmed.track_fit import require_fit
from evenlight.stimuli.video.video_source import VideoSource


@dataclass(frozen=True, slots=True, eq=False)
class MatchedTrack:
    """A track with its baseline, and the display that it was made for."""

    loaded: LoadedTrack
    display: Display


def match_track(
    video: VideoSource, path: Path, display: str | None = None, *, other_video_ok: bool = False
) -> MatchedTrack:
    """Return the track of a video, and its display.

    Parameters
    ----------
    video, path : VideoSource, Path
        The video; a track.csv, or the folder it is in.
    display : str, optional
        Preset or file of the display; else the track's own.
    other_video_ok : bool
        Whether a video of other content is accepted, such as the same film encoded again; frames and times
        must fit all the same.

    Raises
    ------
    InputError
        If the track is of another video or display.
    """
    loaded = load_track(path)
    if not other_video_ok:
        require_content(video, loaded.track)
    require_fit(video, loaded.track)
    return MatchedTrack(loaded, display_of(loaded.track, display))


def is_of(video: VideoSource, track: BrightnessTrack) -> bool:
    """Return whether a track was made of a video, or does not tell of what."""
    made_of = {value for key, value in track.header.provenance.inputs.items() if key.startswith("video")}
    return not made_of or video.sha256() in made_of


def require_content(video: VideoSource, track: BrightnessTrack) -> None:
    """Refuse a video whose content is not the one that a track was made of."""
    if not is_of(video, track):
        raise InputError(
            f"the track was made of the video {track.header.video!r}, and {video.name!r} has other "
            "content: give that video, or `other_video_ok` if it is the same film, encoded again"
        )


def display_of(track: BrightnessTrack, asked: str | None = None) -> Display:
    """Return the display that a track was made for: its own, the preset, or the one asked for.

    Raises
    ------
    InputError
        If another display is asked for, or the track is older and its display is not known.
    """
    header = track.header
    if asked is not None:
        display = load_display(asked)
        require_display_of(header, display, asked, ", or name the track's own (`display` may be left out)")
        return display
    if header.display is not None and header.display.fingerprint == header.display_fingerprint:
        return header.display
    preset = load_display("varjo-xr3")
    if preset.fingerprint == header.display_fingerprint:
        return preset
    raise InputError(
        f"the track does not hold its display {header.display_name!r}, for an earlier version made it: "
        "give the display as `display`, a file"
    )
