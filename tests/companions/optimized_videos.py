"""Videos that tests of `evenlight optimize` make, and runs of it that succeed or are refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.method.preset_files import load_display
from evenlight.stimuli.video_writer import write_video


def texture(seed, height=36, width=48):
    """A picture with detail at every scale, pixel values in [0, 1]."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) / np.maximum(frequency, 1 / width)
    picture = np.fft.irfft2(spectrum, (height, width))
    return np.clip(0.5 + 0.2 * picture / picture.std(), 0, 1)


def frames_of(gray_frames, bits=8):
    top, kind = (255, np.uint8) if bits == 8 else (65535, np.uint16)
    return [np.repeat(np.round(g * top).astype(kind)[..., None], 3, axis=2) for g in gray_frames]


def video(path: Path, gray_frames, fps=5.0, bits=8) -> Path:
    write_video(path, frames_of(gray_frames, bits), fps, bits)
    return path


def limit_file(path: Path, rate: float) -> Path:
    panel = load_display("varjo-xr3")
    limit = RateLimit("made", panel.name, panel.fingerprint, RateLimitForm.RATE, (rate,), (0.01, 0.02))
    write_json_record(path, limit)
    return path


def optimized(command, tmp_path, source, budget=0.5, *more):
    """Run the command; return its track and summary, and check what must hold for every run."""
    out = tmp_path / "out"
    result = command("optimize", source, "--budget", budget, "--out", out, "--quiet", "--no-player", *more)
    assert result.code == 0, result.err
    assert result.err == ""
    track, summary = read_track(out / "track.csv"), json.loads((out / "summary.json").read_text())
    assert summary["achieved"] == pytest.approx(budget, abs=1e-6)
    assert summary["max_rate_ratio"] <= 1 + 1e-6
    assert (np.abs(track.rate) <= track.rate_limit * (1 + 1e-6)).all()
    assert summary["objective"] <= summary["objective_baseline"]
    assert summary["mean_power_w"] == pytest.approx(summary["baseline_power_w"], rel=1e-6)
    assert len(track.times) == summary["frames"]
    return track, summary


def refused(command, tmp_path, *arguments):
    """The line that the command ends with; the output folder must not exist."""
    out = tmp_path / "results"
    result = command("optimize", *arguments, "--out", out, "--quiet")
    assert result.code == 2
    assert result.err.count("\n") == 1
    assert "Traceback" not in result.err
    assert not out.exists()
    return result.err
