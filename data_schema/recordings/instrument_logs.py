"""What instruments record: samples of a power meter and readings of a luminance meter, one row each.

Beside the samples of a played video lie the clocks and what was shown when: flips, backlight, flashes.
"""

from __future__ import annotations

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import count, described, quantity, record, share


@record
class PowerSample:
    """One sample of a power meter, a row of `power.csv`."""

    sequence: int = count("the instrument's own count: a gap is a lost sample, a repetition a duplicated one")
    device_time: float = quantity("s", "when, on the instrument's clock; on the computer's where it has none")
    received: float = quantity("s", "when it had arrived, on the computer's clock")
    power: float = quantity(
        "W", "mean power since the sample before; a little below 0 is the meter's zero error"
    )
    sync: bool = described("level of the synchronisation input at that moment", default=False)


@record
class ClockPing:
    """One comparison of two clocks: the instrument gave its time between two times of the computer."""

    sent: float = quantity("s", "on the computer's clock, right before the question")
    device_time: float = quantity("s", "what the instrument answered")
    received: float = quantity("s", "on the computer's clock, right after the answer")

    def __post_init__(self) -> None:
        if self.received < self.sent:
            raise ValueError(f"need sent <= received, got {self.sent:g} and {self.received:g} s")


@record
class PlayedFlip:
    """One refresh of the display that showed a frame of a played video, a row of `flips.csv`."""

    pass_index: int = count("which time through the video, from 0")
    version: str = described("how the video was dimmed", pattern="^(ours|baseline|full)$")
    flip: float = quantity("s", "when it appeared, on the computer's clock")
    video_frame: int = count("frame of the video")
    factor: float = share("brightness factor b that was asked for")
    achieved_factor: float = share("brightness factor that pixels or backlight made of it")
    sync: bool = described(
        "level of the synchronisation line from this flip on; it changes with every new video frame"
    )


@record
class BacklightSetting:
    """One setting of a backlight, a row of `backlight.csv`."""

    begun: float = quantity("s", "right before it was set, on the computer's clock")
    ended: float = quantity("s", "right after the device had taken it, on the computer's clock")
    commanded: float = quantity("1", "brightness factor b that was asked for")
    achieved: float | None = quantity(
        "1", "brightness factor that the device has taken; empty where it refused"
    )


@record
class FlashMark:
    """One change of a flash marker, a row of `flashes.csv`: the whole brightness, up or down.

    Three flashes of half a second, before what is played and after it, are found in the power of a meter
    without a synchronisation input.
    """

    time: float = quantity("s", "when it appeared, on the computer's clock")
    factor: float = share("brightness factor b from then on")


@record
class PowerLog:
    """What the power of a played video was measured on, `power_log.json` beside its tables."""

    simulated: bool = described("true if power meter or panel are simulated")
    video: str = described("what was played")
    duration: float = quantity("s", "duration of the video", above=0.0)
    passes: tuple[str, ...] = described("version of each pass, in order", pattern="^(ours|baseline|full)$")
    refresh_rate: float = quantity("Hz", "refresh rate of the display", above=0.0)
    sample_rate: float = quantity("Hz", "sample rate of the power meter", above=0.0)
    mean_factor: float = share("mean brightness factor of the track", above=0.0)
    baseline_factor: float = share("brightness factor of constant dimming at equal power", above=0.0)
    sync_connected: bool = described("true if the meter's synchronisation input follows the frames")
    apparatus: dict[str, str] = described("what the devices say of themselves", factory=dict)
    provenance: Provenance = described("how the file was made", default=Provenance())
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")
    shown: str = described("what the window showed of the video, and how large; empty if unknown", default="")


@record
class MeterReading:
    """One reading of a luminance meter, a row of a table."""

    index: int = count("which reading, from 1", minimum=1)
    utc: str = described("when it ended, UTC (ISO 8601); empty without a clock")
    begun: float = quantity("s", "right before the reading, since the first began", minimum=0.0)
    ended: float = quantity("s", "right after the reading, since the first began", minimum=0.0)
    luminance: float = quantity(
        "cd/m^2", "luminance as the meter gave it, reflected light included", minimum=0.0
    )
    meter: str = described("name of the instrument; a simulated one begins with simulated")
    meter_status: str = described("the meter's own word or code", default="")
    chromaticity_x: float | None = quantity(
        "1", "CIE 1931 x; empty from a meter that does not measure it", default=None
    )
    chromaticity_y: float | None = quantity(
        "1", "CIE 1931 y; empty from a meter that does not measure it", default=None
    )

    def __post_init__(self) -> None:
        if self.ended < self.begun:
            raise ValueError(f"need begun <= ended, got {self.begun:g} and {self.ended:g} s")
