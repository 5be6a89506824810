"""`evenlight optimize` and `control` begin with what is gained; a battery's capacity becomes hours."""

import json
import re

import numpy as np
import pytest
from optimized_videos import texture, video

import evenlight
from evenlight import progress


@pytest.mark.parametrize("task", ["optimize", "control"])
def test_the_first_lines_say_what_is_gained_and_for_how_long(command, tmp_path, task) -> None:
    """Full brightness takes, by surace2025, 0.2945 + 0.001858 · 750 = 1.688 W: 10 Wh last 5.92 h."""
    clip = video(tmp_path / "clip.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 12)])
    out = tmp_path / "out"
    done = command(task, clip, "--budget", 0.5, "--battery-wh", 10, "--no-player", "--out", out)
    assert done.code == 0, done.err
    summary = json.loads((out / "summary.json").read_text())
    hours = 10 / summary["mean_power_w"]
    lines = done.out.splitlines()
    assert lines[0].startswith("clip: ")
    begun = [re.sub(r"[\d.]+ ", "", line.partition("(")[0]) for line in lines[1:5]]
    assert begun[:2] == ["  power saved: % ", "  % of visible contrast lost "]
    assert begun[3] == "  % of s periods noticed "
    assert (
        "power is that of the published panel, an LCD (surace2025; give varjo-xr3's own as --power-model); "
        f"10 Wh last that panel alone {hours:.3g} h instead of 5.92 h"
    ) in lines
    assert summary["battery_capacity_wh"] == 10
    assert summary["battery_life_h"] == pytest.approx(hours, rel=1e-12)
    assert summary["battery_life_full_h"] == pytest.approx(10 / 1.688, rel=1e-9)
    track = evenlight.load(out)
    assert summary["worst_contrast_loss"] == max(track.loss())
    assert summary["worst_contrast_loss_baseline"] == max(track.loss(track.baseline))
    assert str(track).splitlines()[:5] == lines[:5]


def test_every_part_of_the_work_is_told_of(command, tmp_path, monkeypatch) -> None:
    """What takes seconds, or compiles in a new installation, is no silence: also after the optimizer."""
    monkeypatch.setattr(progress, "INTERVAL", 0.0)
    clip = video(tmp_path / "clip.mkv", [texture(1) * s for s in np.linspace(0.2, 1, 6)])
    done = command("control", clip, "--target-loss", 0.02, "--no-player", "--out", tmp_path / "online")
    for part in ("analysing clip", "controlling clip", "drawing clip"):
        assert part in done.err
    done = command("optimize", clip, "--budget", 0.5, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    parts = ("analysing clip", "optimizing clip", "lower bound of clip", "loss of clip if pixels dimmed",
             "drawing clip", "maps of lost contrast of clip")  # fmt: skip
    begun = [part for line in done.err.splitlines() for part in parts if part in line]
    assert list(dict.fromkeys(begun)) == list(parts)


@pytest.mark.parametrize("capacity", ["0", "-5", "1e9"])
def test_a_battery_that_cannot_be_is_refused_in_a_line(command, tmp_path, capacity) -> None:
    done = command(
        "optimize", "sunrise", "--budget", 0.5, "--battery-wh", capacity, "--out", tmp_path / "out"
    )
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert re.search(
        "'--battery-wh': Input should be (greater|less) than or equal to (0.001|1000000);", done.err
    )
    assert not (tmp_path / "out").exists()
