"""Where videos are: files, folders and globs, here or at URLs of fsspec, which are read in parts as needed.

Decision (docs/decisions/videos-at-urls.md). Errors take one line and hold no secrets. `file://` is a local
file, which `local_name` names.
"""

from __future__ import annotations

import glob
import hashlib
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote
from urllib.request import url2pathname

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

FILE = "file://"
WEB = ("http://", "https://")  # in their URLs alone, a question mark begins a query, and % a byte
BLOCK = 2 << 20  # [bytes] that are asked for at once
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
    if not is_url(name):
        return name
    parts = (re.sub(r"(?<=://)[^/]*@", "", part) for part in name.split("::"))
    return "::".join(re.sub(r"[?#].*", "", part, flags=re.DOTALL) for part in parts)


@dataclass(frozen=True, slots=True, repr=False)
class RemoteFile:
    """A file at a URL; as a string, its URL without secrets. What cannot be read is an `InputError`.

    Attributes
    ----------
    url : str
        A URL that fsspec knows, with all that it takes to read it.
    """

    url: str

    def __str__(self) -> str:
        return shown_name(self.url)

    def __repr__(self) -> str:
        return f"RemoteFile({str(self)!r})"

    @property
    def stem(self) -> str:
        """Last part of its path, without the ending."""
        return PurePosixPath(unquote(str(self)) if self.url.startswith(WEB) else str(self)).stem

    def info(self) -> dict[str, Any]:
        """Return what the file system tells of it: its size, and more or less else."""
        with _at(self.url) as (files, path):
            return dict(files.info(path))

    def size(self) -> int | None:
        """Return how many bytes it has; None where the file system does not say."""
        info = self.info()
        if info["type"] == "directory":
            raise InputError(
                f"{self} is a folder; at a URL, give a file (folders of images are read here only)"
            )
        return None if info["size"] is None else int(info["size"])

    def opened(self) -> io.RawIOBase:
        """Open it to read its bytes, anywhere."""
        with _at(self.url) as (files, path):
            # Of each open file, fsspec keeps the last 32 blocks: films go back and forth.
            return _Reader(self.url, files.open(path, "rb", block_size=BLOCK, cache_type="blockcache"))

    def sha256(self) -> str:
        """Return the SHA-256 of its bytes, which are read once for it."""
        with self.opened() as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()


VideoPath = Path | RemoteFile


class _Reader(io.RawIOBase):
    """An open remote file with a place of its own: `memory://` has one for all who read a file."""

    def __init__(self, url: str, stream: Any) -> None:
        self.name = PurePosixPath(shown_name(url)).name  # FFmpeg looks at its ending
        self._url, self._stream, self._place = url, stream, 0
        self._size = int(stream.seek(0, io.SEEK_END))

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        view = memoryview(buffer).cast("B")
        with _told_in_one_line(self._url):
            self._stream.seek(self._place)
            content = self._stream.read(len(view))
            if not content and len(view) and self._place < self._size:
                raise OSError(f"it ends at byte {self._place} of {self._size}")
        view[: len(content)] = content
        self._place += len(content)
        return len(content)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        return self._place

    def close(self) -> None:
        if not self.closed:
            self._stream.close()
        super().close()


@contextmanager
def _at(url: str) -> Iterator[tuple[Any, str]]:
    try:
        import fsspec
    except ImportError:
        raise InputError("videos at URLs need an extra: pip install 'evenlight[cluster]'") from None
    with _told_in_one_line(url):
        yield fsspec.url_to_fs(url)


@contextmanager
def _told_in_one_line(url: str) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except ImportError as error:  # of the package that a protocol needs, which fsspec names
        raise InputError(f"cannot read {shown_name(url)}: {error}") from None
    except Exception as error:  # file systems are other packages, with errors of their own
        raise InputError(
            f"cannot read {shown_name(url)}: {_reason(error)}; give a URL that can be read, or download it"
        ) from None


def _reason(error: BaseException) -> str:
    while isinstance(error.__cause__, Exception):
        error = error.__cause__
    if (status := getattr(error, "status", None)) is not None:  # of HTTP
        return f"the server says {status} {getattr(error, 'message', '')}".rstrip()
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, ConnectionError):
        return "nobody answers there"
    if isinstance(error, ValueError) and ("range requests" in str(error) or "streaming" in str(error)):
        return "the server sends no parts of files (range requests)"
    words = re.sub(r"\S+://\S+", lambda url: shown_name(url[0]), " ".join(str(error).split()))
    return words or type(error).__name__


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
            info = RemoteFile(name).info()
            marks = [str(info[mark]) for mark in CONTENT_MARKS if info.get(mark)]
            return f"{info.get('size')} {marks[0]}" if marks else None
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
    found, every = _remote(name) if is_url(name) else _local(Path(name))
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


def natural_order(name: str) -> list[tuple[int, str]]:
    """Return a sorting key in which numbers count as numbers.

    >>> sorted(["frame10.png", "frame2.png", "frame1.png"], key=natural_order)
    ['frame1.png', 'frame2.png', 'frame10.png']
    """
    parts = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(int(part), "") if part[0] in "0123456789" else (-1, part.casefold()) for part in parts] + [
        (-2, name)
    ]


# Names, with their paths below the place that is named (nothing for itself), and whether all count as videos.
Found = tuple[list[tuple[str, PurePosixPath]], bool]


def _local(top: Path) -> Found:
    if top.exists() and not top.is_dir():
        return [(str(top), PurePosixPath())], True
    if top.is_dir():
        below = [(path, path.relative_to(top).as_posix()) for path in top.rglob("*")]
    elif glob.has_magic(str(top)):
        matched = map(Path, glob.iglob(str(top), recursive=True))  # noqa: PTH207 - which has no absolute globs
        below = [(path, path.name) for path in matched]
    else:
        raise InputError(f"{top}: no such file or folder; give videos, a folder of them, or a glob")
    every = not top.is_dir() and _says_ending(str(top))
    return [(str(path), PurePosixPath(name)) for path, name in below if path.is_file()], every


def _remote(url: str) -> Found:
    wild = re.search(r"[*[]" if url.startswith(WEB) else r"[*[?]", url)
    base = url[: url.rindex("/", 0, wild.start()) + 1] if wild else url
    with _at(base) as (files, top):
        info = files.info(top)
        # A server shows a folder as a page of links.
        if wild is None and info["type"] != "directory" and info.get("mimetype") != "text/html":
            return [(url, PurePosixPath())], True
        folder = top.rstrip("/")
        pattern = f"{folder}/{url[len(base) :]}"
        found = files.glob(pattern, detail=True) if wild else files.find(folder, detail=True)
    below = [path.removeprefix(folder).lstrip("/") for path, info in found.items() if info["type"] == "file"]
    return [
        (f"{base.removesuffix('/')}/{path}", PurePosixPath(unquote(path) if url.startswith(WEB) else path))
        for path in below
    ], wild is not None and _says_ending(url)


def _says_ending(pattern: str) -> bool:
    ending = PurePosixPath(pattern).suffix
    return bool(ending) and not glob.has_magic(ending)
