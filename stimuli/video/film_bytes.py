"""The bytes of a film, here or at a URL, for FFmpeg: one pass gives its packets and its SHA-256."""

from __future__ import annotations

import hashlib
import io
import zlib
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath
from typing import Any

from evenlight.data_schema.storage.input_files import open_input
from evenlight.stimuli.video.video_locations import BLOCK, VideoPath, told_in_one_line

FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
READ_FILMS: dict[str, str] = {}  # SHA-256 of each film when it was read last, by its path or URL


class FilmBytes(AbstractContextManager["FilmBytes"]):
    """An open film with a place of its own: `memory://` has one for all who read a file.

    What is read in its order is hashed on the way. A demuxer reads nearly all of a film so: but for an index
    at the end, `sha256` has nothing left to read.

    Parameters
    ----------
    path : Path or RemoteFile
        The film; what cannot be read of it is an `InputError`.

    Attributes
    ----------
    size : int
        How many bytes it had when it was opened.
    """

    def __init__(self, path: VideoPath) -> None:
        self.name = PurePosixPath(str(path)).name  # FFmpeg looks at the ending
        self._path, self._place = path, 0
        self._hash, self._hashed = hashlib.sha256(), 0
        with told_in_one_line(str(path)):
            self._stream: Any = open_input(path, "a video") if isinstance(path, Path) else path.opened()
            self.size = int(self._stream.seek(0, io.SEEK_END))

    def read(self, size: int) -> bytes:
        """Return the next bytes, as far as there are so many."""
        with told_in_one_line(str(self._path)):
            self._stream.seek(self._place)
            content: bytes = self._stream.read(size)
            if not content and size and self._place < self.size:
                raise OSError(f"it ends at byte {self._place} of {self.size}")
        known = self._hashed - self._place
        self._place += len(content)
        if 0 <= known < len(content):
            self._hash.update(memoryview(content)[known:])
            self._hashed = self._place
        return content

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place, and return it [bytes]."""
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self.size}[whence]
        return self._place

    def tell(self) -> int:
        """Return the place of the next byte; FFmpeg seeks in what has one."""
        return self._place

    def sha256(self) -> str:
        """Return the SHA-256 of all bytes; those that are not hashed yet are read."""
        self.seek(self._hashed)
        while self.read(BLOCK):
            pass
        name = str(self._path) if isinstance(self._path, Path) else self._path.url
        READ_FILMS[name] = self._hash.hexdigest()
        return READ_FILMS[name]

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def slices_intact(frame: bytes) -> bool:
    """Whether the slices of an FFV1 frame, each with a checksum, fill it exactly and are all intact.

    FFmpeg's decoder sees checksums fail but does not report it. False also for a frame without checksums.
    """
    end = len(frame)
    while end > 0:
        size = FOOTER + int.from_bytes(frame[max(end - FOOTER, 0) : end - FOOTER + 3], "big")
        if end < size or _crc(frame[end - size : end]) != 0:
            return False
        end -= size
    return True


def _crc(slice_: bytes) -> int:
    """Return the CRC of RFC 9043, 4.9.3, bits reversed: polynomial 0x04C11DB7, highest bit first, start 0.

    zlib has the same polynomial from the lowest bit on, between two inversions.
    """
    return zlib.crc32(slice_.translate(_REVERSED_BITS), 0xFFFFFFFF) ^ 0xFFFFFFFF
