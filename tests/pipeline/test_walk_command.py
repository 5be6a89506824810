"""`evenlight walk SCENE` on a window under a virtual screen, dimmed online; its way renders."""

import csv
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from warm_evenlight import Run

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions
from evenlight.experiments.playback.walk_request import walk_as_asked
from evenlight.stimuli.scenes.content.catalogue import path_named
from evenlight.stimuli.sequences import open_video

SPEED = 1.4  # [m/s] of somebody who walks straight on
# Walks, and presses Ctrl-C after the fifth refresh.
INTERRUPTED = """
import itertools, os, signal, sys
from evenlight import command
from evenlight.experiments.playback import walk

shown, usual = itertools.count(1), walk.moved

def moved(*given):
    if next(shown) == 5:
        os.kill(os.getpid(), signal.SIGINT)
    return usual(*given)

walk.moved = moved
command.main(sys.argv[1:])
"""


def test_the_way_of_a_walk_is_recorded_and_renders_as_a_video(
    virtual_screen: Callable[[], str], tmp_path: Path
) -> None:
    """At 60 Hz of a simulated clock, 0 to 1 s are 61 refreshes, or 62 if rounding puts the last before 1 s.

    A second at 25 Hz has 25 frames. The first run on a machine reckons the light of the house: a minute.
    """
    way, video, log = tmp_path / "way.json", tmp_path / "x.mkv", tmp_path / "log"
    environment = os.environ | {"DISPLAY": virtual_screen()}

    def evenlight_does(*words: object) -> str:
        run = Run([str(word) for word in words], environment)
        out, err = run.communicate(timeout=280)
        assert run.returncode == 0, err
        return out

    simulated = ("--simulate", "--seconds", "1", "--size", "64x36")
    controlled = ("--target-loss", "0.5", "--factor", "0.7", "--out", log)
    controlled += ("--budget", "0.5", "--budget-unit", "power", "--horizon", "0.5")
    said = evenlight_does("walk", "house", *simulated, "--record", way, *controlled)
    assert re.match(
        "house: 6[12] refreshes in 1.0 s, not timed in this rehearsal; contrast loss .*; the way is in", said
    )
    rows = read_rows(LiveRefresh, log / "live_control.csv")
    kept = read_json_record(LiveControl, log / "live_control.json")
    assert (kept.scene, kept.simulated, kept.target_loss) == ("house", True, 0.5)
    # Without a rig or a display the window is a headset's view, 90 degrees wide, and is measured so.
    assert kept.display.pixels_per_degree == pytest.approx(32 * np.radians(1))
    assert "; 90° wide; the way is in" in said
    assert (kept.proportional, kept.limit_curve) == (0.2, "fitted")
    assert (kept.budget, kept.budget_unit, kept.horizon) == (0.5, BudgetUnit.POWER, 0.5)
    # In a second it falls by some 2 % of full power: the first half of it is the most above half of that.
    share = rows[0].power / rows[0].full_power
    assert 0.2 < share - 0.5 - 0.02 < kept.horizon_excess == kept.horizon_error < share - 0.5
    assert all(row.full_power == rows[0].full_power for row in rows)
    assert kept.power_model == "surace2025"
    seconds = np.diff([row.flip_time for row in rows])
    assert kept.mean_factor == pytest.approx(np.average([row.factor for row in rows[:-1]], weights=seconds))
    used, full = (np.array([getattr(row, name) for row in rows[:-1]]) for name in ("power", "full_power"))
    assert kept.achieved == pytest.approx(used @ seconds / (full @ seconds))
    assert f"budget 0.5 (power): {kept.achieved:.3g} on average" in said
    assert kept.steered_horizon == pytest.approx(200 / 60)  # as many answers, of 1/60 s each
    assert "the horizon of 0.5 s holds 30 answers, too few to steer by" in said
    assert 0 < kept.max_rate_ratio <= 1
    assert kept.share_budget_held == 0
    assert len(rows) in (61, 62)
    assert [row.measured_refresh for row in rows[1:]] == list(range(len(rows) - 1))
    moving = [row for row in rows if row.rate]
    assert len(moving) > 30
    assert all(abs(row.rate) <= row.rate_limit for row in moving)
    assert all(row.rate < 0 for row in moving)  # nothing there loses half of its contrast: it is dimmed
    assert rows[-1].factor == pytest.approx(0.7 * (1 - 0.03), rel=0.01)  # by some 3 % of it in a second
    path, begin = path_named(str(way)), path_named("house").keypoints[0]
    assert json.loads(way.read_text())["scene"] == "house"
    assert path.duration == pytest.approx(1.0, abs=1.5 / 60)
    assert path.position(0.0)[:2] == pytest.approx(begin.position[:2], abs=0.001)
    # Nothing is in the way there; the keys are read after the first flip, a refresh late.
    gone = float(np.linalg.norm(path.position(path.duration)[:2] - path.position(0.0)[:2]))
    assert gone == pytest.approx(SPEED, abs=2 * SPEED / 60)

    evenlight_does("render", way, "--size", "64x36", "--out", video, "--quiet")
    pictures = [frame.pixel_values.copy() for frame in open_video(str(video)).frames()]
    assert [picture.shape for picture in pictures] == [(36, 64, 3)] * 25
    assert (pictures[0] != pictures[-1]).mean() > 0.5  # the view has changed


def test_a_walk_without_a_controller_logs_its_frames_and_is_seen_at_true_size_with_a_display(
    virtual_screen: Callable[[], str], tmp_path: Path
) -> None:
    """64 pixels at 72.28 per degree, 4141 from the eye, are 2 atan(32 / 4141) = 0.885 degrees."""
    log = tmp_path / "frames.csv"
    words = [
        "walk",
        "house",
        "--simulate",
        "--seconds",
        "0.1",
        "--size",
        "64x36",
        "--factor",
        "0.8",
    ]
    words += ["--display", "varjo-xr3", "--log", str(log)]
    run = Run(words, os.environ | {"DISPLAY": virtual_screen()})
    out, err = run.communicate(timeout=200)
    assert run.returncode == 0, err
    assert re.search(
        rf"not timed in this rehearsal; 0\.885° wide, at true size; the frames are in {log}", out
    )
    with log.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["video_frame"]) for row in rows] == list(range(len(rows)))
    assert len(rows) in (7, 8)  # 0.1 s at 60 Hz: 6 after the first, or 7 if rounding puts that before 0.1 s
    assert {(row["version"], row["factor"], row["refreshes_dropped"]) for row in rows} == {
        ("walk", "0.8", "0")
    }
    assert {row["pixels_per_degree"] for row in rows} == {"72.28"}
    np.testing.assert_allclose(
        [float(row["flip_time_s"]) for row in rows], np.arange(len(rows)) / 60, atol=1e-8
    )


def test_what_was_walked_until_an_interruption_is_kept(
    virtual_screen: Callable[[], str], tmp_path: Path
) -> None:
    way, log, script = tmp_path / "way.json", tmp_path / "log", tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    words = ["walk", "house", "--simulate", "--seconds", "1e5", "--size", "64x36"]
    words += ["--target-loss", "0.5", "--budget", "0.5", "--record", str(way), "--out", str(log)]
    run = Run(words, os.environ | {"DISPLAY": virtual_screen()}, script)
    out, err = run.communicate(timeout=280)
    assert (run.returncode, out, err.count("\n")) == (130, "", 1)
    assert re.match("evenlight: interrupted; house: .* in .* s, .*; the way is in .*; the log is in ", err)
    rows = read_rows(LiveRefresh, log / "live_control.csv")
    kept = read_json_record(LiveControl, log / "live_control.json")
    assert len(rows) >= 5
    assert (kept.budget, kept.max_rate_ratio <= 1) == (0.5, True)
    assert path_named(str(way)).duration == pytest.approx(rows[-1].flip_time, abs=0.02)


def test_a_first_factor_that_the_controller_may_not_have_is_refused() -> None:
    asked = WalkOptions(scene="house", factor=0.1, seconds=2.0, simulate=True)
    with pytest.raises(InputError, match=r"--factor of a dimmed walk must lie in 0\.2 to 1, got 0\.1"):
        walk_as_asked(asked, LiveOptions(0.05))
