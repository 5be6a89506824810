"""What a player's messages say: which frame of the film is on screen, and whether it moves.

Decision (docs/decisions/following-a-player.md): mpv's `time-pos` names a frame when it is handed to the
output, which is when the frame before it appears. So the picture is one frame behind the last message, until
the player stands still. Between messages the clock counts, times the player's speed, but never beyond that
frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array

STAMP_ROUNDING = 2e-3  # [s] by which a file may round the times of its frames
LATE = 0.1  # [s] by which a message, or a picture, may be late; more is another position
CORRECTION = 0.1  # share of a lateness that each message corrects: most is the message's own
OBSERVED = (
    "working-directory", "path", "idle-active", "rebase-start-time", "demuxer-start-time", "time-pos",
    "speed", "core-idle", "seeking", "fullscreen", "display-names",
)  # fmt: skip


@dataclass(eq=False)
class PlaybackState:
    """The film as a player plays it, by mpv's JSON messages."""

    times: Array  # (N,): when the frames of the film appear [s]
    is_film: Callable[[str, str], bool]  # whether a path, from the player's folder, is the film's
    start: float = (
        0.0  # first stamp of the file, where `times` begin; not of all formats is it the player's 0 [s]
    )
    plays_film: bool | None = None  # None before it has said, and between two files
    playing: str = ""  # what it plays; empty for nothing
    folder: str = ""  # that it plays it from
    ended: str = ""  # why the last file ended (`eof`, `quit`, `stop`, `error`), empty while one plays
    error: str = ""  # what was wrong with that file
    jumps: int = 0  # how often it went to another position, by a seek or another file
    fullscreen: bool | None = None  # None before it has said
    displays: tuple[str, ...] = ()  # names of the outputs that its window is on, where the system tells

    def __post_init__(self) -> None:
        # of the player: whether its 0 is a stamp, and which [s]
        self._rebases, self._zero = True, self.start
        self._announced: float | None = None  # the position that the player has named last
        self._anchor = 0.0, 0.0  # a moment, and the position on screen then [s]
        self._speed, self._idle, self._seeking = 1.0, True, False
        self._counting = False  # whether the clock has counted since the last message

    def take(self, message: dict[str, Any], now: float) -> None:
        """Take a message that came at some time [s]; those of no concern are passed over."""
        event = message.get("event")
        if event == "property-change":
            self._changed(str(message.get("name")), message.get("data"), now)
        elif event in ("seek", "start-file"):
            self._announced, self._counting, self.ended = None, False, ""
            self.jumps += 1
        elif event == "end-file":
            self.ended, self.error = str(message.get("reason")), str(message.get("file_error", ""))

    def speed(self) -> float:
        """Return how fast the film moves: 1 as it was made, 0 while it stands."""
        return 0.0 if self._idle or self._announced is None else self._speed

    def position(self, now: float) -> float | None:
        """Return the position on screen [s]; None while another one is being sought, or without the film."""
        if self._announced is None or self._seeking or not self.plays_film:
            return None
        return self._announced if self._idle else min(self._by_clock(now), self._announced)

    def _by_clock(self, now: float) -> float:
        """Return the position on screen by the clock alone [s]."""
        moment, position = self._anchor
        return position + (now - moment) * self.speed()

    def frame(self, position: float) -> int:
        """Return the frame that the film shows at a position [s]."""
        return max(int(np.searchsorted(self.times, position, side="right")) - 1, 0)

    def _changed(self, name: str, value: Any, now: float) -> None:
        """Take the new value of a property."""
        if name == "time-pos":
            zero = self._zero if self._rebases else 0.0
            self._hear(None if value is None else float(value) + zero - self.start, now)
        elif name == "rebase-start-time":
            self._rebases = value is not False
        elif name == "demuxer-start-time":
            self._zero = self.start if value is None else float(value)
        elif name in ("speed", "core-idle"):
            moved = self.position(now)
            if name == "speed":
                self._speed = float(value or 1.0)
            else:
                self._idle, self._counting = value is not False, False
            if moved is not None:
                self._anchor = now, moved
        elif name == "seeking":
            self._seeking = value is True
        elif name in ("working-directory", "path"):  # they come in any order
            if name == "path":
                self.playing = str(value or "")
            else:
                self.folder = str(value or "")
            known = self.playing and self.folder
            self.plays_film = self.is_film(self.playing, self.folder) if known else None
        elif name == "idle-active" and value is True:
            self.plays_film = False
        elif name == "fullscreen":
            self.fullscreen = value is True
        elif name == "display-names":
            self.displays = tuple(value or ())

    def _hear(self, announced: float | None, now: float) -> None:
        """Take the position that the player names: that of the frame which appears next."""
        expected, self._announced = self._by_clock(now), None
        if announced is None:
            return
        frame = self.frame(announced + STAMP_ROUNDING)
        shown = self._announced = float(self.times[frame])
        if not self._idle:
            shown = float(self.times[max(frame - 1, 0)])
            if self._counting and 0 < expected - shown < LATE:
                shown = expected - CORRECTION * (expected - shown)
            self._counting = True
        self._anchor = now, shown
