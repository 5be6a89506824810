"""The rows of plans: what so many participants of an experiment would show."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity

MOST_PARTICIPANTS = 1000  # a plan that needs more is no plan


@dataclass(frozen=True, slots=True)
class RampPlanRow:
    """What one design with so many trials and participants gives: a row of `plan.csv`."""

    design: str = described("name of the design")
    procedure: str = described("yes_no or two_interval")
    placement: str = described("how the rates are chosen")
    levels: int = quantity("1", "initial luminances")
    trials_per_level: int = quantity("1", "ramps per level")
    participants: int = quantity("1", "how many participants")
    minutes: float = quantity("1", "length of a participant's sessions, breaks included", key="minutes")
    total_hours: float = quantity("1", "of all participants", key="total_hours")
    participant_sd_ln: float = quantity("1", "true SD of ln(threshold) between participants, level by level")
    threshold_error_ln: float = quantity("1", "RMS of ln(fitted / true) of a single threshold")
    half_width: float = quantity("1", "half-width of the 95 % band of the rate limit, as a share; typical")
    half_width_assured: float = quantity("1", "half-width that 80 % of the experiments stay within")
    error: float = quantity("1", "RMS error of the rate limit against the truth, as a share")
    bias: float = quantity("1", "mean error of the rate limit, as a share")
    coverage: float = quantity("1", "share of the bands that hold the truth, whatever their participants")
    meets: bool = described("true if the typical half-width is within the wanted one")
    participants_needed: int | None = quantity("1", "for the wanted half-width; null beyond 1000")
    participants_needed_low: int | None = quantity("1", "lower end of its 95 % interval")
    participants_needed_high: int | None = quantity("1", "upper end of its 95 % interval; null beyond 1000")
    hours_needed: float | None = quantity("1", "of all of them", key="hours_needed")

    @property
    def participants_needed_in_words(self) -> str:
        """How many participants are needed, with the interval that the pool leaves: "33 (26 to 40)"."""
        low, high = self.participants_needed_low, self.participants_needed_high
        if low is None:
            return f"above {MOST_PARTICIPANTS}"
        middle = self.participants_needed or f"above {MOST_PARTICIPANTS}"
        return f"{middle} ({low} to {high or f'above {MOST_PARTICIPANTS}'})"


@dataclass(frozen=True, slots=True)
class ViewingPlanRow:
    """What so many participants of a viewing experiment show by one test: a row of `plan.csv`.

    Attributes
    ----------
    task : str
        "rating", "comparison" or "search".
    test : str
        What is tested, and how.
    participants : int
        How many there are.
    effect : float
        The true effect with which the power is reckoned, in `effect_unit`.
    effect_unit : str
        Rating points, share of answers, ratio of times.
    margin : float or None
        Of an equivalence test; None for a test of a difference.
    level : float
        Of the test: 5 %, or less where it is one of several.
    power, power_low, power_high : float
        Share of experiments in which the test finds what is true, and its 95 % interval from simulation; both
        ends are the power itself where it is exact.
    type_i_error, type_i_error_low, type_i_error_high : float
        Share of experiments in which it finds what is not true: no difference, or one at the margin.
    runs : int
        Simulated experiments; 0 for exact.
    wanted_power : float
        What is wanted.
    meets : bool
        Whether it is reached.
    participants_needed, participants_needed_low, participants_needed_high : int or None
        For the wanted power, and the 95 % interval from simulation; None beyond what a plan tries.
    """

    task: str = described("rating, comparison or search")
    test: str = described("what is tested, and how")
    participants: int = quantity("1", "how many participants", minimum=1)
    effect: float = quantity("1", "true effect, in effect_unit")
    effect_unit: str = described("rating points, share of answers, ratio of times")
    margin: float | None = quantity(
        "1", "of an equivalence test; empty for a test of a difference", above=0.0
    )
    level: float = quantity("1", "of the test", above=0.0, maximum=1.0)
    power: float = quantity("1", "share of experiments that find what is true", minimum=0.0, maximum=1.0)
    power_low: float = quantity("1", "lower end of its interval", minimum=0.0, maximum=1.0)
    power_high: float = quantity("1", "upper end of it", minimum=0.0, maximum=1.0)
    type_i_error: float = quantity(
        "1", "share of experiments that find what is not true", minimum=0.0, maximum=1.0
    )
    type_i_error_low: float = quantity("1", "lower end of its interval", minimum=0.0, maximum=1.0)
    type_i_error_high: float = quantity("1", "upper end of it", minimum=0.0, maximum=1.0)
    runs: int = quantity("1", "simulated experiments; 0 for exact", minimum=0)
    wanted_power: float = quantity("1", "what is wanted", above=0.0, maximum=1.0)
    meets: bool = described("true if the power is the wanted one or more")
    participants_needed: int | None = quantity("1", "for the wanted power; empty beyond what is tried")
    participants_needed_low: int | None = quantity("1", "lower end of its 95 % interval")
    participants_needed_high: int | None = quantity("1", "upper end of its 95 % interval")

    def __post_init__(self) -> None:
        check_limits(self)
