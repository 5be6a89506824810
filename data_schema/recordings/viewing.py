"""The viewing experiments on whole sequences: detail rating and artifact comparison (Sections 4.1, 4.3)."""

from __future__ import annotations

import enum
import itertools
import re
import statistics
import unicodedata
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from numbers import Real
from typing import Any

from evenlight.data_schema.quantities import as_in, count, described, one_line, quantity, record, share
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial, Response, Trial, TrialFlag

# Letters of all scripts, by ranges that ECMA's expressions, of JSON Schema, know as Python's do.
LETTERS = r"0-9A-Za-z\u00c0-\u1fff\u2c00-\u2dff\u3005-\ud7ff"
NAME = f"^[{LETTERS}][{LETTERS}_-]*$"
PAPER_SEQUENCES = ("library", "gym", "living_room", "basement")
LOWEST_RATING, HIGHEST_RATING = 1, 5


def name_in(text: str) -> str:
    """Return the name that a text makes: its letters and digits, and _ for what is between them.

    >>> name_in("Küche (abends)")
    'Küche_abends'
    """
    return re.sub(f"[^{LETTERS}_-]+", "_", unicodedata.normalize("NFC", text)).strip("_-")


class Version(enum.Enum):
    """How a sequence is dimmed."""

    OURS = "ours"  # by its brightness track
    BASELINE = "baseline"  # constantly, at the same mean power


@record
class Stimulus:
    """A sequence that a session shows in both versions, as its manifest has it."""

    name: str = described("name of the sequence, and of its folder", pattern=NAME)
    video_sha256: str = described(
        "SHA-256 of the video file, or of scenes, path and rings of a search; empty if nothing is shown"
    )
    track_sha256: str = described("SHA-256 of track.csv")
    frames: int = count("frames of the video and of the track", minimum=1)
    duration: float = quantity("s", "duration of the video", above=0.0)
    mean_factor: float = share("mean brightness factor of the track", above=0.0)
    baseline_factor: float = share("constant brightness factor of the baseline", above=0.0)
    pixels_per_degree: float | None = quantity(
        "1/deg",
        "pixels of the video per degree of visual angle, in its middle, as it is shown; null if nothing is, "
        "or in older files",
        above=0.0,
        default=None,
    )


@record
class RatingDesign:
    """Which sequences are rated, how often, in which order."""

    sequences: tuple[str, ...] = described(
        "names of the sequences, each shown in both versions", default=PAPER_SEQUENCES, pattern=NAME
    )
    repetitions: int = count("ratings of each version of each sequence", minimum=1, default=1)
    versions_together: bool = described(
        "true if the two versions of a sequence follow each other, as in the paper; else all are mixed",
        default=True,
    )
    adaptation_duration: float = quantity("s", "uniform field before each video", minimum=0.0, default=2.0)
    practice_trials: int = count("short excerpts before the session; left out of the analysis", default=2)
    practice_duration: float = quantity("s", "duration of such an excerpt", above=0.0, default=10.0)
    trials_between_breaks: int = count("trials between two breaks; 0 for no breaks", default=4)
    minutes_between_breaks: float = as_in(RampDesign, "minutes_between_breaks")
    max_dropped_share: float = share("a trial with a larger share of dropped frames is flagged", default=0.01)
    repeat_flagged: bool = as_in(RampDesign, "repeat_flagged")
    order_seed: int = count("draws the orders of all participants, within their balance", default=1)

    def __post_init__(self) -> None:
        require_names(self.sequences, "sequences")


@record
class ComparisonDesign:
    """Which sequences are compared in their two versions, how often, in which order."""

    sequences: tuple[str, ...] = described("names of the sequences", default=PAPER_SEQUENCES, pattern=NAME)
    repetitions: int = count(
        "comparisons of each sequence; in half of them the modulated version comes first",
        minimum=1,
        default=1,
    )
    adaptation_duration: float = quantity(
        "s", "uniform field before each of the two videos", minimum=0.0, default=2.0
    )
    practice_trials: int = count("short excerpts before the session; left out of the analysis", default=1)
    practice_duration: float = as_in(RatingDesign, "practice_duration")
    trials_between_breaks: int = count("trials between two breaks; 0 for no breaks", default=2)
    minutes_between_breaks: float = as_in(RampDesign, "minutes_between_breaks")
    max_dropped_share: float = as_in(RatingDesign, "max_dropped_share")
    repeat_flagged: bool = as_in(RampDesign, "repeat_flagged")
    order_seed: int = as_in(RatingDesign, "order_seed")

    def __post_init__(self) -> None:
        require_names(self.sequences, "sequences")


def require_names(names: tuple[str, ...], what: str) -> None:
    """Refuse a list of names that is empty, or names something twice."""
    if not names or len(set(names)) < len(names):
        raise ValueError(f"{what} must name at least one, and none twice, got {len(names)} of them")


@record
class RatingTrial(Trial):
    """One rated video, as one line of `trials.jsonl`."""

    participant_id: str = as_in(RampTrial, "participant_id")
    session_id: str = as_in(RampTrial, "session_id")
    trial_index: int = as_in(RampTrial, "trial_index")
    sequence: str = described("what was shown", pattern=NAME)
    version: Version = described("how it was dimmed")
    repetition: int = count("which rating of this version, from 1", minimum=1)
    place_in_pair: int | None = quantity(
        "1",
        "1 if this version of the sequence was shown before the other, else 2; null if unknown",
        minimum=1,
        maximum=2,
    )
    mean_factor: float | None = share("mean brightness factor of what was shown; null if unknown", above=0.0)
    rating: float = quantity(
        "1", "quality and saliency of details, 1 (low) to 5 (high) or on the scale that the manifest names"
    )
    response_time: float | None = as_in(RampTrial, "response_time")
    simulated: bool = as_in(RampTrial, "simulated")
    practice: bool = as_in(RampTrial, "practice")
    block: int = as_in(RampTrial, "block")
    attempt: int = as_in(RampTrial, "attempt")
    onset: float | None = as_in(RampTrial, "onset")
    noise_seed: int | None = as_in(RampTrial, "noise_seed")
    n_frames: int | None = count("refreshes of the display", default=None)
    frames_dropped: int | None = count("refreshes without a new frame", default=None)
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)

    def __post_init__(self) -> None:
        if self.rating == int(self.rating):  # files hold whole points as whole numbers, as they always did
            object.__setattr__(self, "rating", int(self.rating))


@record
class ComparisonTrial(Trial):
    """One comparison of the two versions of a sequence, as one line of `trials.jsonl`."""

    participant_id: str = as_in(RampTrial, "participant_id")
    session_id: str = as_in(RampTrial, "session_id")
    trial_index: int = as_in(RampTrial, "trial_index")
    sequence: str = as_in(RatingTrial, "sequence")
    repetition: int = count("which comparison of this sequence, from 1", minimum=1)
    ours_interval: int | None = quantity(
        "1", "which of the two was the modulated version; null if unknown", minimum=1, maximum=2
    )
    mean_factor: float | None = share(
        "mean brightness factor of the modulated version; null if unknown", above=0.0
    )
    baseline_factor: float | None = share(
        "brightness factor of the constant version; null if unknown", above=0.0
    )
    response: Response | None = described(
        "which of the two showed a change in brightness: first, second; null if unknown"
    )
    response_time: float | None = as_in(RampTrial, "response_time")
    simulated: bool = as_in(RampTrial, "simulated")
    practice: bool = as_in(RampTrial, "practice")
    block: int = as_in(RampTrial, "block")
    attempt: int = as_in(RampTrial, "attempt")
    onset: float | None = as_in(RampTrial, "onset")
    noise_seed: int | None = as_in(RampTrial, "noise_seed")
    n_frames: int | None = as_in(RatingTrial, "n_frames")
    frames_dropped: int | None = as_in(RatingTrial, "frames_dropped")
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)
    chosen: Version | None = described(
        "which version showed a change in brightness, where it is not known in which interval it was",
        default=None,
    )

    def __post_init__(self) -> None:
        if self.response not in (None, Response.FIRST, Response.SECOND):
            raise ValueError(f"response must be 'first' or 'second', got {self.response.value!r}")
        known = None not in (self.ours_interval, self.response)
        if known == (self.chosen is not None):
            raise ValueError(
                "a comparison has ours_interval and response, or chosen where one of them is unknown; got "
                f"{self.ours_interval}, {self.response and self.response.value} and "
                f"{self.chosen and self.chosen.value}"
            )

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 2

    @property
    def chose_ours(self) -> bool:
        """Whether the participant answered that the modulated version changed."""
        if self.chosen is not None:
            return self.chosen is Version.OURS
        return (self.response is Response.FIRST) == (self.ours_interval == 1)


@record
class ClipLog:
    """What the display showed of a video in one interval of a trial, as one line of `frames.jsonl`."""

    trial_index: int = as_in(RampTrial, "trial_index")
    attempt: int = as_in(FrameLog, "attempt")
    interval: int = as_in(FrameLog, "interval")
    flip_times: tuple[float, ...] = quantity(
        "s", "when each refresh appeared, since the first of the interval", minimum=0.0
    )
    video_frames: tuple[int, ...] = count("frame of the video that each refresh showed, from 0")
    factors: tuple[float, ...] = share("brightness factor b that each refresh showed", above=0.0)
    backlight_factors: tuple[float, ...] = quantity(
        "1",
        "what the backlight reported for each refresh; empty if pixels make the brightness",
        minimum=0.0,
        default=(),
    )
    probe_refreshes: tuple[int, ...] = count("refreshes that were read back from the window", default=())
    probe_luminance: tuple[float, ...] = quantity(
        "cd/m^2",
        "mean luminance of their middle, up to 256 x 256 pixels of the video",
        minimum=0.0,
        default=(),
    )
    probe_intended: tuple[float, ...] = quantity(
        "cd/m^2", "what that luminance was to be, of the frame and factor", minimum=0.0, default=()
    )
    waited: float = quantity(
        "s",
        "how long the uniform field before it lasted beyond its time, until enough was decoded",
        minimum=0.0,
        default=0.0,
    )

    def __post_init__(self) -> None:
        n = len(self.flip_times)
        if len(self.video_frames) != n or len(self.factors) != n or len(self.backlight_factors) not in (0, n):
            raise ValueError(f"the lists of a clip log must be equally long, got {n} flip_times")
        if not len(self.probe_refreshes) == len(self.probe_luminance) == len(self.probe_intended):
            raise ValueError("the probe lists of a clip log must be equally long")
        for name in ("flip_times", "video_frames"):
            values = getattr(self, name)
            if any(later < earlier for earlier, later in itertools.pairwise(values)):
                raise ValueError(f"{name} must not fall")

    def __repr__(self) -> str:
        name = f"trial {self.trial_index}"
        return one_line(self, name, self.flip_times, video_frames=self.video_frames, factors=self.factors)


def repetitions(answers: Sequence[Mapping[str, Any]], item: Sequence[str]) -> list[int]:
    """Return the number of each answer among those about the same item, from 1, if most have several; else 1.

    Where most was answered once, a further answer is no repetition of the design.

    Parameters
    ----------
    answers : sequence of mapping
        Rows with `session_id` and `trial_index`, or without: they are counted by session, trial and row.
    item : sequence of str
        The columns that tell what is answered about.

    >>> rows = [{"sequence": name, "trial_index": -k} for k, name in enumerate("abab")]
    >>> repetitions(rows, ["sequence"]), repetitions(rows[:3], ["sequence"])
    ([2, 2, 1, 1], [1, 1, 1])
    """
    items = [tuple(each.get(name) for name in item) for each in answers]
    numbers, counts = [1] * len(items), Counter[Hashable]()
    if statistics.median_low(Counter(items).values()) > 1:
        for row in sorted(range(len(items)), key=lambda row: in_sessions(answers[row])):
            counts[items[row]] += 1
            numbers[row] = counts[items[row]]
    return numbers


def in_sessions(answer: Mapping[str, Any]) -> tuple[int, str, float]:
    """Return by what answers are sorted in the order in which they were given: session, then trial.

    >>> in_sessions({"session_id": "2", "trial_index": 9}) < in_sessions({"session_id": "10"})
    True
    """
    session, index = str(answer.get("session_id") or ""), answer.get("trial_index")
    return len(session), session, float(index) if isinstance(index, Real) else 0.0
