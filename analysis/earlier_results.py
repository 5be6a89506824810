"""The files of an earlier run in the same folder: what a new run does not write again does not stay."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.analysis_results import AnalysisSummary
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import read_json_record


def files_in(folder: Path) -> tuple[str, ...]:
    """Return the files of a folder of results, as paths below it."""
    paths = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return tuple(path.relative_to(folder).as_posix() for path in paths)


def earlier_files(summary: Path) -> tuple[str, ...]:
    """Return the files that an earlier run says it wrote; none without a readable summary."""
    try:
        return read_json_record(AnalysisSummary, summary).files
    except InputError:
        return ()


def remove_stale(folder: Path, before: tuple[str, ...], now: tuple[str, ...]) -> None:
    """Remove the files of an earlier run that a new one did not write; nothing outside of the folder."""
    for name in sorted(set(before) - set(now)):
        path = folder / name
        if folder.resolve() in path.resolve().parents and path.is_file():
            path.unlink()


TRACK_FILES = (
    "track.csv",
    "track.json",
    "track.png",
    "summary.json",
    "contrast_map.png",
    "loss_curves.npz",
    "player.html",
    "control.json",
    "tuning.json",
    "tuning.png",
    "target_sweep.csv",
    "target_sweep.png",
)
CLIP_FOLDERS = "[0-9][0-9]-*"  # of clips that share a budget


def remove_earlier_track(folder: Path, now: tuple[str, ...]) -> None:
    """Remove what an earlier track left in a folder and the new one did not write: it would contradict it.

    Parameters
    ----------
    folder : Path
        The results.
    now : tuple of str
        What the new run wrote there, from `files_in`.
    """
    clips = [path for path in folder.glob(CLIP_FOLDERS) if (path / "track.json").is_file()]
    for place in (folder, *clips):
        below = "" if place == folder else f"{place.name}/"
        remove_stale(folder, tuple(f"{below}{name}" for name in TRACK_FILES), now)
    for clip in clips:
        if not any(clip.iterdir()):
            clip.rmdir()
