"""The videos of a catalogue: files, folders and globs, here or at URLs, and what tells a change of them."""

from __future__ import annotations

import glob
import re
from contextlib import suppress
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.video_locations import (
    VIDEO_ENDINGS,
    WEB,
    at_url,
    is_url,
    local_name,
    natural_order,
    shown_name,
)

# What file systems call the state of a content, the surest first.
CONTENT_MARKS = ("etag", "md5", "checksum", "generation", "modif", "mtime", "last_write", "created")


def file_state(name: str) -> str | None:
    """Return words that change when the content of a video's file does, without reading it.

    Parameters
    ----------
    name : str
        As in `open_video`.

    Returns
    -------
    str or None
        Size and time of the last change, or a checksum that the file system keeps; None where nothing tells.
    """
    name = local_name(name)
    with suppress(InputError, OSError):
        if is_url(name):
            with at_url(name) as (files, place):
                info = files.info(place)
            told = [info[key] for mark in CONTENT_MARKS for key in info if mark in key.lower() and info[key]]
            return f"{info.get('size')} {told[0]}" if told else None
        if (path := Path(name)).is_file():
            state = path.stat()
            return f"{state.st_size} {state.st_mtime_ns}"
    return None


def videos_at(source: str) -> list[str]:
    """Return the names of the videos at a place, in natural order; each is one for `open_video`.

    Parameters
    ----------
    source : str
        A file; a folder, with all below it; a glob such as `films/**/*.mkv`; or a URL of one of these. Files
        are known as videos by their endings (`VIDEO_ENDINGS`), unless they are named, or the ending is in the
        glob. Hidden files and folders are passed over.

    Raises
    ------
    InputError
        If there is nothing, or no video.
    """
    name = local_name(source)
    found, wild = _remote(name) if is_url(name) else _local(Path(name))
    ending = PurePosixPath(name).suffix if wild else ""
    every = bool(ending) and not glob.has_magic(ending)
    videos = [
        video
        for video, below in found
        if (every or not below or PurePosixPath(below).suffix.lower() in VIDEO_ENDINGS)
        and not re.search(r"(^|/)\.", below)
    ]
    if not videos:
        wanted = "" if every else f"; looked for files that end in {' '.join(VIDEO_ENDINGS)}"
        raise InputError(f"{shown_name(source)}: there are no videos{wanted}")
    return sorted(videos, key=natural_order)


# Names of files, with their paths below the place that is named (empty for itself), and whether it is a glob.
Found = tuple[list[tuple[str, str]], bool]


def _local(top: Path) -> Found:
    if top.exists() and not top.is_dir():
        return [(str(top), "")], False
    if top.is_dir():
        return [(str(p), p.relative_to(top).as_posix()) for p in top.rglob("*") if p.is_file()], False
    if not glob.has_magic(str(top)):
        raise InputError(f"{top}: no such file or folder; give videos, a folder of them, or a glob")
    matched = map(Path, glob.iglob(str(top), recursive=True))  # noqa: PTH207 - which has no absolute globs
    return [(str(path), path.name) for path in matched if path.is_file()], True


def _remote(url: str) -> Found:
    web = url.startswith(WEB)
    wild = re.search(r"[*[]" if web else r"[*[?]", url)
    base = url[: url.rindex("/", 0, wild.start()) + 1] if wild else url
    with at_url(base) as (files, top):
        info, folder = files.info(top), top.rstrip("/")
        # A server shows a folder as a page of links.
        if wild is None and info["type"] != "directory" and info.get("mimetype") != "text/html":
            return [(url, "")], False
        pattern = f"{folder}/{url[len(base) :]}"
        found = files.glob(pattern, detail=True) if wild else files.find(folder, detail=True)
    below = [path.removeprefix(folder).lstrip("/") for path, info in found.items() if info["type"] == "file"]
    top = base.removesuffix("/")
    return [(f"{top}/{path}", unquote(path) if web else path) for path in below], wild is not None
