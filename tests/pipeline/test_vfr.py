"""A video whose frames stay for different times: a track in its own times, and a mean over time."""

import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves

pytestmark = pytest.mark.usefixtures("blank_pictures")

STEPS = (1, 2, 1, 1, 2, 1, 1, 3, 6, 10, 8, 9, 7, 10, 6, 8)  # how long each frame stays [s]
TIMES = np.cumsum((0.0, *STEPS[:-1]))
TICKS = 25  # of the file's clock [1/s]


def detailed(level: float) -> np.ndarray:
    """Noise of some brightness: detail that dimming takes away."""
    noise = np.random.default_rng(1).integers(0, 256, (36, 48, 1))
    return np.repeat(noise * level, 3, axis=2).astype(np.uint8)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A fade to black in which the dark frames stay longer: means over frames and over time differ."""
    path = tmp_path / "film.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=TICKS)
        stream.width, stream.height, stream.pix_fmt = 48, 36, "bgr0"
        stream.codec_context.time_base = Fraction(1, TICKS)
        for k, step in enumerate(STEPS):
            frame = av.VideoFrame.from_ndarray(detailed(1 - 0.9 * TIMES[k] / TIMES[-1]), format="rgb24")
            frame.pts, frame.time_base, frame.duration = (
                TICKS * sum(STEPS[:k]),
                Fraction(1, TICKS),
                TICKS * step,
            )
            for packet in stream.encode(frame):
                packet.duration = TICKS * step
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path


@pytest.mark.parametrize("solver", ["splitting", "slsqp"])
def test_a_track_has_the_times_of_the_file_and_meets_its_budget_over_time(
    command, film: Path, tmp_path: Path, solver: str
) -> None:
    result = command(
        "optimize",
        "--no-player",
        film,
        "--budget",
        0.5,
        "--out",
        tmp_path / "out",
        "--solver",
        solver,
        "--quiet",
    )
    assert result.code == 0, result.err
    track = read_track(tmp_path / "out" / "track.csv")
    np.testing.assert_allclose(track.times, TIMES, atol=1e-3)  # Matroska's clock ticks in milliseconds
    assert np.average(track.factors, weights=STEPS) == pytest.approx(0.5, abs=1e-6)
    assert abs(track.factors.mean() - 0.5) > 0.02, "the two means must differ for this to be a test"


def test_the_budget_is_met_exactly_with_the_durations_that_the_loss_curves_state(
    command, film: Path, tmp_path: Path
) -> None:
    assert (
        command("optimize", "--no-player", film, "--budget", 0.5, "--out", tmp_path / "out", "--quiet").code
        == 0
    )
    track = read_track(tmp_path / "out" / "track.csv")
    curves = read_loss_curves(tmp_path / "out" / "loss_curves.npz")
    np.testing.assert_allclose(curves.durations, STEPS, atol=1e-3)
    assert np.average(track.factors, weights=curves.durations) == pytest.approx(0.5, abs=1e-6)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["achieved"] == pytest.approx(0.5, abs=1e-6)


def test_the_rate_of_a_step_is_its_change_of_luminance_over_its_own_time(
    command, film: Path, tmp_path: Path
) -> None:
    """A long frame gives the next step more time, and the limit that much more room."""
    assert (
        command("optimize", "--no-player", film, "--budget", 0.5, "--out", tmp_path / "out", "--quiet").code
        == 0
    )
    track = read_track(tmp_path / "out" / "track.csv")
    emitted = track.mean_luminance / track.factors  # this display reflects nothing
    change = np.diff(track.factors) * (emitted[:-1] + emitted[1:]) / 2
    np.testing.assert_allclose(track.rate[:-1], change / np.array(STEPS[:-1]), rtol=1e-4, atol=1e-9)
    assert (np.abs(track.rate) <= track.rate_limit * (1 + 1e-6)).all()
    assert np.abs(track.rate).max() > 0.01
