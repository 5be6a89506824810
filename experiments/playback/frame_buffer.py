"""Frames of a video, decoded ahead of their time by a thread, so that no flip waits for the decoder."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Generator
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame, LumaChroma, Pixels
from evenlight.stimuli.dithering import levels_of
from evenlight.stimuli.video.video_source import VideoSource

CAPACITY = 512 * 2**20  # bytes: 4 s of 1280x720 at 25 Hz and 10 bits, 7.7 s at 8 bits


@dataclass(frozen=True, slots=True, eq=False)
class LevelFrame:
    """A frame as it goes to the graphics memory."""

    index: int  # place in the video, from 0
    time: float  # when it appears [s]
    levels: Pixels  # (height, width, 3): levels of its pixels, row 0 on top
    count: int  # how many levels there are


class FrameBuffer(AbstractContextManager["FrameBuffer"]):
    """Decodes frames ahead, as many as fit; its thread ends with it.

    Frames are asked for by index, and never backwards: what lies before is let go.

    Parameters
    ----------
    source : VideoSource
        The video.
    n_frames : int
        How many of its frames are needed, from the first on.
    capacity : int, optional
        Memory that the frames ahead may take [bytes]; two are held even if they take more.
    planes : bool, optional
        Whether frames of Y, Cb, Cr stay as they are.
    """

    def __init__(
        self, source: VideoSource, n_frames: int, capacity: int = CAPACITY, *, planes: bool = False
    ) -> None:
        self._source, self._n_frames, self._capacity, self._planes = source, n_frames, capacity, planes
        self._frames: deque[LevelFrame] = deque()
        self._failure: BaseException | None = None
        self._ended = self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._decode, name=f"frames of {source.name}", daemon=True)
        self._thread.start()

    def ready(self, seconds: float, patience: float | None = None) -> bool:
        """Wait until enough is decoded, and return whether it is; the reader's failure is enough as well.

        Parameters
        ----------
        seconds : float
            Length of video that is enough [s]; less is, where the buffer is full or holds all that is needed.
        patience : float, optional
            How long to wait [s]; as long as it takes if not given.
        """
        with self._changed:
            return self._changed.wait_for(
                lambda: self._ended or self._is_full() or self._seconds() >= seconds, patience
            )

    def frame(self, index: int) -> LevelFrame:
        """Return a frame; wait for it if it is not decoded yet.

        Raises
        ------
        InputError
            If the video cannot be read as far as that.
        """
        with self._changed:
            while True:
                while self._frames and self._frames[0].index < index:
                    self._frames.popleft()
                self._changed.notify_all()
                if self._frames:
                    break
                if self._failure is not None:
                    raise self._failure
                if self._ended:
                    raise ValueError(f"frame {index} is not among the {self._n_frames} that are needed")
                self._changed.wait()
            if self._frames[0].index != index:
                raise ValueError(f"frame {index} was let go: the next is {self._frames[0].index}")
            return self._frames[0]

    def close(self) -> None:
        """End the thread, and let go of the frames."""
        with self._changed:
            self._closed = True
            self._frames.clear()
            self._changed.notify_all()
        self._thread.join()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _decode(self) -> None:
        failure: BaseException | None = None
        try:
            frames = self._source.frames()
            with contextlib.closing(frames) if isinstance(frames, Generator) else contextlib.nullcontext():
                for index in range(self._n_frames):
                    frame = next(frames, None)
                    if frame is None:
                        raise InputError(
                            f"the video {self._source.name!r} ends after {index} of the {self._n_frames} "
                            "frames that its brightness track has"
                        )
                    if not self._put(_level_frame(index, frame, self._planes)):
                        break
        except BaseException as error:  # it is raised again where the frame is asked for
            failure = error
        with self._changed:
            self._failure, self._ended = failure, True
            self._changed.notify_all()

    def _put(self, frame: LevelFrame) -> bool:
        """Add a frame as soon as there is room; return False if it is no longer needed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or not self._is_full())
            if not self._closed:
                self._frames.append(frame)
                self._changed.notify_all()
            return not self._closed

    def _seconds(self) -> float:
        return self._frames[-1].time - self._frames[0].time if self._frames else 0.0

    def _is_full(self) -> bool:
        n, levels = len(self._frames), self._frames[-1].levels if self._frames else np.empty(0)
        arrays = levels.planes if isinstance(levels, LumaChroma) else (levels,)
        return n >= 2 and (n + 1) * sum(array.nbytes for array in arrays) > self._capacity


def _level_frame(index: int, frame: Frame, planes: bool) -> LevelFrame:
    """Return a frame's levels, in an array of their own: the reader may fill its array again."""
    if planes and isinstance(frame.pixels, LumaChroma):
        return LevelFrame(index, frame.time, frame.pixels, 256)
    levels, count = levels_of(frame.pixel_values)
    if np.shares_memory(levels, frame.pixel_values):
        levels = levels.copy()
    return LevelFrame(index, frame.time, levels, count)
