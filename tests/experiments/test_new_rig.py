"""`evenlight new rig` writes a rig and a display that a session runs on, with a comment on every key."""

import dataclasses
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evenlight.data_schema.display import OF_DEVICE, Display
from evenlight.data_schema.quantities import file_key
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display, preset_names


def test_a_new_rig_is_rehearsed_as_it_is(command: Callable[..., Any], tmp_path: Path) -> None:
    made = command("new", "rig", tmp_path / "desk.rig.toml", "--display", "laptop-lcd")
    assert made.code == 0, made.err
    assert "--simulate data" in made.out
    ran = command(
        "run", "ramp", "--participant", "01", "--session", "01", "--rig", tmp_path / "desk.rig.toml",
        "--design", "quick", "--simulate", "data", "--out", tmp_path / "lab", "--quiet",
    )  # fmt: skip
    assert ran.code == 0, ran.err


def test_the_display_has_the_presets_numbers_and_a_comment_on_every_key(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    assert command("new", "rig", tmp_path / "lab.rig.toml", "--display", "phone-oled").code == 0
    text = (tmp_path / "lab.display.toml").read_text(encoding="utf-8")
    rig, display = load_rig(str(tmp_path / "lab.rig.toml"))
    assert (rig.name, rig.display, display) == ("lab", "lab.display.toml", str(tmp_path / "lab.display.toml"))
    assert rig.viewing_distance == 0.35  # what the preset's pixels per degree are for
    shown = load_display(display)
    assert shown.fingerprint == load_display("phone-oled").fingerprint
    assert (shown.name, shown.measured) == ("lab", "")
    assert shown.source == "the preset phone-oled, not measured"  # nothing that is false once it is filled in
    assert "DisplayMate" not in text
    for field in dataclasses.fields(Display):
        if field.name not in ("measured", "provenance"):
            blank = "# " if field.name == "field_of_view" else ""  # which a phone has not
            assert re.search(
                rf"(?m)^# {re.escape(field.metadata['doc'])}.*\n# how: .+\n{blank}{file_key(field)} = ", text
            )
    assert all(getattr(shown, name) == getattr(load_display("phone-oled"), name) for name in OF_DEVICE)


@pytest.mark.parametrize("preset", preset_names("display"))
def test_every_preset_makes_a_rig(command: Callable[..., Any], tmp_path: Path, preset: str) -> None:
    assert command("new", "rig", tmp_path / "a.rig.toml", "--display", preset).code == 0
    shown = load_display(load_rig(str(tmp_path / "a.rig.toml"))[1])
    assert replace(shown, name=preset, source="") == replace(load_display(preset), source="")


def test_size_and_distance_of_ones_own_make_the_pixels_per_degree(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    """2 · 700 mm · tan(0.5°) is 12.217 mm for a degree, which holds 12.217 / (600 / 3840) pixels."""
    words = ("--width-mm", "600", "--distance-m", "0.7", "--pixels", "3840x2160")
    assert command("new", "rig", tmp_path / "big.rig.toml", *words).code == 0
    rig, display = load_rig(str(tmp_path / "big.rig.toml"))
    shown = load_display(display)
    assert (rig.viewing_distance, shown.resolution, shown.size) == (0.7, (3840, 2160), (600.0, 337.5))
    assert shown.pixels_per_degree == pytest.approx(78.19, abs=0.005)
    assert re.search(r"--pixels WIDTHxHEIGHT +Your display's pixels", command("new", "rig", "--help").out)
    for preset, says in (("quest-3", "no flat picture"), (display, "has its own size")):
        refused = command("new", "rig", tmp_path / "b.rig.toml", "--display", preset, "--width-mm", "600")
        assert (refused.code, refused.err.count("\n")) == (2, 1)
        assert says in refused.err


def test_what_is_there_is_replaced_by_force_alone(command: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "desk.display.toml").write_text("ours")
    refused = command("new", "rig", tmp_path / "desk.rig.toml")
    assert (refused.code, refused.err.count("\n")) == (2, 1)
    assert "desk.display.toml: is there already" in refused.err
    assert not (tmp_path / "desk.rig.toml").exists()
    assert command("new", "rig", tmp_path / "desk.rig.toml", "--force").code == 0
    assert load_display(tmp_path / "desk.display.toml").peak_luminance == 300


def test_a_measured_display_is_not_replaced(command: Callable[..., Any], tmp_path: Path) -> None:
    rig, own = tmp_path / "desk.rig.toml", tmp_path / "desk.display.toml"
    assert command("new", "rig", rig).code == 0
    measured = own.read_text(encoding="utf-8").replace('# measured = "YYYY-MM-DD"', 'measured = "2026-11-20"')
    own.write_text(measured, encoding="utf-8")
    before = rig.read_bytes()
    refused = command("new", "rig", rig, "--force")
    assert (refused.code, refused.err.count("\n")) == (2, 1)
    assert f"keep it with --display {own}" in refused.err
    assert (own.read_text(encoding="utf-8"), rig.read_bytes()) == (measured, before)
    assert load_display(own).measured == "2026-11-20"
    assert command("new", "rig", rig, "--force", "--display", own).code == 0


def test_a_display_of_ones_own_stays_where_it_is(command: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    command("new", "rig", tmp_path / "desk.rig.toml")
    own = tmp_path / "desk.display.toml"
    assert command("new", "rig", tmp_path / "rigs" / "b.rig.toml", "--display", own).code == 0
    assert load_display(load_rig(str(tmp_path / "rigs" / "b.rig.toml"))[1]) == load_display(own)
    assert [path.name for path in (tmp_path / "rigs").iterdir()] == ["b.rig.toml"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("desk.rig",), "desk.rig: a rig is a toml file"),
        (("nowhere/desk.rig.toml",), "in a folder that is there"),
        (("desk.rig.toml", "--display", "laptop"), "did you mean 'laptop-lcd'"),
    ],
)
def test_what_cannot_be_is_refused(
    command: Callable[..., Any],
    tmp_path: Path,
    words: tuple[str, ...],
    says: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    refused = command("new", "rig", *words)
    assert (refused.code, list(tmp_path.iterdir())) == (2, [])
    assert says in refused.err


def test_a_rig_that_is_missing_is_told_how_to_make_one(command: Callable[..., Any], tmp_path: Path) -> None:
    words = ("run", "ramp", "--participant", "01", "--session", "01", "--out", tmp_path / "lab")
    for rig in (tmp_path / "desk.rig.toml", "desk"):  # `desk` is what a new one is copied from
        refused = command(*words, "--rig", rig)
        assert refused.code == 2
        assert "`evenlight new rig" in refused.err
