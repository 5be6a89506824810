"""What analyses and plans write: rows of result tables, points of figures, and a summary beside them.

A `Statistic` is a number with its interval and its origin; a `PlottedPoint` is a point of a figure; plans
have a row per design and number of participants.
"""

from __future__ import annotations

import enum

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import count, described, quantity, record, share
from evenlight.data_schema.recordings.roll_call import RollCall

MOST_PARTICIPANTS = 1000  # a plan that needs more is no plan


class Origin(enum.Enum):
    """Where a number comes from."""

    PUBLISHED = "published"  # printed in the paper, or a difference or ratio of what is printed
    AUTHORS = "authors' program"  # not in the paper: from the program that its authors published
    SIMULATED = "simulated"  # from answers of simulated participants
    RECORDED = "recorded"  # from answers of people, or from readings of an instrument
    COMPUTED = "computed"  # without participants: by the model, or from printed numbers
    MEASURED = "measured here"  # a time that the machine took which made the report


@record
class Statistic:
    """One number of a result: a row of a table of results."""

    table: str = described("table of the results that it belongs to, e.g. means")
    group: str = described("what it is about within the table: a sequence, a place, all")
    what: str = described("what it is, in words")
    value: float | None = quantity("1", "the number; empty if the data do not give it, and flag says why")
    unit: str = described("unit of value and interval; 1 for a pure number")
    origin: Origin = described("where it comes from")
    ci_low: float | None = quantity(
        "1",
        "lower end of the confidence interval, or of the credible interval that method names; empty for none",
        default=None,
    )
    ci_high: float | None = quantity("1", "upper end of that interval; empty for none", default=None)
    interval: float | None = share(
        "level of the interval, e.g. 0.95; empty without one", above=0.0, default=None
    )
    p_value: float | None = share("p-value of the test that method names", default=None)
    p_adjusted: float | None = share("that p-value, adjusted for the number of tests", default=None)
    n: int | None = count("number of participants it rests on, or of trials if method says so", default=None)
    method: str = described("how it was computed", default="")
    flag: str = described("why it should be looked at, or is missing; empty for nothing", default="")

    def __post_init__(self) -> None:
        if self.value is None and not self.flag:
            raise ValueError(f"{self.what!r} has no value, and no flag that says why")


@record
class PlottedPoint:
    """One point, bar or step of a figure: a row of the table beside it."""

    panel: str = described("part of the figure")
    series: str = described("what is drawn in it")
    label: str = described("place on an axis of categories; empty on an axis of numbers")
    x: float | None = quantity("1", "place on an axis of numbers, in x_unit; empty on an axis of categories")
    y: float | None = quantity("1", "in y_unit; empty where there is nothing to draw")
    x_quantity: str = described("what the horizontal axis is")
    x_unit: str = described("unit of the horizontal axis")
    y_quantity: str = described("what the vertical axis is")
    y_unit: str = described("unit of the vertical axis")
    origin: Origin = described("where it comes from")
    low: float | None = quantity("1", "lower end of the bar or band of uncertainty", default=None)
    high: float | None = quantity("1", "upper end of the bar or band of uncertainty", default=None)
    n: int | None = count("number of participants, trials or frames it rests on", default=None)


@record
class AnalysisSummary:
    """What an analysis was made of and came to."""

    simulated: bool = described("true if any of the data come from simulated participants")
    leads: dict[str, str] = described("what came out, in a sentence or two, by the name of each part")
    refused: dict[str, str] = described("parts that could not be analysed, and why")
    warnings: tuple[str, ...] = described("what is wrong but does not forbid the use")
    provenance: Provenance = described("how the files were made")
    files: tuple[str, ...] = described(
        "files written beside this one; a later run into the same folder removes those that "
        "it does not write",
        default=(),
    )
    roll: RollCall | None = described("sessions of the data set, those that were not read too", default=None)
    departures: tuple[str, ...] = described("from what was pre-registered, in words", default=())
    quick: bool = described("true for a quick run, whose numbers are no result", default=False)


@record
class RampPlanRow:
    """What one design with so many trials and participants gives: a row of `plan.csv`."""

    design: str = described("name of the design")
    procedure: str = described("yes_no or two_interval")
    placement: str = described("how the rates are chosen")
    levels: int = quantity("1", "number of initial luminances")
    trials_per_level: int = quantity("1", "ramps per level")
    participants: int = quantity("1", "number of participants")
    minutes: float = quantity("min", "length of a participant's sessions, breaks included", key="minutes")
    total_hours: float = quantity("h", "length of all participants' sessions", key="total_hours")
    participant_sd_ln: float = quantity("1", "true SD of ln(threshold) between participants, level by level")
    threshold_error_ln: float = quantity("1", "RMS of ln(fitted / true) of a single threshold")
    half_width: float = quantity(
        "1", "typical half-width of the rate limit's 95 % confidence band, as a share"
    )
    half_width_mc_error: float = quantity(
        "1", "Monte Carlo standard error of half_width, as a share of it: other simulated people and draws"
    )
    half_width_assured: float = quantity("1", "half-width that 80 % of the experiments stay within")
    error: float = quantity("1", "RMS error of the rate limit against the truth, as a share")
    bias: float = quantity("1", "mean error of the rate limit, as a share")
    coverage: float = quantity("1", "share of the bands that hold the truth, whatever their participants")
    meets: bool = described("true if the typical half-width is within the one asked for")
    participants_needed: int | None = quantity(
        "1", "participants needed for the half-width asked for; null beyond 1000"
    )
    participants_needed_low: int | None = quantity("1", "lower end of its 95 % confidence interval")
    participants_needed_high: int | None = quantity(
        "1", "upper end of its 95 % confidence interval; null beyond 1000"
    )
    hours_needed: float | None = quantity("h", "length of the sessions of all of them", key="hours_needed")


@record
class ViewingPlanRow:
    """What so many participants of a viewing experiment show by one test: a row of `plan.csv`."""

    task: str = described("rating, comparison or search")
    test: str = described("what is tested, and how")
    participants: int = count("number of participants", minimum=1)
    effect: float = quantity("1", "true effect for which the power is computed, in effect_unit")
    effect_unit: str = described("unit of the effect: rating points, share of answers, ratio of times")
    margin: float | None = quantity(
        "1", "margin of an equivalence test; empty for a test of a difference", above=0.0
    )
    level: float = share("level of the test: 0.05, or less if it is one of several", above=0.0)
    power: float = share("share of experiments in which the test finds what is true")
    power_low: float = share(
        "lower end of its 95 % confidence interval from simulation; the power itself if exact"
    )
    power_high: float = share("upper end of its 95 % confidence interval; the power itself if exact")
    type_i_error: float = share(
        "share of experiments that find what is not true: a difference, or none at the margin"
    )
    type_i_error_low: float = share("lower end of its 95 % confidence interval; the share itself if exact")
    type_i_error_high: float = share("upper end of its 95 % confidence interval; the share itself if exact")
    runs: int = count("simulated experiments; 0 for exact")
    wanted_power: float = share("power asked for", above=0.0)
    meets: bool = described("true if the power is the one asked for or more")
    participants_needed: int | None = quantity(
        "1", "participants needed for the power asked for; empty beyond what is tried"
    )
    participants_needed_low: int | None = quantity(
        "1", "lower end of its 95 % confidence interval from simulation"
    )
    participants_needed_high: int | None = quantity(
        "1", "upper end of its 95 % confidence interval from simulation"
    )
