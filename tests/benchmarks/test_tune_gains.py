"""The script that tunes the controller's gains: its file, and what it says of other targets."""

import numpy as np
import pytest

from benchmarks.tune_gains import TuningReport, main
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.loss_curves import write_loss_curves
from evenlight.method.online.control_curves import control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit


def test_gains_are_tuned_and_targets_tried(make_curves, tmp_path, capsys) -> None:
    times = np.arange(60) / 5
    curves = make_curves(0.2 + 0.05 * np.sin(times), luminance=40 - 15 * np.sin(times), frames_per_second=5.0)
    write_loss_curves(tmp_path / "loss_curves.npz", curves)
    out = tmp_path / "tuning.json"
    main([str(tmp_path / "loss_curves.npz"), "--target-loss", "0.08", "--out", str(out), "--targets", "0.05"])
    found = read_json_record(TuningReport, out)
    after = found.after
    assert (after.gain_margin_db or 0) >= found.least_gain_margin_db - 1e-9
    assert after.rms_error <= found.before.rms_error * 1.02
    limit = scalar_rate_limit(load_rate_limit("surace2025"), curves.display.reflected_luminance)
    gains = (after.proportional, after.integral, after.derivative)

    def run(target: float):
        settings = ControllerSettings(target, *gains, lowest_factor=float(curves.factors[0]))
        return control_curves(curves, Controller(settings, limit))

    error = run(0.08).contrast_loss - 0.08
    assert after.rms_error == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    alone = run(0.05)
    said = capsys.readouterr().out
    assert f"target 5 %: mean factor {alone.factors.mean():.4g}, " in said
    assert f"SD {100 * alone.contrast_loss.std():.2g} points" in said
