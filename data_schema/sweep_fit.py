"""What follows from a sweep: the levels of a display as measured, and the models fitted to them."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.display import HIGHEST_GAMMA, HIGHEST_LUMINANCE
from evenlight.data_schema.power_model import LARGEST
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity


class SweepFlag(enum.Enum):
    """Why a fit to a sweep should be looked at before it is used."""

    INCOMPLETE = "incomplete"  # the sweep has fewer readings than its design asks for
    NOT_GAMMA = "not_gamma"  # no gamma curve describes the display
    NOT_LINEAR = "not_linear"  # power is not linear in luminance
    DRIFTED = "drifted"  # the readings at the end differ from those of the sweep
    UNSTEADY = "unsteady"  # the warm-up ended before the display was steady
    WARM_UP_UNKNOWN = "warm_up_unknown"  # too few readings of the warm-up to tell
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


@dataclass(frozen=True, slots=True)
class LuminanceLevel:
    """One measured level of a display: a row of `luminance_levels.csv` or `brightness.csv`.

    Attributes
    ----------
    factor : float or None
        Brightness factor b that was asked for; None for a pixel value at full brightness.
    achieved_factor : float
        The one that the device had taken.
    luminance : float or None
        Mean of the readings, reflected light included; None where all were too dark for the meter [cd/m^2].
    pixel_value : float
        L' that was shown.
    luminance_sd : float or None
        Standard deviation of the readings [cd/m^2]; None of fewer than two.
    n_readings : int
        Readings with a value.
    n_under_range : int
        Readings that were too dark for the meter.
    share : float or None
        Of the light at full brightness and full pixel value, reflected light taken off.
    model_luminance : float or None
        L of the fitted gamma curve; in `brightness.csv`, L in proportion to the achieved factor [cd/m^2].
    deviation : float or None
        Measured over that, less 1.
    """

    factor: float | None = quantity(
        "1", "brightness factor that was asked for; empty for a pixel value", above=0.0, maximum=1.0
    )
    achieved_factor: float = quantity("1", "the one that the device had taken", minimum=0.0, maximum=1.0)
    luminance: float | None = quantity(
        "cd/m^2", "mean of the readings; empty where too dark", maximum=HIGHEST_LUMINANCE
    )
    pixel_value: float = quantity("1", "L' that was shown", minimum=0.0, maximum=1.0, default=1.0)
    luminance_sd: float | None = quantity(
        "cd/m^2", "standard deviation of the readings", minimum=0.0, default=None
    )
    n_readings: int = quantity("1", "readings with a value", minimum=0, default=1)
    n_under_range: int = quantity("1", "readings too dark for the meter", minimum=0, default=0)
    share: float | None = quantity("1", "of the full luminance, reflected light taken off", default=None)
    model_luminance: float | None = quantity(
        "cd/m^2", "of the gamma curve; of factors, in proportion to them", default=None
    )
    deviation: float | None = quantity("1", "measured over that, less 1", default=None)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class PowerLevel:
    """One measured brightness factor of a panel: a row of `power_levels.csv`.

    Attributes
    ----------
    factor : float
        Brightness factor b that was asked for.
    achieved_factor : float
        The one that the device had taken.
    luminance : float
        Mean of the readings, or factor times peak [cd/m^2].
    luminance_sd : float or None
        Standard deviation of the readings [cd/m^2]; None of fewer than two, or without a meter.
    power : float
        Mean of the readings [W].
    power_sd : float or None
        Standard deviation of the readings [W]; None of fewer than two.
    n_readings : int
        Readings that count.
    model_power : float
        P(L) of the fitted line [W].
    residual : float
        Measured less fitted [W].
    """

    factor: float = quantity("1", "brightness factor that was asked for", above=0.0, maximum=1.0)
    achieved_factor: float = quantity("1", "the one that the device had taken", minimum=0.0, maximum=1.0)
    luminance: float = quantity("cd/m^2", "mean of the readings, or factor times peak")
    luminance_sd: float | None = quantity("cd/m^2", "standard deviation of the readings", minimum=0.0)
    power: float = quantity("W", "mean of the readings")
    power_sd: float | None = quantity("W", "standard deviation of the readings", minimum=0.0)
    n_readings: int = quantity("1", "readings that count", minimum=1)
    model_power: float = quantity("W", "P(L) of the fitted line")
    residual: float = quantity("W", "measured less fitted")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class DisplayFit:
    """The display model fitted to a luminance sweep (Eq. 1), and how far it can be trusted.

    Intervals are of 95 %, and None where the readings do not tell.

    Attributes
    ----------
    display_name, session_id : str
        Of which display, from which sweep.
    simulated : bool
        Whether any instrument, or the display, was simulated.
    gamma, peak_luminance, black_level : float
        Fitted; luminances are without reflected light, at full brightness, in the middle of the sweep
        [1, cd/m^2, cd/m^2].
    gamma_interval, peak_luminance_interval, black_level_interval : (float, float)
        Their intervals.
    reflected_luminance : float
        L_refl that was taken off, from the sweep's design [cd/m^2].
    n_readings, n_levels, n_under_range : int
        Readings of pixel values with a value, levels among them, and readings without a value.
    noise_share, noise_floor : float
        Of one reading: standard deviation as a share of the luminance, and in the dark [1, cd/m^2].
    lack_of_fit_f, lack_of_fit_p : float or None
        F of the levels' deviations from the curve over the scatter of repeats, and how probable as large a
        one is on a gamma display; None without repeats.
    largest_deviation : float
        Largest deviation of a level from the curve, measured over fitted, less 1, among those that exceed
        most what is tolerated.
    largest_deviation_pixel_value : float
        Where it is.
    is_gamma : bool
        Whether the gamma curve describes the display.
    drift, drift_interval
        Luminance at the end over that in the sweep, less 1; None if nothing was repeated.
    warm_up_change, warm_up_interval
        Change of luminance towards the end of the warm-up, as a share per ten minutes; None of too few
        readings.
    brightness_deviation : float or None
        Largest deviation of luminance from proportion to the brightness factor, as a share of it; None if no
        factors were measured.
    brightness_deviation_factor : float or None
        Where it is.
    flags : tuple of SweepFlag
        What to look at.
    provenance : Provenance
        Software and inputs.
    """

    display_name: str = described("of which display")
    session_id: str = described("from which sweep", pattern="^[0-9A-Za-z]+$")
    simulated: bool = described("true if any instrument, or the display, was simulated")
    gamma: float = quantity("1", "exponent from pixel value to luminance", above=0.0, maximum=HIGHEST_GAMMA)
    gamma_interval: tuple[float, float] = quantity("1", "its 95 % interval")
    peak_luminance: float = quantity("cd/m^2", "L_max, without reflected light", above=0.0)
    peak_luminance_interval: tuple[float, float] = quantity("cd/m^2", "its 95 % interval")
    black_level: float = quantity("cd/m^2", "L_black, without reflected light", minimum=0.0)
    black_level_interval: tuple[float, float] = quantity("cd/m^2", "its 95 % interval")
    reflected_luminance: float = quantity("cd/m^2", "L_refl that was taken off", minimum=0.0)
    n_readings: int = quantity("1", "readings of pixel values with a value", minimum=1)
    n_levels: int = quantity("1", "pixel values among them", minimum=1)
    n_under_range: int = quantity("1", "readings too dark for the meter", minimum=0)
    noise_share: float = quantity("1", "SD of a reading as a share of the luminance", minimum=0.0)
    noise_floor: float = quantity("cd/m^2", "SD of a reading in the dark", minimum=0.0)
    lack_of_fit_f: float | None = quantity("1", "F of lack of fit; null without repeats", minimum=0.0)
    lack_of_fit_p: float | None = quantity(
        "1", "probability of as large an F on a gamma display", minimum=0.0, maximum=1.0
    )
    largest_deviation: float = quantity("1", "largest deviation of a level, as a share of its luminance")
    largest_deviation_pixel_value: float = quantity("1", "where it is", minimum=0.0, maximum=1.0)
    is_gamma: bool = described("whether the gamma curve describes the display")
    drift: float | None = quantity("1", "luminance at the end over that in the sweep, less 1")
    drift_interval: tuple[float, float] | None = quantity("1", "its 95 % interval")
    warm_up_change: float | None = quantity("1", "share per ten minutes at the end of the warm-up")
    warm_up_interval: tuple[float, float] | None = quantity("1", "its 95 % interval")
    brightness_deviation: float | None = quantity("1", "largest deviation from proportion to the factor")
    brightness_deviation_factor: float | None = quantity("1", "where it is", above=0.0, maximum=1.0)
    flags: tuple[SweepFlag, ...] = described("what to look at")
    provenance: Provenance = described("how the file was made")

    def __post_init__(self) -> None:
        check_limits(self)
        for name in ("gamma", "peak_luminance", "black_level"):
            _check_interval(name, getattr(self, name), getattr(self, f"{name}_interval"))


@dataclass(frozen=True, slots=True)
class PowerFit:
    """The line P(L) fitted to a power sweep (Section 5 of the paper), and how far it can be trusted.

    Intervals are of 95 %, and None where the readings do not tell.

    Attributes
    ----------
    display_name, session_id, simulated
        As of `DisplayFit`.
    luminance_source : LuminanceSource
        Where the luminances come from.
    base_power : float
        P at zero luminance [W].
    base_power_interval : (float, float)
        Its interval [W].
    power_per_luminance : float
        Slope [W m^2/cd].
    power_per_luminance_interval : (float, float)
        Its interval [W m^2/cd].
    peak_luminance : float
        L at b = 1, without reflected light [cd/m^2].
    reflected_luminance : float
        L_refl that was taken off, from the sweep's design [cd/m^2].
    n_readings, n_levels, n_left_out : int
        Readings that count, factors among them, and readings left out for want of a luminance.
    n_samples, n_lost, n_duplicated : int
        Samples of the power meter in all readings that count.
    residual_sd : float
        Standard deviation of the readings around the line [W].
    r_squared : float
        Share of the readings' variance that the line explains.
    lack_of_fit_f, lack_of_fit_p : float or None
        F of the levels' deviations from the line over the scatter of repeats, and how probable as large a one
        is on a linear panel; None without repeats.
    bend : float
        Height of the curve, a quadratic, over the middle of its chord, as a share of the power that
        brightness adds; below 0 if efficiency falls with luminance, as with LED droop.
    bend_p : float or None
        How probable as clear a bend is on a linear panel.
    largest_deviation : float
        Largest deviation of a level from the line, as a share of its power.
    largest_deviation_luminance : float
        Where it is [cd/m^2].
    is_linear : bool
        Whether the line describes the panel.
    drift, drift_interval
        Power at the end over that in the sweep, less 1; None if nothing was repeated.
    luminance_drift, luminance_drift_interval
        The same of luminance; None also without a luminance meter.
    warm_up_change, warm_up_interval
        Change of luminance (without a luminance meter, of power) towards the end of the warm-up, as a share
        per ten minutes; None of too few readings.
    flags : tuple of SweepFlag
        What to look at.
    provenance : Provenance
        Software and inputs.
    """

    display_name: str = described("of which display")
    session_id: str = described("from which sweep", pattern="^[0-9A-Za-z]+$")
    simulated: bool = described("true if any instrument, or the display, was simulated")
    luminance_source: LuminanceSource = described("where the luminances come from")
    base_power: float = quantity("W", "P at zero luminance", minimum=0.0, maximum=LARGEST)
    base_power_interval: tuple[float, float] = quantity("W", "its 95 % interval")
    power_per_luminance: float = quantity("W m^2/cd", "slope", above=0.0, maximum=LARGEST)
    power_per_luminance_interval: tuple[float, float] = quantity("W m^2/cd", "its 95 % interval")
    peak_luminance: float = quantity("cd/m^2", "L at b = 1, without reflected light", above=0.0)
    reflected_luminance: float = quantity("cd/m^2", "L_refl that was taken off", minimum=0.0)
    n_readings: int = quantity("1", "readings that count", minimum=1)
    n_levels: int = quantity("1", "factors among them", minimum=1)
    n_left_out: int = quantity("1", "readings without a luminance", minimum=0)
    n_samples: int = quantity("1", "samples of the power meter", minimum=0)
    n_lost: int = quantity("1", "samples that did not come", minimum=0)
    n_duplicated: int = quantity("1", "samples that came twice", minimum=0)
    residual_sd: float = quantity("W", "SD of the readings around the line", minimum=0.0)
    r_squared: float = quantity("1", "share of the variance explained", maximum=1.0)
    lack_of_fit_f: float | None = quantity("1", "F of lack of fit; null without repeats", minimum=0.0)
    lack_of_fit_p: float | None = quantity(
        "1", "probability of as large an F on a linear panel", minimum=0.0, maximum=1.0
    )
    bend: float = quantity("1", "height of a quadratic over its chord, as a share of the added power")
    bend_p: float | None = quantity(
        "1", "probability of as clear a bend on a linear panel", minimum=0.0, maximum=1.0
    )
    largest_deviation: float = quantity("1", "largest deviation of a level, as a share of its power")
    largest_deviation_luminance: float = quantity("cd/m^2", "where it is")
    is_linear: bool = described("whether the line describes the panel")
    drift: float | None = quantity("1", "power at the end over that in the sweep, less 1")
    drift_interval: tuple[float, float] | None = quantity("1", "its 95 % interval")
    luminance_drift: float | None = quantity("1", "luminance at the end over that in the sweep, less 1")
    luminance_drift_interval: tuple[float, float] | None = quantity("1", "its 95 % interval")
    warm_up_change: float | None = quantity("1", "share per ten minutes at the end of the warm-up")
    warm_up_interval: tuple[float, float] | None = quantity("1", "its 95 % interval")
    flags: tuple[SweepFlag, ...] = described("what to look at")
    provenance: Provenance = described("how the file was made")

    def __post_init__(self) -> None:
        check_limits(self)
        for name in ("base_power", "power_per_luminance"):
            _check_interval(name, getattr(self, name), getattr(self, f"{name}_interval"))


def _check_interval(name: str, value: float, interval: tuple[float, float]) -> None:
    """Refuse an interval without its value."""
    low, high = interval
    if not low <= value <= high:
        raise ValueError(f"need {name} within its interval, got {low:g}, {value:g}, {high:g}")
