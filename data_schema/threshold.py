"""Detection thresholds for luminance ramps, one row per participant and level."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from data_schema.quantities import check_limits, described, quantity


class ThresholdFlag(enum.Enum):
    """Why a threshold should be looked at before it is used."""

    NONE = ""
    ALL_YES = "all_yes"  # every ramp was detected: the threshold lies below what was tested
    ALL_NO = "all_no"  # no ramp was detected: the threshold lies above what was tested
    SEPARATED = "separated"  # a rate divides all "no" from all "yes": the slope is the prior's
    BELOW_RANGE = "below_range"  # the threshold lies below the slowest ramp tested
    ABOVE_RANGE = "above_range"  # the threshold lies above the fastest ramp tested
    FALSE_ALARMS = "false_alarms"  # "yes" to more than half of the catch trials


@dataclass(frozen=True, slots=True)
class Threshold:
    """The rate of luminance change that one participant detects in 75 % of the trials at one level.

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

    def __post_init__(self) -> None:
        check_limits(self)
        if not self.ci_low <= self.threshold <= self.ci_high:
            raise ValueError(
                f"need ci_low <= threshold <= ci_high, "
                f"got {self.ci_low:g}, {self.threshold:g}, {self.ci_high:g}"
            )
