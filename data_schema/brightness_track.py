"""The brightness track: one factor per frame, with what it does to contrast, luminance and power."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.files import write_whole
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import Array, check_limits, described, quantity, read_only, rises
from evenlight.data_schema.ramp import Procedure
from evenlight.data_schema.text_files import csv_rows, csv_text, number_in, read_json_record, write_json

ASKED = "what the participants were asked whom the rate limit rests on"


class BudgetUnit(enum.Enum):
    """What a budget counts."""

    FACTOR = "factor"  # mean brightness factor, as in the paper
    POWER = "power"  # share of the power at full brightness
    WATT = "watt"  # mean power


@dataclass(frozen=True, slots=True)
class TrackHeader:
    """What a brightness track was made for, and how; the sidecar `track.json`.

    Attributes
    ----------
    video : str
        Name of the video.
    display_name, display_fingerprint : str
        The display that it is meant for.
    power_model, rate_limit : str
        Names of the power model and of the rate limit.
    budget : float
        In the budget's unit.
    budget_unit : BudgetUnit
        What the budget counts.
    solver : str
        Which solver made it.
    provenance : Provenance
        Software, seed and inputs.
    rate_limit_procedure : Procedure or None
        What the participants were asked whom the rate limit rests on; None if that is not known.
    """

    video: str = described("name of the video")
    display_name: str = described("display that it is meant for")
    display_fingerprint: str = described("identity of that display's photometry")
    power_model: str = described("name of the power model")
    rate_limit: str = described("name of the rate limit")
    budget: float = quantity("1", "the budget, in its unit", above=0.0)
    budget_unit: BudgetUnit = described("what the budget counts")
    solver: str = described("which solver made it")
    provenance: Provenance = described("how the file was made")
    rate_limit_procedure: Procedure | None = described(ASKED, default=None)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class BrightnessTrack:
    """A brightness factor for each of N frames; the columns of `track.csv`.

    Attributes
    ----------
    times : array, (N,)
        When each frame appears [s].
    factors : array, (N,)
        b, in (0, 1].
    contrast_loss : array, (N,)
        𝓛_c of the dimmed frame, in [0, 1].
    mean_luminance : array, (N,)
        Mean luminance of the dimmed frame, reflected light included [cd/m^2].
    rate : array, (N,)
        Luminance change that the modulation makes from this frame to the next, per second; signed, 0 in the
        last frame [cd/m^2/s].
    rate_limit : array, (N,)
        What that change may be at most, in either direction [cd/m^2/s].
    power : array, (N,)
        Power of the display while the frame is shown [W].
    header : TrackHeader
        What it was made for, and how.
    """

    times: Array = quantity("s", "when the frame appears", key="time_s")
    factors: Array = quantity("1", "brightness factor", above=0.0, maximum=1.0, key="factor")
    contrast_loss: Array = quantity("1", "contrast loss of the dimmed frame", minimum=0.0, maximum=1.0)
    mean_luminance: Array = quantity("cd/m^2", "mean luminance of the dimmed frame", minimum=0.0)
    rate: Array = quantity("cd/m^2/s", "luminance change by the modulation, to the next frame")
    rate_limit: Array = quantity("cd/m^2/s", "largest such change allowed", minimum=0.0)
    power: Array = quantity("W", "power while the frame is shown", minimum=0.0)
    header: TrackHeader = described("what the track was made for, and how")

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            object.__setattr__(self, name, read_only(getattr(self, name)))
        check_limits(self)
        if len({len(getattr(self, name)) for name in _ARRAYS}) != 1 or len(self.times) == 0:
            raise ValueError("the columns of a track must be equally long and hold at least one frame")
        if not rises(self.times):
            raise ValueError("time_s must rise from frame to frame")


_ARRAYS = ("times", "factors", "contrast_loss", "mean_luminance", "rate", "rate_limit", "power")
TRACK_COLUMNS = (
    "frame",
    "time_s",
    "factor",
    "contrast_loss",
    "mean_luminance_cd_m2",
    "rate_cd_m2_s",
    "rate_limit_cd_m2_s",
    "power_w",
)


def write_track(path: Path, track: BrightnessTrack) -> None:
    """Write a track as a csv table, and its header as a json file of the same name beside it."""
    columns = [getattr(track, name).tolist() for name in _ARRAYS]
    rows = ([i, *cells] for i, cells in enumerate(zip(*columns, strict=True)))
    write_json(path.with_suffix(".json"), mapping_from_record(track.header))
    write_whole(path, csv_text(TRACK_COLUMNS, rows))


def read_track(path: Path) -> BrightnessTrack:
    """Return the track of a csv table and its json header; raise `InputError` if either is unusable."""
    header = read_json_record(TrackHeader, path.with_suffix(".json"))
    rows = csv_rows(path, TRACK_COLUMNS, "a brightness track (csv)")
    table = []
    for frame, (line, cells) in enumerate(rows):
        where = f"{path}, line {line}"
        if cells[0] != str(frame):
            raise InputError(f"{where}: frame: expected {frame}, the frames from 0 on, got {cells[0]!r}")
        table.append(
            [number_in(cell, f"{where}: {name}") for name, cell in zip(TRACK_COLUMNS, cells, strict=True)]
        )
    if not table:
        raise InputError(f"{path}: expected a row for each frame, got none; the table is empty or torn")
    columns = read_only(table).T[1:]  # the number of the frame is its place
    try:
        return BrightnessTrack(**dict(zip(_ARRAYS, columns, strict=True)), header=header)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


@dataclass(frozen=True, slots=True)
class OptimizationSummary:
    """What an optimization achieved; the keys of `summary.json`.

    Attributes
    ----------
    frames, duration : int, float
        Number of frames, and how long they take [s].
    budget, budget_unit, achieved : float, BudgetUnit, float
        What was asked, in which unit, and what the track has.
    objective, objective_baseline : float
        Mean absolute difference of contrast loss between two frames: of the track, and of the constant
        baseline of equal power.
    lower_bound : float
        No track within the limits has a smaller objective.
    max_rate_ratio : float
        Largest ratio of a step's rate to its limit; at most 1.
    mean_power, baseline_power, full_power : float
        Mean power of the track, of the baseline and at full brightness [W].
    solver, iterations : str, int
        Which solver, and its iterations.
    calm : float
        Share of the gain that was to be given up, at most, for a calmer track.
    solve_s, curves_s, bound_s : float
        Time taken by the optimizer, by the loss curves, and by the lower bound [s].
    limit_curve, modulated : str
        Which curve of the rate limit was obeyed, and whose luminance it was about.
    lowest_factor, pixels_per_degree : float
        Lowest factor allowed; pixels of the video per degree of the visual field.
    contrast_model : str
        Name of the choices of the contrast model.
    simulated : bool
        Whether the rate limit rests on simulated participants.
    frames_without_contrast : int
        Frames in which nothing is visible even undimmed; they have nothing to lose.
    seed : int or None
        Seed of the random numbers; None where none were drawn.
    versions : dict of str to str
        Of Evenlight, and of the packages that the numbers depend on.
    rate_limit_procedure : Procedure or None
        What the participants were asked whom the rate limit rests on; None if that is not known.
    curves_tolerance, counted : float
        Error of the loss curves that was accepted for not counting all of every frame, and what share of
        the pixels was counted.
    curves_computed_on : str
        What computed the loss curves: "cpu", or "gpu" and its name.
    clips : int
        How many clips share the budget. In the summary of one of several, the budget is that of all, the
        baseline has the clip's own power, no bound is known (0), and iterations and times are those of all.
    weighted : bool
        Whether frames count differently in the objective, its baseline's and the bound.
    largest_allowance : float or None
        How many times the rate limit the most generous step of the video may reach.
    max_rate_ratio_fitted : float or None
        Largest ratio of a step's rate to the limit without allowances; None in files from before them.
    """

    video: str = described("name of the video")
    display: str = described("name of the display")
    rate_limit: str = described("name of the rate limit")
    power_model: str = described("name of the power model")
    frames: int = quantity("1", "number of frames", minimum=1)
    duration: float = quantity("s", "how long they take", above=0.0)
    budget: float = quantity("1", "what was asked", above=0.0)
    budget_unit: BudgetUnit = described("unit of the budget")
    achieved: float = quantity("1", "what the track has, in the budget's unit", above=0.0)
    objective: float = quantity("1", "mean absolute pairwise difference of contrast loss", minimum=0.0)
    objective_baseline: float = quantity("1", "the same, for constant dimming", minimum=0.0)
    lower_bound: float = quantity("1", "no track within the limits does better", minimum=0.0)
    max_rate_ratio: float = quantity("1", "largest ratio of a rate to its limit", minimum=0.0)
    mean_contrast_loss: float = quantity("1", "mean contrast loss of the track", minimum=0.0)
    mean_contrast_loss_baseline: float = quantity("1", "the same, for constant dimming", minimum=0.0)
    mean_factor: float = quantity("1", "mean brightness factor of the track", above=0.0)
    baseline_factor: float = quantity("1", "factor of constant dimming at equal power", above=0.0)
    mean_power: float = quantity("W", "mean power of the track", minimum=0.0)
    baseline_power: float = quantity("W", "mean power of constant dimming", minimum=0.0)
    full_power: float = quantity("W", "mean power at full brightness", minimum=0.0)
    limit_curve: str = described("curve of the rate limit that was obeyed: fitted or safe")
    modulated: str = described("luminance that the rate limit was about: frame_mean or white_field")
    lowest_factor: float = quantity("1", "lowest brightness factor allowed", above=0.0, maximum=1.0)
    pixels_per_degree: float = quantity("1", "pixels of the video per degree", above=0.0)
    contrast_model: str = described("choices of the contrast model, by name or file")
    simulated: bool = described("true if the rate limit rests on simulated participants")
    frames_without_contrast: int = quantity("1", "frames with nothing visible even undimmed", minimum=0)
    solver: str = described("which solver")
    iterations: int = quantity("1", "iterations of the solver", minimum=0)
    calm: float = quantity("1", "share of the gain given up at most for calm", minimum=0.0, maximum=1.0)
    solve_s: float = quantity("s", "time that the optimizer took", minimum=0.0, key="solve_s")
    curves_s: float = quantity("s", "time that the loss curves took", minimum=0.0, key="curves_s")
    bound_s: float = quantity("s", "time that the lower bound took", minimum=0.0, key="bound_s")
    seed: int | None = quantity("1", "seed of the random numbers; null where none were drawn", minimum=0)
    versions: dict[str, str] = described("versions of the software")
    provenance: Provenance = described("how the file was made")
    rate_limit_procedure: Procedure | None = described(ASKED, default=None)
    curves_tolerance: float = quantity("1", "accepted error of the loss curves", minimum=0.0, default=0.0)
    counted: float = quantity(
        "1", "share of the pixels that was counted for the loss curves", minimum=0.0, maximum=1.0, default=1.0
    )
    curves_computed_on: str = described(
        "what computed the loss curves: cpu, or gpu and its name", default="cpu"
    )
    clips: int = quantity("1", "clips that share the budget", minimum=1, default=1)
    weighted: bool = described("true if frames count differently in the objective", default=False)
    largest_allowance: float | None = quantity(
        "1", "largest multiple of the rate limit that a step may reach", minimum=0.0, default=None
    )
    max_rate_ratio_fitted: float | None = quantity(
        "1", "largest ratio of a rate to the limit without allowances", minimum=0.0, default=None
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if self.lower_bound > self.objective:
            raise ValueError(
                f"lower_bound must be at most the objective, got {self.lower_bound:g} and {self.objective:g}"
            )
