"""`--actuator pixels`: in the files of a track, and against loss curves that were made for a backlight."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image


@pytest.fixture
def night(tmp_path: Path) -> Path:
    """A folder of dark, noisy images, 48 x 32."""
    folder, rng = tmp_path / "night", np.random.default_rng(2)
    folder.mkdir()
    for k in range(4):
        pixels = np.clip(rng.normal(12, 10, (32, 48, 3)), 0, 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / f"{k}.png")
    return folder


def test_the_files_say_what_dims_and_curves_for_another_actuator_are_refused(
    night: Path, tmp_path: Path, command: Any, blank_pictures: None
) -> None:
    asked = ("optimize", "--no-player", night, "--budget", 0.5, "--fps", 5)
    assert command(*asked, "--out", tmp_path / "ours", "--actuator", "pixels").code == 0
    told = json.loads((tmp_path / "ours" / "track.json").read_text())
    assert (told["actuator"], told["loss_added_by_pixels"]) == ("pixels", None)
    known = ("--curves", tmp_path / "ours" / "loss_curves.npz")
    refused = command(*asked, *known, "--out", tmp_path / "never", "--quiet")
    assert refused.code == 2
    assert "dimmed by pixels, asked is --actuator backlight" in refused.err
    assert refused.err.count("\n") == 1
    assert not (tmp_path / "never").exists()


def test_the_controller_too_holds_the_loss_of_what_pixels_show(
    night: Path, tmp_path: Path, command: Any, blank_pictures: None
) -> None:
    asked = ("control", "--no-player", night, "--target-loss", 0.05, "--fps", 5, "--actuator", "pixels")
    assert command(*asked, "--out", tmp_path / "ours").code == 0
    assert json.loads((tmp_path / "ours" / "track.json").read_text())["actuator"] == "pixels"
