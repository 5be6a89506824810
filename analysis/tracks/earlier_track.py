"""Tracks of an earlier result, to start from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.brightness_track import read_track
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.loss_curves import LossCurves

TRACK = "track.csv"


def clip_folder(number: int, video: str) -> str:
    """Return the name of the folder of a clip that shares its budget, from 1 on.

    >>> clip_folder(2, "films/b.mkv")
    '02-b'
    """
    return f"{number:02d}-{Path(video).stem}"


def track_files(path: Path) -> tuple[Path, ...]:
    """Return the tables of an earlier result: of one video, or of clips that share a budget, in order.

    Parameters
    ----------
    path : Path
        A table, its folder, or the folder of the clips' folders.

    Raises
    ------
    InputError
        If a folder holds neither.
    """
    if not path.is_dir():
        return (path,)
    if (path / TRACK).is_file():
        return (path / TRACK,)
    clips = {file: file.parent.name.partition("-")[0] for file in path.glob(f"[0-9]*-*/{TRACK}")}
    if not clips:
        raise InputError(
            f"--start {path}: expected a folder with {TRACK}, or with the folders 01-NAME, 02-NAME, ... of "
            f"several clips, got neither"
        )
    return tuple(sorted(clips, key=lambda file: (int(clips[file]), file)))


def start_factors(path: Path, clips: Sequence[LossCurves]) -> Array:
    """Return the factors of earlier tracks at each frame's time, clip by clip, (N,).

    Parameters
    ----------
    path : Path
        As in `track_files`.
    clips : sequence of LossCurves
        Of each clip to be optimized.

    Raises
    ------
    InputError
        If there is not one track for each clip, or one cannot be used.
    """
    files = track_files(path)
    if len(files) != len(clips):
        raise InputError(
            f"--start {path}: holds {_tracks(len(files))}, asked is an optimization of {_clips(len(clips))}; "
            "give one with a track for each clip, in the same order"
        )
    earlier = [read_track(file) for file in files]
    return np.concatenate(
        [
            np.interp(clip.times, track.times, track.factors)
            for clip, track in zip(clips, earlier, strict=True)
        ]
    )


def _tracks(count: int) -> str:
    return "1 track" if count == 1 else f"{count} tracks"


def _clips(count: int) -> str:
    return "1 video" if count == 1 else f"{count} clips"
