"""The ramp experiment: its design, its trials and frames, and how long a session takes (Section 3.4)."""

from __future__ import annotations

import enum
import math

from evenlight.data_schema.quantities import count, described, one_line, quantity, record, share

ROUNDING = 1e-6  # relative, of a luminance that was computed and written
ANSWER_TIME = 1.5  # [s] from the question to the answer, of a practised person (choice)
BREAK_TIME = 60.0  # [s] a break (choice)
INSTRUCTION_TIME = 180.0  # [s] consent, instructions, adaptation to the room (choice)


class Procedure(enum.Enum):
    """What a participant is asked."""

    YES_NO = "yes_no"  # one ramp, "did the brightness change?": the paper's
    TWO_INTERVAL = "two_interval"  # two intervals, "in which did it change?": free of the criterion


class Placement(enum.Enum):
    """How the rates of the ramps are chosen."""

    CONSTANT = "constant"  # the design's rates, equally often: constant stimuli, the paper's
    TARGETED = "targeted"  # around the posterior mean of the 75 % point
    PSI_MARGINAL = "psi_marginal"  # where an answer tells most about the threshold (Prins 2013)


class Direction(enum.Enum):
    """Which way the luminance goes."""

    DOWN = "down"
    UP = "up"


class IntervalGap(enum.Enum):
    """What is seen before, between and after two intervals (docs/decisions/yes-no-task.md)."""

    RANDOM_STEPS = "random_steps"  # two luminances drawn at random, with abrupt steps to and from them
    STEADY = "steady"  # the luminance at which the last interval ended, without any step


class Response(enum.Enum):
    """The answer to "did the brightness change?", or to "in which interval did it?"."""

    YES = "yes"
    NO = "no"
    FIRST = "first"
    SECOND = "second"


class TrialFlag(enum.Enum):
    """Why a trial is left out of the analysis."""

    NONE = ""
    DROPPED_FRAMES = "dropped_frames"  # more than the design allows: not the intended stimulus
    SEEN_BEFORE = "seen_before"  # a search that was interrupted: where the ring is may be known


@record
class RampDesign:
    """Which ramps are shown, how often and how, and what is asked."""

    procedure: Procedure = described("what a participant is asked", default=Procedure.YES_NO)
    placement: Placement = described("how the rates of the ramps are chosen", default=Placement.CONSTANT)
    screens: tuple[str, ...] = described(
        "uniform screens, white and gray; each a block of its own",
        default=("white", "gray"),
        pattern="^(white|gray)$",
    )
    factors: tuple[float, ...] = share(
        "initial brightness factors, B in the paper",
        above=0.0,
        min_items=1,
        default=(0.2, 0.4, 0.6, 0.8, 1.0),
    )
    white_pixel_value: float = share("pixel value of the white screen", above=0.0, default=1.0)
    gray_pixel_value: float = share("pixel value of the gray screen", above=0.0, default=0.46)
    directions: tuple[Direction, ...] = described(
        "whether the luminance falls or rises; each a block of its own", default=(Direction.DOWN,)
    )
    ramp_durations: tuple[float, ...] = quantity(
        "s", "durations of the ramp; each a block of its own", above=0.0, min_items=1, default=(5.0,)
    )
    relative_rates: tuple[float, ...] = quantity(
        "1/s",
        "rates of change as a share of the initial luminance per second; adaptive placement "
        "moves between the lowest and the highest",
        above=0.0,
        min_items=1,
        default=(0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12),
        key="relative_rates_per_s",
    )
    same_amounts: bool = described(
        "true if the rates are those of the first duration, and are scaled for others so that "
        "the total change is the same",
        default=True,
    )
    repetitions: int = count(
        "trials per screen, factor, direction, duration and rate, for constant placement",
        minimum=1,
        default=6,
    )
    trials_per_level: int = count(
        "ramps per screen, factor, direction and duration, for adaptive placement", minimum=1, default=40
    )
    catch_share: float = quantity(
        "1", "share of all trials without any change; yes/no only", minimum=0.0, maximum=0.9, default=0.2
    )
    adaptation_duration: float = quantity("s", "constant luminance before the ramp", minimum=0.0, default=1.0)
    hold_duration: float = quantity("s", "constant luminance after the ramp", minimum=0.0, default=1.0)
    interval_gap: float = quantity(
        "s", "time before each of two intervals and after them", minimum=0.1, default=0.5
    )
    interval_gap_kind: IntervalGap = described(
        "what is seen then: luminances drawn at random, or the one at which the last interval ended",
        default=IntervalGap.RANDOM_STEPS,
    )
    fixation_mark: bool = described(
        "true if intervals have a small mark in the middle, by a fixed share darker than the field",
        default=False,
    )
    pause_duration: float = quantity(
        "s",
        "time from an answer to the next trial, at that trial's initial luminance",
        minimum=0.0,
        default=1.0,
    )
    practice_trials: int = count(
        "practice trials in a round before the session; left out of the analysis", default=6
    )
    practice_correct: int = count(
        "right answers that a round of practice needs, its ramps going from the fastest down to near "
        "threshold; 0 for one round of the fastest, whatever the answers",
        default=0,
    )
    practice_rounds: int = count(
        "rounds of practice at most, while too few answers are right", minimum=1, default=3
    )
    trials_between_breaks: int = count("trials between two breaks; 0 for no breaks", default=60)
    minutes_between_breaks: float = quantity(
        "min",
        "time after which a break comes before as many trials are done; 0 for none",
        minimum=0.0,
        default=0.0,
    )
    max_dropped_frames: int = count("a trial with more dropped frames is flagged", default=3)
    repeat_flagged: bool = described(
        "true if a flagged trial is shown again at the end of the session", default=True
    )

    def __post_init__(self) -> None:
        for name in ("screens", "directions", "ramp_durations", "factors", "relative_rates"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ValueError(f"{name} must name at least one, and none twice, got {len(values)} of them")
        if len(self.screens) > 1 and self.white_pixel_value <= self.gray_pixel_value:
            raise ValueError(
                f"white_pixel_value must be above gray_pixel_value, got {self.white_pixel_value:g} and "
                f"{self.gray_pixel_value:g}"
            )
        if self.practice_correct > self.practice_trials:
            raise ValueError(
                f"practice_correct must be at most practice_trials, {self.practice_trials}, got "
                f"{self.practice_correct}"
            )
        for duration in self.ramp_durations if Direction.DOWN in self.directions else ():
            fastest = max(self.rates_of(duration))
            if fastest * duration >= 1:
                raise ValueError(
                    f"a decrease of {fastest:g} of the initial luminance per second for {duration:g} s "
                    f"would end below black; the fastest must stay below {1 / duration:g}"
                )

    def rates_of(self, duration: float) -> tuple[float, ...]:
        """Return the relative rates [1/s] of ramps of a duration [s].

        >>> RampDesign(ramp_durations=(5.0, 10.0), relative_rates=(0.02, 0.04)).rates_of(10.0)
        (0.01, 0.02)
        """
        scale = self.ramp_durations[0] / duration if self.same_amounts else 1.0
        return tuple(rate * scale for rate in self.relative_rates)

    @property
    def has_catch_trials(self) -> bool:
        """Whether trials without change are mixed in: two intervals need none."""
        return self.procedure is Procedure.YES_NO and self.catch_share > 0


class Trial:
    """What the trials of all experiments have in common."""

    __slots__ = ()
    participant_id: str
    session_id: str
    trial_index: int
    simulated: bool
    practice: bool
    attempt: int
    flag: TrialFlag

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 1

    @property
    def usable(self) -> bool:
        """Whether it counts: neither practice nor flagged."""
        return not self.practice and self.flag is TrialFlag.NONE


@record
class RampTrial(Trial):
    """One trial of the ramp experiment, as one line of `trials.jsonl`."""

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = count("place among the session's answered trials, from 0")
    screen: str = described("white or gray", pattern="^(white|gray)$")
    factor: float = share("initial brightness factor", above=0.0)
    initial_luminance: float = quantity("cd/m^2", "luminance before the ramp", above=0.0)
    final_luminance: float = quantity("cd/m^2", "luminance after the ramp", minimum=0.0)
    rate: float = quantity("cd/m^2/s", "rate of change; 0 in a catch trial", minimum=0.0)
    duration: float = quantity("s", "duration of the ramp", above=0.0)
    is_catch: bool = described("true if nothing changed")
    response: Response = described("answer to: did the brightness change, or in which interval?")
    response_time: float | None = quantity("s", "from the question to the answer", minimum=0.0)
    simulated: bool = described("true if a simulated observer answered")
    procedure: Procedure = described("what was asked", default=Procedure.YES_NO)
    direction: Direction = described(
        "which way the luminance went, or would have gone in a catch trial", default=Direction.DOWN
    )
    ramp_interval: int | None = quantity(
        "1", "which of two intervals held the ramp; null in yes/no", minimum=1, maximum=2, default=None
    )
    practice: bool = described("true if it was practice", default=False)
    block: int = count("block of the session, from 1; 0 for practice", default=1)
    attempt: int = count("above 1 if it was shown before and interrupted", minimum=1, default=1)
    onset: float | None = quantity(
        "s", "first flip of the trial, since the session began", minimum=0.0, default=None
    )
    noise_seed: int | None = count("seed of the dithering noise", default=None)
    n_frames: int | None = count("frames shown", default=None)
    frames_dropped: int | None = count("frames that the display showed longer than one refresh", default=None)
    drawn_initial_luminance: float | None = quantity(
        "cd/m^2", "mean luminance read back from the window before the ramp", minimum=0.0, default=None
    )
    drawn_final_luminance: float | None = quantity(
        "cd/m^2", "mean luminance read back from the window after the ramp", minimum=0.0, default=None
    )
    largest_luminance_error: float | None = quantity(
        "cd/m^2", "largest difference of read-back and intended mean luminance", minimum=0.0, default=None
    )
    repetition: int | None = count(
        "which ramp of its level and rate, from 1; null where it is not counted", minimum=1, default=None
    )
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)

    def __post_init__(self) -> None:
        if self.is_catch != (self.rate == 0):
            raise ValueError(f"a catch trial has rate 0 and only a catch trial has, got rate {self.rate:g}")
        two = self.procedure is Procedure.TWO_INTERVAL
        if two != (self.ramp_interval is not None) or (two and self.is_catch):
            raise ValueError(
                f"two_interval needs a ramp, and ramp_interval 1 or 2, which yes_no has not; "
                f"got {self.procedure.value} with {self.ramp_interval} and rate {self.rate:g}"
            )
        answers = (Response.FIRST, Response.SECOND) if two else (Response.YES, Response.NO)
        if self.response not in answers:
            raise ValueError(
                f"response must be {answers[0].value!r} or {answers[1].value!r} to {self.procedure.value}, "
                f"got {self.response.value!r}"
            )
        way = 1 if self.direction is Direction.UP else -1
        end = self.initial_luminance + way * self.rate * self.duration
        if abs(end - self.final_luminance) > ROUNDING * max(self.initial_luminance, end):
            raise ValueError(
                f"a ramp {self.direction.value} from {self.initial_luminance:g} cd/m^2 at {self.rate:g} "
                f"cd/m^2/s for {self.duration:g} s ends at {end:g}, not at {self.final_luminance:g} cd/m^2"
            )

    @property
    def intervals(self) -> int:
        """How many intervals a trial has."""
        return 1 if self.ramp_interval is None else 2

    @property
    def success(self) -> bool:
        """Whether the change was reported: "yes", or the interval that it was in."""
        if self.procedure is Procedure.YES_NO:
            return self.response is Response.YES
        return (self.response is Response.FIRST) == (self.ramp_interval == 1)


def session_minutes(design: RampDesign, n_trials: int) -> float:
    """Return how long a participant takes [min]: instructions, one round of practice, trials, breaks.

    Parameters
    ----------
    design : RampDesign
        How trials are shown; of several durations each is as frequent as any other.
    n_trials : int
        Trials, catch trials among them and practice not.

    >>> design = RampDesign(practice_trials=4, trials_between_breaks=30)
    >>> round(session_minutes(design, 60), 2)  # 64 trials of 9.5 s, one break, and 3 minutes before
    14.13
    >>> often = RampDesign(practice_trials=4, trials_between_breaks=30, minutes_between_breaks=3.0)
    >>> round(session_minutes(often, 60), 2)  # a break after every 19 trials: three
    16.13
    """
    by_time = math.ceil(design.minutes_between_breaks * 60 / trial_seconds(design))
    between = min(filter(None, (design.trials_between_breaks, by_time)), default=0)
    breaks = max(math.ceil(n_trials / between) - 1, 0) if between else 0
    trials = (n_trials + design.practice_trials) * trial_seconds(design)
    return (INSTRUCTION_TIME + trials + breaks * BREAK_TIME) / 60


def trial_seconds(design: RampDesign) -> float:
    """Return how long a trial takes up to the next one, on average over the ramp's durations [s].

    >>> trial_seconds(RampDesign())  # 1 + 5 + 1, 1.5 to answer, 1 until the next
    9.5
    >>> trial_seconds(RampDesign(procedure=Procedure.TWO_INTERVAL))  # twice 7, three gaps of 0.5, and 2.5
    18.0
    """
    ramp = math.fsum(design.ramp_durations) / len(design.ramp_durations)
    shown = design.adaptation_duration + ramp + design.hold_duration
    if design.procedure is Procedure.TWO_INTERVAL:
        shown = 2 * shown + 3 * design.interval_gap
    return shown + ANSWER_TIME + design.pause_duration


@record
class FrameLog:
    """What the display showed in one interval of a trial, as one line of `frames.jsonl`."""

    trial_index: int = count("place among the session's answered trials, from 0")
    attempt: int = count("above 1 if it was shown before and interrupted", minimum=1)
    interval: int = quantity("1", "interval of the trial: 1, or 2 for the second", minimum=1, maximum=2)
    flip_times: tuple[float, ...] = quantity(
        "s", "when each frame appeared, since the first of the interval", minimum=0.0
    )
    intended_luminance: tuple[float, ...] = quantity(
        "cd/m^2", "luminance that each frame was to show", minimum=0.0
    )
    probe_frames: tuple[int, ...] = count("frames that were read back from the window", default=())
    probe_luminance: tuple[float, ...] = quantity(
        "cd/m^2", "mean luminance of the frames read back", minimum=0.0, default=()
    )
    backlight_factors: tuple[float, ...] = quantity(
        "1",
        "what the backlight reported for each frame; empty if pixels make the brightness",
        minimum=0.0,
        default=(),
    )

    def __post_init__(self) -> None:
        n = len(self.flip_times)
        if len(self.intended_luminance) != n or len(self.backlight_factors) not in (0, n):
            raise ValueError(f"the lists of a frame log must be equally long, got {n} flip_times")
        if len(self.probe_frames) != len(self.probe_luminance):
            raise ValueError("probe_frames and probe_luminance_cd_m2 must be equally long")
        if any(later < earlier for earlier, later in zip(self.flip_times, self.flip_times[1:], strict=False)):
            raise ValueError("flip_times_s must not fall")

    def __repr__(self) -> str:
        name = f"trial {self.trial_index}"
        return one_line(self, name, self.flip_times, intended_luminance=self.intended_luminance)

    @property
    def largest_error(self) -> float:
        """Largest difference of read-back and intended mean luminance [cd/m^2]; 0 without a probe."""
        pairs = zip(self.probe_frames, self.probe_luminance, strict=True)
        return max((math.fabs(self.intended_luminance[k] - L) for k, L in pairs), default=0.0)
