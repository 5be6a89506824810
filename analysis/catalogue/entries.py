"""The videos of a catalogue: from a folder, a glob or a table, each with what is asked of it."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, get_type_hints
from urllib.parse import unquote

from evenlight.analysis.catalogue.video_listing import videos_at
from evenlight.analysis.tracks.track_request import TrackRequest, WantedOfAll
from evenlight.data_schema.arguments import positive
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import typed
from evenlight.data_schema.result_request import REQUEST
from evenlight.data_schema.storage.tables import csv_rows, plain_cell
from evenlight.stimuli.sequences import is_sequence
from evenlight.stimuli.video.video_locations import is_url, shown_name

CURVES = ".npz"
CATALOGUE, FIGURE, REPORT = "catalogue.csv", "catalogue.png", "report.html"
OWN_FILES = ("weights", "allowances")
PRESETS_OR_FILES = ("display", "power_model", "rate_limit", "contrast_model")
FORMER = {"field_of_view_deg": "field_of_view"}  # columns of tables for earlier versions
# The columns of a table: fields of a request, beside video and folder; what is new there needs no word here.
COLUMNS = ("path", "name", *(field.name for field in fields(WantedOfAll)), *OWN_FILES, *FORMER)
RESERVED = (CATALOGUE, FIGURE, "catalogue.svg", "catalogue.pdf", REPORT, REQUEST)  # beside folders


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
    rows = csv_rows(path, COLUMNS, "a table of videos", optional=COLUMNS[1:])
    entries = {f"{path}, line {line}": dict(zip(COLUMNS, cells, strict=True)) for line, cells in rows}
    if not entries:
        raise InputError(f"{path}: lists no video; give a row for each, with the column path")
    for where, entry in entries.items():
        if not entry["path"]:
            raise InputError(f"{where}: names no video in the column path")
        if (name := entry["name"]) and (name[0] == "." or set(name) & set("/\\") or name in RESERVED):
            raise InputError(
                f"{where}: name {name!r} cannot be that of a folder of results; give one without / that does "
                "not begin with a dot"
            )
    given = [entry["path"] for entry in entries.values()]
    videos = [video if is_sequence(video) else _beside(path, video) for video in given]
    own_names = [entry["name"] for entry in entries.values()]
    unnamed = iter(_names([video for video, name in zip(videos, own_names, strict=True) if not name]))
    names = [name or next(unnamed) for name in own_names]
    twice = [name for name, count in Counter(map(str.casefold, names)).items() if count > 1]
    if twice:
        raise InputError(
            f"{path}: {twice[0]!r} would be the folder of two rows; give them names in the column name"
        )
    return tuple(
        CatalogueVideo(video, out / name, _own(path, where, entry, asked))
        for video, name, (where, entry) in zip(videos, names, entries.items(), strict=True)
    )


def _own(table: Path, where: str, entry: Mapping[str, str], asked: TrackRequest) -> TrackRequest:
    """Return what a row of a table asks; an empty cell leaves what is asked of all."""
    own, kinds = dict[str, Any](), get_type_hints(TrackRequest)
    for column, text in entry.items():
        if not text or column in ("path", "name"):
            continue
        name, beside = FORMER.get(column, column), _beside(table, text)
        if name in OWN_FILES:
            own[name] = Path(beside)
        elif name in PRESETS_OR_FILES:
            own[name] = beside if Path(beside).exists() else text
        else:
            own[name] = typed(kinds[name], plain_cell(kinds[name], text), f"{where}: {column}")
    of_row = replace(asked, **own)
    try:
        WantedOfAll.check(of_row)
        positive("budget", of_row.budget)
        of_row.posed()
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return of_row


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
