"""The checksums inside FFV1 frames, which FFmpeg's decoder sees fail but does not report (RFC 9043, 4.9)."""

from __future__ import annotations

import zlib

FOOTER = 8  # bytes at the end of a slice: its size (3), an error status (1), parity that makes the CRC 0 (4)
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def slices_intact(frame: bytes) -> bool:
    """Whether the slices of an FFV1 frame, each with a checksum, fill it exactly and are all intact.

    False also for a frame that was written without checksums.
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
