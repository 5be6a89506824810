"""The player's side of `evenlight follow`: mpv's messages over its socket, and when the watchdog may go."""

import contextlib
import json
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.experiments.follow import mpv_player, watchdog
from evenlight.experiments.follow.mpv_player import UNKNOWN, MpvPlayer, join_mpv
from evenlight.experiments.follow.watchdog import watched_backlight
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.panel import SimulatedBacklight


@contextlib.contextmanager
def talking(
    video: Path, reading: FilmReading = UNKNOWN
) -> Iterator[tuple[MpvPlayer, Callable[..., None], socket.socket]]:
    """A joined player whose side of the socket the test writes."""
    ours, theirs = socket.socketpair()
    with MpvPlayer(ours, video, np.arange(10) * 0.04, reading=reading) as player, theirs:
        asked = [json.loads(line) for line in theirs.recv(65536).splitlines()]
        assert ["observe_property", 2, "path"] in [one["command"] for one in asked]

        def say(*messages: dict[str, Any]) -> None:
            for message in messages:
                theirs.sendall(json.dumps(message).encode() + b"\n")

        yield player, say, theirs


def change(name: str, value: Any) -> dict[str, Any]:
    return {"event": "property-change", "name": name, "data": value}


def test_messages_come_in_pieces_between_answers_and_among_other_things(tmp_path: Path) -> None:
    video = tmp_path / "film.mp4"
    video.touch()
    with talking(video) as (player, say, theirs):
        say({"request_id": 0, "error": "success"}, change("working-directory", str(tmp_path)))
        theirs.sendall(b"no message\n[1, 2]\n" + json.dumps(change("path", "film.mp4")).encode()[:20])
        player.wait(0.0)
        assert player.state.plays_film is None
        theirs.sendall(json.dumps(change("path", "film.mp4")).encode()[20:] + b"\n")
        player.require_film()
        assert not player.ended()


def test_a_joined_player_with_another_film_or_none_is_refused(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(mpv_player, "OPENING", 0.0)
    video = tmp_path / "film.mp4"
    video.touch()
    for path, words in (("other.mp4", "plays other.mp4, not"), (None, "plays nothing, not")):
        with talking(video) as (player, say, _):
            say(
                *(
                    change(*one)
                    for one in (("path", path), ("working-directory", "/"), ("idle-active", not path))
                )
            )
            with pytest.raises(InputError, match=words):
                player.require_film()


def test_of_several_videos_that_one_is_played_that_the_track_is_for(tmp_path: Path) -> None:
    tracks = [{"type": "video", "id": 1, "ff-index": 0}, {"type": "video", "id": 2, "ff-index": 3}]
    for stream, chosen in ((3, [2]), (None, [])):
        with talking(tmp_path / "film.mp4", FilmReading(stream)) as (player, say, theirs):
            say(change("track-list", [*tracks, {"type": "audio", "id": 1, "ff-index": 3}]))
            player.wait(0.0)
            theirs.setblocking(False)
            asked = theirs.recv(65536).splitlines() if chosen else []
            assert [json.loads(line)["command"][2] for line in asked] == chosen


def test_a_player_that_quits_ends_and_one_that_dies_fails(tmp_path: Path) -> None:
    with talking(tmp_path / "film.mp4") as (player, say, theirs):
        say({"event": "end-file", "reason": "quit"})
        theirs.close()
        player.wait(0.0)
        assert player.ended()
    with talking(tmp_path / "film.mp4") as (player, say, theirs):
        theirs.close()
        player.wait(0.0)
        with pytest.raises(InstrumentError, match="the player died while it played"):
            player.ended()


def test_a_socket_without_a_player_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--socket .*none: no player listens there .*--input-ipc-server="):
        join_mpv(tmp_path / "none", tmp_path / "film.mp4", np.zeros(1))


def test_the_watchdog_goes_only_when_the_brightness_is_back(monkeypatch) -> None:
    """A backlight that cannot be left as it was found leaves it to the watchdog, which acts when we end."""
    dismissed: list[bool] = []

    class Stuck(SimulatedBacklight):
        def close(self) -> None:
            raise InstrumentError("stuck")

    class Watchdog:
        def __init__(self, backlight: str, curve: str, found: float) -> None:
            assert (backlight, curve, found) == ("sysfs:panel", "", 1.0)

        def done(self) -> None:
            dismissed.append(True)

    monkeypatch.setattr(watchdog, "BrightnessWatchdog", Watchdog)
    for kind, gone in ((Stuck, []), (SimulatedBacklight, [True])):
        device = kind(lambda: 0.0)
        monkeypatch.setattr(watchdog, "_opened", lambda backlight, curve, device=device: device)
        with contextlib.suppress(InstrumentError), watched_backlight("sysfs:panel", "") as opened:
            opened.set_factor(0.5)
        assert dismissed == gone
