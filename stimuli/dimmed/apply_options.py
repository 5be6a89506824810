"""What is chosen when a video is dimmed: the version, and how its file is encoded."""

import enum
from dataclasses import dataclass
from pathlib import Path


class DimmedVersion(enum.Enum):
    """What a video is dimmed by."""

    OURS = "ours"  # its track
    CONSTANT = "constant"  # the constant factor of equal power


class ExportFormat(enum.Enum):
    """The program that a track is exported for."""

    FFMPEG = "ffmpeg"  # a filter script
    MPV = "mpv"  # a Lua script
    JSON = "json"  # an `ExportedTrack`


class AppliedVersion(enum.Enum):
    """What a dimmed video shows."""

    OURS = "ours"
    CONSTANT = "constant"
    SIDE_BY_SIDE = "side-by-side"  # ours left, constant right


class Codec(enum.Enum):
    """How a dimmed video is encoded."""

    H264 = "h264"  # 8 bits, plays everywhere
    HEVC10 = "hevc10"  # 10 bits
    AV1 = "av1"  # 10 bits
    FFV1 = "ffv1"  # without loss, 10 bits or more


@dataclass(frozen=True, slots=True)
class DimmedFile:
    """A dimmed video to be written: where, how encoded, and what it shows."""

    path: Path
    codec: Codec
    version: AppliedVersion = AppliedVersion.OURS
