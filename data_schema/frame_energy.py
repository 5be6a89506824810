"""Energy of the frames of a played video, and the clock that puts power on their times."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity


class ClockMethod(enum.Enum):
    """What a meter's clock was put on the computer's with, the best first."""

    EDGES = "edges"  # of the synchronisation input, against the flips
    PINGS = "pings"  # questions and answers, with the computer's time before and after
    FLASHES = "flashes"  # flash markers, found in the power
    COMPUTER_TIME = "computer_time"  # the samples carry the computer's time: nothing to fit
    ARRIVALS = "arrivals"  # when the samples arrived: late by a latency that nobody knows


class ClockFlag(enum.Enum):
    """What a reader should know about a fitted clock."""

    NO_EDGES = "no_edges"  # the synchronisation input is connected, and its level never changes
    EDGES_UNUSABLE = "edges_unusable"  # too few edges fit the flips
    SAMPLED_TOO_SLOWLY = "sampled_too_slowly"  # the synchronisation level changes faster than it is sampled
    EDGES_MISSING = "edges_missing"  # none for a while
    AMBIGUOUS = "ambiguous"  # the edges fit the flips as well a frame earlier or later
    INVERTED = "inverted"  # the synchronisation input is upside down
    DISAGREES = "disagrees"  # pings or markers say otherwise than edges
    NOT_LINEAR = "not_linear"  # no line is within all pings
    OFFSET_ONLY = "offset_only"  # the drift could not be told, and was taken as none
    FLASHES_NOT_FOUND = "flashes_not_found"
    UNKNOWN_LATENCY = "unknown_latency"  # how late samples are timed is not known


@dataclass(frozen=True, slots=True)
class ClockFit:
    """A meter's clock on the computer's.

    Computer's time = reference + offset + (1 + 1e-6 drift_ppm) · (meter's time - reference).

    Attributes
    ----------
    method : ClockMethod
        What it was found with.
    reference : float
        Time on the meter's clock at which `offset` holds [s].
    offset : float
        Computer's time less the meter's [s].
    drift_ppm : float
        Seconds of the computer in a second of the meter, less 1, in parts per million.
    residual_sd : float or None
        Standard deviation of what was used about the line [s].
    bound : float or None
        How far off the line may be at most while something was played, as far as edges, pings or markers
        tell, and the flips' own times are right [s]; None where the latency is unknown.
    n_used, n_rejected : int
        Edges, pings or markers that the line rests on, and those left out.
    flags : tuple of ClockFlag
        What a reader should know.
    """

    method: ClockMethod = described("what it was found with")
    reference: float = quantity("s", "time on the meter's clock at which offset_s holds")
    offset: float = quantity("s", "computer's time less the meter's")
    drift_ppm: float = quantity("1", "how much slower the meter's clock is, in parts per million")
    residual_sd: float | None = quantity("s", "standard deviation about the line", minimum=0.0)
    bound: float | None = quantity("s", "how far off at most; null where the latency is unknown", minimum=0.0)
    n_used: int = quantity("1", "edges, pings or markers that it rests on", minimum=0)
    n_rejected: int = quantity("1", "those left out", minimum=0)
    flags: tuple[ClockFlag, ...] = described("what a reader should know", default=())

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class SampleCount:
    """Which samples of a power meter came.

    Attributes
    ----------
    n_samples : int
        Samples that came, each counted once.
    n_lost : int
        Samples that did not come, by the meter's own count.
    n_duplicated : int
        Samples that came again.
    duration : float
        From the first to the last, on the meter's clock [s].
    bridged_share : float
        Share of that time without a sample, where power was interpolated.
    longest_gap : float
        The longest time without a sample [s].
    """

    n_samples: int = quantity("1", "samples that came, each counted once", minimum=0)
    n_lost: int = quantity("1", "samples that did not come, by the meter's count", minimum=0)
    n_duplicated: int = quantity("1", "samples that came again", minimum=0)
    duration: float = quantity("s", "from the first to the last", minimum=0.0)
    bridged_share: float = quantity("1", "share of the time without a sample", minimum=0.0, maximum=1.0)
    longest_gap: float = quantity("s", "the longest time without a sample", minimum=0.0)

    def __post_init__(self) -> None:
        check_limits(self)


class FrameFlag(enum.Enum):
    """What to know about the energy of a frame."""

    OK = "ok"
    UNRESOLVED = "unresolved"  # shorter than the time between samples: its share of a longer mean
    GAP = "gap"  # it lies in a long time without samples: left out
    OUTSIDE = "outside"  # the samples begin after it, or end before it: left out


@dataclass(frozen=True, slots=True)
class FrameEnergy:
    """Energy that the panel took while a frame was shown, a row of `frame_energy.csv`.

    Attributes
    ----------
    pass_index : int
        Which time through the video, from 0.
    version : str
        How it was dimmed.
    video_frame : int
        Frame of the video.
    begun : float
        When it appeared, on the computer's clock [s].
    duration : float
        Until the next one appeared [s].
    energy : float or None
        Integral of power over that time; None where it was left out [J].
    power : float or None
        Its mean [W].
    factor : float
        Brightness factor b that was achieved, its mean over time.
    n_samples : int
        Samples that ended while it was shown.
    bridged_share : float
        Share of its time without a sample.
    flag : FrameFlag
        What to know about it.
    """

    pass_index: int = quantity("1", "which time through the video, from 0", minimum=0)
    version: str = described("how it was dimmed", pattern="^(ours|baseline|full)$")
    video_frame: int = quantity("1", "frame of the video", minimum=0)
    begun: float = quantity("s", "when it appeared, on the computer's clock")
    duration: float = quantity("s", "until the next one appeared", above=0.0)
    energy: float | None = quantity("J", "integral of power over that time; empty where left out")
    power: float | None = quantity("W", "its mean; empty where left out")
    factor: float = quantity("1", "brightness factor that was achieved", minimum=0.0, maximum=1.0)
    n_samples: int = quantity("1", "samples that ended while it was shown", minimum=0)
    bridged_share: float = quantity("1", "share of its time without a sample", minimum=0.0, maximum=1.0)
    flag: FrameFlag = described("what to know about it")

    def __post_init__(self) -> None:
        check_limits(self)
        left_out = self.flag in LEFT_OUT
        if (self.energy is None) != left_out or (self.power is None) != left_out:
            raise ValueError(
                f"energy and power must be missing of a frame that is left out, and there of any other; "
                f"got the flag {self.flag.value!r}"
            )


LEFT_OUT = (FrameFlag.GAP, FrameFlag.OUTSIDE)  # frames without an energy
