"""What the track of a film wants of a backlight while mpv plays that film full screen."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.monitor_dimmer import FilmFrame
from evenlight.experiments.follow.follow_film import film_wanted
from evenlight.experiments.follow.limited_backlight import FilmLight
from evenlight.experiments.follow.mpv_player import UNKNOWN, MpvPlayer
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.rate_limit import ScalarRateLimit

OFTEN = 1.0  # [s] between two tries to reach mpv
PATIENCE = 0.1  # [s] that each may take
# It does not listen, has ended, or is no mpv.
NO_PLAYER = OSError, InstrumentError, ValueError, LookupError, TypeError, AttributeError
NO_TIMES = np.zeros(1)


class FilmTracks:
    """Listens to an mpv by its IPC socket, and follows the track of what it plays full screen."""

    def __init__(self, options: LiveOptions, tell: Callable[[str], None]) -> None:
        self._options, self._tell = options, tell
        self._pool = ThreadPoolExecutor(1)  # reading a film may take longer than the time between two looks
        self._tried_at = -OFTEN
        self._player: MpvPlayer | None = None
        self._see(None)

    def frame(self, output: str, alone: bool, now: float) -> FilmFrame | None:
        """Return what a film on a monitor, maybe the only one, wants; None without one of a known track."""
        try:
            self._listen(now)
        except NO_PLAYER:
            self._leave()
        state, light = self._player.state if self._player else None, self._light
        if state is None or light is None or not (alone or output in state.displays):
            return None
        if (position := state.position(now)) is None:  # another one is sought
            return None
        at = state.frame(position)
        return FilmFrame(float(light.factors[at]), float(light.luminance[at]))

    def _listen(self, now: float) -> None:
        if self._player is None:
            if self._options.mpv_socket is None or now - self._tried_at < OFTEN:
                return
            self._tried_at = now
            self._player = self._reached(Path(os.devnull))
        self._player.wait(0.0)
        state = self._player.state
        if self._player.ended():
            self._leave()
        elif state.fullscreen is not None and state.plays_film is not None:
            film = Path(state.folder, state.playing) if state.fullscreen and state.playing else None
            if film != self._film:
                self._see(film)
            if film is not None and self._wanted is not None and self._wanted.done():
                self._follow(film, self._wanted)

    def _see(self, film: Path | None) -> None:
        self._film = film
        self._light: FilmLight | None = None
        self._wanted: Future[tuple[FilmLight, ScalarRateLimit]] | None = None
        if film is not None and (track := track_beside(film)):
            display = self._options.display_name
            self._wanted = self._pool.submit(film_wanted, film, track, display, self._options)

    def _follow(self, film: Path, wanted: Future[tuple[FilmLight, ScalarRateLimit]]) -> None:
        self._wanted = None
        try:
            self._light, _ = wanted.result()
        except (InputError, InstrumentError) as error:
            self._tell(f"dimmed by its picture, not by a track: {error}")
            return
        self._tell(f"{film.name}: dimmed by its track")
        if self._player is not None:
            self._player.close()  # it says all again to who comes anew
        self._player = self._reached(film, self._light.times, self._light.reading)

    def _reached(self, film: Path, times: Array = NO_TIMES, reading: FilmReading = UNKNOWN) -> MpvPlayer:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(PATIENCE)
            connection.connect(str(self._options.mpv_socket))
            return MpvPlayer(connection.dup(), film, times, reading=reading)

    def _leave(self) -> None:
        if self._player is not None:
            self._player.close()
        self._player = None
        self._see(None)


def track_beside(film: Path) -> Path | None:
    """Return the track of a film: track.csv in the folder of its name, or else in its own."""
    places = (film.with_suffix(""), film.parent)
    return next((found for place in places if (found := place / "track.csv").is_file()), None)
