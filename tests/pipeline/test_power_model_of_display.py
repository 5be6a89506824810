"""Power model and actuator are the display's: without a model no watts are told, and none can be asked."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import evenlight
from evenlight.data_schema.display import OF_DEVICE, Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.method import preset_files as presets

LAPTOP = ("--display", "laptop-lcd", "--other-display-ok")


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A folder of noisy images, 48 x 32."""
    folder, rng = tmp_path / "film", np.random.default_rng(2)
    folder.mkdir()
    for k in range(4):
        pixels = np.clip(rng.normal(60 + 30 * k, 20, (32, 48, 3)), 0, 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / f"{k}.png")
    return folder


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("name", ["optimize", "control"])
def test_a_display_without_a_power_model_has_no_watts_anywhere(
    name: str, film: Path, tmp_path: Path, command: Any
) -> None:
    out = tmp_path / "out"
    made = command(name, film, "--fps", 5, "--budget", 0.5, *LAPTOP, "--out", out)
    assert made.code == 0, made.err
    unknown = r"mean brightness: 5. % \(savings unknown: no power model for laptop-lcd\)"
    assert re.fullmatch(f"  {unknown}", made.out.splitlines()[1])
    assert "no power model for laptop-lcd (`evenlight run power-sweep` measures one)" in made.out
    assert " W" not in made.out
    summary, header = (json.loads((out / file).read_text()) for file in ("summary.json", "track.json"))
    keys = ("power_model", "mean_power_w", "baseline_power_w", "full_power_w", "battery_life_h")
    assert [summary[key] for key in keys] == [None] * 5
    assert (header["power_model"], header["panel"], header["actuator"]) == (None, None, "backlight")
    assert "power_model" not in header["provenance"]["inputs"]
    rows = (out / "track.csv").read_text().splitlines()
    assert {row.rpartition(",")[2] for row in rows} == {"power_w", ""}
    assert read_track(out / "track.csv").power is None
    assert command("validate", out).code == 0
    page = (out / "player.html").read_text()
    assert '"power": null' in page
    assert "no power model for laptop-lcd" in page


def test_a_power_in_some_rows_alone_is_refused(film: Path, tmp_path: Path) -> None:
    track = evenlight.optimize(film, 0.5, fps=5, display="laptop-lcd", other_display_ok=True)
    assert (track.power(), track.outcome.mean_power) == (None, None)
    assert track.first_lines[1][0].value == "50 %"
    track.save(tmp_path / "out")
    table = tmp_path / "out" / "track.csv"
    table.write_text(table.read_text().rstrip() + "1.0\n")
    with pytest.raises(InputError, match="line 5: power_w: expected a number in every row, or in none"):
        read_track(table)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--budget", 0.5, "--budget-unit", "power"), "a budget in power: no power model for laptop-lcd"),
        (("--budget", 1, "--budget-unit", "watt"), "a budget in watt: no power model for laptop-lcd"),
        (("--budget", 0.5, "--battery-wh", 10), "--battery-wh: no power model for laptop-lcd"),
    ],
)
def test_what_needs_a_power_model_is_refused_without_one(
    words: tuple[Any, ...], says: str, film: Path, tmp_path: Path, command: Any
) -> None:
    refused = command("optimize", film, "--fps", 5, "--out", tmp_path / "out", *words, *LAPTOP)
    assert (refused.code, refused.err.count("\n")) == (2, 1)
    assert says in refused.err
    assert "--power-model" in refused.err
    assert not (tmp_path / "out").exists()


def test_the_actuator_is_the_displays_unless_another_is_asked(film: Path) -> None:
    asked: dict[str, Any] = {"fps": 5, "display": "phone-oled"}
    curves = evenlight.loss_curves(film, **asked)
    assert curves.actuator.value == "pixels"
    assert evenlight.loss_curves(film, **asked, actuator="backlight").actuator.value == "backlight"
    track = evenlight.optimize(film, 0.5, **asked, other_display_ok=True)
    assert track.track.header.actuator.value == "pixels"
    np.testing.assert_array_equal(track.curves.loss, curves.loss)


def test_an_older_file_of_a_preset_display_is_the_whole_device() -> None:
    """It has no fields of a device, and keeps the hash that it had."""
    known = presets.load_display("varjo-xr3")
    blank = {name: getattr(Display("a", 100.0, 0.1, 2.2, 40.0), name) for name in OF_DEVICE}
    older, limit = replace(known, **blank), presets.load_rate_limit("surace2025")
    model = presets.power_model_for(presets.display_for(replace(limit, display=older)))
    assert getattr(model, "name", None) == "surace2025"
    assert presets.whole_device(replace(older, peak_luminance=90.0)).power_model == ""  # another light
    assert sha256_of_record(older) != sha256_of_record(known)
