"""What follows from a sweep: the levels of a display as measured, and the models fitted to them."""

from __future__ import annotations

import enum

from evenlight.data_schema.display import HIGHEST_GAMMA, HIGHEST_LUMINANCE, LOWEST_GAMMA
from evenlight.data_schema.power_model import LARGEST
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import as_in, count, described, quantity, record, share


class SweepFlag(enum.Enum):
    """Why a fit to a sweep should be looked at before it is used."""

    INCOMPLETE = "incomplete"  # the sweep has fewer readings than its design asks for
    NOT_GAMMA = "not_gamma"  # no gamma curve describes the display
    NOT_LINEAR = "not_linear"  # power is not linear in luminance
    VAGUE = "vague"  # the readings leave open whether the model describes the display
    DRIFTED = "drifted"  # the readings at the end differ from those of the sweep
    UNSTEADY = "unsteady"  # the warm-up ended before the display was steady
    WARM_UP_UNKNOWN = "warm_up_unknown"  # too few readings of the warm-up to tell
    STALE_READINGS = "stale_readings"  # readings repeat the one before, of another level
    SUSPECT_READINGS = "suspect_readings"  # readings contradict others of their level, or its neighbours
    REPEATS_APART = "repeats_apart"  # readings of one level lie far from each other
    BLACK_UNDER_RANGE = "black_under_range"  # black was too dark for the meter
    BLACK_NEGATIVE = "black_negative"  # black reads darker than the reflected light alone
    BRIGHTNESS_NOT_LINEAR = "brightness_not_linear"  # luminance is not in proportion to the factor
    LUMINANCE_MISSING = "luminance_missing"  # power readings without a luminance were left out
    SAMPLES_LOST = "samples_lost"  # the power meter lost many samples
    BASE_POWER_ZERO = "base_power_zero"  # the line would have a base power below 0 W


class LuminanceSource(enum.Enum):
    """Where the luminances of a power sweep come from."""

    METER = "meter"  # each power reading has its own
    FACTOR = "factor"  # brightness factor times the display's peak luminance


@record
class LuminanceLevel:
    """One measured level of a display: a row of `brightness.csv`, or of a fit."""

    factor: float | None = share(
        "brightness factor b that was asked for; empty for a pixel value at full brightness", above=0.0
    )
    achieved_factor: float = share("brightness factor that the device had taken")
    luminance: float | None = quantity(
        "cd/m^2",
        "mean of the readings, reflected light included; empty if all were too dark for the meter",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
    )
    pixel_value: float = share("L' that was shown", default=1.0)
    luminance_sd: float | None = quantity(
        "cd/m^2", "standard deviation of the readings; empty for fewer than two", minimum=0.0, default=None
    )
    n_readings: int = count("readings with a value", default=1)
    n_under_range: int = count("readings too dark for the meter", default=0)
    share: float | None = quantity(
        "1",
        "share of the light at full brightness and full pixel value, reflected light taken off",
        default=None,
    )
    model_luminance: float | None = quantity(
        "cd/m^2",
        "L of the fitted gamma curve; in `brightness.csv`, L in proportion to the achieved factor",
        default=None,
    )
    deviation: float | None = quantity("1", "measured luminance over model_luminance, less 1", default=None)


@record
class PowerLevel:
    """One measured brightness factor of a panel."""

    factor: float = share("brightness factor b that was asked for", above=0.0)
    achieved_factor: float = as_in(LuminanceLevel, "achieved_factor")
    luminance: float = quantity("cd/m^2", "mean of the readings, or factor times peak luminance")
    luminance_sd: float | None = quantity(
        "cd/m^2",
        "standard deviation of the readings; empty for fewer than two, or without a meter",
        minimum=0.0,
    )
    power: float = quantity("W", "mean of the readings")
    power_sd: float | None = quantity(
        "W", "standard deviation of the readings; empty for fewer than two", minimum=0.0
    )
    n_readings: int = count("readings that count", minimum=1)
    model_power: float = quantity("W", "P(L) of the fitted line")
    residual: float = quantity("W", "measured less fitted power")


@record
class SuspectReading:
    """A reading of a sweep that cannot be right together with the others."""

    index: int = count("its index among the readings")
    row: str = described("where it stands: the line of the readings, or of the table they were imported from")
    level: str = described("what was shown, in words")
    value: float | None = quantity("1", "what was read [cd/m^2, or W]; null if too dark for the meter")
    unit: str = described("cd/m^2, or W")
    others: float | None = quantity(
        "1", "median of the readings of its level that count, in the same unit; null if none does"
    )
    left_out: bool = described(
        "whether it was left out of the fit; false of readings that agree with each other, of a level that "
        "is out of order with its neighbours"
    )


@record
class DisplayFit:
    """The display model fitted to a luminance sweep (Eq. 1), and how far it can be trusted.

    Intervals are of 95 %, and None where the readings do not tell.
    """

    display_name: str = described("name of the display")
    session_id: str = described("session of the sweep", pattern="^[0-9A-Za-z]+$")
    simulated: bool = described("true if any instrument, or the display, was simulated")
    gamma: float = quantity(
        "1", "fitted γ, exponent from pixel value to luminance", minimum=LOWEST_GAMMA, maximum=HIGHEST_GAMMA
    )
    gamma_interval: tuple[float, float] = quantity("1", "95 % confidence interval of gamma")
    peak_luminance: float = quantity(
        "cd/m^2",
        "fitted L_max, without reflected light, at full brightness, in the middle of the sweep",
        above=0.0,
    )
    peak_luminance_interval: tuple[float, float] = quantity("cd/m^2", "95 % confidence interval of L_max")
    black_level: float = quantity(
        "cd/m^2",
        "fitted L_black, without reflected light, at full brightness, in the middle of the sweep",
        minimum=0.0,
    )
    black_level_interval: tuple[float, float] = quantity("cd/m^2", "95 % confidence interval of L_black")
    reflected_luminance: float = quantity(
        "cd/m^2", "L_refl that was taken off, from the sweep's design", minimum=0.0
    )
    n_readings: int = count("readings of pixel values with a value", minimum=1)
    n_levels: int = count("pixel values among them", minimum=1)
    n_under_range: int = count("readings too dark for the meter")
    noise_share: float = quantity(
        "1", "standard deviation of one reading, as a share of the luminance", minimum=0.0
    )
    noise_floor: float = quantity("cd/m^2", "standard deviation of one reading in the dark", minimum=0.0)
    lack_of_fit_f: float | None = quantity(
        "1",
        "F of the levels' deviations from the curve over the scatter of repeats; null without repeats",
        minimum=0.0,
    )
    lack_of_fit_p: float | None = share(
        "probability of so large an F on a gamma display; null without repeats"
    )
    largest_deviation: float = quantity(
        "1",
        "deviation of a level from the curve, measured over fitted, less 1: the one that "
        "exceeds most what is tolerated",
    )
    largest_deviation_pixel_value: float = share("pixel value of that level")
    is_gamma: bool = described("whether the gamma curve describes the readings that count")
    drift: float | None = quantity(
        "1", "luminance at the end over that in the sweep, less 1; null if nothing was repeated"
    )
    drift_interval: tuple[float, float] | None = quantity("1", "95 % confidence interval of the drift")
    warm_up_change: float | None = quantity(
        "1",
        "change of luminance towards the end of the warm-up, as a share per ten minutes; null "
        "with too few readings",
    )
    warm_up_interval: tuple[float, float] | None = quantity("1", "95 % confidence interval of that change")
    brightness_deviation: float | None = quantity(
        "1",
        "largest deviation of luminance from proportion to the brightness factor, as a share; "
        "null if no factors were measured",
    )
    brightness_deviation_factor: float | None = share("brightness factor of that deviation", above=0.0)
    flags: tuple[SweepFlag, ...] = described("what to look at")
    provenance: Provenance = described("how the file was made")
    suspects: tuple[SuspectReading, ...] = described("readings that contradict the others", default=())
    n_stale: int = count(
        "readings that repeat the one before to the last digit, though another level was shown", default=0
    )
    levels: tuple[LuminanceLevel, ...] = described(
        "pixel values as they were read, beside the curve; none in older files", default=()
    )

    def __post_init__(self) -> None:
        for name in ("gamma", "peak_luminance", "black_level"):
            _check_interval(name, getattr(self, name), getattr(self, f"{name}_interval"))


@record
class PowerFit:
    """The line P(L) fitted to a power sweep (Section 5 of the paper), and how far it can be trusted.

    Intervals are of 95 %, and None where the readings do not tell.
    """

    display_name: str = described("name of the display")
    session_id: str = as_in(DisplayFit, "session_id")
    simulated: bool = as_in(DisplayFit, "simulated")
    luminance_source: LuminanceSource = described("where the luminances come from")
    base_power: float = quantity("W", "P at zero luminance", minimum=0.0, maximum=LARGEST)
    base_power_interval: tuple[float, float] = quantity("W", "95 % confidence interval of the base power")
    power_per_luminance: float = quantity(
        "W m^2/cd", "slope of power over luminance", above=0.0, maximum=LARGEST
    )
    power_per_luminance_interval: tuple[float, float] = quantity(
        "W m^2/cd", "95 % confidence interval of the slope"
    )
    peak_luminance: float = quantity("cd/m^2", "L at b = 1, without reflected light", above=0.0)
    reflected_luminance: float = as_in(DisplayFit, "reflected_luminance")
    n_readings: int = as_in(PowerLevel, "n_readings")
    n_levels: int = count("factors among them", minimum=1)
    n_left_out: int = count("readings left out for want of a luminance")
    n_samples: int = count("samples of the power meter in all readings that count")
    n_lost: int = count("samples that did not come")
    n_duplicated: int = count("samples that came twice")
    residual_sd: float = quantity("W", "standard deviation of the readings around the line", minimum=0.0)
    r_squared: float = quantity("1", "share of the readings' variance that the line explains", maximum=1.0)
    lack_of_fit_f: float | None = quantity(
        "1",
        "F of the levels' deviations from the line over the scatter of repeats; null without repeats",
        minimum=0.0,
    )
    lack_of_fit_p: float | None = share(
        "probability of so large an F on a linear panel; null without repeats"
    )
    bend: float = quantity(
        "1",
        "height of a quadratic over the middle of its chord, as a share of the power that "
        "brightness adds; below 0 if efficiency falls with luminance (LED droop)",
    )
    bend_p: float | None = share("probability of so clear a bend on a linear panel")
    largest_deviation: float = quantity(
        "1", "largest deviation of a level from the line, as a share of its power"
    )
    largest_deviation_luminance: float = quantity("cd/m^2", "luminance of that level")
    is_linear: bool = described("whether the line describes the panel")
    drift: float | None = quantity(
        "1", "power at the end over that in the sweep, less 1; null if nothing was repeated"
    )
    drift_interval: tuple[float, float] | None = as_in(DisplayFit, "drift_interval")
    luminance_drift: float | None = quantity(
        "1", "the same for luminance; null also without a luminance meter"
    )
    luminance_drift_interval: tuple[float, float] | None = quantity(
        "1", "95 % confidence interval of the luminance's drift"
    )
    warm_up_change: float | None = quantity(
        "1",
        "change of luminance (of power, without a luminance meter) towards the end of the "
        "warm-up, as a share per ten minutes; null with too few readings",
    )
    warm_up_interval: tuple[float, float] | None = as_in(DisplayFit, "warm_up_interval")
    flags: tuple[SweepFlag, ...] = as_in(DisplayFit, "flags")
    provenance: Provenance = described("how the file was made")
    suspects: tuple[SuspectReading, ...] = as_in(DisplayFit, "suspects")
    n_stale: int = as_in(DisplayFit, "n_stale")
    levels: tuple[PowerLevel, ...] = described(
        "brightness factors as they were read, beside the line; none in older files", default=()
    )

    def __post_init__(self) -> None:
        for name in ("base_power", "power_per_luminance"):
            _check_interval(name, getattr(self, name), getattr(self, f"{name}_interval"))


def _check_interval(name: str, value: float, interval: tuple[float, float]) -> None:
    low, high = interval
    if not low <= value <= high:
        raise ValueError(f"need {name} within its interval, got {low:g}, {value:g}, {high:g}")
