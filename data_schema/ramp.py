"""The ramp experiment: its design and its trials (Section 3.4 of the paper)."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity

ROUNDING = 1e-6  # relative, of a luminance that was computed and written


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


class Response(enum.Enum):
    """The answer to "did the brightness change?", or to "in which interval did it?"."""

    YES = "yes"
    NO = "no"
    FIRST = "first"
    SECOND = "second"


class TrialFlag(enum.Enum):
    """Why a trial is left out of the analysis."""

    NONE = ""
    DROPPED_FRAMES = "dropped_frames"  # more than the design allows: not what was meant
    SEEN_BEFORE = "seen_before"  # a search that was interrupted: where the ring is may be known


@dataclass(frozen=True, slots=True)
class RampDesign:
    """Which ramps are shown, how often and how, and what is asked.

    Attributes
    ----------
    procedure : Procedure
        What a participant is asked.
    placement : Placement
        How the rates of the ramps are chosen.
    screens : tuple of str
        "white" and "gray", each a block of its own.
    factors : tuple of float
        Initial brightness factors B of the paper.
    white_pixel_value, gray_pixel_value : float
        Pixel values of the two uniform screens, in [0, 1].
    directions : tuple of Direction
        Whether the luminance falls or rises; each a block of its own.
    ramp_durations : tuple of float
        Durations of the ramp [s]; each a block of its own.
    relative_rates : tuple of float
        Rates of change as a share of the initial luminance per second [1/s]. Adaptive placement moves
        between the lowest and the highest.
    same_amounts : bool
        Whether `relative_rates` are those of the first duration, and others are scaled so that a ramp of
        another duration makes the same total change.
    repetitions : int
        Trials per screen, factor, direction, duration and rate, for constant placement.
    trials_per_level : int
        Ramps per screen, factor, direction and duration, for adaptive placement.
    catch_share : float
        Share of all trials without any change; yes/no only.
    adaptation_duration, hold_duration : float
        Constant luminance before and after the ramp [s].
    interval_gap : float
        Before each of the two intervals of a trial and after them, at luminances drawn at random [s].
    pause_duration : float
        From an answer to the next trial, at that trial's initial luminance [s].
    practice_trials : int
        Before the session; left out of the analysis.
    trials_between_breaks : int
        0 for no breaks.
    max_dropped_frames : int
        A trial with more dropped frames is flagged.
    repeat_flagged : bool
        Whether a flagged trial is shown again at the end of the session.
    """

    procedure: Procedure = described("what a participant is asked", default=Procedure.YES_NO)
    placement: Placement = described("how the rates are chosen", default=Placement.CONSTANT)
    screens: tuple[str, ...] = described(
        "uniform screens: white, gray", default=("white", "gray"), pattern="^(white|gray)$"
    )
    factors: tuple[float, ...] = quantity(
        "1",
        "initial brightness factors",
        above=0.0,
        maximum=1.0,
        min_items=1,
        default=(0.2, 0.4, 0.6, 0.8, 1.0),
    )
    white_pixel_value: float = quantity(
        "1", "pixel value of the white screen", above=0.0, maximum=1.0, default=1.0
    )
    gray_pixel_value: float = quantity(
        "1", "pixel value of the gray screen", above=0.0, maximum=1.0, default=0.46
    )
    directions: tuple[Direction, ...] = described(
        "whether the luminance falls or rises", default=(Direction.DOWN,)
    )
    ramp_durations: tuple[float, ...] = quantity(
        "s", "durations of the ramp", above=0.0, min_items=1, default=(5.0,)
    )
    relative_rates: tuple[float, ...] = quantity(
        "1/s",
        "rates of change as a share of the initial luminance per second; adaptive placement stays within",
        above=0.0,
        min_items=1,
        default=(0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12),
        key="relative_rates_per_s",
    )
    same_amounts: bool = described(
        "true if rates are those of the first duration, and others are scaled to the same change",
        default=True,
    )
    repetitions: int = quantity("1", "trials per rate and level, constant placement", minimum=1, default=6)
    trials_per_level: int = quantity("1", "ramps per level, adaptive placement", minimum=1, default=40)
    catch_share: float = quantity(
        "1", "share of trials without change; yes/no only", minimum=0.0, maximum=0.9, default=0.2
    )
    adaptation_duration: float = quantity("s", "constant luminance before the ramp", minimum=0.0, default=1.0)
    hold_duration: float = quantity("s", "constant luminance after the ramp", minimum=0.0, default=1.0)
    interval_gap: float = quantity(
        "s", "before each of two intervals and after them, at random luminances", minimum=0.1, default=0.5
    )
    pause_duration: float = quantity(
        "s", "from an answer to the next trial, at its initial luminance", minimum=0.0, default=1.0
    )
    practice_trials: int = quantity("1", "before the session; left out of the analysis", minimum=0, default=6)
    trials_between_breaks: int = quantity("1", "0 for no breaks", minimum=0, default=60)
    max_dropped_frames: int = quantity("1", "a trial with more is flagged", minimum=0, default=3)
    repeat_flagged: bool = described("true if flagged trials are shown again at the end", default=True)

    def __post_init__(self) -> None:
        check_limits(self)
        for name in ("screens", "directions", "ramp_durations", "factors", "relative_rates"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ValueError(f"{name} must name at least one, and none twice, got {len(values)} of them")
        if len(self.screens) > 1 and self.white_pixel_value <= self.gray_pixel_value:
            raise ValueError(
                f"white_pixel_value must be above gray_pixel_value, got {self.white_pixel_value:g} and "
                f"{self.gray_pixel_value:g}"
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


@dataclass(frozen=True, slots=True)
class RampTrial:
    """One trial of the ramp experiment, as one line of `trials.jsonl`.

    Attributes
    ----------
    participant_id, session_id : str
        Whose trial it is.
    trial_index : int
        Place among the answered trials of the session, from 0; practice is counted.
    screen : str
        "white" or "gray".
    factor : float
        Initial brightness factor.
    initial_luminance, final_luminance : float
        Before and after the ramp [cd/m^2].
    rate : float
        Rate of change; 0 in a catch trial [cd/m^2/s].
    duration : float
        Of the ramp [s].
    is_catch : bool
        Whether nothing changed.
    response : Response
        The answer.
    response_time : float or None
        From the question to the answer; None from a simulation without a clock [s].
    simulated : bool
        Whether a simulated observer answered.
    procedure : Procedure
        What was asked.
    direction : Direction
        Which way the luminance went, or would have gone in a catch trial.
    ramp_interval : int or None
        Which of two intervals held the ramp, 1 or 2; None in yes/no.
    practice : bool
        Whether it was practice.
    block : int
        Of the session, from 1; 0 for practice.
    attempt : int
        1, or more where the trial was shown before and interrupted.
    onset : float or None
        First flip of the trial, since the session began [s].
    noise_seed : int or None
        Of the dithering noise.
    n_frames, frames_dropped : int or None
        Frames shown, and those that the display showed longer than one refresh.
    drawn_initial_luminance, drawn_final_luminance : float or None
        Mean luminance read back from the window, before and after the ramp [cd/m^2].
    largest_luminance_error : float or None
        Largest difference of read-back and intended mean luminance [cd/m^2].
    flag : TrialFlag
        Why it is left out of the analysis, if it is.
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = quantity("1", "place among the session's answered trials, from 0", minimum=0)
    screen: str = described("white or gray", pattern="^(white|gray)$")
    factor: float = quantity("1", "initial brightness factor", above=0.0, maximum=1.0)
    initial_luminance: float = quantity("cd/m^2", "before the ramp", above=0.0)
    final_luminance: float = quantity("cd/m^2", "after the ramp", minimum=0.0)
    rate: float = quantity("cd/m^2/s", "rate of change; 0 in a catch trial", minimum=0.0)
    duration: float = quantity("s", "duration of the ramp", above=0.0)
    is_catch: bool = described("true if nothing changed")
    response: Response = described("did the brightness change, or in which interval?")
    response_time: float | None = quantity("s", "from the question to the answer", minimum=0.0)
    simulated: bool = described("true if a simulated observer answered")
    procedure: Procedure = described("what was asked", default=Procedure.YES_NO)
    direction: Direction = described("which way the luminance goes", default=Direction.DOWN)
    ramp_interval: int | None = quantity(
        "1", "which of two intervals held the ramp", minimum=1, maximum=2, default=None
    )
    practice: bool = described("true if it was practice", default=False)
    block: int = quantity("1", "block of the session, from 1; 0 for practice", minimum=0, default=1)
    attempt: int = quantity("1", "above 1 if it was shown before and interrupted", minimum=1, default=1)
    onset: float | None = quantity(
        "s", "first flip of the trial, since the session began", minimum=0.0, default=None
    )
    noise_seed: int | None = quantity("1", "seed of the dithering noise", minimum=0, default=None)
    n_frames: int | None = quantity("1", "frames shown", minimum=0, default=None)
    frames_dropped: int | None = quantity("1", "refreshes without a new frame", minimum=0, default=None)
    drawn_initial_luminance: float | None = quantity(
        "cd/m^2", "read back from the window before the ramp", minimum=0.0, default=None
    )
    drawn_final_luminance: float | None = quantity(
        "cd/m^2", "read back from the window after the ramp", minimum=0.0, default=None
    )
    largest_luminance_error: float | None = quantity(
        "cd/m^2", "largest difference of read-back and intended mean", minimum=0.0, default=None
    )
    flag: TrialFlag = described("why it is left out of the analysis; empty for none", default=TrialFlag.NONE)

    def __post_init__(self) -> None:
        check_limits(self)
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

    @property
    def usable(self) -> bool:
        """Whether it counts: neither practice nor flagged."""
        return not self.practice and self.flag is TrialFlag.NONE
