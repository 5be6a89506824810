"""What is known of a video whose analysis was interrupted, so that another can go on there.

A frame's curve depends on no other frame: an analysis that goes on gives the same numbers, bit for bit.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from evenlight.data_schema.arrays import Array

EVERY = 10.0  # [s] of work, from one checkpoint to the next


@dataclass(frozen=True, slots=True)
class AnalysedFrames:
    """Frames of a video, one after the other, that were analysed.

    Attributes
    ----------
    times, durations, shown : array (n,)
        When each frame appears and for how long [s], and the number of its content in the video.
    rows : array (contents, 6 + K)
        Of each content: visible contrast, mean luminance, means of three channels, number of bends, losses.
    bends : array (M, 2)
        Of all contents, one after the other: brightness factors and losses.
    floor : array (n, K) or None
        What the pixels' floor adds to the loss of each frame, where pixels dim.
    """

    times: Array
    durations: Array
    shown: Array
    rows: Array
    bends: Array
    floor: Array | None = None

    @property
    def n_frames(self) -> int:
        """How many frames."""
        return len(self.times)


@dataclass(slots=True)
class Checkpoints:
    """Hands on what has been analysed of a video, every few seconds of work.

    Attributes
    ----------
    keep : function of AnalysedFrames
        Takes the frames since the checkpoint before.
    clock : function
        Tells the time [s].
    begun : AnalysedFrames or None
        Those of the video's beginning that another analysis kept; the frames that follow are given.
    """

    keep: Callable[[AnalysedFrames], None]
    clock: Callable[[], float]
    begun: AnalysedFrames | None = None
    _frames: int = field(default=0, init=False)  # kept by now
    _contents: int = field(default=0, init=False)
    _bends: int = field(default=0, init=False)
    _last: float = field(init=False)  # when something was kept [s]

    def __post_init__(self) -> None:
        self._last = self.clock()
        if self.begun is not None:
            self._frames, self._contents = self.begun.n_frames, len(self.begun.rows)
            self._bends = self.begun.bends.size

    def at(
        self, numbers: array[float], bends: array[float], width: int, frames: tuple[Sequence[float], ...]
    ) -> None:
        """Keep what is complete, if it is time.

        Parameters
        ----------
        numbers, bends : array of float
            The rows and the bends so far, one after the other.
        width : int
            Of a row.
        frames : (times, durations, shown)
            Of all frames so far; they may be further than the rows.
        """
        times, durations, shown = frames
        contents, now = len(numbers) // width, self.clock()
        if now - self._last < EVERY or shown[-1] < contents:  # more frames may show the last of them
            return
        end = bisect_left(shown, contents)  # the frame in which the next content appears
        part = slice(self._frames, end)
        rows = np.array(numbers[self._contents * width :]).reshape(-1, width)
        kept = np.array(times[part]), np.array(durations[part]), np.array(shown[part])
        self.keep(AnalysedFrames(*kept, rows, np.array(bends[self._bends :]).reshape(-1, 2)))
        self._frames, self._contents, self._bends, self._last = end, contents, len(bends), now
