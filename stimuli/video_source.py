"""Where frames come from: a video file, a folder of images, or a built-in sequence, by one name."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame


class VideoSource(Protocol):
    """A video, as the model and the player see it."""

    @property
    def name(self) -> str:
        """Short name for titles."""

    @property
    def n_frames(self) -> int | None:
        """How many frames it has, None if that is not known beforehand."""

    def frames(self) -> Iterator[Frame]:
        """Yield its frames in order, one at a time, from the first one on at every call.

        A frame's pixel values are the reader's until the next frame is asked for: a source may fill the same
        array again, and who keeps pixel values for longer copies them.
        """

    def sha256(self) -> str:
        """Return the SHA-256 of its content: of the file, of the folder, or of the sequence's definition."""


def size_of(video: VideoSource) -> tuple[int, int]:
    """Return width and height of a video [pixels], those of its first frame."""
    frames = video.frames()
    with contextlib.closing(frames) if isinstance(frames, Generator) else contextlib.nullcontext():
        height, width, _ = next(frames).pixel_values.shape
    return width, height


def open_videos(names: Sequence[str], frames_per_second: float | None = None) -> tuple[VideoSource, ...]:
    """Return the videos of some names; those that tell no frame rate of their own get the one given.

    Parameters
    ----------
    names : sequence of str
        As in `open_video`.
    frames_per_second : float, optional
        Frame rate of folders of images and of built-in sequences [Hz].

    Raises
    ------
    InputError
        If one cannot be used, or if a frame rate is given and all tell their own.
    """
    own = [_tells_its_rate(name) for name in names]
    return tuple(
        open_video(name, None if tells and not all(own) else frames_per_second)
        for name, tells in zip(names, own, strict=True)
    )


def _tells_its_rate(name: str) -> bool:
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
    from evenlight.stimuli.image_folder import open_image_folder
    from evenlight.stimuli.sequences import SEQUENCES, built_in_sequence, is_sequence
    from evenlight.stimuli.video_file import open_video_file

    path = Path(name)
    if path.is_dir():
        return open_image_folder(path, frames_per_second)
    if _tells_its_rate(name):
        if frames_per_second is not None:
            raise InputError(
                f"{name} tells its own frame rate; only a folder of images or a built-in sequence takes one, "
                f"got {frames_per_second:g}"
            )
        return open_video_file(path)
    if is_sequence(name):
        return built_in_sequence(name, frames_per_second=frames_per_second)
    raise InputError(
        f"no video {name!r}: give a video file, a folder of images, or one of the built-in sequences "
        + ", ".join(SEQUENCES)
    )
