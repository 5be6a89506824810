"""Where frames come from, by one name: a video file, a folder of images, or a built-in sequence.

A new built-in sequence gets a line in the table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from evenlight.data_schema.arguments import number
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import ArgumentError, InputError, shown_kind
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading
from evenlight.stimuli.checkerboard import Checkerboard
from evenlight.stimuli.scenes.content.catalogue import is_scene_file
from evenlight.stimuli.scenes.scene_sequence import SceneSequence, standard_format
from evenlight.stimuli.sequence_format import BuiltInSequence, SequenceFormat
from evenlight.stimuli.sunrise import Sunrise
from evenlight.stimuli.video.video_locations import RemoteFile, is_url, local_name, shown_name
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import field_of_view_on, full_screen

# Camera paths through scenes that serve as sequences.
WALKS = ("library", "gym", "living_room", "basement", "house")
# How each is made, and the format it has if nothing else is asked for.
SEQUENCES: dict[str, tuple[Callable[[SequenceFormat], BuiltInSequence], Callable[[], SequenceFormat]]] = {
    "checkerboard": (Checkerboard, partial(SequenceFormat, duration=20.0)),
    "sunrise": (Sunrise, partial(SequenceFormat, duration=40.0)),
    **{walk: (partial(SceneSequence, path_name=walk), partial(standard_format, walk)) for walk in WALKS},
}


def is_sequence(name: str) -> bool:
    """Return whether a name is that of a built-in sequence, or of a file with a camera path.

    >>> is_sequence("sunrise"), is_sequence("walk.json"), is_sequence("film.mkv")
    (True, True, False)
    """
    return name in SEQUENCES or (name.endswith(".json") and not is_url(name))


def built_in_sequence(
    name: str,
    size: tuple[int, int] | None = None,
    duration: float | None = None,
    frames_per_second: float | None = None,
    seen: float | Display | None = None,
    *,
    scene: str = "",
) -> BuiltInSequence:
    """Return a built-in sequence.

    Parameters
    ----------
    name : str
        Its name in `SEQUENCES`, or a json file with a camera path.
    size : (int, int), optional
        Width and height [pixels].
    duration, frames_per_second : float, optional
        Length [s] and frame rate [Hz].
    seen : float or Display, optional
        What its width spans [deg], or the display that it fills (pixel for pixel, if of unknown size).
    scene : str
        Name or file of the scene that the camera path of a file leads through, in place of its own.

    Raises
    ------
    InputError
        If there is no such sequence, or it cannot be rendered in that format.

    >>> built_in_sequence("checkerboard", duration=2.0).n_frames
    50
    """
    if is_scene_file(name):
        raise InputError(f"{name} is a scene: give a camera path through it, a .json file (docs/scenes.md)")
    if not (scene or is_sequence(name)):
        raise InputError(f"no built-in sequence {name!r}: there are {', '.join(SEQUENCES)}")
    walk = partial(SceneSequence, path_name=name, scene=scene), partial(standard_format, name, scene)
    make, standard_of = SEQUENCES.get("" if scene else name, walk)
    standard = standard_of()
    width, height = size or (standard.width, standard.height)
    seconds = standard.duration if duration is None else duration
    rate = standard.frames_per_second if frames_per_second is None else frames_per_second
    if isinstance(seen, Display):
        seen = full_screen(seen, (width, height)) or field_of_view_on(seen, width)
    field_of_view = standard.field_of_view if seen is None else seen
    try:
        return make(SequenceFormat(width, height, seconds, rate, field_of_view))
    except ValueError as error:
        raise InputError(f"cannot render {name}: {error}") from error


def open_videos(names: Sequence[str], fps: float | None = None, **film: Any) -> tuple[VideoSource, ...]:
    """Return the videos of some names; those without a frame rate of their own get the one given.

    Parameters
    ----------
    names : sequence of str
        As in `open_video`.
    fps : float, optional
        Frame rate of folders of images and of built-in sequences [Hz].
    **film
        Arguments of `open_video` for films.

    Raises
    ------
    InputError
        If one cannot be used, or if a frame rate is given and all have their own.
    """
    own = [_has_its_rate(name) for name in names]
    return tuple(
        open_video(name, None if has_rate and not all(own) else fps, **film)
        for name, has_rate in zip(names, own, strict=True)
    )


def _has_its_rate(name: str) -> bool:
    if is_url(name := local_name(name)):
        return True
    path = Path(name)
    return path.exists() and not path.is_dir() and path.suffix != ".json"


def open_as_read(name: str, film: FilmReading | None, fps: float | None = None) -> VideoSource:
    """Return the video of a name, read as the film of a track was."""
    return open_video(name, fps) if film is None else open_video(name, fps, film.damaged, film.stream)


def open_video(
    name: str | PathLike[str],
    fps: float | None = None,
    damaged: Damaged | str = "refuse",
    stream: int | None = None,
) -> VideoSource:
    """Return the video of a name: a file's path or URL, a folder's path, else a built-in sequence.

    Parameters
    ----------
    name : str or path
        A path, a URL, or the name of a built-in sequence; a path wins over a name. A json file is a camera
        path.
    fps : float, optional
        Frame rate of a folder of images, or of a built-in sequence; 25 if not given [Hz].
    damaged : Damaged or str
        "refuse" a damaged film, "hold" the picture before those that are lost, or "skip" these.
    stream : int, optional
        Stream of the film, as FFmpeg counts them; else the one that players take.

    Raises
    ------
    InputError
        If there is no such video, or it cannot be used.
    """
    from evenlight.stimuli.video.image_folder import open_image_folder
    from evenlight.stimuli.video.video_file import open_video_file

    if not isinstance(name, str | PathLike):
        raise ArgumentError("video", f"must be a path or a built-in sequence's name, got {shown_kind(name)}")
    if fps is not None:
        number("fps", fps)
    name = local_name(fspath(name))
    if is_scene_file(name) and not is_url(name):
        return built_in_sequence(name)
    path = RemoteFile(name) if is_url(name) else Path(name)
    if isinstance(path, Path) and path.is_dir():
        return open_image_folder(path, fps)
    if _has_its_rate(name):
        if fps is not None:
            raise InputError(
                f"{shown_name(name)} has its own frame rate; only a folder of images or a built-in sequence "
                f"takes one, got {fps:g}"
            )
        return open_video_file(path, Damaged(damaged), stream)
    if is_sequence(name):
        return built_in_sequence(name, frames_per_second=fps)
    raise InputError(
        f"no video {name!r}: give a video file, a folder of images, or one of the built-in sequences "
        + ", ".join(SEQUENCES)
    )
