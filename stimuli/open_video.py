"""Where frames come from: a video file, a folder of images, or a built-in sequence, by one name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.video_source import VideoSource


def open_videos(names: Sequence[str], frames_per_second: float | None = None) -> tuple[VideoSource, ...]:
    """Return the videos of some names; those without a frame rate of their own get the one given.

    Parameters
    ----------
    names : sequence of str
        As in `open_video`.
    frames_per_second : float, optional
        Frame rate of folders of images and of built-in sequences [Hz].

    Raises
    ------
    InputError
        If one cannot be used, or if a frame rate is given and all have their own.
    """
    own = [_has_its_rate(name) for name in names]
    return tuple(
        open_video(name, None if has_rate and not all(own) else frames_per_second)
        for name, has_rate in zip(names, own, strict=True)
    )


def _has_its_rate(name: str) -> bool:
    """Return whether a name is that of a video file."""
    path = Path(name)
    return path.exists() and not path.is_dir() and path.suffix != ".json"


def open_video(name: str, frames_per_second: float | None = None) -> VideoSource:
    """Return the video of a name: a file's or a folder's path, else a built-in sequence.

    Parameters
    ----------
    name : str
        A path, or the name of a built-in sequence; a path wins over a name. A json file is a camera path.
    frames_per_second : float, optional
        Frame rate of a folder of images, or of a built-in sequence; 25 if not given [Hz].

    Raises
    ------
    InputError
        If there is no such video, or it cannot be used.
    """
    from evenlight.stimuli.sequences import SEQUENCES, built_in_sequence, is_sequence
    from evenlight.stimuli.video.image_folder import open_image_folder
    from evenlight.stimuli.video.video_file import open_video_file

    path = Path(name)
    if path.is_dir():
        return open_image_folder(path, frames_per_second)
    if _has_its_rate(name):
        if frames_per_second is not None:
            raise InputError(
                f"{name} has its own frame rate; only a folder of images or a built-in sequence takes one, "
                f"got {frames_per_second:g}"
            )
        return open_video_file(path)
    if is_sequence(name):
        return built_in_sequence(name, frames_per_second=frames_per_second)
    raise InputError(
        f"no video {name!r}: give a video file, a folder of images, or one of the built-in sequences "
        + ", ".join(SEQUENCES)
    )
