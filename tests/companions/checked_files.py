"""What tests of `evenlight validate` share: the problems that it tells, and results to be checked."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from example_tracks import example_track, header_of

from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import (
    BudgetUnit,
    write_track,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def problems_of(path: Path) -> list[str]:
    """The problems at a path, without the path."""
    found = [problem for checked in validate(path) for problem in checked.problems]
    assert all(problem.startswith(str(path)) and "\n" not in problem for problem in found)
    return [problem.removeprefix(str(path)).lstrip("/") for problem in found]


def results(folder: Path, **changes: Any) -> Path:
    """Results of an optimization of four frames; their loss is 0, 0.1, 0.2, 0.4."""
    loss = np.array([0.0, 0.1, 0.2, 0.4])
    origin = Provenance()
    display = Display("bench", 104.4, 0.2, 1.95, 72.28)
    header = header_of(display, power_model="panel", rate_limit="limit", budget=0.6, solver="s")
    columns = {"contrast_loss": loss, "mean_luminance": 12.0, "rate_limit": 2.0, "power": 0.5}
    write_track(folder / "track.csv", example_track(np.full(4, 0.6), header=header, **columns))
    required = (f.name for f in dataclasses.fields(OptimizationSummary) if f.default is dataclasses.MISSING)
    values: dict[str, Any] = dict.fromkeys(required, 0.5) | {
        "video": "v",
        "display": "bench",
        "rate_limit": "limit",
        "power_model": "panel",
        "frames": 4,
        "budget": 0.6,
        "budget_unit": BudgetUnit.FACTOR,
        # pairs: 0.1 + 0.2 + 0.4 + 0.1 + 0.3 + 0.2 = 1.3 in 6
        "objective": 1.3 / 6,
        "lower_bound": 0.2,
        "achieved": 0.6,
        "max_rate_ratio": 0.0,
        "limit_curve": "fitted",
        "modulated": "frame_mean",
        "contrast_model": "default",
        "simulated": False,
        "mean_contrast_loss": 0.175,
        "mean_factor": 0.6,
        "frames_without_contrast": 0,
        "solver": "s",
        "iterations": 3,
        "seed": None,
        "versions": {},
        "provenance": origin,
        "rate_limit_procedure": None,
        "curves_computed_on": "cpu",
        "clips": 1,
        "weighted": False,
        "largest_allowance": 1.0,
        "max_rate_ratio_fitted": 0.0,
        "wide_band_accepted": False,
    }
    write_json_record(folder / "summary.json", OptimizationSummary(**(values | changes)))
    curves = LossCurves(
        "v", display, np.arange(4) * 0.04, np.full(4, 0.04), np.array([0.2, 1.0]), np.zeros((4, 2)),
        np.full(4, 0.5), np.full(4, 20.0), np.full((4, 3), 0.2), origin,
    )  # fmt: skip
    write_loss_curves(folder / "loss_curves.npz", curves)
    return folder
