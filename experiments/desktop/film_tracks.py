"""What the track of a film wants of a backlight while mpv plays that film full screen."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.monitor_dimmer import FilmFrame
from evenlight.experiments.follow.follow_command import FollowOptions
from evenlight.experiments.follow.follow_film import film_wanted
from evenlight.experiments.follow.limited_backlight import FilmLight
from evenlight.experiments.follow.mpv_player import MpvPlayer, join_mpv
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.choices import LimitCurve

OFTEN = 1.0  # [s] between two questions to mpv
PATIENCE = 0.1  # [s] that it may take to answer
NO_ANSWER = OSError, ValueError, LookupError, TypeError, AttributeError  # or one that is none of mpv's
ASKED = ("path", "working-directory", "fullscreen", "display-names")


class FilmTracks:
    """Looks for the track of what an mpv plays full screen, by its IPC socket, and joins it for one."""

    def __init__(self, mpv: Path, options: LiveOptions, tell: Callable[[str], None]) -> None:
        self._mpv, self._options, self._tell = mpv, options, tell
        self._pool = ThreadPoolExecutor(1)  # reading a film may take longer than the time between two looks
        self._asked_at = -OFTEN
        self._film: Path | None = None
        self._outputs: list[str] = []
        self._wanted: Future[FilmLight] | None = None
        self._player: MpvPlayer | None = None
        self._frame: FilmFrame | None = None

    def frame(self, output: str, now: float) -> FilmFrame | None:
        """Return what a film on a monitor wants now; None without one, or one whose track is not known."""
        if now - self._asked_at >= OFTEN:
            self._asked_at = now
            try:
                self._ask()
            except (InputError, InstrumentError) as error:
                self._leave()
                self._tell(f"dimmed by its picture, not by a track: {error}")
        elsewhere = self._outputs and output not in self._outputs and not output.isdigit()
        if self._player is None or self._wanted is None or elsewhere:
            return None
        self._player.wait(0.0)
        state, light = self._player.state, self._wanted.result()
        if (position := state.position(now)) is not None:
            at = state.frame(position)
            self._frame = FilmFrame(float(light.factors[at]), float(light.luminance[at]))
        return self._frame  # while another position is sought, the last one

    def _ask(self) -> None:
        said = playing_in(self._mpv)
        shown = said.get("fullscreen") and said["path"]
        film = Path(said["working-directory"], said["path"]) if shown else None
        self._outputs = said.get("display-names") or []
        if film != self._film:
            if self._player is not None:
                self._tell("the film is over, or a window again: dimmed by what is on the monitor")
            self._leave()
            self._film = film
            if film is not None and (track := track_beside(film, self._options.tracks)):
                self._wanted = self._pool.submit(self._light_of, film, track)
        if film is not None and self._wanted is not None and self._wanted.done() and self._player is None:
            light = self._wanted.result()
            self._player = join_mpv(self._mpv, film, light.times, light.reading)
            self._tell(f"{film.name}: dimmed by its track")

    def _light_of(self, film: Path, track: Path) -> FilmLight:
        live = self._options
        options = FollowOptions(
            video=film, track=track, rate_limit=str(live.rate_limit), noticed=live.noticed,
            limit_curve=LimitCurve(live.limit_curve),
        )  # fmt: skip
        return film_wanted(options, None if live.display is None else str(live.display))[0]

    def _leave(self) -> None:
        if self._player is not None:
            self._player.close()
        self._player = self._wanted = self._frame = None


def track_beside(film: Path, folder: Path | None) -> Path | None:
    """Return the track of a film: FOLDER/NAME/track.csv, or the same, or track.csv alone, beside the film."""
    places = [film.with_suffix(""), film.parent]
    if folder is not None:
        places.insert(0, folder / film.stem)
    return next((found for place in places if (found := place / "track.csv").is_file()), None)


def playing_in(mpv: Path) -> dict[str, Any]:
    """Return what mpv says of itself by its IPC socket; nothing where none answers."""
    said: dict[str, Any] = {}
    with contextlib.suppress(*NO_ANSWER), socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(PATIENCE)
        connection.connect(str(mpv))
        for number, name in enumerate(ASKED):
            asked = {"command": ["get_property", name], "request_id": number}
            connection.sendall(json.dumps(asked).encode() + b"\n")
        with connection.makefile("rb") as lines:
            while len(said) < len(ASKED):
                answer = json.loads(lines.readline(65536))
                if "event" not in answer:
                    said[ASKED[answer["request_id"]]] = answer.get("data")
        return said
    return {}
