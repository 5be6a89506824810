"""A rate limit, a track and a rig know their display, so that `--display` is needed at most once."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import evenlight
from evenlight import command as command_line
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.experiments.stimulus_folder import track_display
from evenlight.method.preset_files import load_display, load_rate_limit

pytestmark = pytest.mark.usefixtures("blank_pictures")
LAPTOP = load_display("laptop-lcd")


def limit_of_the_laptop() -> RateLimit:
    """The published curve, as if it had been measured on a laptop."""
    return dataclasses.replace(
        load_rate_limit("surace2025"), name="ours", display_name=LAPTOP.name,
        display_fingerprint=LAPTOP.fingerprint, display=LAPTOP,
    )  # fmt: skip


@pytest.fixture
def limit(tmp_path: Path) -> Path:
    write_json_record(tmp_path / "rate_limit.json", limit_of_the_laptop())
    return tmp_path / "rate_limit.json"


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second of a small sunrise."""
    path = tmp_path_factory.mktemp("films") / "film.mkv"
    words = [
        "render",
        "sunrise",
        "--size",
        "64x36",
        "--duration",
        "1",
        "--fps",
        "5",
        "--out",
        str(path),
        "--quiet",
    ]
    with pytest.raises(SystemExit, match="0"):
        command_line.main(words)
    return path


@pytest.fixture
def optimize(command: Callable[..., Any], film: Path) -> Callable[..., Any]:
    """Run `optimize` on it."""
    options = ("--budget", 0.5, "--no-player", "--no-cache", "--quiet")
    return lambda *more: command("optimize", film, *options, *more)


def test_a_rate_limit_tells_the_display_of_its_tracks(
    optimize: Callable[..., Any], command: Callable[..., Any], film: Path, limit: Path, tmp_path: Path
) -> None:
    made = optimize("--rate-limit", limit, "--out", tmp_path / "library")
    assert made.code == 0, made.err
    assert read_track(tmp_path / "library" / "track.csv").header.display == LAPTOP
    assert track_display(tmp_path, ["library"]) == LAPTOP  # `simulate rating --stimuli` goes by it
    out = tmp_path / "film-dimmed.mkv"
    assert command("apply", film, tmp_path / "library", "--out", out, "--quiet").code == 0
    judged = command(
        "judge", film, tmp_path / "library", "--measures", "relative", "--no-modulation", "--no-cache",
        "--quiet", "--out", tmp_path / "judged",
    )  # fmt: skip
    assert judged.code == 0, judged.err
    for shown in (("--display", "desktop-lcd"), ("--rig", "simulated")):
        refused = command("play", film, tmp_path / "library", *shown, "--simulate")
        named = "varjo-xr3" if "--rig" in shown else "desktop-lcd"
        assert refused.code == 2
        assert f"`evenlight optimize VIDEO --display {named} ...`" in refused.err


def test_a_display_that_is_not_the_limits_is_refused_and_both_ways_out_are_named(
    optimize: Callable[..., Any], limit: Path, tmp_path: Path
) -> None:
    for options in (("--display", "laptop-lcd"), ("--display", "phone-oled", "--rate-limit", limit)):
        refused = optimize(*options, "--out", tmp_path / "track")
        assert (refused.code, refused.err.count("\n")) == (2, 1)
        assert "`evenlight run ramp`" in refused.err
        assert "--other-display-ok" in refused.err
        assert not (tmp_path / "track").exists()
    assert optimize("--display", "laptop-lcd", "--other-display-ok", "--out", tmp_path / "track").code == 0
    assert read_track(tmp_path / "track" / "track.csv").header.display == LAPTOP


def test_loss_curves_tell_their_display(
    optimize: Callable[..., Any], command: Callable[..., Any], film: Path, tmp_path: Path
) -> None:
    borrowed = ("--other-display-ok", "--budget", 0.5, "--no-player", "--no-cache")
    words = command("optimize", film, *borrowed, "--display", "laptop-lcd", "--out", tmp_path / "a")
    assert "rate limit borrowed: fitted on 'varjo-xr3', unproven on 'laptop-lcd'\n" in words.out
    curves = ("--curves", tmp_path / "a" / "loss_curves.npz")
    again = command("optimize", film, *borrowed, *curves, "--out", tmp_path / "b")
    assert again.code == 0, again.err
    assert (tmp_path / "a" / "track.csv").read_text() == (tmp_path / "b" / "track.csv").read_text()
    assert read_track(tmp_path / "b" / "track.csv").header.display_name == "laptop-lcd"
    run = command("control", film, *borrowed, *curves, "--out", tmp_path / "c")
    assert "rate limit borrowed" in run.out, run.err
    refused = optimize(*curves, "--display", "varjo-xr3", "--out", tmp_path / "d")
    assert refused.code == 2
    assert "leave out --display" in refused.err
    with pytest.raises(evenlight.InputError, match=r"^display: loss curves were made with their own"):
        evenlight.optimize(evenlight.load(tmp_path / "a").curves, 0.5, display="varjo-xr3")


def test_a_limit_of_an_earlier_version_asks_for_the_display(
    optimize: Callable[..., Any], limit: Path, tmp_path: Path
) -> None:
    earlier = json.loads(limit.read_text())
    del earlier["display"]
    limit.write_text(json.dumps(earlier))
    refused = optimize("--rate-limit", limit, "--out", tmp_path / "track")
    assert refused.code == 2
    assert "name the display that it was fitted on (--display)" in refused.err
    assert optimize("--rate-limit", limit, "--display", "laptop-lcd", "--out", tmp_path / "track").code == 0


def test_python_takes_the_display_of_the_rate_limit(limit: Path) -> None:
    frames = [np.random.default_rng(k).random((36, 64, 3)) for k in range(3)]
    track = evenlight.optimize(frames, budget=0.5, rate_limit=limit)
    assert track.track.header.display == LAPTOP
    online = evenlight.OnlineController(target_loss=0.05, rate_limit=limit, display="laptop-lcd")
    assert online.step(frames[0]) == evenlight.OnlineController(0.05, rate_limit=limit).step(frames[0])
    borrowed = evenlight.OnlineController(0.05, display=LAPTOP, other_display_ok=True)
    assert 0.2 <= borrowed.step(frames[0]) <= 1


def test_a_limit_with_its_display_is_the_limit_without() -> None:
    """Tracks of earlier versions, which hold the hash of `surace2025`, can still be followed."""
    preset = load_rate_limit("surace2025")
    assert preset.display == load_display("varjo-xr3")
    assert sha256_of_record(dataclasses.replace(preset, display=None)) == sha256_of_record(preset)
    with pytest.raises(ValueError, match="display has other photometry"):
        dataclasses.replace(preset, display=LAPTOP)
