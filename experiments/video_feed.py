"""The images of a video, one by one, in the graphics memory of a window."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.experiments.stage import Clip
from evenlight.stimuli.frame_buffer import FrameBuffer, LevelFrame
from evenlight.stimuli.image_renderer import Image, ImageRenderer

AHEAD = 2.0  # [s] of video that is decoded before it begins
LARGEST_DEVIATION = 1e-3  # [s] of a frame's time from its track's


class Feed(Protocol):
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
