"""What arrives in the swapchain of a real runtime: factor times picture in linear light, in each eye."""

import csv
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from played_in_headset import assert_factor_times_frames, make_yard, play_yard, watch

from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions
from evenlight.experiments.playback.player import PlaybackDevices, open_devices
from evenlight.experiments.playback.walk_request import walk_as_asked
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.scenes.scene_sequence import SceneSequence

FACTORS = np.linspace(0.9, 0.4, 50)  # of frames at 25 Hz


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SceneSequence]:
    with pytest.MonkeyPatch.context() as patched:
        yield make_yard(patched, tmp_path_factory.mktemp("yard"))


@pytest.fixture(
    params=[
        pytest.param(True, id="counted"),
        # A sample on an edge of the scene may fall to either side, at times that nobody chose.
        pytest.param(False, id="real time", marks=pytest.mark.real_time),
    ]
)
def devices(request: pytest.FixtureRequest) -> Iterator[PlaybackDevices]:
    rig = replace(load_rig("headset")[0], full_screen=True)
    display = load_display("varjo-xr3")
    with open_devices(rig, display, simulated=request.param, any_rate=False) as opened:
        yield opened


def test_each_eye_is_given_the_factor_times_its_picture(
    devices: PlaybackDevices, sequence: SceneSequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the factor that the track has at the time that the runtime predicts, between its frames too."""
    given = watch(monkeypatch)
    in_real_time = devices.window.apparatus()["clock"] == "runtime"
    one = play_yard(devices, sequence, FACTORS, 2.0 if in_real_time else 5 / devices.rig.refresh_rate)
    times = np.array([drawn.time for drawn in given])
    factors = 0.9 - (0.9 - 0.4) / 49 * 25 * times
    assert len(given) >= (2 if in_real_time else 5)  # a processor alone draws few in 2 s
    if in_real_time:  # frames that are late leave it behind the track, and no step is faster
        fastest = (0.9 - 0.4) / 49 * 25 * np.diff(one.shown.flip_times)
        assert (np.diff(one.shown.factors) >= -fastest - 1e-6).all()
        assert (one.shown.factors >= factors - 1e-6).all()
        predicted = [drawn.frame.display_time - one.shown.onset for drawn in given[1:]]
        np.testing.assert_allclose(times[1:], predicted, atol=1e-6)
    else:
        np.testing.assert_allclose(one.shown.factors, factors, atol=1e-6)
    assert_factor_times_frames(devices, sequence, given[:5], one.shown.factors[:5])
    assert all(before <= after for before, after in pairwise(head.display_time for head in one.heads))


@pytest.mark.real_time  # a busy processor draws few frames in 3 s
@pytest.mark.usefixtures("sequence")
def test_a_walk_dimmed_live_keeps_to_the_rate_limit_by_the_times_that_the_runtime_predicts(
    tmp_path: Path,
) -> None:
    """Drawn without a graphics card, many refreshes are missed; the true luminances are in the log."""
    files = {"out": tmp_path / "live", "log": tmp_path / "frames.csv"}
    asked = WalkOptions(scene="yard", rig="headset", factor=0.8, seconds=3.0, **files)
    said = walk_as_asked(asked, LiveOptions(0.02))
    assert "for both eyes" in said
    logged = list(csv.DictReader((tmp_path / "live" / "live_control.csv").read_text().splitlines()))
    ratios = [abs(float(row["rate_cd_m2_s"])) / float(row["rate_limit_cd_m2_s"]) for row in logged[1:]]
    assert len(ratios) > 1
    assert 0 < max(ratios) <= 1
    frames = list(csv.DictReader((tmp_path / "frames.csv").read_text().splitlines()))
    assert len(frames) == len(logged)
    print(f"{len(logged)} refreshes, largest rate ratio {max(ratios):.3f}: {said}")
