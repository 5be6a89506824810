"""Measured average power of a played video: ours, baseline and full brightness (the paper's power table)."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.frame_energy import ClockFit, SampleCount
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity

VERSION = "^(ours|baseline|full)$"


@dataclass(frozen=True, slots=True)
class PassPower:
    """Power of one time through a video.

    Attributes
    ----------
    pass_index : int
        Which, from 0.
    version : str
        How the video was dimmed.
    begun : float
        When its first frame appeared, on the computer's clock [s].
    duration : float
        Until its last frame had gone [s].
    mean_power : float or None
        Energy over time, of the frames that have an energy; None if no frame has one [W].
    mean_factor : float
        Mean over time of the brightness factor b that was achieved.
    n_frames, n_left_out : int
        Frames shown, and those of them without an energy.
    n_dropped : int
        Refreshes of the display that passed without a new picture where one was due.
    measured_share : float
        Share of the video's duration that is in `mean_power`.
    bridged_share : float
        Share of the measured time without a sample.
    used : bool
        Whether it counts in the means of its version: enough of the video was measured.
    """

    pass_index: int = quantity("1", "which time through the video, from 0", minimum=0)
    version: str = described("how the video was dimmed", pattern=VERSION)
    begun: float = quantity("s", "when its first frame appeared, on the computer's clock")
    duration: float = quantity("s", "until its last frame had gone", above=0.0)
    mean_power: float | None = quantity("W", "energy over time of the frames with an energy")
    mean_factor: float = quantity("1", "mean over time of the achieved factor", minimum=0.0, maximum=1.0)
    n_frames: int = quantity("1", "frames shown", minimum=1)
    n_left_out: int = quantity("1", "frames without an energy", minimum=0)
    n_dropped: int = quantity("1", "refreshes without a new picture where one was due", minimum=0)
    measured_share: float = quantity("1", "share of the video that was measured", minimum=0.0)
    bridged_share: float = quantity("1", "share of that time without a sample", minimum=0.0, maximum=1.0)
    used: bool = described("true if it counts in the means of its version")

    def __post_init__(self) -> None:
        check_limits(self)
        if self.used and self.mean_power is None:
            raise ValueError("a pass that is used must have a mean_power_w")


@dataclass(frozen=True, slots=True)
class VersionPower:
    """Measured average power of a version of a video, a row of `power_table.csv`.

    Intervals are of 95 %, from Student's t over passes; None without repetitions. What a version saves is
    freed from the drift that all versions share.

    Attributes
    ----------
    version : str
        How the video was dimmed.
    n_passes : int
        Passes that count.
    mean_power : float
        Energy of all passes over their time [W].
    sd_power : float or None
        Standard deviation of the passes' means [W].
    ci_low, ci_high : float or None
        Interval of the mean [W].
    saving : float or None
        Power of full brightness less this; None where full brightness was not measured [W].
    saving_percent, saving_percent_ci_low, saving_percent_ci_high : float or None
        The same in percent of full brightness, and its interval.
    frame_energy_min, frame_energy_max : float
        Least and greatest energy of a frame [J].
    mean_factor : float
        Mean over time of the brightness factor b that was achieved.
    predicted_power : float or None
        What a power model says of that factor [W].
    """

    version: str = described("how the video was dimmed", pattern=VERSION)
    n_passes: int = quantity("1", "passes that count", minimum=1)
    mean_power: float = quantity("W", "energy of all passes over their time")
    sd_power: float | None = quantity("W", "standard deviation of the passes' means", minimum=0.0)
    ci_low: float | None = quantity("W", "lower end of the 95 % interval of the mean")
    ci_high: float | None = quantity("W", "upper end of it")
    saving: float | None = quantity("W", "power of full brightness less this, at the same time")
    saving_percent: float | None = quantity("1", "the same in percent of full brightness")
    saving_percent_ci_low: float | None = quantity("1", "lower end of its 95 % interval")
    saving_percent_ci_high: float | None = quantity("1", "upper end of it")
    frame_energy_min: float = quantity("J", "least energy of a frame")
    frame_energy_max: float = quantity("J", "greatest energy of a frame")
    mean_factor: float = quantity("1", "mean over time of the achieved factor", minimum=0.0, maximum=1.0)
    predicted_power: float | None = quantity("W", "what a power model says of that factor", default=None)

    def __post_init__(self) -> None:
        check_limits(self)
        if (self.ci_low is None) != (self.ci_high is None):
            raise ValueError("ci_low_w and ci_high_w must both be there, or neither")
        if self.ci_low is not None and self.ci_high is not None and self.ci_low > self.ci_high:
            raise ValueError(f"need ci_low <= ci_high, got {self.ci_low:g} and {self.ci_high:g} W")


@dataclass(frozen=True, slots=True)
class EqualPower:
    """Whether ours and baseline take the same power, freed from the drift that they share.

    Attributes
    ----------
    difference : float
        Ours less baseline [W].
    ci_low, ci_high : float or None
        Its 95 % interval; None without repetitions [W].
    degrees_of_freedom : int
        That the interval and the test rest on; 0 without repetitions.
    margin : float or None
        Differences below this count as none; None where full brightness, whose share it is, is unknown [W].
    p : float or None
        Of two one-sided t-tests, the greater: how probable as small a difference is if it is the margin.
    equal : bool or None
        Whether the tests say that the difference is within the margin; None where they could not be made.
    """

    difference: float = quantity("W", "ours less baseline")
    ci_low: float | None = quantity("W", "lower end of its 95 % interval")
    ci_high: float | None = quantity("W", "upper end of it")
    degrees_of_freedom: int = quantity("1", "that interval and test rest on", minimum=0)
    margin: float | None = quantity("W", "differences below this count as none", above=0.0)
    p: float | None = quantity("1", "of two one-sided t-tests, the greater", minimum=0.0, maximum=1.0)
    equal: bool | None = described("true if the tests say that the difference is within the margin")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class PlayedPower:
    """Measured power of a played video, `played_power.json`.

    Attributes
    ----------
    simulated : bool
        Whether power meter or panel are simulated.
    video : str
        What was played.
    duration : float
        Of the video [s].
    refresh_rate, sample_rate : float
        Of display and power meter [Hz].
    clock : ClockFit
        How the meter's clock was put on the computer's.
    samples : SampleCount
        Which samples came.
    passes : tuple of PassPower
        Each time through the video.
    versions : tuple of VersionPower
        What was measured of each version.
    equal_power : EqualPower or None
        Ours against baseline; None if one of them was not measured.
    drift_w_h : float or None
        By how much the power of one and the same version rose, per hour; None without repetitions.
    power_model : str
        Name of the model that predicts; empty without one.
    notes : tuple of str
        What a reader should be warned of.
    provenance : Provenance
        Software, and the SHA-256 of what was read.
    """

    simulated: bool = described("true if power meter or panel are simulated")
    video: str = described("what was played")
    duration: float = quantity("s", "of the video", above=0.0)
    refresh_rate: float = quantity("Hz", "of the display", above=0.0)
    sample_rate: float = quantity("Hz", "of the power meter", above=0.0)
    clock: ClockFit = described("how the meter's clock was put on the computer's")
    samples: SampleCount = described("which samples came")
    passes: tuple[PassPower, ...] = described("each time through the video")
    versions: tuple[VersionPower, ...] = described("what was measured of each version")
    equal_power: EqualPower | None = described("ours against baseline")
    drift_w_h: float | None = quantity("W/h", "rise of the power of a version per hour")
    power_model: str = described("name of the model that predicts; empty without one", default="")
    notes: tuple[str, ...] = described("what a reader should be warned of", default=())
    provenance: Provenance = described("how the file was made", default=Provenance())

    def __post_init__(self) -> None:
        check_limits(self)
