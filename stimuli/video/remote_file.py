"""Files at URLs of fsspec, read in parts as they are needed; errors take one line and hold no secrets.

Decision (docs/decisions/videos-at-urls.md). `file://` is a local file, which `local_name` names.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
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
EXTRA = "videos at URLs need an extra: pip install 'evenlight[cluster]'"
BLOCK = 2 << 20  # [bytes] that are asked for at once
CACHE = "blockcache"  # of each open file, fsspec keeps the last 32 blocks: films go back and forth


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
    """A file at a URL; as a string, its URL without secrets.

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
    def name(self) -> str:
        """Last part of its path."""
        shown = str(self)
        return PurePosixPath(unquote(shown) if shown.startswith(WEB) else shown).name

    @property
    def stem(self) -> str:
        """Its name without the ending."""
        return PurePosixPath(self.name).stem

    def info(self) -> dict[str, Any]:
        """Return what the file system tells of it: its size, and more or less else.

        Raises
        ------
        InputError
            If it is not there, or nothing can be read there.
        """
        files, path = file_system(self.url)
        with told_in_one_line(self.url):
            return dict(files.info(path))

    def size(self) -> int | None:
        """Return how many bytes it has; None where the file system does not say.

        Raises
        ------
        InputError
            As `info`, and of a folder.
        """
        info = self.info()
        if info["type"] == "directory":
            raise InputError(
                f"{self} is a folder; at a URL, give a file (folders of images are read here only)"
            )
        return None if info["size"] is None else int(info["size"])

    def opened(self) -> io.RawIOBase:
        """Open it to read its bytes, anywhere.

        Raises
        ------
        InputError
            If it is not there, or cannot be read in parts; later, if the server goes away.
        """
        files, path = file_system(self.url)
        with told_in_one_line(self.url):
            return _Reader(self, files.open(path, "rb", block_size=BLOCK, cache_type=CACHE))

    def sha256(self) -> str:
        """Return the SHA-256 of its bytes, which are read once for it."""
        with self.opened() as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()


VideoPath = Path | RemoteFile


class _Reader(io.RawIOBase):
    """An open remote file with a place of its own: `memory://` has one for all who read a file.

    Parameters
    ----------
    file : RemoteFile
        The file.
    stream : file object
        Of fsspec.
    """

    def __init__(self, file: RemoteFile, stream: Any) -> None:
        self.name = file.name  # FFmpeg looks at its ending
        self._url, self._stream, self._at = file.url, stream, 0
        self._size = int(stream.seek(0, io.SEEK_END))

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        view = memoryview(buffer).cast("B")
        with told_in_one_line(self._url):
            self._stream.seek(self._at)
            content = self._stream.read(len(view))
            if not content and len(view) and self._at < self._size:
                raise OSError(f"it ends at byte {self._at} of {self._size}")
        view[: len(content)] = content
        self._at += len(content)
        return len(content)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def close(self) -> None:
        if not self.closed:
            self._stream.close()
        super().close()


def file_system(url: str) -> tuple[Any, str]:
    """Return fsspec's file system of a URL, and the path there.

    Raises
    ------
    InputError
        If fsspec is not installed, does not know the protocol, or needs another package for it.
    """
    try:
        import fsspec
        from fsspec.registry import known_implementations
    except ImportError:
        raise InputError(EXTRA) from None
    protocol = url.partition("://")[0].rpartition("::")[2]
    try:
        found: tuple[Any, str] = fsspec.url_to_fs(url)
        return found
    except ImportError as error:
        package = str(known_implementations[protocol]["class"]).partition(".")[0]
        own = package == "fsspec"  # then the text of the error names what is missing
        needs = error if own else f"needs the package {package}: pip install {package}"
        raise InputError(f"{protocol}:// {needs}") from None
    except Exception as error:
        if protocol not in fsspec.available_protocols():
            known = "https, s3, gs, az, sftp, file"
            raise InputError(
                f"{shown_name(url)}: unknown protocol {protocol}; fsspec knows {known} and others"
            ) from None
        raise InputError(f"{shown_name(url)}: {_reason(error)}") from None


@contextmanager
def told_in_one_line(url: str) -> Iterator[None]:
    """Tell what goes wrong with a remote file in one line, without secrets."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # file systems are other packages, with errors of their own
        raise InputError(
            f"cannot read {shown_name(url)}: {_reason(error)}; give a URL that can be read, or download it"
        ) from None


def _reason(error: BaseException) -> str:
    """Return what was wrong, in a few words: of an error that came of another, that one's."""
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
