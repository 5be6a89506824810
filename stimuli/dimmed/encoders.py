"""What dimmed videos are written with: codecs, their settings, and the kinds of files that hold them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from evenlight.data_schema.errors import ArgumentError
from evenlight.stimuli.dimmed.apply_options import Codec
from evenlight.stimuli.video_writer import FFV1_OPTIONS


@dataclass(frozen=True, slots=True)
class Encoder:
    """An encoder and its settings."""

    name: str  # FFmpeg's
    bits: tuple[int, ...]  # a sample may have; of a deeper source the deepest is taken
    layouts: tuple[str, ...]  # how Y', Cb, Cr are sampled that it takes
    endings: tuple[str, ...]  # files that can hold what it writes
    options: dict[str, str] = field(default_factory=dict)
    tag: str | None = None  # the codec's name in MP4, where players want another than FFmpeg's usual one

    def bits_for(self, source: int) -> int:
        """Return the bits that samples of a source are written with: no fewer where there are as many."""
        return next((bits for bits in self.bits if bits >= source), self.bits[-1])


USUAL = {".mp4": Codec.H264, ".mov": Codec.H264, ".mkv": Codec.FFV1}  # what files of an ending hold
LAYOUTS = ("420", "422", "444")
# The quality at which a dark gradient keeps its dithered means (docs/decisions/dimming-in-files.md).
OPTIONS_H264 = {"crf": "14", "preset": "medium", "aq-mode": "3"}
OPTIONS_HEVC = {"crf": "14", "preset": "medium", "x265-params": "log-level=none"}
ENCODERS = {
    Codec.H264: Encoder("libx264", (8,), LAYOUTS, tuple(USUAL), OPTIONS_H264),
    Codec.HEVC10: Encoder("libx265", (10,), LAYOUTS, tuple(USUAL), OPTIONS_HEVC, tag="hvc1"),
    Codec.AV1: Encoder("libsvtav1", (10,), ("420",), (".mp4", ".mkv"), {"crf": "13", "preset": "8"}),
    Codec.FFV1: Encoder("ffv1", (10, 12, 14, 16), LAYOUTS, (".mkv",), FFV1_OPTIONS),
}


def codec_for(out: Path, asked: Codec | None) -> Codec:
    """Return the codec of a file: the one asked for, or what files of its ending usually hold.

    Raises
    ------
    InputError
        If no such files are written, or they cannot hold the codec.
    """
    ending = out.suffix.lower()
    if ending not in USUAL:
        raise ArgumentError(
            "out", f"{out}: need a name that ends in {', '.join(USUAL)}, got {ending or 'none'}"
        )
    codec = asked or USUAL[ending]
    endings = ENCODERS[codec].endings
    if ending not in endings:
        raise ArgumentError(
            "out",
            f"{out}: {ending} files cannot hold {codec.value}; give a name that ends in "
            f"{' or '.join(endings)}, or `codec` {USUAL[ending].value}",
        )
    return codec
