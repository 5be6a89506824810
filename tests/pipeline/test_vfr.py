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


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fade to black in which the dark frames stay longer: means over frames and over time differ."""
    path = tmp_path_factory.mktemp("film") / "film.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=TICKS)
        stream.width, stream.height, stream.pix_fmt = 48, 36, "bgr0"
        stream.codec_context.time_base = Fraction(1, TICKS)
        for k, step in enumerate(STEPS):
            frame = av.VideoFrame.from_ndarray(detailed(1 - 0.9 * TIMES[k] / TIMES[-1]), format="rgb24")
            frame.pts, frame.duration = TICKS * sum(STEPS[:k]), TICKS * step
            frame.time_base = Fraction(1, TICKS)
            for packet in stream.encode(frame):
                packet.duration = TICKS * step
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path


@pytest.mark.parametrize("solver", ["splitting", "slsqp"])
def test_a_track_has_the_times_of_the_file_and_its_budget_and_rates_are_over_time(
    command, film: Path, tmp_path: Path, solver: str
) -> None:
    out = tmp_path / "out"
    words = ("--no-player", "--budget", 0.5, "--out", out, "--solver", solver, "--quiet")
    result = command("optimize", film, *words)
    assert result.code == 0, result.err
    track, curves = read_track(out / "track.csv"), read_loss_curves(out / "loss_curves.npz")
    np.testing.assert_allclose(track.times, TIMES, atol=1e-3)  # Matroska's clock ticks in milliseconds
    np.testing.assert_allclose(curves.durations, STEPS, atol=1e-3)
    assert np.average(track.factors, weights=curves.durations) == pytest.approx(0.5, abs=1e-6)
    assert json.loads((out / "summary.json").read_text())["achieved"] == pytest.approx(0.5, abs=1e-6)
    assert abs(track.factors.mean() - 0.5) > 0.02, "the two means must differ for this to be a test"
    # A long frame gives the next step more time, and the limit that much more room.
    emitted = track.mean_luminance / track.factors  # this display reflects nothing
    change = np.diff(track.factors) * (emitted[:-1] + emitted[1:]) / 2
    np.testing.assert_allclose(track.rate[:-1], change / np.array(STEPS[:-1]), rtol=1e-4, atol=1e-9)
    assert (np.abs(track.rate) <= track.rate_limit * (1 + 1e-6)).all()
    assert np.abs(track.rate).max() > 0.01
