"""The videos of a catalogue: from a folder, a glob or a table, each with what is asked of it."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.tracks.catalogue import CatalogueEntry
from evenlight.stimuli.sequences import is_sequence
from evenlight.stimuli.video.video_locations import is_url, shown_name, videos_at

CURVES = ".npz"
CATALOGUE, FIGURE, REPORT = "catalogue.csv", "catalogue.png", "report.html"
OWN_FILES = ("weights", "allowances")
PRESETS_OR_FILES = ("display", "power_model", "rate_limit", "contrast_model")
# The columns of a table that are fields of a request; what is new there needs no word here.
OWN_OPTIONS = {field.name for field in fields(CatalogueEntry)} & {
    field.name for field in fields(TrackRequest)
}
OWN_OPTIONS -= {*OWN_FILES, *PRESETS_OR_FILES}
RESERVED = (CATALOGUE, FIGURE, REPORT)  # beside the folders of results


@dataclass(frozen=True, slots=True)
class CatalogueVideo:
    """A video of a catalogue."""

    video: str  # what `open_video` takes, or a file of loss curves, which needs no video
    folder: Path  # of its results, absolute
    asked: TrackRequest

    @property
    def name(self) -> str:
        """What the folder of its results is called."""
        return self.folder.name

    @property
    def shown(self) -> str:
        """What the video is called in tables: a URL without what may be secret."""
        return shown_name(self.video)


def videos_of(source: str, asked: TrackRequest, out: Path) -> tuple[CatalogueVideo, ...]:
    """Return the videos of a catalogue, each with a folder name of its own; names of files are absolute.

    Parameters
    ----------
    source : str
        A table (CSV), or what `videos_at` takes: a folder, a glob, a file, a URL of these.
    asked : TrackRequest
        What is wanted of all; a table may say otherwise for some.
    out : Path
        Where the results go: what lies there is no video of the catalogue.

    Raises
    ------
    InputError
        If there is no video, the table cannot be read, or two rows have the same name.
    """
    asked = _with_absolute_files(asked)
    if source.lower().endswith(".csv") and not is_url(source):
        return _of_table(Path(source).resolve(), asked, out.resolve())
    everywhere, own = map(_absolute, videos_at(source)), out.resolve()
    videos = [name for name in everywhere if is_url(name) or own not in Path(name).parents]
    if not videos:
        raise InputError(f"{source}: holds no videos but those below {out}, the folder of results")
    base = _absolute(source) if is_url(source) or Path(source).is_dir() else None
    named = zip(videos, _names(videos, base), strict=True)
    return tuple(CatalogueVideo(video, own / name, asked) for video, name in named)


def _absolute(name: str) -> str:
    """Return the name of a file as it is in any folder; URLs and built-in sequences stay as they are."""
    return name if is_url(name) or not Path(name).exists() else str(Path(name).resolve())


def _with_absolute_files(asked: TrackRequest) -> TrackRequest:
    """Return what is asked, with the whole names of its files: workers may be in another folder."""
    named: dict[str, Any] = {
        key: _absolute(value) for key in PRESETS_OR_FILES if (value := getattr(asked, key)) is not None
    }
    return replace(asked, **named)


def _of_table(path: Path, asked: TrackRequest, out: Path) -> tuple[CatalogueVideo, ...]:
    entries = read_rows(CatalogueEntry, path)
    if not entries:
        raise InputError(f"{path}: lists no video; give a row for each, with the column path")
    videos = [entry.path if is_sequence(entry.path) else _beside(path, entry.path) for entry in entries]
    for number, entry in enumerate(entries, start=2):
        if entry.name and (
            entry.name.startswith(".") or set(entry.name) & set("/\\") or entry.name in RESERVED
        ):
            raise InputError(
                f"{path}, row {number}: name {entry.name!r} cannot be that of a folder of results; give one "
                "without / that does not begin with a dot"
            )
    unnamed = iter(_names([v for v, entry in zip(videos, entries, strict=True) if not entry.name]))
    names = [entry.name or next(unnamed) for entry in entries]
    twice = [name for name, count in Counter(map(str.casefold, names)).items() if count > 1]
    if twice:
        raise InputError(
            f"{path}: {twice[0]!r} would be the folder of two rows; give them names in the column name"
        )
    return tuple(
        CatalogueVideo(video, out / name, _own(path, entry, asked))
        for video, name, entry in zip(videos, names, entries, strict=True)
    )


def _own(path: Path, entry: CatalogueEntry, asked: TrackRequest) -> TrackRequest:
    own: dict[str, Any] = {key: getattr(entry, key) for key in OWN_OPTIONS if getattr(entry, key) is not None}
    own |= {key: Path(_beside(path, value)) for key in OWN_FILES if (value := getattr(entry, key))}
    for key in PRESETS_OR_FILES:
        if value := getattr(entry, key):
            own[key] = beside if Path(beside := _beside(path, value)).exists() else value
    return replace(asked, **own)


def _beside(table: Path, name: str) -> str:
    return name if is_url(name) else str(table.parent / name)


def _names(videos: Sequence[str], base: str | None = None) -> list[str]:
    """Return a name for the folder of each video: its path from the folder of all, without its ending.

    Parameters
    ----------
    videos : sequence of str
        Absolute names, or URLs.
    base : str, optional
        The folder of all; otherwise the lowest that holds them all.

    >>> _names(["/films/a.mkv", "/films/old/a.mkv", "/films/b.mkv", "/films/b.mp4"])
    ['a', 'old-a', 'b.mkv', 'b.mp4']
    """
    if not videos:
        return []
    paths = [Path("/") / unquote(shown_name(video)) for video in videos]  # URLs too: only to compare
    above = Path("/") / unquote(shown_name(base or ""))
    if base is None or not all(above in path.parents for path in paths):
        above = Path(os.path.commonpath([path.parent for path in paths]))
    whole = ["-".join(path.relative_to(above).parts) for path in paths]
    short = [name.removesuffix(path.suffix) for name, path in zip(whole, paths, strict=True)]
    count = Counter(map(str.casefold, short))
    names, taken = [], set(RESERVED)
    for name, longer in zip(short, whole, strict=True):
        tried = (f"{longer}-{number}" for number in itertools.count(2))
        first = (name,) if count[name.casefold()] == 1 else ()
        every = itertools.chain(first, [longer], tried)
        names.append(next(one for one in every if one.casefold() not in taken))
        taken.add(names[-1].casefold())
    return names
