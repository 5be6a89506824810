"""Detection thresholds for luminance ramps, one row per participant and level."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.ramp import Direction, Procedure


class ThresholdFlag(enum.Enum):
    """Why a threshold should be looked at before it is used."""

    NONE = ""
    ALL_YES = "all_yes"  # every ramp was detected: the threshold lies below what was tested
    ALL_NO = "all_no"  # no ramp was detected, or of two intervals most were wrong: it lies above
    SEPARATED = "separated"  # a rate divides all "no" from all "yes": the slope is the prior's
    BELOW_RANGE = "below_range"  # the threshold lies below the slowest ramp tested
    ABOVE_RANGE = "above_range"  # the threshold lies above the fastest ramp tested
    FALSE_ALARMS = "false_alarms"  # "yes" to more than half of the catch trials
    POOR_FIT = "poor_fit"  # answers this far from the function come by chance once in a hundred times


@dataclass(frozen=True, slots=True)
class Threshold:
    """The rate of luminance change that one participant detects in 75 % of the trials at one level.

    In yes/no they notice it in 75 %, of two intervals they tell the right one in 75 % (`procedure`).

    Attributes
    ----------
    participant_id : str
        Who, e.g. "01".
    screen : str
        "white" or "gray".
    factor : float
        Initial brightness factor b of the ramps.
    luminance : float
        Initial luminance of the ramps [cd/m^2].
    threshold : float
        Rate detected in 75 % of the trials [cd/m^2/s].
    ci_low, ci_high : float
        95 % interval of the threshold [cd/m^2/s].
    standard_error_ln : float
        Standard deviation of the posterior of ln(threshold).
    width : float
        Width of the psychometric function: ln(rate) from 5 % to 95 % of its rise.
    guess_rate, lapse_rate : float
        Fitted asymptotes: P("yes") with nothing to see, P("no") with everything to see.
    false_alarm_rate : float or None
        "Yes" in catch trials, None if there were none.
    n_trials, n_catch : int
        Trials with a ramp, and catch trials.
    flag : ThresholdFlag
        Why to look at it, if at all.
    direction : Direction
        Which way the luminance went.
    ramp_duration : float
        Of the ramps [s].
    procedure : Procedure
        What was asked; of two intervals, "yes" means the right one.
    d_prime : float or None
        d′ at the threshold; None without catch trials (yes/no).
    criterion : float or None
        Yes/no: z(1 - FA), from the participant's catch trials. Two intervals: the bias c, above 0 if the
        participant leans to the first interval.
    threshold_d_prime_1 : float or None
        Rate at which d′ is 1, whatever the criterion [cd/m^2/s]; None where it is not known.
    deviance : float or None
        Of the answers from the fitted function; None with too few rates to judge it by.
    deviance_p : float or None
        Share of simulated data sets of that function with at least this deviance.
    drift_ratio, drift_p : float or None
        Of the participant: threshold at the end of the trials over that at their beginning, and how
        probable as clear a drift is by chance.
    level_n_catch : int
        Catch trials at this level; `n_catch` are the participant's.
    level_false_alarm_rate : float or None
        "Yes" in them; None without any.
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    screen: str = described("white or gray", pattern="^(white|gray)$")
    factor: float = quantity("1", "initial brightness factor", above=0.0, maximum=1.0)
    luminance: float = quantity("cd/m^2", "initial luminance", above=0.0)
    threshold: float = quantity("cd/m^2/s", "rate detected in 75 % of the trials", above=0.0)
    ci_low: float = quantity("cd/m^2/s", "95 % interval, lower end", above=0.0, key="ci_low")
    ci_high: float = quantity("cd/m^2/s", "95 % interval, upper end", above=0.0, key="ci_high")
    standard_error_ln: float = quantity("1", "posterior SD of ln(threshold)", above=0.0)
    width: float = quantity("1", "ln(rate) from 5 % to 95 % of the rise", above=0.0)
    guess_rate: float = quantity("1", "fitted lower asymptote", minimum=0.0, maximum=1.0)
    lapse_rate: float = quantity("1", "one minus the fitted upper asymptote", minimum=0.0, maximum=1.0)
    false_alarm_rate: float | None = quantity("1", "share of yes in catch trials", minimum=0.0, maximum=1.0)
    n_trials: int = quantity("1", "trials with a ramp", minimum=1)
    n_catch: int = quantity("1", "catch trials", minimum=0)
    flag: ThresholdFlag = described("why to look at it before use; empty for none")
    direction: Direction = described("which way the luminance went", default=Direction.DOWN)
    ramp_duration: float = quantity("s", "duration of the ramps", above=0.0, default=5.0)
    procedure: Procedure = described("what was asked", default=Procedure.YES_NO)
    d_prime: float | None = quantity("1", "d' at the threshold", default=None)
    criterion: float | None = quantity(
        "1", "yes/no: z(1 - false alarms); two intervals: bias, above 0 to the first", default=None
    )
    threshold_d_prime_1: float | None = quantity("cd/m^2/s", "rate with d' = 1", above=0.0, default=None)
    deviance: float | None = quantity("1", "of the answers from the function", minimum=0.0, default=None)
    deviance_p: float | None = quantity(
        "1", "share of simulated data with at least this deviance", minimum=0.0, maximum=1.0, default=None
    )
    drift_ratio: float | None = quantity(
        "1", "participant's threshold at the end over that at the beginning", above=0.0, default=None
    )
    drift_p: float | None = quantity(
        "1", "probability of as clear a drift by chance", minimum=0.0, maximum=1.0, default=None
    )
    level_n_catch: int = quantity("1", "catch trials at this level", minimum=0, default=0)
    level_false_alarm_rate: float | None = quantity(
        "1", "share of yes in the catch trials at this level", minimum=0.0, maximum=1.0, default=None
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if not self.ci_low <= self.threshold <= self.ci_high:
            raise ValueError(
                f"need ci_low <= threshold <= ci_high, "
                f"got {self.ci_low:g}, {self.threshold:g}, {self.ci_high:g}"
            )
