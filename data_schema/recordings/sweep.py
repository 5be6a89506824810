"""Sweeps: a display measured level by level, with a luminance meter or a power meter."""

from __future__ import annotations

import enum

from evenlight.data_schema.display import HIGHEST_LUMINANCE, Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionStatus

FEWEST_READINGS = 3  # of each level: fewer do not separate noise from an error
SIXTEENTHS = tuple(step / 16 for step in range(17))
TENTHS = tuple(step / 10 for step in range(1, 11))


class SweepPhase(enum.Enum):
    """What a reading of a sweep is for."""

    WARM_UP = "warm_up"  # the display at full brightness, until it is steady
    SWEEP = "sweep"
    DRIFT = "drift"  # levels repeated at the end


class ReadingStatus(enum.Enum):
    """Whether there is a value."""

    OK = "ok"
    UNDER_RANGE = "under_range"  # darker than the instrument measures: no value


@record
class LuminanceSweepDesign:
    """Which levels of a display are measured with a luminance meter, and how often."""

    name: str = described("name of the design", default="standard")
    pixel_values: tuple[float, ...] = share(
        "pixel values L' of a uniform screen at full brightness, with black and white among them",
        min_items=3,
        default=SIXTEENTHS,
    )
    factors: tuple[float, ...] = share(
        "brightness factors b of the white screen; empty to measure pixel values only",
        above=0.0,
        default=TENTHS,
    )
    repeats: int = quantity(
        "1",
        "readings of each level, each time in another random order",
        minimum=FEWEST_READINGS,
        default=FEWEST_READINGS,
    )
    settle: float = quantity("s", "time from a change of level to its reading", minimum=0.0, default=1.0)
    warm_up: float = quantity("s", "how long the white screen is shown first", minimum=0.0, default=1800.0)
    warm_up_interval: float = quantity(
        "s", "time between two readings of the warm-up", above=0.0, default=60.0
    )
    drift_pixel_values: tuple[float, ...] = share(
        "pixel values that are measured again at the end, as often as the others", default=(0.5, 1.0)
    )
    retries: int = count("how often a reading that failed on its way is tried again", default=2)
    reflected_luminance: float = quantity(
        "cd/m^2",
        "L_refl, read with the display off in the light of the sweep",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
        default=0.0,
    )

    def __post_init__(self) -> None:
        if not {0.0, 1.0} <= set(self.pixel_values):
            raise ValueError("pixel_values must hold 0 and 1: black and white are measured")
        if missing := set(self.drift_pixel_values) - set(self.pixel_values):
            raise ValueError(f"drift_pixel_values must be among pixel_values, got {min(missing):g}")
        _refuse_repeated("pixel_values", self.pixel_values)
        _refuse_repeated("factors", self.factors)


@record
class PowerSweepDesign:
    """At which brightness factors the power of a panel is measured, and how long."""

    name: str = as_in(LuminanceSweepDesign, "name")
    factors: tuple[float, ...] = share(
        "brightness factors b of the white screen", above=0.0, min_items=3, default=TENTHS
    )
    repeats: int = quantity(
        "1",
        "readings of each factor, each time in another random order",
        minimum=FEWEST_READINGS,
        default=FEWEST_READINGS,
    )
    average: float = quantity("s", "how long power is averaged for one reading", above=0.0, default=2.0)
    sample_rate: float = quantity("Hz", "sample rate of the power meter", above=0.0, default=100.0)
    settle: float = quantity("s", "time from a change of factor to its reading", minimum=0.0, default=1.0)
    warm_up: float = as_in(LuminanceSweepDesign, "warm_up")
    warm_up_interval: float = as_in(LuminanceSweepDesign, "warm_up_interval")
    drift_factors: tuple[float, ...] = share(
        "factors that are measured again at the end, as often as the others", above=0.0, default=(1.0,)
    )
    retries: int = as_in(LuminanceSweepDesign, "retries")
    reflected_luminance: float = quantity(
        "cd/m^2",
        "L_refl, read with the display off in the light of the sweep; taken off what a luminance meter reads",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
        default=0.0,
    )

    def __post_init__(self) -> None:
        if missing := set(self.drift_factors) - set(self.factors):
            raise ValueError(f"drift_factors must be among factors, got {min(missing):g}")
        _refuse_repeated("factors", self.factors)


SweepDesign = LuminanceSweepDesign | PowerSweepDesign
DESIGN_OF_SWEEP: dict[str, type[SweepDesign]] = {
    "luminance-sweep": LuminanceSweepDesign,
    "power-sweep": PowerSweepDesign,
}


@record
class LuminanceReading:
    """One reading of a luminance sweep, as one line of `readings.jsonl`."""

    index: int = count("place in the sweep, from 0")
    phase: SweepPhase = described("what the reading is for")
    repeat: int = count("which reading of its level, from 1", minimum=1)
    pixel_value: float = share("L' that was shown, a code of the display")
    factor: float | None = share(
        "brightness factor b that was asked for; null in the sweep of pixel values, at full brightness",
        above=0.0,
    )
    achieved_factor: float = share("brightness factor that the device has taken")
    luminance: float | None = quantity(
        "cd/m^2",
        "L as it was read, reflected light included; null if too dark for the meter",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
    )
    status: ReadingStatus = described("whether there is a value")
    meter_status: str = described("the meter's own word or code")
    begun: float = quantity("s", "right before the reading, since the sweep began", minimum=0.0)
    ended: float = quantity("s", "right after the reading, since the sweep began", minimum=0.0)
    chromaticity_x: float | None = quantity(
        "1", "CIE 1931 x; null from a meter that does not measure it", default=None
    )
    chromaticity_y: float | None = quantity(
        "1", "CIE 1931 y; null from a meter that does not measure it", default=None
    )
    attempts: int = count("tries that it took", minimum=1, default=1)
    utc: str = described("when it ended, UTC (ISO 8601); empty without a clock", default="")
    again_of: int | None = count(
        "index of the reading that it repeats at once, because that contradicted those before it; null of a "
        "reading that the design asks for",
        default=None,
    )

    def __post_init__(self) -> None:
        _check_reading(self.luminance, self.status, self.begun, self.ended)

    @property
    def level(self) -> tuple[str, float]:
        """Which kind of level it is of, and the level."""
        return ("pixel value", self.pixel_value) if self.factor is None else ("factor", self.factor)

    @property
    def measured(self) -> dict[str, float | None]:
        """What was read, by its unit; None if too dark for the meter."""
        return {"cd/m^2": self.luminance}


@record
class PowerReading:
    """One reading of a power sweep, as one line of `readings.jsonl`."""

    index: int = as_in(LuminanceReading, "index")
    phase: SweepPhase = described("what the reading is for")
    repeat: int = as_in(LuminanceReading, "repeat")
    factor: float = share("brightness factor b of the white screen that was asked for", above=0.0)
    achieved_factor: float = as_in(LuminanceReading, "achieved_factor")
    luminance: float | None = quantity(
        "cd/m^2",
        "L that a luminance meter read right after; null without a meter, or if too dark",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
    )
    luminance_status: ReadingStatus | None = described(
        "whether the luminance meter had a value; null without a meter"
    )
    power: float = quantity("W", "time-weighted mean power")
    power_sd: float = quantity("W", "standard deviation of the samples", minimum=0.0)
    duration: float = quantity("s", "from the first to the last sample, on the meter's clock", minimum=0.0)
    n_samples: int = count("samples that came, by the meter's own count", minimum=1)
    n_lost: int = count("samples that did not come")
    n_duplicated: int = count("samples that came twice")
    meter_status: str = as_in(LuminanceReading, "meter_status")
    begun: float = as_in(LuminanceReading, "begun")
    ended: float = as_in(LuminanceReading, "ended")
    attempts: int = as_in(LuminanceReading, "attempts")
    utc: str = as_in(LuminanceReading, "utc")
    again_of: int | None = as_in(LuminanceReading, "again_of")

    def __post_init__(self) -> None:
        _check_reading(self.luminance, self.luminance_status, self.begun, self.ended)

    @property
    def level(self) -> tuple[str, float]:
        """Which kind of level it is of, and the level."""
        return "factor", self.factor

    @property
    def measured(self) -> dict[str, float | None]:
        """What was read, by its unit; a luminance of None if too dark for the meter."""
        light = {} if self.luminance_status is None else {"cd/m^2": self.luminance}
        return {"W": self.power, **light}


@record
class SweepManifest:
    """What a sweep is: which design, of which display, with which instruments."""

    session_id: str = described("which sweep", pattern="^[0-9A-Za-z]+$")
    task: str = described("luminance-sweep or power-sweep", pattern="^(luminance|power)-sweep$")
    simulated: bool = described("true if any instrument, or the display, is simulated")
    status: SessionStatus = described("how far the sweep got")
    n_readings: int = count("readings that the design asks for, the warm-up's included")
    design: SweepDesign = described("what is measured")
    rig: Rig = described("what it ran on")
    display_name: str = described("what the display is called")
    pixels_per_degree: float | None = quantity(
        "1/deg",
        "pixels per degree of the display, as its file or the rig has it; null of a panel "
        "that is not watched",
        above=0.0,
    )
    peak_luminance: float | None = quantity(
        "cd/m^2",
        "luminance of the display at b = 1, as its file has it: for a power sweep without a luminance meter",
        above=0.0,
    )
    provenance: Provenance = described("how the file was made")
    display: Display | None = described(
        "the display as the rig's file has it; null if it has no file yet", default=None
    )
    measured_by: str = described("who measured, as a code", default="", pattern="^[0-9A-Za-z]*$")
    apparatus: dict[str, str] = described("what instruments and window say of themselves", factory=dict)
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        expected = DESIGN_OF_SWEEP[self.task]
        if not isinstance(self.design, expected):
            raise ValueError(
                f"the design of the task {self.task!r} must be a {expected.__name__}, got a "
                f"{type(self.design).__name__}"
            )


def _refuse_repeated(name: str, levels: tuple[float, ...]) -> None:
    if len(set(levels)) < len(levels):
        raise ValueError(f"{name} must differ from each other; `repeats` says how often each is measured")


def _check_reading(luminance: float | None, status: ReadingStatus | None, begun: float, ended: float) -> None:
    if ended < begun:
        raise ValueError(f"need begun <= ended, got {begun:g} and {ended:g} s")
    if (luminance is not None) != (status is ReadingStatus.OK):
        raise ValueError("a luminance must be there where its status is ok, and null otherwise")
