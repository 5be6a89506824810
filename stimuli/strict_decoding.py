"""Decoders that report damage, where by default they would guess the picture."""

from __future__ import annotations

from av.codec.context import CodecContext

STRICT = {"err_detect": "crccheck+explode"}
# FFmpeg's TIFF decoder then refuses good files too; it reports damage of its own accord.
STRICT_ALREADY = ("tiff",)


def decode_strictly(decoder: CodecContext) -> None:
    """Make a decoder that is not yet open stop at the first error, checksums included."""
    if decoder.name not in STRICT_ALREADY:
        decoder.options = STRICT
