"""The viewing experiments on whole sequences: detail rating and artifact comparison (Sections 4.1, 4.3)."""

from __future__ import annotations

import enum
import itertools
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.ramp import Response, TrialFlag

NAME = "^[A-Za-z0-9][A-Za-z0-9_-]*$"
PAPER_SEQUENCES = ("library", "gym", "living_room", "basement")
LOWEST_RATING, HIGHEST_RATING = 1, 5


class Version(enum.Enum):
    """How a sequence is dimmed."""

    OURS = "ours"  # by its brightness track
    BASELINE = "baseline"  # constantly, at the same mean power


@dataclass(frozen=True, slots=True)
class Stimulus:
    """A sequence that a session shows in both versions, as its manifest has it.

    Attributes
    ----------
    name : str
        Of the sequence, and of its folder.
    video_sha256, track_sha256 : str
        Of the video file, or of all that a search along its path shows, and of `track.csv`; the first is
        empty where nothing is shown.
    frames : int
        Of the video, and of the track.
    duration : float
        Of the video [s].
    mean_factor, baseline_factor : float
        Mean brightness factor of the track, and the constant one of the baseline.
    """

    name: str = described("name of the sequence, and of its folder", pattern=NAME)
    video_sha256: str = described(
        "of the video, or of scenes, path and rings of a search; empty where nothing is shown"
    )
    track_sha256: str = described("of track.csv")
    frames: int = quantity("1", "of video and track", minimum=1)
    duration: float = quantity("s", "of the video", above=0.0)
    mean_factor: float = quantity("1", "mean brightness factor of the track", above=0.0, maximum=1.0)
    baseline_factor: float = quantity(
        "1", "constant brightness factor of the baseline", above=0.0, maximum=1.0
    )

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class RatingDesign:
    """Which sequences are rated, how often, in which order.

    Attributes
    ----------
    sequences : tuple of str
        Names of the sequences, each shown in both versions.
    repetitions : int
        How often each version of each sequence is rated.
    versions_together : bool
        Whether the two versions of a sequence follow each other, as in the paper; else all are mixed.
    adaptation_duration : float
        Uniform field before each video [s].
    practice_trials : int
        Short excerpts before the session; left out of the analysis.
    practice_duration : float
        Of such an excerpt [s].
    trials_between_breaks : int
        0 for no breaks.
    max_dropped_share : float
        A trial with a larger share of dropped frames is flagged.
    repeat_flagged : bool
        Whether a flagged trial is shown again at the end of the session.
    """

    sequences: tuple[str, ...] = described("names of the sequences", default=PAPER_SEQUENCES, pattern=NAME)
    repetitions: int = quantity("1", "ratings of each version of each sequence", minimum=1, default=1)
    versions_together: bool = described(
        "true if the two versions of a sequence follow each other", default=True
    )
    adaptation_duration: float = quantity("s", "uniform field before each video", minimum=0.0, default=2.0)
    practice_trials: int = quantity("1", "excerpts before the session; left out", minimum=0, default=2)
    practice_duration: float = quantity("s", "of such an excerpt", above=0.0, default=10.0)
    trials_between_breaks: int = quantity("1", "0 for no breaks", minimum=0, default=4)
    max_dropped_share: float = quantity(
        "1",
        "a trial with a larger share of dropped frames is flagged",
        minimum=0.0,
        maximum=1.0,
        default=0.01,
    )
    repeat_flagged: bool = described("true if flagged trials are shown again at the end", default=True)

    def __post_init__(self) -> None:
        check_limits(self)
        require_names(self.sequences, "sequences")


@dataclass(frozen=True, slots=True)
class ComparisonDesign:
    """Which sequences are compared in their two versions, how often, in which order.

    Attributes
    ----------
    sequences : tuple of str
        Names of the sequences.
    repetitions : int
        How often each is compared; in half of the comparisons the modulated version comes first.
    adaptation_duration : float
        Uniform field before each of the two videos [s].
    practice_trials, practice_duration, trials_between_breaks, max_dropped_share, repeat_flagged
        As in `RatingDesign`.
    """

    sequences: tuple[str, ...] = described("names of the sequences", default=PAPER_SEQUENCES, pattern=NAME)
    repetitions: int = quantity("1", "comparisons of each sequence", minimum=1, default=1)
    adaptation_duration: float = quantity("s", "uniform field before each video", minimum=0.0, default=2.0)
    practice_trials: int = quantity("1", "excerpts before the session; left out", minimum=0, default=1)
    practice_duration: float = quantity("s", "of such an excerpt", above=0.0, default=10.0)
    trials_between_breaks: int = quantity("1", "0 for no breaks", minimum=0, default=2)
    max_dropped_share: float = quantity(
        "1",
        "a trial with a larger share of dropped frames is flagged",
        minimum=0.0,
        maximum=1.0,
        default=0.01,
    )
    repeat_flagged: bool = described("true if flagged trials are shown again at the end", default=True)

    def __post_init__(self) -> None:
        check_limits(self)
        require_names(self.sequences, "sequences")


def require_names(names: tuple[str, ...], what: str) -> None:
    """Refuse a list of names that is empty, or names something twice."""
    if not names or len(set(names)) < len(names):
        raise ValueError(f"{what} must name at least one, and none twice, got {len(names)} of them")


@dataclass(frozen=True, slots=True)
class RatingTrial:
    """One rated video, as one line of `trials.jsonl`.

    Attributes
    ----------
    participant_id, session_id, trial_index, simulated, practice, block, attempt, onset, noise_seed, \
n_frames, frames_dropped, flag
        As in `RampTrial`.
    sequence : str
        What was shown.
    version : Version
        How it was dimmed.
    repetition : int
        Which rating of this version, from 1.
    place_in_pair : int
        1 if this version of the sequence was shown before the other, else 2.
    mean_factor : float
        Mean brightness factor of what was shown.
    rating : int
        Quality and saliency of details, 1 (low) to 5 (high).
    response_time : float or None
        From the question to the answer [s].
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    sequence: str = described("what was shown", pattern=NAME)
    version: Version = described("how it was dimmed")
    repetition: int = quantity("1", "which rating of this version, from 1", minimum=1)
    place_in_pair: int = quantity("1", "1 if shown before the other version", minimum=1, maximum=2)
    mean_factor: float = quantity("1", "mean brightness factor shown", above=0.0, maximum=1.0)
    rating: int = quantity(
        "1", "quality and saliency of details", minimum=LOWEST_RATING, maximum=HIGHEST_RATING
    )
    response_time: float | None = quantity("s", "from the question to the answer", minimum=0.0)
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

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 1

    @property
    def usable(self) -> bool:
        """Whether it counts: neither practice nor flagged."""
        return not self.practice and self.flag is TrialFlag.NONE


@dataclass(frozen=True, slots=True)
class ComparisonTrial:
    """One comparison of the two versions of a sequence, as one line of `trials.jsonl`.

    Attributes
    ----------
    participant_id, session_id, trial_index, simulated, practice, block, attempt, onset, noise_seed, \
n_frames, frames_dropped, flag
        As in `RampTrial`.
    sequence : str
        What was shown.
    repetition : int
        Which comparison of this sequence, from 1.
    ours_interval : int
        Which of the two was the modulated version, 1 or 2.
    mean_factor, baseline_factor : float
        Mean brightness factor of the two versions.
    response : Response
        Which of the two showed a change in brightness: first or second.
    response_time : float or None
        From the question to the answer [s].
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    sequence: str = described("what was shown", pattern=NAME)
    repetition: int = quantity("1", "which comparison of this sequence, from 1", minimum=1)
    ours_interval: int = quantity("1", "which of the two was modulated", minimum=1, maximum=2)
    mean_factor: float = quantity("1", "mean factor of the modulated version", above=0.0, maximum=1.0)
    baseline_factor: float = quantity("1", "factor of the constant version", above=0.0, maximum=1.0)
    response: Response = described("which of the two showed a change in brightness: first, second")
    response_time: float | None = quantity("s", "from the question to the answer", minimum=0.0)
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
        if self.response not in (Response.FIRST, Response.SECOND):
            raise ValueError(f"response must be 'first' or 'second', got {self.response.value!r}")

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 2

    @property
    def chose_ours(self) -> bool:
        """Whether the modulated version was said to have changed."""
        return (self.response is Response.FIRST) == (self.ours_interval == 1)

    @property
    def usable(self) -> bool:
        """Whether it counts: neither practice nor flagged."""
        return not self.practice and self.flag is TrialFlag.NONE


@dataclass(frozen=True, slots=True)
class ClipLog:
    """What the display showed of a video in one interval of a trial, as one line of `frames.jsonl`.

    Attributes
    ----------
    trial_index, attempt, interval : int
        Which interval of which trial.
    flip_times : tuple of float
        When each refresh appeared, since the first of the interval [s].
    video_frames : tuple of int
        Frame of the video that it showed, from 0.
    factors : tuple of float
        Brightness factor b that it showed.
    backlight_factors : tuple of float
        What the backlight reported; empty where pixels make the brightness.
    probe_refreshes : tuple of int
        Refreshes that were read back from the window.
    probe_luminance : tuple of float
        Mean luminance of the video's middle, up to 256 x 256 pixels, then [cd/m^2].
    probe_intended : tuple of float
        What it was to be, of the frame and factor [cd/m^2].
    waited : float
        How long the uniform field before it lasted beyond its time, until enough was decoded [s].
    """

    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    attempt: int = quantity("1", "above 1 if it was shown before and interrupted", minimum=1)
    interval: int = quantity("1", "of the trial", minimum=1, maximum=2)
    flip_times: tuple[float, ...] = quantity("s", "of each refresh, since the first", minimum=0.0)
    video_frames: tuple[int, ...] = quantity("1", "frame of the video that it showed", minimum=0)
    factors: tuple[float, ...] = quantity("1", "brightness factor that it showed", above=0.0, maximum=1.0)
    backlight_factors: tuple[float, ...] = quantity(
        "1", "as the backlight reported; empty where pixels make the brightness", minimum=0.0, default=()
    )
    probe_refreshes: tuple[int, ...] = quantity(
        "1", "refreshes read back from the window", minimum=0, default=()
    )
    probe_luminance: tuple[float, ...] = quantity("cd/m^2", "their mean", minimum=0.0, default=())
    probe_intended: tuple[float, ...] = quantity("cd/m^2", "what it was to be", minimum=0.0, default=())
    waited: float = quantity(
        "s", "how much longer than meant the uniform field before it lasted", minimum=0.0, default=0.0
    )

    def __post_init__(self) -> None:
        check_limits(self)
        n = len(self.flip_times)
        if len(self.video_frames) != n or len(self.factors) != n or len(self.backlight_factors) not in (0, n):
            raise ValueError(f"the lists of a clip log must be equally long, got {n} flip_times")
        if not len(self.probe_refreshes) == len(self.probe_luminance) == len(self.probe_intended):
            raise ValueError("the probe lists of a clip log must be equally long")
        for name in ("flip_times", "video_frames"):
            values = getattr(self, name)
            if any(later < earlier for earlier, later in itertools.pairwise(values)):
                raise ValueError(f"{name} must not fall")
