"""The images of clips, decoded ahead or drawn when due; and whether a brightness track fits its video."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack, OptimizationSummary, read_track
from evenlight.experiments.recordings import frames_of_refreshes
from evenlight.experiments.stage import Clip
from evenlight.stimuli.dithering import GRID_LEVELS, levels_of
from evenlight.stimuli.image_renderer import Image, ImageRenderer
from evenlight.stimuli.scenes.camera_path import check_path
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.scene import scene_named
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.video.frame_buffer import FrameBuffer, LevelFrame
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource

if TYPE_CHECKING:
    import moderngl

AHEAD = 2.0  # [s] of video that is decoded before it begins
LARGEST_DEVIATION = 1e-3  # [s] of a frame's time from its track's
TRACK, SUMMARY = "track.csv", "summary.json"


class ImageFeed(Protocol):
    """Gives the images of a clip, in order."""

    def ready(self, patience: float) -> bool:
        """Wait until the clip can begin, for some time at most [s], and return whether it can."""

    def size(self) -> tuple[int, int]:
        """Return width and height of the images [pixels]."""

    def image(self, index: int) -> Image:
        """Return the image of a frame; it holds until the next one is asked for.

        Raises
        ------
        InputError
            If there is none.
        """

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""


class VideoFeed(AbstractContextManager["VideoFeed"]):
    """The images of a video that is decoded ahead, from now on.

    Parameters
    ----------
    clip : Clip
        The clip.
    n_frames : int
        How many of its frames are needed.
    renderer : ImageRenderer
        Puts them into the graphics memory.

    Raises
    ------
    InputError
        If the video has more or fewer frames than the clip.
    """

    def __init__(self, clip: Clip, n_frames: int, renderer: ImageRenderer) -> None:
        assert clip.video is not None
        self._clip, self._renderer, self._name = clip, renderer, clip.video.name
        self._n_frames = n_frames
        known, wanted = clip.video.n_frames, len(clip.factors)
        if known is not None and known != wanted:
            raise wrong_count(self._name, known, wanted)
        self._buffer = FrameBuffer(clip.video, n_frames)
        self._frame: LevelFrame | None = None
        self._image: Image | None = None

    def serves(self, clip: Clip, n_frames: int) -> bool:
        """Return whether these are the images of as many frames of a clip, however it is dimmed."""
        here, length = self._clip, self._n_frames
        return here.video is clip.video and here.times is clip.times and length == n_frames

    def ready(self, patience: float) -> bool:
        """Wait until the clip can begin, for some time at most [s], and return whether it can."""
        return self._buffer.ready(AHEAD, patience)

    def size(self) -> tuple[int, int]:
        """Return width and height of the images [pixels]; before the first image, of that."""
        height, width, _ = self._present().levels.shape
        return width, height

    def image(self, index: int) -> Image:
        """Return the image of a frame; it holds until the next one is asked for."""
        if self._image is None or self._frame is None or index != self._frame.index:
            self._frame = self._taken(index)
            self._image = self._renderer.upload(self._frame.levels, self._frame.count)
        return self._image

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        frame = self._present()
        return frame.levels, frame.count

    def close(self) -> None:
        """End the reading."""
        self._buffer.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _present(self) -> LevelFrame:
        """Return the frame last asked for, or the first."""
        if self._frame is None:
            self._frame = self._taken(0)
        return self._frame

    def _taken(self, index: int) -> LevelFrame:
        """Return a frame that appears when its track says."""
        frame, wanted = self._buffer.frame(index), float(self._clip.times[index])
        if abs(frame.time - wanted) > LARGEST_DEVIATION:
            raise wrong_time(self._name, index, frame.time, wanted)
        return frame


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


def part_of(levels: NDArray[Any], whole: tuple[int, int], part: tuple[int, int]) -> NDArray[Any]:
    """Return what of an image in the middle of a window lies in a part in its middle, as windows read it.

    Parameters
    ----------
    levels : array, (height, width, ...)
        The image.
    whole, part : (int, int)
        Width and height of the window, and of the part; the part is no larger than the image.

    >>> part_of(np.arange(12).reshape(3, 4), (9, 8), (3, 1)).tolist()
    [[5, 6, 7]]
    """
    height, width = levels.shape[:2]
    left = (whole[0] - part[0]) // 2 - (whole[0] - width) // 2
    top = (whole[1] - part[1]) // 2 - (whole[1] - height) // 2
    return np.asarray(levels[top : top + part[1], left : left + part[0]])


class ClipFeeds:
    """Opens the images of clips: a file's are decoded ahead, those of a scene are drawn when due.

    Parameters
    ----------
    context : moderngl.Context
        The window's.
    renderer : ImageRenderer
        Puts images into the graphics memory.
    refresh_rate : float
        Of the display [Hz].
    """

    def __init__(self, context: moderngl.Context, renderer: ImageRenderer, refresh_rate: float) -> None:
        self._context, self._renderer, self._refresh_rate = context, renderer, refresh_rate
        self._scene: SceneFeed | None = None  # kept, for it takes long to make
        self._prepared: VideoFeed | None = None

    def prepare(self, clip: Clip) -> None:
        """Begin to read a clip, unless it is being read; another one that was not taken is let go.

        Raises
        ------
        InputError
            If the video has not as many frames as the clip, or there is no such scene.
        """
        if isinstance(clip.video, SceneSequence):
            self.close()
            self._scene_feed(clip.video)
        elif self._prepared is None or not self._prepared.serves(clip, self._n_frames(clip)):
            self.close()
            self._prepared = VideoFeed(clip, self._n_frames(clip), self._renderer)

    def taken(self, clip: Clip) -> AbstractContextManager[ImageFeed]:
        """Return the images of a clip, from now on the caller's to close."""
        self.prepare(clip)
        if isinstance(clip.video, SceneSequence):
            return nullcontext(self._scene_feed(clip.video))
        prepared, self._prepared = self._prepared, None
        assert prepared is not None
        return prepared

    def close(self) -> None:
        """End the reading of a clip that was prepared and not taken."""
        if self._prepared is not None:
            self._prepared.close()
            self._prepared = None

    def _n_frames(self, clip: Clip) -> int:
        """Return how many frames of a clip's video are needed."""
        return int(frames_of_refreshes(clip, self._refresh_rate)[-1]) + 1

    def _scene_feed(self, sequence: SceneSequence) -> SceneFeed:
        """Return what draws a walk."""
        if self._scene is None or self._scene.sequence != sequence:
            self._scene = SceneFeed(sequence, self._context)
        return self._scene


class SceneFeed:
    """Draws the frames of a walk; the same codes as `SceneSequence.frames` yields.

    Parameters
    ----------
    sequence : SceneSequence
        The walk.
    context : moderngl.Context
        The window's.

    Raises
    ------
    InputError
        If there is no such scene, or the path leaves it.
    """

    def __init__(self, sequence: SceneSequence, context: moderngl.Context) -> None:
        self.sequence, self._path = sequence, sequence.path()
        scene = scene_named(self._path.scene)
        check_path(self._path, scene)
        self._size = sequence.format.width, sequence.format.height
        self._times = [time for time, _ in sequence.format.times()]
        self._renderer = SceneRenderer(context, scene, self._size, sequence.quality)
        self._image = Image(self._renderer.codes, GRID_LEVELS, from_below=True)
        self._drawn: int | None = None

    def ready(self, patience: float) -> bool:
        """Return True: each frame is drawn when it is due."""
        return True

    def size(self) -> tuple[int, int]:
        """Return width and height of the images [pixels]."""
        return self._size

    def image(self, index: int) -> Image:
        """Return the image of a frame; it holds until the next one is asked for."""
        if index != self._drawn:
            self._renderer.render(self._path.camera(self._times[index]))
            self._renderer.encode()
            self._drawn = index
        return self._image

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        levels, count = levels_of(np.asarray(self._renderer.pixel_values()))
        return levels, count


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
