"""Which videos are at a place: a file, a folder or a glob, here or at a URL; and whether one has changed."""

from __future__ import annotations

import glob
import re
from contextlib import suppress
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.video.image_folder import natural_order
from evenlight.stimuli.video.remote_file import (
    WEB,
    RemoteFile,
    file_system,
    is_url,
    local_name,
    shown_name,
    told_in_one_line,
)

# What FFmpeg plays and what is nearly always a film; GIFs are mostly pictures.
VIDEO_ENDINGS = (
    ".mp4", ".mkv", ".mov", ".avi", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv", ".flv",
    ".ogv", ".mxf", ".y4m",
)  # fmt: skip
# What file systems call the state of a content, the surest first.
CONTENT_MARKS = (
    "ETag", "etag", "md5Hash", "Content-MD5", "content_md5", "checksum", "generation", "Last-Modified",
    "LastModified", "last_modified", "modified", "modify", "mtime", "last_write_time", "created",
)  # fmt: skip


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
    found, every = _remote(name) if is_url(name) else _local(name)
    videos = [
        video
        for video, place in found
        if (every or place.suffix.lower() in VIDEO_ENDINGS)
        and not any(part.startswith(".") for part in place.parts)
    ]
    if not videos:
        wanted = "" if every else f"; looked for files that end in {' '.join(VIDEO_ENDINGS)}"
        raise InputError(f"{shown_name(source)}: there are no videos{wanted}")
    return sorted(videos, key=natural_order)


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
    if is_url(name):
        with suppress(InputError):
            info = RemoteFile(name).info()
            marks = [str(info[mark]) for mark in CONTENT_MARKS if info.get(mark)]
            return f"{info.get('size')} {marks[0]}" if marks else None
        return None
    with suppress(OSError):
        if (path := Path(name)).is_file():
            state = path.stat()
            return f"{state.st_size} {state.st_mtime_ns}"
    return None


# Names, with their paths below the place that is named (nothing for itself), and whether all count as videos.
Found = tuple[list[tuple[str, PurePosixPath]], bool]


def _local(name: str) -> Found:
    """Return the files of this computer."""
    top = Path(name)
    if top.is_dir():
        return [
            (str(path), PurePosixPath(path.relative_to(top).as_posix()))
            for path in top.rglob("*")
            if path.is_file()
        ], False
    if top.exists():
        return [(name, PurePosixPath())], True
    if not glob.has_magic(name):
        raise InputError(f"{name}: no such file or folder; give videos, a folder of them, or a glob")
    matched = map(Path, glob.iglob(name, recursive=True))  # noqa: PTH207 - which has no absolute globs
    return [(str(path), PurePosixPath(path.name)) for path in matched if path.is_file()], _has_ending(name)


def _remote(url: str) -> Found:
    """Return the files of another file system; their URLs begin as the one given does."""
    wild = re.search(r"[*[]" if url.startswith(WEB) else r"[*[?]", url)
    base = url[: url.rindex("/", 0, wild.start()) + 1] if wild else url
    files, top = file_system(base)
    with told_in_one_line(url):
        info = files.info(top)
        # A server shows a folder as a page of links.
        if wild is None and info["type"] != "directory" and info.get("mimetype") != "text/html":
            return [(url, PurePosixPath())], True
        top = top.rstrip("/")
        pattern = f"{top}/{url[len(base) :]}"
        found = files.glob(pattern, detail=True) if wild else files.find(top, detail=True)
    below = [path.removeprefix(top).lstrip("/") for path, info in found.items() if info["type"] == "file"]
    return [
        (f"{base.removesuffix('/')}/{path}", PurePosixPath(unquote(path) if url.startswith(WEB) else path))
        for path in below
    ], wild is not None and _has_ending(url)


def _has_ending(pattern: str) -> bool:
    """Return whether a glob says how files end."""
    ending = PurePosixPath(pattern).suffix
    return bool(ending) and not glob.has_magic(ending)
