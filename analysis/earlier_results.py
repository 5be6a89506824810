"""The files of an earlier run in the same folder: what a new run does not write again does not stay."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evenlight.data_schema.analysis_results import AnalysisSummary
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.storage.whole_files import results_folder


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
)
CLIP_FOLDERS = "[0-9][0-9]-*"  # of clips that share a budget


@contextmanager
def track_folder(out: Path) -> Iterator[Path]:
    """Yield a folder for the results of a track, which become those of `out`.

    What an earlier track left there and the new one does not write is removed: it would contradict it.
    """
    with results_folder(out) as folder:
        yield folder
        now = files_in(folder)
    clips = [path for path in out.glob(CLIP_FOLDERS) if (path / "track.json").is_file()]
    for place in (out, *clips):
        below = "" if place == out else f"{place.name}/"
        remove_stale(out, tuple(f"{below}{name}" for name in TRACK_FILES), now)
    for clip in clips:
        if not any(clip.iterdir()):
            clip.rmdir()
