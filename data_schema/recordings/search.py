"""The Landolt-ring search: its design and its trials (Section 4.2 of the paper)."""

from __future__ import annotations

from evenlight.data_schema.quantities import as_in, count, described, one_line, quantity, record, share
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial, Trial, TrialFlag
from evenlight.data_schema.recordings.viewing import (
    NAME,
    PAPER_SEQUENCES,
    ClipLog,
    RatingDesign,
    RatingTrial,
    Version,
    require_names,
)

# Gap directions of ISO 8596: degrees counter-clockwise from the right.
ORIENTATIONS = (0, 45, 90, 135, 180, 225, 270, 315)
KEYPOINT = f"{NAME[:-1]}/[A-Za-z0-9][A-Za-z0-9 _-]*$"  # a path's name, and a keypoint's


@record
class SearchDesign:
    """Where rings are searched for, how they look, and for how long."""

    sequences: tuple[str, ...] = described(
        "camera paths whose keypoints are used, and whose brightness tracks say how bright it is there",
        default=PAPER_SEQUENCES,
        pattern=NAME,
    )
    keypoints: tuple[str, ...] = described(
        "keypoints as path/name, e.g. library/stacks; empty for all that the paths mark for the search",
        default=(),
        pattern=KEYPOINT,
    )
    ring_gap: float = quantity(
        "arcmin",
        "gap, and stroke, of the ring: a fifth of its diameter",
        above=0.0,
        maximum=600.0,
        default=10.0,
        key="ring_gap_arcmin",
    )
    ring_contrast: float = quantity(
        "1",
        "Weber contrast of the ring against the luminance around it; negative for a dark ring",
        minimum=-1.0,
        maximum=10.0,
        default=-0.15,
    )
    time_limit: float = quantity("s", "time after which a ring counts as undetected", above=0.0, default=30.0)
    field_of_view: float = quantity(
        "deg",
        "how far one may look away from the first direction, to each side",
        above=0.0,
        maximum=180.0,
        default=60.0,
    )
    adaptation_duration: float = quantity("s", "uniform field before each scene", minimum=0.0, default=2.0)
    practice_trials: int = count("practice trials before the session; left out of the analysis", default=2)
    trials_between_breaks: int = count("trials between two breaks; 0 for no breaks", default=12)
    minutes_between_breaks: float = as_in(RampDesign, "minutes_between_breaks")
    max_dropped_share: float = share("a trial with a larger share of dropped frames is flagged", default=0.05)
    repeat_flagged: bool = described(
        "true if a flagged trial is shown again at the end; false because a place that was seen is known",
        default=False,
    )
    order_seed: int = as_in(RatingDesign, "order_seed")

    def __post_init__(self) -> None:
        require_names(self.sequences, "sequences")
        if len(set(self.keypoints)) < len(self.keypoints):
            raise ValueError("keypoints must name none twice")
        for keypoint in self.keypoints:
            if keypoint.partition("/")[0] not in self.sequences:
                raise ValueError(
                    f"keypoint {keypoint!r} is on none of the sequences {', '.join(self.sequences)}"
                )
        if self.ring_contrast == 0:
            raise ValueError("ring_contrast must not be 0: such a ring is not there")


@record
class SearchTrial(Trial):
    """One search for a ring, as one line of `trials.jsonl`."""

    participant_id: str = as_in(RampTrial, "participant_id")
    session_id: str = as_in(RampTrial, "session_id")
    trial_index: int = as_in(RampTrial, "trial_index")
    sequence: str = described("camera path", pattern=NAME)
    keypoint: str = described("point on the camera path")
    version: Version = described("whose brightness the scene had")
    factor: float | None = share("brightness factor b of the scene; null if unknown", above=0.0)
    ring_place: int | None = quantity(
        "1", "which of the keypoint's two places of a ring; null if unknown", minimum=1, maximum=2
    )
    ring_azimuth: float | None = quantity("deg", "azimuth of the ring, from the first direction of view")
    ring_altitude: float | None = quantity("deg", "altitude of the ring, from the horizon")
    ring_gap: float | None = quantity("arcmin", "gap of the ring", above=0.0, key="ring_gap_arcmin")
    ring_contrast: float | None = quantity("1", "Weber contrast of the ring", minimum=-1.0)
    shown_contrast: float | None = quantity(
        "1",
        "that contrast as it left the display: smaller if pixels make the brightness and ring "
        "or surroundings would be darker than the display's black; without reflected light",
        minimum=-1.0,
    )
    ring_orientation: int | None = quantity(
        "deg", "direction of its gap, counter-clockwise from the right; null if unknown"
    )
    background_luminance: float | None = quantity(
        "cd/m^2", "mean luminance around the ring, at full brightness", above=0.0
    )
    gap_pixels: float | None = quantity("1", "size of the gap on the display, in pixels", above=0.0)
    time_limit: float = quantity("s", "time limit of the search", above=0.0)
    found: bool = described(
        "true if the key was pressed before the time limit; false if the key was the answer, and wrong"
    )
    search_time: float = quantity(
        "s",
        "time until the key was pressed; the time limit if nothing was found (censored); less, if a wrong "
        "answer ended the search",
        minimum=0.0,
    )
    reported_orientation: int | None = quantity(
        "deg", "direction of the gap as the participant reported it; null if nothing was found, or unknown"
    )
    response_time: float | None = quantity("s", "from that question to the answer", minimum=0.0)
    simulated: bool = as_in(RampTrial, "simulated")
    practice: bool = as_in(RampTrial, "practice")
    block: int = as_in(RampTrial, "block")
    attempt: int = as_in(RampTrial, "attempt")
    onset: float | None = as_in(RampTrial, "onset")
    noise_seed: int | None = as_in(RampTrial, "noise_seed")
    n_frames: int | None = as_in(RatingTrial, "n_frames")
    frames_dropped: int | None = as_in(RatingTrial, "frames_dropped")
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)
    repetition: int = count("which search of this version at this location, from 1", minimum=1, default=1)

    def __post_init__(self) -> None:
        for name in ("ring_orientation", "reported_orientation"):
            value = getattr(self, name)
            if value is not None and value not in ORIENTATIONS:
                raise ValueError(
                    f"{name}_deg must be one of {', '.join(map(str, ORIENTATIONS))}, got {value}"
                )
        reported = self.reported_orientation is not None
        answered = self.found or self.search_time < self.time_limit
        if reported != answered and (reported or self.ring_orientation is not None):
            raise ValueError(
                "a search that was answered has a reported orientation, where that of the ring is known, and "
                "only such a search"
            )
        if self.search_time > self.time_limit:
            raise ValueError(
                f"search_time_s must be at most the time limit, got {self.search_time:g} of "
                f"{self.time_limit:g} s"
            )

    @property
    def correct(self) -> bool:
        """Whether the ring was found and its gap, where its orientation is known, identified correctly."""
        if self.ring_orientation is None:
            return self.found
        return self.found and self.reported_orientation == self.ring_orientation


@record
class ViewLog:
    """Where a participant looked during a search, as one line of `frames.jsonl`."""

    trial_index: int = as_in(RampTrial, "trial_index")
    attempt: int = as_in(FrameLog, "attempt")
    interval: int = quantity("1", "interval of the trial, always 1", minimum=1, maximum=1)
    flip_times: tuple[float, ...] = quantity(
        "s", "when each refresh appeared, since the first of the scene", minimum=0.0
    )
    azimuths: tuple[float, ...] = quantity("deg", "azimuth of the view, from the first direction")
    altitudes: tuple[float, ...] = quantity("deg", "altitude of the view, from the horizon")
    backlight_factors: tuple[float, ...] = as_in(ClipLog, "backlight_factors")

    def __post_init__(self) -> None:
        n = len(self.flip_times)
        lengths = (len(self.azimuths), len(self.altitudes), len(self.backlight_factors) or n)
        if set(lengths) != {n}:
            raise ValueError(f"the lists of a view log must be equally long, got {n} flip_times")
        if any(later < earlier for earlier, later in zip(self.flip_times, self.flip_times[1:], strict=False)):
            raise ValueError("flip_times_s must not fall")

    def __repr__(self) -> str:
        name = f"trial {self.trial_index}"
        return one_line(self, name, self.flip_times, azimuths=self.azimuths, altitudes=self.altitudes)
