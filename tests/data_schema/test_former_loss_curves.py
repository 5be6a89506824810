"""What earlier versions kept of loss curves and summaries that this one does not is passed over."""

import json
from pathlib import Path

import numpy as np
import pytest
from made_summary import made_summary

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves, write_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

CURVES = LossCurves(
    video="v",
    display=Display("d", 100.0, 0.1, 2.2, 30.0),
    times=np.array([0.0, 0.04]),
    durations=np.array([0.04, 0.04]),
    factors=np.array([0.2, 1.0]),
    loss=np.array([[0.5, 0.0], [0.25, 0.0]]),
    visible_contrast=np.array([0.5, 0.5]),
    mean_luminance=np.array([20.0, 30.0]),
    channel_means=np.full((2, 3), 0.25),
    provenance=Provenance(),
)


def with_header(path: Path, **more: object) -> Path:
    """Add keys to the header of a file, and the array that told how much of each frame was counted."""
    write_loss_curves(path, CURVES)
    with np.load(path) as content:
        arrays = {name: content[name] for name in content}
    header = json.loads(str(arrays.pop("header"))) | more
    np.savez(path, allow_pickle=False, header=json.dumps(header), counted=np.array([1.0, 0.06]), **arrays)
    return path


@pytest.mark.parametrize("tolerance", [0.0, 0.001])
def test_curves_as_they_were_by_default_are_read(tmp_path: Path, tolerance: float) -> None:
    read = read_loss_curves(with_header(tmp_path / "c.npz", tolerance=tolerance))
    np.testing.assert_array_equal(read.loss, CURVES.loss)


def test_curves_that_were_counted_more_roughly_are_refused_with_the_way_to_make_them_anew(
    tmp_path: Path,
) -> None:
    file = with_header(tmp_path / "c.npz", tolerance=0.02)
    with pytest.raises(
        InputError, match=r"curves right to 0.02 alone; make them anew with `evenlight optimize`"
    ):
        read_loss_curves(file)


def test_other_keys_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown key 'tolerances'"):
        read_loss_curves(with_header(tmp_path / "c.npz", tolerances=0.001))


def test_a_summary_that_tells_what_was_counted_is_read() -> None:
    summary = made_summary()
    former = mapping_from_record(summary) | {"curves_tolerance": 0.001, "counted": 0.4}
    assert record_from_mapping(OptimizationSummary, former, "summary.json") == summary
