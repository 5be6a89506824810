"""A track for other programs: times, factors and what is needed to apply them, in one JSON file."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, check_limits, described, quantity
from evenlight.data_schema.tracks.brightness_track import TrackHeader

STEP = (
    "step: a factor holds from the time of its frame until that of the next; "
    "before the first frame the first holds, after the last the last"
)


@dataclass(frozen=True, slots=True)
class ExportedTrack:
    """The brightness factors of a video over time, for any program: `evenlight track export --to json`."""

    video: str = as_in(TrackHeader, "video")
    video_sha256: str | None = described("SHA-256 of the video's file; null if it is not known")
    version: str = described("dimmed by its track, or constantly at equal power", pattern="ours|constant")
    display_name: str = as_in(TrackHeader, "display_name")
    peak_luminance: float = as_in(Display, "peak_luminance")
    gamma: float = as_in(Display, "gamma")
    baseline: float = quantity(
        "1", "the constant factor at which the display takes equal power", above=0.0, maximum=1.0
    )
    interpolation: str = described("which factor holds between the times", pattern="step: .*")
    times: tuple[float, ...] = quantity(
        "s", "when each frame appears, from the first frame on", min_items=1, key="times_s"
    )
    factors: tuple[float, ...] = quantity(
        "1",
        "brightness factor of each frame: of linear light; gamma-encoded values take factor^(1/gamma)",
        above=0.0,
        maximum=1.0,
        min_items=1,
    )
    provenance: Provenance = described("how the file was made")

    def __post_init__(self) -> None:
        check_limits(self)
        if len(self.times) != len(self.factors):
            raise ValueError(
                f"times_s and factors must be equally long, got {len(self.times)} and {len(self.factors)}"
            )
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times_s must rise from frame to frame")
