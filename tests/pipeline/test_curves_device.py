"""What computes loss curves: asked for on the command line, said on the screen, kept in the results."""

import json

import numpy as np
import pytest
from compute_shaders import own_context

from evenlight.data_schema.tracks.loss_curves import read_loss_curves

pytestmark = pytest.mark.usefixtures("blank_pictures")

CLIP = ("sunrise", "--fps", "0.2", "--budget", "0.5")


def test_the_graphics_processor_gives_the_curves_of_the_processor_and_is_named_in_the_results(
    command, tmp_path
) -> None:
    own_context()  # skips where there are no compute shaders
    by_gpu = command("optimize", "--no-player", *CLIP, "--device", "gpu", "--out", tmp_path / "gpu")
    by_cpu = command("optimize", "--no-player", *CLIP, "--out", tmp_path / "cpu")
    assert (by_gpu.code, by_cpu.code) == (0, 0)
    assert by_gpu.err.startswith("loss curves by OpenGL: ")
    ours, theirs = (read_loss_curves(tmp_path / name / "loss_curves.npz") for name in ("gpu", "cpu"))
    np.testing.assert_allclose(ours.loss, theirs.loss, atol=1e-3)
    assert ours.computed_on.startswith("gpu: ")
    assert theirs.computed_on == "cpu"
    summary = json.loads((tmp_path / "gpu" / "summary.json").read_text())
    assert summary["curves_computed_on"] == ours.computed_on


def test_a_choice_that_shaders_cannot_do_is_refused_or_left_to_the_processor(command, tmp_path) -> None:
    own_context()
    model = tmp_path / "level_mean.contrast_model.toml"
    model.write_text('sensitivity = "authors"\n')
    asked = ("optimize", *CLIP, "--no-player", "--contrast-model", model)
    refused = command(*asked, "--device", "gpu", "--out", tmp_path / "gpu")
    assert refused.code == 2
    assert refused.err.count("\n") == 1
    assert "sensitivity" in refused.err
    assert not (tmp_path / "gpu").exists()
    left = command(*asked, "--device", "auto", "--out", tmp_path / "auto")
    assert left.code == 0
    assert left.err.startswith("loss curves on the processor: ")
