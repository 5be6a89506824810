"""Light over time: what a photodiode or another sampler recorded, what was shown meanwhile, and its results.

Values are of the sampler's own scale: what counts are times, and shares of a change.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.recordings.played_power import ClockFit
from evenlight.data_schema.storage.tables import csv_rows, number_in

if TYPE_CHECKING:  # every command imports this module, and shows its help without numpy
    from evenlight.data_schema.arrays import Array

LIGHT_LOG, LIGHT_SAMPLES, LIGHT_ARRIVALS = "light_log.json", "light.csv", "light_arrivals.csv"
PATCH_FLIPS, LIGHT_RESULTS = "light_flips.csv", "light_results.json"
FEWEST_SAMPLES = 100


@dataclass(frozen=True, slots=True)
class LightSample:
    """One sample of light, a row of `light.csv`; a table made elsewhere has the same columns."""

    time: float = quantity("s", "when, on the sampler's clock")
    value: float = quantity("1", "light, on the sampler's own scale: 1 is where it saturates, if it tells")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class LightArrival:
    """When a block of samples came, a row of `light_arrivals.csv`."""

    time: float = quantity("s", "of its last sample, on the sampler's clock")
    received: float = quantity("s", "when it had arrived, on the computer's clock")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class PatchFlip:
    """One change of the patch that the photodiode looks at, a row of `light_flips.csv`."""

    flip: float = quantity("s", "when it appeared, as the window tells it, on the computer's clock")
    lit: bool = described("true if the patch is white from then on, false if black")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class LightLog:
    """What a recording of light was made with, `light_log.json` beside its tables."""

    simulated: bool = described("true if sampler or panel are simulated")
    instrument: str = described("name of the sampler")
    sample_rate: float = quantity("Hz", "sampling rate", above=0.0)
    full_scale: float | None = quantity(
        "1", "value at which the sampler saturates; null if unknown", above=0.0
    )
    dc_coupled: bool = described("false if steady light reads as none, as at the input of a sound card")
    dark: float | None = quantity("1", "value with the photodiode covered; null if it was not measured")
    refresh_rate: float | None = quantity("Hz", "refresh rate of the display; null if no frames were shown")
    place: str = described("where the patch was; empty if no frames were shown", default="")
    apparatus: dict[str, str] = field(
        default_factory=dict, metadata={"doc": "what the devices say of themselves"}
    )
    provenance: Provenance = described("how the file was made", default=Provenance())
    started: str = described("when it began, UTC (ISO 8601); empty without a clock", default="")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class Ripple:
    """The periodic change of a steady white: that of a backlight's PWM, if it has one.

    Intervals are of 95 %.
    """

    frequency: float | None = quantity("Hz", "frequency; null if none was found")
    frequency_ci_low: float | None = quantity("Hz", "lower end of its interval, the clock's error included")
    frequency_ci_high: float | None = quantity("Hz", "upper end of its interval, the clock's error included")
    depth: float | None = quantity(
        "1", "(max - min) / (max + min) of the light (Michelson); null where it cannot be known"
    )
    depth_ci_low: float | None = quantity("1", "lower end of its interval")
    depth_ci_high: float | None = quantity("1", "upper end of its interval")
    depth_is_least: bool = described(
        "true if darkness was not measured, or samples fall on few phases: the depth is at least this"
    )
    duty: float | None = quantity(
        "1",
        "share of a period above the middle of maximum and minimum; null where samples fall on few phases",
    )
    smallest_seen: float | None = quantity(
        "1", "a sine of this amplitude, as a share of the mean light, would have been found; null if unknown"
    )
    lowest_frequency: float = quantity("Hz", "below it none was looked for")
    highest_frequency: float = quantity("Hz", "half the sampling rate: above it none can be seen")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class ResponseTime:
    """From 10 to 90 % of a change; its interval is of 95 %, a bootstrap over edges."""

    rising: bool = described("true from black to white, false from white to black")
    time: float = quantity("s", "of the median edge; where is_most, ci_high_s", minimum=0.0)
    ci_low: float = quantity("s", "lower end of its interval", minimum=0.0)
    ci_high: float = quantity("s", "upper end of its interval", minimum=0.0)
    is_most: bool = described("true if sampling, or averaging the PWM out, is as slow: at most this")
    n_edges: int = quantity("1", "edges that it rests on", minimum=1)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class Latency:
    """From a flip to the middle (50 %) of the change of light."""

    median: float = quantity("s", "median over edges")
    ci_low: float = quantity("s", "lower end of its 95 % interval, clocks included")
    ci_high: float = quantity("s", "upper end of its 95 % interval, clocks included")
    sd: float = quantity("s", "standard deviation over edges within a direction", minimum=0.0)
    median_rising: float | None = quantity("s", "of edges from black to white")
    median_falling: float | None = quantity("s", "of edges from white to black")
    is_most: bool = described("true if how late the samples are timed is unknown: at most this")

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class LightResults:
    """What a recording of light says of a display, `light_results.json`."""

    simulated: bool = described("true if sampler or panel are simulated")
    instrument: str = described("name of the sampler")
    sample_rate: float = quantity("Hz", "sampling rate", above=0.0)
    n_samples: int = quantity("1", "samples that came", minimum=0)
    n_lost: int = quantity("1", "samples that did not come, by the gaps in their times", minimum=0)
    ripple: Ripple | None = described("the PWM; null if the recording is too short for one")
    n_flips: int = quantity("1", "changes of the patch", minimum=0)
    n_edges: int = quantity("1", "changes of the patch that have their edge in the light", minimum=0)
    n_extra: int = quantity("1", "edges in the light that no change of the patch has", minimum=0)
    response_times: tuple[ResponseTime, ...] = described("from 10 to 90 %")
    averaged_over: float | None = quantity(
        "s", "period of the PWM that the edges were averaged over; null if it was divided out, or is none"
    )
    latency: Latency | None = described("from flip to light; null without one")
    clock: ClockFit | None = described("the sampler's clock on the computer's; null without frames")
    notes: tuple[str, ...] = described("what a reader should be warned of", default=())
    provenance: Provenance = described("how the file was made", default=Provenance())

    def __post_init__(self) -> None:
        check_limits(self)


def read_light_samples(path: Path) -> tuple[Array, Array]:
    """Return times [s] and values of a table of `LightSample`, two arrays of (N,).

    Raises
    ------
    InputError
        If it is none, holds too few samples, or its times do not rise; it names file and line.
    """
    import numpy as np

    rows = csv_rows(path, ("time_s", "value"), "a table of light samples")
    cells = [(number_in(t, f"{path}, line {n}"), number_in(v, f"{path}, line {n}")) for n, (t, v) in rows]
    if len(cells) < FEWEST_SAMPLES:
        raise InputError(f"{path}: holds {len(cells)} samples; expected at least {FEWEST_SAMPLES}")
    times, values = np.array(cells).T
    odd = ~np.isfinite(times) | ~np.isfinite(values)
    odd[1:] |= ~(np.diff(times) > 0)
    if odd.any():
        line = int(np.flatnonzero(odd)[0]) + 2
        raise InputError(f"{path}, line {line}: expected finite numbers, and times that rise")
    return times, values
