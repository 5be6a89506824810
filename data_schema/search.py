"""The Landolt-ring search: its design and its trials (Section 4.2 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.ramp import TrialFlag
from evenlight.data_schema.viewing import NAME, PAPER_SEQUENCES, Version, require_names

# Gap directions of ISO 8596: degrees counter-clockwise from the right.
ORIENTATIONS = (0, 45, 90, 135, 180, 225, 270, 315)
KEYPOINT = "^[A-Za-z0-9][A-Za-z0-9_-]*/[A-Za-z0-9][A-Za-z0-9 _-]*$"


@dataclass(frozen=True, slots=True)
class SearchDesign:
    """Where rings are searched for, how they look, and for how long.

    Attributes
    ----------
    sequences : tuple of str
        Camera paths whose keypoints are used, and whose brightness tracks say how bright it is there.
    keypoints : tuple of str
        Which of their keypoints, as "library/stacks"; empty for all that a path marks for the search.
    ring_gap : float
        Gap, and stroke, of the ring: one fifth of its diameter [arcmin].
    ring_contrast : float
        Weber contrast of the ring against the luminance around it; negative for a dark ring.
    time_limit : float
        After which a ring counts as undetected [s].
    field_of_view : float
        How far one may look away from the first direction, to each side [deg].
    adaptation_duration : float
        Uniform field before each scene [s].
    practice_trials, trials_between_breaks : int
        As in `RampDesign`.
    max_dropped_share : float
        A trial with a larger share of dropped frames is flagged.
    repeat_flagged : bool
        Whether a flagged trial is shown again at the end; False, because a place that was seen is known.
    """

    sequences: tuple[str, ...] = described("camera paths", default=PAPER_SEQUENCES, pattern=NAME)
    keypoints: tuple[str, ...] = described(
        "keypoints as path/name; empty for all that the paths mark", default=(), pattern=KEYPOINT
    )
    ring_gap: float = quantity(
        "arcmin", "gap and stroke; a fifth of the diameter", above=0.0, maximum=600.0, default=10.0,
        key="ring_gap_arcmin",
    )  # fmt: skip
    ring_contrast: float = quantity(
        "1", "Weber contrast against the luminance around it", minimum=-1.0, maximum=10.0, default=-0.15
    )
    time_limit: float = quantity("s", "after which a ring counts as undetected", above=0.0, default=30.0)
    field_of_view: float = quantity(
        "deg", "how far one may look to each side", above=0.0, maximum=180.0, default=60.0
    )
    adaptation_duration: float = quantity("s", "uniform field before each scene", minimum=0.0, default=2.0)
    practice_trials: int = quantity("1", "before the session; left out", minimum=0, default=2)
    trials_between_breaks: int = quantity("1", "0 for no breaks", minimum=0, default=12)
    max_dropped_share: float = quantity(
        "1",
        "a trial with a larger share of dropped frames is flagged",
        minimum=0.0,
        maximum=1.0,
        default=0.05,
    )
    repeat_flagged: bool = described("true if flagged trials are shown again at the end", default=False)

    def __post_init__(self) -> None:
        check_limits(self)
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


@dataclass(frozen=True, slots=True)
class SearchTrial:
    """One search for a ring, as one line of `trials.jsonl`.

    Attributes
    ----------
    participant_id, session_id, trial_index, simulated, practice, block, attempt, onset, noise_seed, \
n_frames, frames_dropped, flag
        As in `RampTrial`.
    sequence, keypoint : str
        Camera path, and the point on it.
    version : Version
        Whose brightness the scene had.
    factor : float
        That brightness factor.
    ring_place : int
        Which of the keypoint's two places of a ring, 1 or 2.
    ring_azimuth, ring_altitude : float
        Where the ring was: from the first direction of view, and from the horizon [deg].
    ring_gap, ring_contrast : float
        Gap [arcmin] and Weber contrast of the ring.
    shown_contrast : float
        That contrast as it left the display: smaller where pixels make the brightness and the dimmed ring, or
        its surroundings, would be darker than the display's black. Reflected light is left out.
    ring_orientation : int
        Direction of its gap, counter-clockwise from the right [deg].
    background_luminance : float
        Mean luminance around the ring at full brightness [cd/m^2].
    gap_pixels : float
        Size of the gap on the display [pixels].
    time_limit : float
        Of the search [s].
    found : bool
        Whether the participant pressed the key before the time limit.
    search_time : float
        Until then; the time limit of a trial that was not found (a censored time) [s].
    reported_orientation : int or None
        Direction of the gap as the participant said; None where nothing was found.
    response_time : float or None
        From that question to the answer [s].
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    sequence: str = described("camera path", pattern=NAME)
    keypoint: str = described("point on the path")
    version: Version = described("whose brightness the scene had")
    factor: float = quantity("1", "that brightness factor", above=0.0, maximum=1.0)
    ring_place: int = quantity("1", "which of the keypoint's two places", minimum=1, maximum=2)
    ring_azimuth: float = quantity("deg", "of the ring, from the first direction of view")
    ring_altitude: float = quantity("deg", "of the ring, from the horizon")
    ring_gap: float = quantity("arcmin", "gap of the ring", above=0.0, key="ring_gap_arcmin")
    ring_contrast: float = quantity("1", "Weber contrast of the ring", minimum=-1.0)
    shown_contrast: float = quantity(
        "1", "that contrast of the light the display emitted, nothing below its black", minimum=-1.0
    )
    ring_orientation: int = quantity("deg", "direction of its gap, counter-clockwise from the right")
    background_luminance: float = quantity("cd/m^2", "around the ring, at full brightness", above=0.0)
    gap_pixels: float = quantity("1", "size of the gap on the display, in pixels", above=0.0)
    time_limit: float = quantity("s", "of the search", above=0.0)
    found: bool = described("true if the key was pressed before the time limit")
    search_time: float = quantity("s", "until then, or the time limit (censored)", minimum=0.0)
    reported_orientation: int | None = quantity("deg", "as the participant said")
    response_time: float | None = quantity("s", "from that question to the answer", minimum=0.0)
    simulated: bool = described("true if a simulated observer answered")
    practice: bool = described("true if it was practice", default=False)
    block: int = quantity("1", "block of the session, from 1; 0 for practice", minimum=0, default=1)
    attempt: int = quantity("1", "above 1 if it was shown before and interrupted", minimum=1, default=1)
    onset: float | None = quantity(
        "s", "first flip of the trial, since the session began", minimum=0.0, default=None
    )
    noise_seed: int | None = quantity("1", "seed of the dithering noise", minimum=0, default=None)
    n_frames: int | None = quantity("1", "refreshes of the display", minimum=0, default=None)
    frames_dropped: int | None = quantity("1", "refreshes without a new frame", minimum=0, default=None)
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)

    def __post_init__(self) -> None:
        check_limits(self)
        for name in ("ring_orientation", "reported_orientation"):
            value = getattr(self, name)
            if value is not None and value not in ORIENTATIONS:
                raise ValueError(
                    f"{name}_deg must be one of {', '.join(map(str, ORIENTATIONS))}, got {value}"
                )
        if self.found != (self.reported_orientation is not None):
            raise ValueError("a ring that was found has a reported orientation, and only such a ring")
        if self.search_time > self.time_limit or (not self.found and self.search_time != self.time_limit):
            raise ValueError(
                f"search_time_s must be the time limit where nothing was found, and at most that, got "
                f"{self.search_time:g} of {self.time_limit:g} s"
            )

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 1

    @property
    def correct(self) -> bool:
        """Whether the ring was found and its gap told rightly."""
        return self.found and self.reported_orientation == self.ring_orientation

    @property
    def usable(self) -> bool:
        """Whether it counts: neither practice nor flagged."""
        return not self.practice and self.flag is TrialFlag.NONE


@dataclass(frozen=True, slots=True)
class ViewLog:
    """Where a participant looked during a search, as one line of `frames.jsonl`.

    Attributes
    ----------
    trial_index, attempt, interval : int
        Which trial; the interval is 1.
    flip_times : tuple of float
        When each refresh appeared, since the first of the scene [s].
    azimuths, altitudes : tuple of float
        Direction of view, from the first one and from the horizon [deg].
    backlight_factors : tuple of float
        What the backlight reported; empty where pixels make the brightness.
    """

    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    attempt: int = quantity("1", "above 1 if it was shown before and interrupted", minimum=1)
    interval: int = quantity("1", "of the trial", minimum=1, maximum=1)
    flip_times: tuple[float, ...] = quantity("s", "of each refresh, since the first", minimum=0.0)
    azimuths: tuple[float, ...] = quantity("deg", "of the view, from the first direction")
    altitudes: tuple[float, ...] = quantity("deg", "of the view, from the horizon")
    backlight_factors: tuple[float, ...] = quantity(
        "1", "as the backlight reported; empty where pixels make the brightness", minimum=0.0, default=()
    )

    def __post_init__(self) -> None:
        check_limits(self)
        n = len(self.flip_times)
        lengths = (len(self.azimuths), len(self.altitudes), len(self.backlight_factors) or n)
        if set(lengths) != {n}:
            raise ValueError(f"the lists of a view log must be equally long, got {n} flip_times")
        if any(later < earlier for earlier, later in zip(self.flip_times, self.flip_times[1:], strict=False)):
            raise ValueError("flip_times_s must not fall")
