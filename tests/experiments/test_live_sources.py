"""What `evenlight live` asks besides: mpv for its film, grim for Wayland's picture, a meter for the power."""

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
from evenlight.experiments.desktop.power_gauge import PowerGauge
from evenlight.experiments.desktop.screens import MssScreens, WatchedScreen, opened_screens
from evenlight.experiments.follow.limited_backlight import FilmLight
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.preset_files import load_display


def playing(socket: Path, says: dict[str, Any]) -> socketserver.ThreadingUnixStreamServer:
    """An mpv that answers what it is asked, and tells at once what it is to watch."""

    class Answers(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            for line in self.rfile:
                asked = json.loads(line)
                verb, name = asked["command"][0], asked["command"][-1]
                answer = {"request_id": asked.get("request_id", 0), "data": says.get(name)}
                if verb == "observe_property":
                    answer = {"event": "property-change", "name": name, "data": says.get(name)}
                self.wfile.write(json.dumps(answer).encode() + b"\n")

    server = socketserver.ThreadingUnixStreamServer(str(socket), Answers)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def test_a_film_full_screen_is_dimmed_by_its_track_until_it_is_a_window(tmp_path: Path, monkeypatch) -> None:
    film, told = tmp_path / "film.mp4", list[str]()
    for name in ("film.mp4", "film/track.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    light = FilmLight(
        np.arange(3.0), np.ones(3), np.array([0.5, 0.6, 0.7]), np.array([10.0, 20.0, 30.0]), 99.0
    )
    monkeypatch.setattr(film_tracks, "film_wanted", lambda options, display: (light, options.track))
    says = {"path": "film.mp4", "working-directory": str(tmp_path), "fullscreen": True}
    says |= {"display-names": ["DP-1"], "core-idle": True, "time-pos": 1.0}
    films = FilmTracks(tmp_path / "mpv", LiveOptions(), told.append)
    assert films.frame("DP-1", 0.0) is None  # no mpv yet
    with playing(tmp_path / "mpv", says) as server:
        now, end = 1.0, time.monotonic() + 60
        while (wanted := films.frame("DP-1", now)) is None and time.monotonic() < end:
            now += 1.0
        assert wanted == FilmFrame(0.6, 20.0)
        assert films.frame("DP-2", now) is None  # another monitor
        says["fullscreen"] = False
        assert films.frame("DP-1", now + 1) is None
        says |= {"fullscreen": True, "path": "other.mp4"}
        assert films.frame("DP-1", now + 2) is None  # no track of that
        refused = InputError("the track was made of another video")
        monkeypatch.setattr(films, "_light_of", lambda *_: (_ for _ in ()).throw(refused))
        says["path"] = str(film)
        while len(told) < 3 and time.monotonic() < end:
            now += 1.0
            films.frame("DP-1", now + 2)
        films.frame("DP-1", now + 9)  # told once
        server.shutdown()
    assert told == [
        "film.mp4: dimmed by its track",
        "the film is over, or a window again: dimmed by what is on the monitor",
        "dimmed by its picture, not by a track: the track was made of another video",
    ]


@pytest.mark.parametrize("line", [b'{"error": "success"}', b"[1]", b'{"request_id": 99}', b"\xff"])
def test_what_is_no_answer_of_mpv_is_none(tmp_path: Path, line: bytes) -> None:
    class Stranger(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(line + b"\n")
            self.rfile.read()

    with socketserver.UnixStreamServer(str(tmp_path / "mpv"), Stranger) as server:
        threading.Thread(target=server.handle_request, daemon=True).start()
        assert film_tracks.playing_in(tmp_path / "mpv") == {}


def test_a_track_lies_in_a_folder_of_tracks_or_beside_the_film(tmp_path: Path) -> None:
    film = tmp_path / "films" / "one.mkv"
    for name in ("films/track.csv", "films/one/track.csv", "tracks/one/track.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
        assert film_tracks.track_beside(film, tmp_path / "tracks") == tmp_path / name
    assert film_tracks.track_beside(tmp_path / "two.mkv", None) is None


def test_under_wayland_the_picture_is_that_of_grim(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-1")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(screens, "CONNECTORS", tmp_path)
    monkeypatch.setattr(screens.time, "monotonic", lambda: 0.0)
    with pytest.raises(InputError, match="install grim"), opened_screens():
        pass
    pytest.importorskip("mss")
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
        screen = WatchedScreen(grabber, 1, load_display("laptop-lcd"), DEFAULT_MODEL, brightness_factors(0.1))
        first = screen.look(0.0)
        assert screen.name == "eDP-1"
        assert screen.size == (64, 48)
        assert screen.look(0.25) is first
        assert WatchedScreen(grabber, 3, *[None] * 3).look(0.0) is None  # type: ignore[arg-type]
    assert (tmp_path / "asked").read_text() == "-o eDP-1 -t ppm -\n"  # not twice within a second


def test_mss_is_made_anew_where_monitors_change(monkeypatch) -> None:
    """Now and then, and at once where a picture cannot be taken; the old one is closed once."""
    made, closed, now = [], [], [0.0]
    monkeypatch.setattr(screens.time, "monotonic", lambda: now[0])

    def make() -> Any:
        one = SimpleNamespace(monitors=[{}] * (len(made) + 2), grab=lambda area: area["there"])
        one.close = lambda: closed.append(one)
        made.append(one)
        return one

    grabber = MssScreens(make)
    assert len(grabber.monitors) == 2
    now[0] = 2.5
    assert len(grabber.monitors) == 3
    with pytest.raises(KeyError):
        grabber.grab({})
    assert grabber.grab({"there": 1}) == 1
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

    meter = SimpleNamespace(start=lambda rate: rate, samples=samples, close=lambda: None)
    monkeypatch.setattr(power_gauge, "open_power_meter", lambda name, clock: meter)
    monkeypatch.setattr(power_gauge.time, "monotonic", lambda: now[0])
    gauge = PowerGauge("battery:")
    assert gauge.mean() == 3.0
    assert gauge.mean() == 3.0
    now[0] = 59.0
    assert gauge.mean() == 3.0
    now[0] = 61.0
    assert gauge.mean() == 4.0
    assert PowerGauge("").mean() is None


def test_a_monitor_is_known_by_its_output_where_another_comes_before_it() -> None:
    pixels = np.zeros((48, 64, 4), np.uint8)
    grabber = SimpleNamespace(monitors=[{}, {"output": "eDP-1"}], asked=[])

    def grab(area: dict[str, str]) -> Any:
        grabber.asked.append(area["output"])
        return SimpleNamespace(raw=pixels.tobytes(), width=64, height=48)

    grabber.grab = grab
    screen = WatchedScreen(grabber, 1, load_display("laptop-lcd"), DEFAULT_MODEL, brightness_factors(0.1))
    assert screen.look(0.0) is not None
    grabber.monitors = [{}, {"output": "DP-1"}, {"output": "eDP-1"}]
    assert screen.look(1.0) is not None
    grabber.monitors = [{}, {"output": "DP-1"}]
    assert screen.look(2.0) is None
    assert grabber.asked == ["eDP-1", "eDP-1"]
