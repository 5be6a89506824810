"""How much of each frame was counted travels with loss curves; files from before it did are still read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves, write_loss_curves


def curves(**changed: Any) -> LossCurves:
    given: dict[str, Any] = {
        "video": "v",
        "display": Display("d", 100.0, 0.1, 2.2, 30.0),
        "times": np.array([0.0, 0.04]),
        "durations": np.array([0.04, 0.04]),
        "factors": np.array([0.2, 1.0]),
        "loss": np.array([[0.5, 0.0], [0.25, 0.0]]),
        "visible_contrast": np.array([0.5, 0.5]),
        "mean_luminance": np.array([20.0, 30.0]),
        "channel_means": np.full((2, 3), 0.25),
        "provenance": Provenance(),
    }
    return LossCurves(**(given | changed))


def test_what_was_counted_survives_the_file(tmp_path: Path) -> None:
    write_loss_curves(tmp_path / "c.npz", curves(counted=np.array([1.0, 0.06]), tolerance=1e-3))
    read = read_loss_curves(tmp_path / "c.npz")
    assert read.tolerance == 1e-3
    np.testing.assert_array_equal(read.counted, [1.0, 0.06])


def test_curves_that_say_nothing_were_counted_whole() -> None:
    assert curves().tolerance == 0
    np.testing.assert_array_equal(curves().counted, [1.0, 1.0])


def test_files_of_earlier_versions_are_read_as_counted_whole(tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    write_loss_curves(path, curves())
    with np.load(path) as content:
        earlier = {name: content[name] for name in content if name != "counted"}
    header = str(earlier["header"]).replace(', "tolerance": 0.0', "")
    assert "tolerance" not in header
    np.savez(path, allow_pickle=False, **(earlier | {"header": np.array(header)}))
    read = read_loss_curves(path)
    assert read.tolerance == 0
    np.testing.assert_array_equal(read.counted, [1.0, 1.0])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"counted": np.array([0.5, 1.5])}, "counted must be at most 1"),
        ({"counted": np.array([0.5])}, r"counted must have the shape \(2,\)"),
        ({"tolerance": -0.1}, "tolerance must be at least 0"),
    ],
)
def test_impossible_counts_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        curves(**changed)
