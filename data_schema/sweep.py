"""Sweeps: a display measured level by level, with a luminance meter or a power meter."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

from evenlight.data_schema.display import HIGHEST_LUMINANCE, Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.rig import Rig
from evenlight.data_schema.session import SessionStatus

FEWEST_READINGS = 3  # of each level: fewer do not tell noise from a slip
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


@dataclass(frozen=True, slots=True)
class LuminanceSweepDesign:
    """Which levels of a display are measured with a luminance meter, and how often.

    Attributes
    ----------
    name : str
        What the design is called.
    pixel_values : tuple of float
        Pixel values L' of a uniform screen at full brightness; black and white are among them.
    factors : tuple of float
        Brightness factors b of the white screen; empty to measure pixel values only.
    repeats : int
        Readings of each level, each time in another random order.
    settle : float
        From a change of level to its reading [s].
    warm_up : float
        How long the white screen is shown first [s].
    warm_up_interval : float
        Between two readings of the warm-up [s].
    drift_pixel_values : tuple of float
        Pixel values that are measured again at the end, `repeats` times each.
    retries : int
        How often a reading that failed on its way is tried again.
    reflected_luminance : float
        L_refl, read with the display off in the light of the sweep [cd/m^2].
    """

    name: str = described("name of the design", default="standard")
    pixel_values: tuple[float, ...] = quantity(
        "1", "pixel values of a uniform screen", minimum=0.0, maximum=1.0, min_items=3, default=SIXTEENTHS
    )
    factors: tuple[float, ...] = quantity(
        "1", "brightness factors of the white screen", above=0.0, maximum=1.0, default=TENTHS
    )
    repeats: int = quantity("1", "readings of each level", minimum=FEWEST_READINGS, default=FEWEST_READINGS)
    settle: float = quantity("s", "from a change of level to its reading", minimum=0.0, default=1.0)
    warm_up: float = quantity("s", "how long the white screen is shown first", minimum=0.0, default=1800.0)
    warm_up_interval: float = quantity("s", "between two readings of it", above=0.0, default=60.0)
    drift_pixel_values: tuple[float, ...] = quantity(
        "1", "pixel values measured again at the end", minimum=0.0, maximum=1.0, default=(0.5, 1.0)
    )
    retries: int = quantity("1", "tries more of a reading that failed on its way", minimum=0, default=2)
    reflected_luminance: float = quantity(
        "cd/m^2", "read with the display off", minimum=0.0, maximum=HIGHEST_LUMINANCE, default=0.0
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if not {0.0, 1.0} <= set(self.pixel_values):
            raise ValueError("pixel_values must hold 0 and 1: black and white are measured")
        if missing := set(self.drift_pixel_values) - set(self.pixel_values):
            raise ValueError(f"drift_pixel_values must be among pixel_values, got {min(missing):g}")
        _refuse_repeated("pixel_values", self.pixel_values)
        _refuse_repeated("factors", self.factors)


@dataclass(frozen=True, slots=True)
class PowerSweepDesign:
    """At which brightness factors the power of a panel is measured, and how long.

    Attributes
    ----------
    name : str
        What the design is called.
    factors : tuple of float
        Brightness factors b of the white screen.
    repeats : int
        Readings of each factor, each time in another random order.
    average : float
        How long power is averaged for one reading [s].
    sample_rate : float
        Of the power meter [Hz].
    settle, warm_up, warm_up_interval, retries
        As of `LuminanceSweepDesign`.
    drift_factors : tuple of float
        Factors that are measured again at the end, `repeats` times each.
    reflected_luminance : float
        L_refl, read with the display off in the light of the sweep; taken off what a luminance meter reads
        [cd/m^2].
    """

    name: str = described("name of the design", default="standard")
    factors: tuple[float, ...] = quantity(
        "1", "brightness factors of the white screen", above=0.0, maximum=1.0, min_items=3, default=TENTHS
    )
    repeats: int = quantity("1", "readings of each factor", minimum=FEWEST_READINGS, default=FEWEST_READINGS)
    average: float = quantity("s", "over which power is averaged", above=0.0, default=2.0)
    sample_rate: float = quantity("Hz", "of the power meter", above=0.0, default=100.0)
    settle: float = quantity("s", "from a change of factor to its reading", minimum=0.0, default=1.0)
    warm_up: float = quantity("s", "how long the white screen is shown first", minimum=0.0, default=1800.0)
    warm_up_interval: float = quantity("s", "between two readings of it", above=0.0, default=60.0)
    drift_factors: tuple[float, ...] = quantity(
        "1", "factors measured again at the end", above=0.0, maximum=1.0, default=(1.0,)
    )
    retries: int = quantity("1", "tries more of a reading that failed on its way", minimum=0, default=2)
    reflected_luminance: float = quantity(
        "cd/m^2", "read with the display off", minimum=0.0, maximum=HIGHEST_LUMINANCE, default=0.0
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if missing := set(self.drift_factors) - set(self.factors):
            raise ValueError(f"drift_factors must be among factors, got {min(missing):g}")
        _refuse_repeated("factors", self.factors)


SweepDesign = LuminanceSweepDesign | PowerSweepDesign
DESIGN_OF_SWEEP: dict[str, type[SweepDesign]] = {
    "luminance-sweep": LuminanceSweepDesign,
    "power-sweep": PowerSweepDesign,
}


@dataclass(frozen=True, slots=True)
class LuminanceReading:
    """One reading of a luminance sweep, as one line of `readings.jsonl`.

    Attributes
    ----------
    index : int
        Its place in the sweep, from 0.
    phase : SweepPhase
        What it is for.
    repeat : int
        Which reading of its level, from 1.
    pixel_value : float
        L' that was shown, a code of the display.
    factor : float or None
        Brightness factor b that was asked for; None in the sweep of pixel values, at full brightness.
    achieved_factor : float
        The one that the device has taken.
    luminance : float or None
        L as it was read, reflected light included; None where the screen was too dark for the meter [cd/m^2].
    status : ReadingStatus
        Whether there is a value.
    meter_status : str
        The meter's own word or code.
    begun, ended : float
        Right before and right after the reading, since the sweep began [s].
    chromaticity_x, chromaticity_y : float or None
        CIE 1931, of meters that measure them.
    attempts : int
        Tries that it took.
    utc : str
        When it ended (ISO 8601); empty from a simulation without a clock.
    """

    index: int = quantity("1", "place in the sweep, from 0", minimum=0)
    phase: SweepPhase = described("what the reading is for")
    repeat: int = quantity("1", "which reading of its level, from 1", minimum=1)
    pixel_value: float = quantity("1", "L' that was shown", minimum=0.0, maximum=1.0)
    factor: float | None = quantity("1", "brightness factor that was asked for", above=0.0, maximum=1.0)
    achieved_factor: float = quantity("1", "the one that the device has taken", minimum=0.0, maximum=1.0)
    luminance: float | None = quantity(
        "cd/m^2", "as it was read; null where too dark", minimum=0.0, maximum=HIGHEST_LUMINANCE
    )
    status: ReadingStatus = described("whether there is a value")
    meter_status: str = described("the meter's own word or code")
    begun: float = quantity("s", "right before the reading, since the sweep began", minimum=0.0)
    ended: float = quantity("s", "right after it", minimum=0.0)
    chromaticity_x: float | None = quantity("1", "CIE 1931 x", default=None)
    chromaticity_y: float | None = quantity("1", "CIE 1931 y", default=None)
    attempts: int = quantity("1", "tries that it took", minimum=1, default=1)
    utc: str = described("when it ended, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        _check_reading(self.luminance, self.status, self.begun, self.ended)


@dataclass(frozen=True, slots=True)
class PowerReading:
    """One reading of a power sweep, as one line of `readings.jsonl`.

    Attributes
    ----------
    index, phase, repeat, begun, ended, attempts, utc
        As of `LuminanceReading`.
    factor : float
        Brightness factor b of the white screen that was asked for.
    achieved_factor : float
        The one that the device has taken.
    luminance : float or None
        L that a luminance meter read right after; None without one, or where it was too dark [cd/m^2].
    luminance_status : ReadingStatus or None
        Whether the meter had a value; None without a meter.
    power : float
        Time-weighted mean [W].
    power_sd : float
        Standard deviation of the samples [W].
    duration : float
        From the first to the last sample, on the meter's clock [s].
    n_samples, n_lost, n_duplicated : int
        Samples that came, by the meter's own count.
    meter_status : str
        The meter's own word or code.
    """

    index: int = quantity("1", "place in the sweep, from 0", minimum=0)
    phase: SweepPhase = described("what the reading is for")
    repeat: int = quantity("1", "which reading of its level, from 1", minimum=1)
    factor: float = quantity("1", "brightness factor that was asked for", above=0.0, maximum=1.0)
    achieved_factor: float = quantity("1", "the one that the device has taken", minimum=0.0, maximum=1.0)
    luminance: float | None = quantity(
        "cd/m^2",
        "read right after; null without a meter, or where too dark",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
    )
    luminance_status: ReadingStatus | None = described("whether the luminance meter had a value")
    power: float = quantity("W", "time-weighted mean")
    power_sd: float = quantity("W", "standard deviation of the samples", minimum=0.0)
    duration: float = quantity("s", "from the first to the last sample", minimum=0.0)
    n_samples: int = quantity("1", "samples that came", minimum=1)
    n_lost: int = quantity("1", "samples that did not come", minimum=0)
    n_duplicated: int = quantity("1", "samples that came twice", minimum=0)
    meter_status: str = described("the meter's own word or code")
    begun: float = quantity("s", "right before the reading, since the sweep began", minimum=0.0)
    ended: float = quantity("s", "right after it", minimum=0.0)
    attempts: int = quantity("1", "tries that it took", minimum=1, default=1)
    utc: str = described("when it ended, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        _check_reading(self.luminance, self.luminance_status, self.begun, self.ended)


@dataclass(frozen=True, slots=True)
class SweepManifest:
    """What a sweep is: which design, of which display, with which instruments.

    Attributes
    ----------
    session_id, task : str
        Which sweep, "luminance-sweep" or "power-sweep".
    simulated : bool
        Whether any instrument, or the display, is simulated.
    status : SessionStatus
        How far it got.
    n_readings : int
        Readings that the design asks for, the warm-up's included.
    design : LuminanceSweepDesign or PowerSweepDesign
        What is measured.
    rig : Rig
        What it ran on.
    display_name : str
        What the display is called.
    pixels_per_degree : float or None
        Of the display, as its file or the rig has it; None of a panel that nobody watches.
    peak_luminance : float or None
        Of the display at b = 1, as its file has it: what a power sweep without a luminance meter goes by
        [cd/m^2].
    provenance : Provenance
        Software and seed.
    display : Display or None
        The display as the rig's file has it; None of one that has no file yet.
    measured_by : str
        Who measured, as a code.
    apparatus : dict of str to str
        What instruments and window said of themselves.
    started : str
        When it began, UTC (ISO 8601); empty from a simulation without a clock.
    """

    session_id: str = described("which sweep", pattern="^[0-9A-Za-z]+$")
    task: str = described("luminance-sweep or power-sweep", pattern="^(luminance|power)-sweep$")
    simulated: bool = described("true if any instrument, or the display, is simulated")
    status: SessionStatus = described("how far the sweep got")
    n_readings: int = quantity("1", "readings that the design asks for", minimum=0)
    design: SweepDesign = described("what is measured")
    rig: Rig = described("what it ran on")
    display_name: str = described("what the display is called")
    pixels_per_degree: float | None = quantity("1/deg", "of the display", above=0.0)
    peak_luminance: float | None = quantity(
        "cd/m^2", "of the display at b = 1, as its file has it", above=0.0
    )
    provenance: Provenance = described("how the file was made")
    display: Display | None = described("the display as its file has it", default=None)
    measured_by: str = described("who measured, as a code", default="", pattern="^[0-9A-Za-z]*$")
    apparatus: dict[str, str] = field(
        default_factory=dict, metadata={"doc": "what instruments and window say of themselves"}
    )
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        expected = DESIGN_OF_SWEEP[self.task]
        if not isinstance(self.design, expected):
            raise ValueError(
                f"the design of the task {self.task!r} must be a {expected.__name__}, got a "
                f"{type(self.design).__name__}"
            )


def _refuse_repeated(name: str, levels: tuple[float, ...]) -> None:
    """Refuse levels that are there twice."""
    if len(set(levels)) < len(levels):
        raise ValueError(f"{name} must differ from each other; `repeats` says how often each is measured")


def _check_reading(luminance: float | None, status: ReadingStatus | None, begun: float, ended: float) -> None:
    """Refuse a reading that ends before it begins, or whose status says other than its value."""
    if ended < begun:
        raise ValueError(f"need begun <= ended, got {begun:g} and {ended:g} s")
    if (luminance is not None) != (status is ReadingStatus.OK):
        raise ValueError("a luminance must be there where its status is ok, and null otherwise")
