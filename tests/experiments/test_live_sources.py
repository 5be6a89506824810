"""What `evenlight live` asks besides: mpv for its film, grim for Wayland's picture, a meter for the power."""

import contextlib
import json
import socketserver
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.contrast_model import DEFAULT_MODEL
from evenlight.data_schema.errors import InputError
from evenlight.experiments.desktop import film_tracks, power_gauge, screens
from evenlight.experiments.desktop.film_tracks import FilmTracks
from evenlight.experiments.desktop.live_command import LiveOptions
from evenlight.experiments.desktop.monitor_dimmer import FilmFrame
from evenlight.experiments.desktop.screens import MssScreens, WatchedScreen, opened_screens
from evenlight.experiments.follow.limited_backlight import FilmLight
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.preset_files import load_display


def seen(name: str, grabber: Any) -> WatchedScreen:
    return WatchedScreen(grabber, name, load_display("laptop-lcd"), DEFAULT_MODEL, brightness_factors(0.1))


class Mpv(socketserver.ThreadingUnixStreamServer):
    """An mpv that tells at once what it is to watch, and what becomes of it."""

    daemon_threads = True

    def __init__(self, socket: Path, says: dict[str, Any]) -> None:
        super().__init__(str(socket), Answers)
        self.says = says
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def tell(self, changed: dict[str, Any]) -> None:
        self.says |= changed
        for name in changed:
            self.last(name)


class Answers(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        self.server.last = self.tell
        for line in self.rfile:
            self.tell(json.loads(line)["command"][-1])

    def tell(self, name: str) -> None:
        told = {"event": "property-change", "name": name, "data": self.server.says.get(name)}
        self.wfile.write(json.dumps(told).encode() + b"\n")


def test_a_film_full_screen_is_dimmed_by_its_track_until_it_is_a_window(tmp_path: Path, monkeypatch) -> None:
    film, told = tmp_path / "film.mp4", list[str]()
    for name in ("film.mp4", "film/track.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    light = FilmLight(
        np.arange(3.0), np.ones(3), np.array([0.5, 0.6, 0.7]), np.array([10.0, 20.0, 30.0]), 99.0
    )
    monkeypatch.setattr(film_tracks, "film_wanted", lambda *_: (light, None))
    says = {"path": "film.mp4", "working-directory": str(tmp_path), "fullscreen": True}
    says |= {"display-names": ["DP-1"], "core-idle": True, "time-pos": 1.0}
    films = FilmTracks(LiveOptions(mpv_socket=tmp_path / "mpv"), told.append)
    assert films.frame("DP-1", False, 0.0) is None  # no mpv yet
    with Mpv(tmp_path / "mpv", says) as server:
        now, end = 1.0, time.monotonic() + 60
        while (wanted := films.frame("DP-1", False, now)) is None and time.monotonic() < end:
            now += 1.0
        assert wanted == FilmFrame(0.6, 20.0)
        assert films.frame("DP-2", False, now) is None  # another monitor
        assert films.frame("2", True, now) == wanted  # the only one
        for change in ({"fullscreen": False}, {"fullscreen": True, "path": "other.mp4"}):  # no track of that
            server.tell(change)
            while films.frame("DP-1", False, now) and time.monotonic() < end:
                pass
            assert films.frame("DP-1", False, now) is None
        refused = InputError("the track was made of another video")
        monkeypatch.setattr(film_tracks, "film_wanted", lambda *_: (_ for _ in ()).throw(refused))
        server.tell({"path": str(film)})
        while len(told) < 2 and time.monotonic() < end:
            films.frame("DP-1", False, now)
        films.frame("DP-1", False, now + 9)  # told once
        films._leave()
        server.shutdown()
    assert told == [
        "film.mp4: dimmed by its track",
        "dimmed by its picture, not by a track: the track was made of another video",
    ]


LINES = [b'{"error": "success"}', b"[1]", b'{"request_id": 99}', b"\xff"]
LINES += [b'{"event": "property-change", "name": "time-pos", "data": "x"}', b'{"event": "end-file"}']


@pytest.mark.parametrize("line", LINES)
def test_what_is_no_answer_of_mpv_is_none(tmp_path: Path, line: bytes) -> None:
    answered = threading.Event()

    class Stranger(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(line + b"\n")
            answered.set()

    with socketserver.UnixStreamServer(str(tmp_path / "mpv"), Stranger) as server:
        threading.Thread(target=server.handle_request, daemon=True).start()
        films = FilmTracks(LiveOptions(mpv_socket=tmp_path / "mpv"), print)
        assert films.frame("DP-1", True, 0.0) is None
        assert answered.wait(60)
        assert films.frame("DP-1", True, 0.1) is None
        films._leave()


def test_a_track_lies_beside_the_film_or_in_the_folder_of_its_name(tmp_path: Path) -> None:
    film = tmp_path / "films" / "one.mkv"
    for name in ("films/track.csv", "films/one/track.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
        assert film_tracks.track_beside(film) == tmp_path / name
    assert film_tracks.track_beside(tmp_path / "two.mkv") is None


def test_under_wayland_the_picture_is_that_of_grim(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-1")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(screens, "CONNECTORS", tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(InputError, match="install grim"), opened_screens():
        pass
    picture = b"P6\n64 48\n255\n" + bytes(range(256)) * 36
    (tmp_path / "picture").write_bytes(picture)
    grim = tmp_path / "grim"
    grim.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\nexec /bin/cat {tmp_path}/picture\n')
    grim.chmod(0o755)
    for name, words in (
        ("card0-eDP-1", "enabled\n"),
        ("card0-DP-1", "enabled\n"),
        ("card0-VGA-1", "disabled\n"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "enabled").write_text(words)
    with opened_screens() as grabber:
        assert grabber.names() == ["DP-1", "eDP-1"]
        screen = seen("eDP-1", grabber)
        assert screen.look(0.0)
        assert screen.size == (64, 48)
        assert (tmp_path / "asked").read_text() == "-o eDP-1 -t ppm -\n"
        (tmp_path / "wayland-1").touch()
        (tmp_path / "picture").unlink()  # as of an output that is off
        assert screen.look(60.0) is None
        (tmp_path / "wayland-1").unlink()
        with pytest.raises(InstrumentError, match="the screen cannot be looked at"):
            screen.look(180.0)


def test_mss_is_made_anew_where_monitors_change(monkeypatch) -> None:
    """Now and then, and at once where a picture cannot be taken; the old one is closed once."""
    made, closed, now = [], [], [0.0]
    monkeypatch.setattr(screens.time, "monotonic", lambda: now[0])

    def make() -> Any:
        areas = [{"output": f"DP-{k}", "there": made[:]} for k in range(len(made) + 1)]
        one = SimpleNamespace(monitors=[{}, *areas], grab=lambda area: area["there"][1])
        one.close = lambda: closed.append(one)
        made.append(one)
        return one

    grabber = MssScreens(make)
    assert grabber.names() == ["DP-0"]
    assert grabber.grab("DP-1") is None
    now[0] = 2.5
    assert grabber.names() == ["DP-0", "DP-1"]
    assert grabber.grab("DP-1") is made[1]  # at the second try
    grabber.close()
    assert closed == made
    assert len(made) == 3


def test_a_battery_that_is_charged_is_asked_again_a_minute_later(monkeypatch) -> None:
    now, answers = [0.0], [[2.0, 4.0], InstrumentError("charging"), [6.0]]

    def samples() -> list[SimpleNamespace]:
        answer = answers.pop(0)
        if isinstance(answer, InstrumentError):
            raise answer
        return [SimpleNamespace(power=power) for power in answer]

    meter = SimpleNamespace(start=lambda rate: rate, samples=samples)
    monkeypatch.setattr(power_gauge, "open_power_meter", lambda name, clock: contextlib.nullcontext(meter))
    monkeypatch.setattr(power_gauge.time, "monotonic", lambda: now[0])
    means = power_gauge.mean_power("battery:")
    assert [next(means), next(means)] == [3.0] * 2
    now[0] = 61.0
    assert next(means) == 4.0
