"""Claims about starting from an earlier result: its tracks are found, in order."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track

from evenlight.analysis.tracks.optimization_job import clip_folder, start_factors, track_files
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import (
    write_track,
)


def write(folder: Path, factor: float) -> Path:
    """Write a track that begins with a factor and rises by 0.05 in each of 2 s."""
    folder.mkdir(parents=True)
    write_track(folder / "track.csv", example_track(factor + 0.05 * np.arange(3), 1.0))
    return folder / "track.csv"


def clips(*times: list[float]) -> Any:
    """Return what is asked of loss curves: when frames appear."""
    return [SimpleNamespace(times=np.array(each)) for each in times]


def test_a_table_and_its_folder_are_one_start(tmp_path: Path) -> None:
    table = write(tmp_path / "one", 0.3)
    for path in (table, table.parent):
        np.testing.assert_allclose(start_factors(path, clips([0.0, 0.5, 5.0])), [0.3, 0.325, 0.4])


def test_each_clip_starts_from_its_own_track(tmp_path: Path) -> None:
    write(tmp_path / "s" / "01-b", 0.3)
    write(tmp_path / "s" / "02-a", 0.6)
    np.testing.assert_allclose(start_factors(tmp_path / "s", clips([0.0, 2.0], [1.0])), [0.3, 0.4, 0.65])


def test_a_hundred_clips_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    numbers = (100, 9, 11)
    for number in numbers:
        write(tmp_path / clip_folder(number, "films/a.mkv"), 0.3)
    assert [file.parent.name for file in track_files(tmp_path)] == ["09-a", "11-a", "100-a"]


def test_another_number_of_clips_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "01-a", 0.3)
    with pytest.raises(InputError, match="holds 1 track, asked is an optimization of 2 clips"):
        start_factors(tmp_path, clips([0.0], [0.0]))


def test_a_folder_without_tracks_is_refused(tmp_path: Path) -> None:
    (tmp_path / "12-monkeys").mkdir()
    (tmp_path / "3d-film").mkdir()
    with pytest.raises(InputError, match=r"expected a folder with track\.csv"):
        track_files(tmp_path)
