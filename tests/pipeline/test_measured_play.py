"""`evenlight measure played`: the power of a played video, in its versions, on a simulated panel."""

import itertools
import json
import os

import numpy as np
import pytest
from warm_evenlight import Run

from evenlight.data_schema.recordings.instrument_logs import FlashMark, PlayedFlip, PowerSample
from evenlight.data_schema.storage.tables import read_rows
from evenlight.hardware.simulated.panel import PanelPhysics
from evenlight.method.preset_files import load_display

FRAMES, RATE = 30, 20.0


@pytest.fixture(scope="module")
def measured(tmp_path_factory, virtual_screen, small_rig, make_stimulus, make_video):
    """A video of a second and a half with its track, and the folder of its measured power."""
    folder = tmp_path_factory.mktemp("measured")
    factors = np.linspace(0.9, 0.3, FRAMES)
    make_stimulus(folder / "track", factors, frames_per_second=RATE)
    make_video(folder / "clip.mkv", np.linspace(0.2, 0.9, FRAMES), (64, 48), RATE)
    words = ["measure", "played", folder / "clip.mkv", folder / "track", "--rig", small_rig, "--simulate"]
    words += ["--passes", "2", "--out", folder / "power"]
    done = Run([str(word) for word in words], os.environ | {"DISPLAY": virtual_screen(24)})
    out, err = done.communicate(timeout=200)
    assert done.returncode == 0, err
    return folder / "power", out, factors


def panel_power(factor):
    """P of the simulated panel, by hand: base + slope · b · peak."""
    physics = PanelPhysics()
    peak = load_display("varjo-xr3").peak_luminance
    return physics.base_power + physics.power_per_luminance * factor * peak


def test_every_version_is_played_as_often_and_each_round_begins_with_another(measured):
    flips = read_rows(PlayedFlip, measured[0] / "flips.csv")
    order = {flip.pass_index: flip.version for flip in flips}
    assert list(order.values()) == ["ours", "baseline", "full", "baseline", "full", "ours"]
    shown = [flip.video_frame for flip in flips if flip.pass_index == 5]
    assert sorted(set(shown)) == list(range(FRAMES))


def test_the_sync_line_changes_with_every_new_video_frame(measured):
    flips = read_rows(PlayedFlip, measured[0] / "flips.csv")
    for before, after in itertools.pairwise(flips):
        new = (before.pass_index, before.video_frame) != (after.pass_index, after.video_frame)
        assert (before.sync != after.sync) == new


def test_three_flashes_come_before_and_three_after(measured):
    flashes = read_rows(FlashMark, measured[0] / "flashes.csv")
    flips = read_rows(PlayedFlip, measured[0] / "flips.csv")
    for some in (flashes[:7], flashes[7:]):
        assert [flash.factor for flash in some] == [0.2, 1.0] * 3 + [0.2]
        np.testing.assert_allclose(np.diff([flash.time for flash in some]), 0.5, atol=1e-9)
    assert flashes[6].time < flips[0].flip
    assert flashes[7].time > flips[-1].flip


def test_samples_came_from_before_the_first_flash_to_after_the_last(measured):
    samples = read_rows(PowerSample, measured[0] / "power.csv")
    flashes = read_rows(FlashMark, measured[0] / "flashes.csv")
    assert samples[0].received < flashes[0].time
    assert samples[-1].received >= flashes[-1].time
    assert {sample.sync for sample in samples} == {False, True}


def powers_in(folder):
    versions = json.loads((folder / "played_power.json").read_text())["versions"]
    return {version["version"]: version["mean_power_w"] for version in versions}


def test_the_table_has_the_panels_power(measured):
    folder, said, factors = measured
    rows = powers_in(folder)
    # The backlight's lag of 5 ms leaves the mean over a pass of 1.5 s within 1 % of the power at its factors.
    expected = {"ours": panel_power(factors.mean()), "full": panel_power(1.0)}
    for version, power in expected.items():
        assert abs(rows[version] / power - 1) < 0.01
    assert "SIMULATED" in said
    assert json.loads((folder / "power_log.json").read_text())["simulated"]


def test_what_was_recorded_is_analysed_anew_also_where_it_ends_early(measured, command, tmp_path):
    folder, _, factors = measured
    early = tmp_path / "early"
    early.mkdir()
    for name in ("power_log.json", "clock.csv", "flashes.csv"):
        (early / name).write_text((folder / name).read_text())
    flips = (folder / "flips.csv").read_text().splitlines()
    kept = [line for line in flips[1:] if int(line.split(",")[0]) < 4]
    (early / "flips.csv").write_text("\n".join([flips[0], *kept]) + "\n")
    samples = (folder / "power.csv").read_text().splitlines()
    (early / "power.csv").write_text("\n".join(samples[: 3 * len(samples) // 4]) + "\n")
    done = command("fit", early, "--out", tmp_path / "fitted")
    assert done.code == 0, done.err
    assert "2 of 6 passes were not played" in done.out
    assert abs(powers_in(tmp_path / "fitted")["ours"] / panel_power(factors.mean()) - 1) < 0.01


def test_a_folder_with_a_measurement_is_refused_before_anything_is_played(measured, command, tmp_path):
    folder = measured[0]
    words = ("measure", "played", folder.parent / "clip.mkv", folder.parent / "track")
    done = command(*words, "--rig", "simulated", "--out", folder)
    assert (done.code, "never overwritten" in done.err) == (2, True)
    done = command(*words, "--rig", "simulated")
    assert (done.code, "Missing option '--out'" in done.err) == (2, True)
    done = command(*words, "--out", tmp_path / "new")
    assert (done.code, "names no power meter" in done.err) == (2, True)
    done = command("play", *words[2:], "--measure-power", "--out", tmp_path / "new")
    assert (done.code, "`evenlight measure played VIDEO TRACK`" in done.err) == (2, True)
    assert not (tmp_path / "new").exists()
