"""What several measures of loss say of one brightness track: the results of `evenlight judge`."""

from __future__ import annotations

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, described, quantity, record, share
from evenlight.data_schema.tracks.brightness_track import TrackHeader
from evenlight.data_schema.tracks.optimization_summary import MeasuredTrack, OptimizationSummary


@record
class MeasureAgreement:
    """Whether two measures put the frames in one order at constant dimming."""

    first: str = described("name of a measure")
    second: str = described("name of another")
    correlation: float | None = quantity(
        "1",
        "Spearman's rank correlation of their losses over the frames; null where one is the same in all",
        minimum=-1.0,
        maximum=1.0,
    )


@record
class ModulationStretch:
    """How visible ColorVideoVDP finds the movement of a track in a stretch of the video."""

    begin: float = quantity("s", "when its first frame appears", minimum=0.0)
    end: float = quantity("s", "when its last frame appears", minimum=0.0)
    lowest_factor: float = share("smallest brightness factor in it", above=0.0)
    highest_factor: float = share("largest brightness factor in it", above=0.0)
    jod: float = quantity(
        "JOD",
        "quality beside the same stretch dimmed evenly to its mean factor; 10 for no difference",
        maximum=10.0,
    )
    jod_flicker: float = quantity(
        "JOD", "the same for that even dimming with 2 % of flicker at 5 Hz, for comparison", maximum=10.0
    )


@record
class Judgement:
    """What several measures of loss say of a track; `judgement.json`."""

    video: str = as_in(TrackHeader, "video")
    display: str = as_in(OptimizationSummary, "display")
    frames: int = as_in(OptimizationSummary, "frames")
    mean_factor: float = as_in(OptimizationSummary, "mean_factor")
    constant_factor: float = as_in(OptimizationSummary, "baseline_factor")
    measured: tuple[MeasuredTrack, ...] = described("what each measure says")
    agreements: tuple[MeasureAgreement, ...] = described("how each pair of measures agrees")
    modulation: tuple[ModulationStretch, ...] = described(
        "ColorVideoVDP on the stretches in which the track moves most; empty where it was not asked"
    )
    modulation_note: str = described("how that was made, or why it is not there")
    provenance: Provenance = described("how the file was made")
    field_of_view: float | None = as_in(TrackHeader, "field_of_view")
