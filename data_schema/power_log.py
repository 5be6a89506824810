"""Power over time while something was played: samples, clocks, and what was shown when."""

from __future__ import annotations

from dataclasses import dataclass, field

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity


@dataclass(frozen=True, slots=True)
class PowerSample:
    """One sample of a power meter, a row of `power.csv`.

    Attributes
    ----------
    sequence : int
        The instrument's own count: a gap is a lost sample, a repetition a duplicated one.
    device_time : float
        When, on the instrument's clock; on the computer's where it has none [s].
    received : float
        When it had arrived, on the computer's clock [s].
    power : float
        Power, the mean since the sample before [W]; a little below 0 is a meter's zero error.
    sync : bool
        Level of the synchronisation input at that moment.
    """

    sequence: int = quantity("1", "the instrument's own count", minimum=0)
    device_time: float = quantity("s", "when, on the instrument's clock")
    received: float = quantity("s", "when it had arrived, on the computer's clock")
    power: float = quantity("W", "power, the mean since the sample before")
    sync: bool = described("level of the synchronisation input", default=False)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class ClockPing:
    """One comparison of two clocks: the instrument told its time between two times of the computer.

    Attributes
    ----------
    sent : float
        On the computer's clock, right before the question [s].
    device_time : float
        What the instrument answered [s].
    received : float
        On the computer's clock, right after the answer [s].
    """

    sent: float = quantity("s", "on the computer's clock, right before the question")
    device_time: float = quantity("s", "what the instrument answered")
    received: float = quantity("s", "on the computer's clock, right after the answer")

    def __post_init__(self) -> None:
        check_limits(self)
        if self.received < self.sent:
            raise ValueError(f"need sent <= received, got {self.sent:g} and {self.received:g} s")


@dataclass(frozen=True, slots=True)
class PlayedFlip:
    """One refresh of the display that showed a frame of a played video, a row of `flips.csv`.

    Attributes
    ----------
    pass_index : int
        Which time through the video, from 0.
    version : str
        How it was dimmed: "ours", "baseline" or "full".
    flip : float
        When it appeared, on the computer's clock [s].
    video_frame : int
        Frame of the video.
    factor : float
        Brightness factor b that was asked for.
    achieved_factor : float
        The one that pixels or backlight have made of it.
    sync : bool
        Level of the synchronisation line from this flip on; it changes with every new video frame.
    """

    pass_index: int = quantity("1", "which time through the video, from 0", minimum=0)
    version: str = described("how it was dimmed", pattern="^(ours|baseline|full)$")
    flip: float = quantity("s", "when it appeared, on the computer's clock")
    video_frame: int = quantity("1", "frame of the video", minimum=0)
    factor: float = quantity("1", "brightness factor that was asked for", minimum=0.0, maximum=1.0)
    achieved_factor: float = quantity("1", "the one that was made of it", minimum=0.0, maximum=1.0)
    sync: bool = described("level of the synchronisation line from this flip on")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class BacklightSetting:
    """One setting of a backlight, a row of `backlight.csv`.

    Attributes
    ----------
    begun, ended : float
        Right before it was set, and right after the device had taken it, on the computer's clock [s].
    commanded : float
        Brightness factor b that was asked for.
    achieved : float or None
        The one that the device has taken; None where it refused.
    """

    begun: float = quantity("s", "right before it was set, on the computer's clock")
    ended: float = quantity("s", "right after the device had taken it")
    commanded: float = quantity("1", "brightness factor that was asked for")
    achieved: float | None = quantity("1", "the one that the device has taken; empty where it refused")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class FlashMark:
    """One change of a flash marker, a row of `flashes.csv`: the whole brightness, up or down.

    Three flashes of half a second, before what is played and after it, are found in the power of a meter
    without a synchronisation input.

    Attributes
    ----------
    time : float
        When it appeared, on the computer's clock [s].
    factor : float
        Brightness factor b from then on.
    """

    time: float = quantity("s", "when it appeared, on the computer's clock")
    factor: float = quantity("1", "brightness factor from then on", minimum=0.0, maximum=1.0)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class PowerLog:
    """What the power of a played video was measured on, `power_log.json` beside its tables.

    Attributes
    ----------
    simulated : bool
        Whether power meter or panel are simulated.
    video : str
        What was played.
    duration : float
        Of the video [s].
    passes : tuple of str
        The version of each pass, in order.
    refresh_rate : float
        Of the display [Hz].
    sample_rate : float
        Of the power meter [Hz].
    mean_factor, baseline_factor : float
        Of the track, and of constant dimming at equal power.
    sync_connected : bool
        Whether the meter's synchronisation input follows the frames.
    apparatus : dict of str to str
        What the devices said of themselves.
    provenance : Provenance
        Software, and the SHA-256 of the track.
    started : str
        When it began, UTC (ISO 8601); empty from a simulation without a clock.
    """

    simulated: bool = described("true if power meter or panel are simulated")
    video: str = described("what was played")
    duration: float = quantity("s", "of the video", above=0.0)
    passes: tuple[str, ...] = described("version of each pass, in order", pattern="^(ours|baseline|full)$")
    refresh_rate: float = quantity("Hz", "of the display", above=0.0)
    sample_rate: float = quantity("Hz", "of the power meter", above=0.0)
    mean_factor: float = quantity("1", "of the track", above=0.0, maximum=1.0)
    baseline_factor: float = quantity("1", "of constant dimming at equal power", above=0.0, maximum=1.0)
    sync_connected: bool = described("true if the synchronisation input follows the frames")
    apparatus: dict[str, str] = field(
        default_factory=dict, metadata={"doc": "what the devices say of themselves"}
    )
    provenance: Provenance = described("how the file was made", default=Provenance())
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        check_limits(self)
