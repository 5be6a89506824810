"""`evenlight validate` on the results of an optimization: files that contradict each other are told."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checked_files import problems_of, results

from evenlight.data_schema.checking.validation import mean_absolute_difference, validate
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def test_results_that_agree_have_no_problem(tmp_path: Path) -> None:
    (results(tmp_path) / "track.png").write_bytes(b"\x89PNG")
    assert problems_of(tmp_path) == []
    assert {c.path.name: c.words for c in validate(tmp_path)} == {
        "loss_curves.npz": "loss curves",
        "summary.json": "optimization summary",
        "track.csv": "brightness track",
        "track.json": "track header",
        "track.png": "",
    }


def test_a_summary_prints_in_one_line(tmp_path: Path) -> None:
    summary = read_json_record(OptimizationSummary, results(tmp_path) / "summary.json")
    assert repr(summary) == (
        "<OptimizationSummary 'v': 4 frames, budget 0.6 (factor), objective 0.217, baseline 0.5>"
    )


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"frames": 5}, "summary.json: frames: expected 4, the rows of track.csv, got 5"),
        ({"video": "w"}, "summary.json: video: expected 'v', as in track.json, got 'w'"),
        ({"display": "w"}, "summary.json: display: expected 'bench', as in track.json, got 'w'"),
        ({"budget": 0.5, "achieved": 0.5}, "summary.json: budget: expected 0.6, as in track.json, got 0.5"),
        ({"budget_unit": BudgetUnit.WATT}, "summary.json: budget_unit: expected 'factor', as in"),
        ({"solver": "t"}, "summary.json: solver: expected 's', as in track.json, got 't'"),
        ({"mean_factor": 0.7}, "summary.json: mean_factor: expected 0.6 to 0.6, as the track's column"),
        ({"mean_contrast_loss": 0.5}, "summary.json: mean_contrast_loss: expected 0 to 0.4"),
        ({"achieved": 0.5}, "summary.json: achieved: expected the budget 0.6, got 0.5"),
        (
            {"objective_baseline": 0.21},
            "summary.json: objective: expected at most 0.21, that of constant dimming",
        ),
        ({"max_rate_ratio": 7.0}, "summary.json: max_rate_ratio: expected 0, as in the track, got 7"),
        ({"mean_power": 0.6}, "summary.json: mean_power_w: expected 0.5 to 0.5"),
        ({"objective": 0.2}, "summary.json: objective: expected 0.216667, the mean absolute difference"),
    ],
)
def test_results_that_contradict_each_other_are_told(
    changes: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    found = problems_of(results(tmp_path, **changes))
    assert len(found) == 1
    assert found[0].startswith(problem)


def test_a_row_missing_from_a_track_is_told(tmp_path: Path) -> None:
    track = results(tmp_path) / "track.csv"
    track.write_text("".join(track.read_text().splitlines(keepends=True)[:-1]))
    assert "summary.json: frames: expected 3, the rows of track.csv, got 4" in problems_of(tmp_path)


def test_loss_curves_of_another_display_are_told(tmp_path: Path) -> None:
    text = (results(tmp_path) / "track.json").read_text()
    fingerprint = json.loads(text)["display_fingerprint"]
    (tmp_path / "track.json").write_text(text.replace(fingerprint, "0" * 16))
    assert problems_of(tmp_path) == [
        f"loss_curves.npz: display fingerprint: expected '{'0' * 16}', as in the track's header, "
        f"got {fingerprint!r}"
    ]


def test_every_wrong_cell_of_a_track_is_told(tmp_path: Path) -> None:
    track = results(tmp_path) / "track.csv"
    text = track.read_text().replace("\n1,0.04,0.6,", "\n1,0.04,1.6,").replace("\n2,0.08,", "\n2,now,")
    track.write_text(text.replace("\n3,0.12,0.6,0.4,", "\n3,0.12,0.6,-0.4,"))
    assert [told for told in problems_of(tmp_path) if told.startswith("track.csv")] == [
        "track.csv, line 3: factor: expected at most 1, got 1.6",
        "track.csv, line 4: time_s: expected a number, got 'now'",
        "track.csv, line 5: contrast_loss: expected at least 0, got -0.4",
    ]


def test_a_track_without_its_header_is_told(tmp_path: Path) -> None:
    (results(tmp_path) / "track.json").unlink()
    assert problems_of(tmp_path) == ["track.json: no such file; there is no brightness track without it"]


@pytest.mark.parametrize("values", [[], [0.3], [0.0, 1.0], [0.2, 0.2, 0.9, 0.1, 0.4]])
def test_the_mean_absolute_difference_is_the_double_sum(values: list[float]) -> None:
    pairs = [abs(x - y) for i, x in enumerate(values) for y in values[i + 1 :]]
    expected = sum(pairs) / len(pairs) if pairs else 0.0
    assert mean_absolute_difference(np.array(values)) == pytest.approx(expected, abs=1e-15)
