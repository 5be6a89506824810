"""Where a video is: a file here, or at a URL of fsspec, which is read in parts as needed.

Decision (docs/decisions/frame-times.md). Errors take one line and hold no secrets. `file://` is a local
file, which `local_name` names.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote
from urllib.request import url2pathname

from evenlight.data_schema.errors import InputError

FILE = "file://"
WEB = ("http://", "https://")  # in their URLs alone, a question mark begins a query, and % a byte
BLOCK = 2 << 20  # [bytes] that are asked for at once
# What FFmpeg plays and what is nearly always a film; GIFs are mostly pictures.
VIDEO_ENDINGS = (
    ".mp4", ".mkv", ".mov", ".avi", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv", ".flv",
    ".ogv", ".mxf", ".y4m",
)  # fmt: skip


def is_url(name: str) -> bool:
    """Return whether a name is a URL, `file://` included.

    >>> is_url("s3://bucket/film.mp4"), is_url("film.mp4")
    (True, False)
    """
    return "://" in name


def local_name(name: str) -> str:
    """Return the path of a `file://` URL; other names as they are.

    >>> local_name("file:///films/my%20film.mp4"), local_name("s3://bucket/film.mp4")
    ('/films/my film.mp4', 's3://bucket/film.mp4')
    """
    return url2pathname(name[len(FILE) :].removeprefix("localhost")) if name.startswith(FILE) else name


def shown_name(name: str) -> str:
    """Return the name of a video without what may be secret in a URL: user, password, query.

    >>> shown_name("https://me:word@host/film.mp4?X-Amz-Signature=12")
    'https://host/film.mp4'
    """
    return re.sub(r"(?<=://)[^/]*@|[?#].*", "", name, flags=re.DOTALL) if is_url(name) else name


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """A file at a URL that fsspec knows; as a string, its URL without secrets."""

    url: str = field(repr=False)  # with all that it takes to read it

    def __str__(self) -> str:
        return shown_name(self.url)

    @property
    def stem(self) -> str:
        """Last part of its path, without the ending."""
        return PurePosixPath(unquote(str(self)) if self.url.startswith(WEB) else str(self)).stem

    def opened(self) -> Any:
        """Open it to read its bytes, anywhere; what cannot be read is an `InputError`."""
        with at_url(self.url) as (files, path):
            info = files.info(path)
            if info["type"] == "directory":
                raise InputError(f"{self} is a folder; at a URL, give a file (folders of images: here only)")
            if info["size"] == 0:  # of which no server sends a part
                return io.BytesIO()
            # Of each open file, fsspec keeps the last 32 blocks: films go back and forth.
            return files.open(path, "rb", block_size=BLOCK, cache_type="blockcache")


VideoPath = Path | RemoteFile


@contextmanager
def at_url(url: str) -> Iterator[tuple[Any, str]]:
    """Yield the file system of a URL, and its path there."""
    try:
        import fsspec
    except ImportError:
        raise InputError("videos at URLs need an extra: pip install 'evenlight[cluster]'") from None
    with told_in_one_line(url):
        yield fsspec.url_to_fs(url)


@contextmanager
def told_in_one_line(name: str) -> Iterator[None]:
    """Say why a video cannot be read. File systems are other packages, with errors of their own."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        way_out = (
            "; give a URL that can be read, or download it" if is_url(name) else "; give one that can be"
        )
        if isinstance(error, ImportError):  # fsspec names the package to install
            way_out = ""
        raise InputError(f"cannot read {shown_name(name)}: {_reason(error)}{way_out}") from None


def _reason(error: BaseException) -> str:
    while isinstance(error.__cause__, Exception) and not isinstance(error, ImportError):
        error = error.__cause__
    said = getattr(error, "strerror", None) or str(error)
    words = re.sub(r"\S+://\S+", lambda url: shown_name(url[0]), " ".join(said.split()))
    if (status := getattr(error, "status", None)) is not None:  # of HTTP
        return f"the server says {status} {getattr(error, 'message', '')}".rstrip()
    if isinstance(error, ValueError) and ("range requests" in words or "streaming" in words):
        return "the server sends no parts of files (range requests)"
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return "nobody answers there" if isinstance(error, ConnectionError) else words or type(error).__name__


def natural_order(name: str) -> list[tuple[int, str]]:
    """Return a sorting key in which numbers count as numbers.

    >>> sorted(["frame10.png", "frame2.png", "frame1.png"], key=natural_order)
    ['frame1.png', 'frame2.png', 'frame10.png']
    """
    parts = [(digits, words.casefold()) for digits, words in re.findall(r"([0-9]+)|([^0-9]+)", name)]
    return [(int(digits or -1), words) for digits, words in parts] + [(-2, name)]
