"""Measured power of a played video: of a panel, frame by frame, or of the whole device that plays it.

Of a panel: ours, baseline and full brightness (the paper's power table). The power meter's clock is fitted to
the computer's, each frame gets its energy, and passes are averaged. Of a device: what a dimmed version saves.
"""

from __future__ import annotations

import enum

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share

VERSION = "^(ours|baseline|full)$"


class ClockMethod(enum.Enum):
    """What a meter's clock was put on the computer's with, the best first."""

    EDGES = "edges"  # of the synchronisation input, against the flips
    PINGS = "pings"  # questions and answers, with the computer's time before and after
    FLASHES = "flashes"  # flash markers, found in the power
    COMPUTER_TIME = "computer_time"  # the samples carry the computer's time: nothing to fit
    ARRIVALS = "arrivals"  # when the samples arrived: late by an unknown latency


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
    OFFSET_ONLY = "offset_only"  # the drift could not be determined, and was taken as none
    FLASHES_NOT_FOUND = "flashes_not_found"
    UNKNOWN_LATENCY = "unknown_latency"  # how late samples are timed is not known


@record
class ClockFit:
    """A meter's clock on the computer's.

    Computer's time = reference + offset + (1 + 1e-6 drift_ppm) · (meter's time - reference).
    """

    method: ClockMethod = described("what it was found with")
    reference: float = quantity("s", "time on the meter's clock at which offset_s holds")
    offset: float = quantity("s", "computer's time less the meter's")
    drift_ppm: float = quantity(
        "ppm", "seconds of the computer in a second of the meter, less 1, in parts per million"
    )
    residual_sd: float | None = quantity(
        "s", "standard deviation about the line of what it was fitted to", minimum=0.0
    )
    bound: float | None = quantity(
        "s",
        "largest error of the line while something was played, as far as edges, pings or "
        "markers tell and the flips' own times are right; null if the latency is unknown",
        minimum=0.0,
    )
    n_used: int = count("edges, pings or markers that the line rests on")
    n_rejected: int = count("edges, pings or markers that were left out")
    flags: tuple[ClockFlag, ...] = described("what a reader should know", default=())


@record
class SampleCount:
    """Which samples of a power meter came."""

    n_samples: int = count("samples that came, each counted once")
    n_lost: int = count("samples that did not come, by the meter's own count")
    n_duplicated: int = count("samples that came again")
    duration: float = quantity("s", "from the first to the last, on the meter's clock", minimum=0.0)
    bridged_share: float = share("share of that time without a sample, where power was interpolated")
    longest_gap: float = quantity("s", "the longest time without a sample", minimum=0.0)


class FrameFlag(enum.Enum):
    """What to know about the energy of a frame."""

    OK = "ok"
    UNRESOLVED = "unresolved"  # shorter than the time between samples: its share of a longer mean
    GAP = "gap"  # it lies in a long time without samples: left out
    OUTSIDE = "outside"  # the samples begin after it, or end before it: left out


@record
class FrameEnergy:
    """Energy that the panel took while a frame was shown, a row of `frame_energy.csv`."""

    pass_index: int = count("which time through the video, from 0")
    version: str = described("how the video was dimmed", pattern="^(ours|baseline|full)$")
    video_frame: int = count("frame of the video")
    begun: float = quantity("s", "when it appeared, on the computer's clock")
    duration: float = quantity("s", "until the next one appeared", above=0.0)
    energy: float | None = quantity("J", "integral of power over that time; empty where left out")
    power: float | None = quantity("W", "mean power over that time; empty where left out")
    factor: float = share("brightness factor b that was achieved, mean over the frame's time")
    n_samples: int = count("samples that ended while it was shown")
    bridged_share: float = share("share of its time without a sample")
    flag: FrameFlag = described("what to know about it")

    def __post_init__(self) -> None:
        left_out = self.flag in LEFT_OUT
        if (self.energy is None) != left_out or (self.power is None) != left_out:
            raise ValueError(
                f"energy and power must be missing of a frame that is left out, and there of any other; "
                f"got the flag {self.flag.value!r}"
            )


LEFT_OUT = (FrameFlag.GAP, FrameFlag.OUTSIDE)  # frames without an energy


@record
class PassPower:
    """Power of one time through a video."""

    pass_index: int = as_in(FrameEnergy, "pass_index")
    version: str = described("how the video was dimmed", pattern=VERSION)
    begun: float = quantity("s", "when its first frame appeared, on the computer's clock")
    duration: float = quantity("s", "until its last frame had gone", above=0.0)
    mean_power: float | None = quantity(
        "W", "energy over time, of the frames that have an energy; null if none has"
    )
    mean_factor: float = share("mean over time of the brightness factor b that was achieved")
    n_frames: int = count("frames shown", minimum=1)
    n_left_out: int = count("frames without an energy")
    n_dropped: int = count("refreshes of the display without a new picture where one was due")
    measured_share: float = quantity(
        "1", "share of the video's duration that is in mean_power_w", minimum=0.0
    )
    bridged_share: float = share("share of the measured time without a sample")
    used: bool = described("true if it counts in the means of its version: enough of the video was measured")

    def __post_init__(self) -> None:
        if self.used and self.mean_power is None:
            raise ValueError("a pass that is used must have a mean_power_w")


@record
class VersionPower:
    """Measured average power of a version of a video.

    Intervals are of 95 %, from Student's t over passes; None without repetitions. What a version saves is
    freed from the drift that all versions share.
    """

    version: str = as_in(PassPower, "version")
    n_passes: int = count("passes that count", minimum=1)
    mean_power: float = quantity("W", "energy of all passes over their time")
    sd_power: float | None = quantity("W", "standard deviation of the passes' means", minimum=0.0)
    ci_low: float | None = quantity(
        "W",
        "lower end of the 95 % confidence interval of the mean (Student's t over passes); "
        "empty with one pass",
    )
    ci_high: float | None = quantity(
        "W", "upper end of the 95 % confidence interval of the mean; empty with one pass"
    )
    saving: float | None = quantity(
        "W",
        "power of full brightness less this, freed from the drift that all versions share; "
        "empty if full brightness was not measured",
    )
    saving_percent: float | None = quantity("%", "saving in percent of full brightness")
    saving_percent_ci_low: float | None = quantity(
        "%", "lower end of the 95 % confidence interval of saving_percent"
    )
    saving_percent_ci_high: float | None = quantity(
        "%", "upper end of the 95 % confidence interval of saving_percent"
    )
    frame_energy_min: float = quantity("J", "least energy of a frame")
    frame_energy_max: float = quantity("J", "greatest energy of a frame")
    mean_factor: float = as_in(PassPower, "mean_factor")
    predicted_power: float | None = quantity(
        "W", "power that the power model predicts for that factor", default=None
    )

    def __post_init__(self) -> None:
        if (self.ci_low is None) != (self.ci_high is None):
            raise ValueError("ci_low_w and ci_high_w must both be there, or neither")
        if self.ci_low is not None and self.ci_high is not None and self.ci_low > self.ci_high:
            raise ValueError(f"need ci_low <= ci_high, got {self.ci_low:g} and {self.ci_high:g} W")


@record
class EqualPower:
    """Whether the track and baseline take the same power, freed from the drift that they share."""

    difference: float = quantity(
        "W", "power of the track less baseline, freed from the drift that they share"
    )
    ci_low: float | None = quantity(
        "W", "lower end of its 95 % confidence interval; null without repetitions"
    )
    ci_high: float | None = quantity(
        "W", "upper end of its 95 % confidence interval; null without repetitions"
    )
    degrees_of_freedom: int = count("degrees of freedom of interval and test; 0 without repetitions")
    margin: float | None = quantity(
        "W",
        "differences below this count as none; null if full brightness, whose share it is, was not measured",
        above=0.0,
    )
    p: float | None = share(
        "greater p-value of two one-sided t-tests: how probable so small a difference is if it is the margin"
    )
    equal: bool | None = described(
        "true if the tests find the difference within the margin; null if they could not be made"
    )


@record
class PlayedPower:
    """Measured power of a played video, `played_power.json`."""

    simulated: bool = described("true if power meter or panel are simulated")
    video: str = described("what was played")
    duration: float = quantity("s", "duration of the video", above=0.0)
    refresh_rate: float = quantity("Hz", "refresh rate of the display", above=0.0)
    sample_rate: float = quantity("Hz", "sample rate of the power meter", above=0.0)
    clock: ClockFit = described("how the meter's clock was put on the computer's")
    samples: SampleCount = described("which samples came")
    passes: tuple[PassPower, ...] = described("each time through the video")
    versions: tuple[VersionPower, ...] = described("what was measured of each version")
    equal_power: EqualPower | None = described(
        "the track against baseline; null if one of them was not measured"
    )
    drift_w_h: float | None = quantity(
        "W/h", "rise of the power of one and the same version, per hour; null without repetitions"
    )
    power_model: str = described("name of the model that predicts; empty without one", default="")
    notes: tuple[str, ...] = described("what a reader should be warned of", default=())
    provenance: Provenance = described("how the file was made", default=Provenance())


@record
class DevicePass:
    """One time through a film on a device, a row of `passes.csv`; its samples are in `power.csv`."""

    pass_index: int = count("which pass, from 0")
    version: str = described("which version of the film", pattern="^(full|dimmed)$")
    begun: float = quantity("s", "when it counts from: after the settling time, on the computer's clock")
    duration: float = quantity("s", "how long it counts", above=0.0)
    mean_power: float = quantity("W", "mean power of the device over that time, weighted by time", above=0.0)
    n_samples: int = count("samples that came in that time", minimum=2)
    n_lost: int = count("samples that did not come")
    longest_hold: float = quantity(
        "s", "the longest time for which the meter gave one and the same value", minimum=0.0
    )
    n_wild: int = count("samples left out: over 3 times the pass's median, or under a third of it", default=0)

    @property
    def used(self) -> bool:
        """Whether it counts: what does not is not recorded."""
        return True


@record
class DeviceSaving:
    """The power that a dimmed version saves of the whole device, `saving.json`.

    Both versions are compared at one and the same time, freed from the device's straight drift; intervals are
    of 95 %, from Student's t over the passes.
    """

    simulated: bool = described("true if the device is simulated")
    instrument: str = described("what measured the power")
    full: str = described("the film at full brightness")
    dimmed: str = described("its dimmed version")
    settle: float = quantity("s", "time at the beginning of each pass that does not count", minimum=0.0)
    passes: tuple[DevicePass, ...] = described("each pass, in order")
    full_power: float = quantity("W", "mean power of the device with the film at full brightness", above=0.0)
    dimmed_power: float = quantity("W", "the same with its dimmed version", above=0.0)
    saving_percent: float = quantity("%", "1 - dimmed/full, freed from drift", key="saving_percent")
    ci_low: float = quantity("%", "lower end of its interval", key="saving_percent_ci_low")
    ci_high: float = quantity("%", "upper end of its interval", key="saving_percent_ci_high")
    degrees_of_freedom: int = count("of the interval", minimum=1)
    detectable_percent: float = quantity(
        "%", "saving that such a measurement tells from none four times in five", minimum=0.0
    )
    drift_percent_h: float = quantity("%", "rise of the power of one and the same version, per hour")
    notes: tuple[str, ...] = described("what a reader should be warned of", default=())
    apparatus: dict[str, str] = described("what the instrument says of itself", factory=dict)
    provenance: Provenance = described("how the file was made", default=Provenance())
