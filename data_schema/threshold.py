"""Detection thresholds for luminance ramps, one row per participant and level."""

from __future__ import annotations

import enum

from evenlight.data_schema.quantities import count, described, quantity, record, share
from evenlight.data_schema.recordings.ramp import Direction, Procedure


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


@record
class Threshold:
    """The rate of luminance change that one participant detects in 75 % of the trials at one level.

    In yes/no they notice it in 75 %, of two intervals they identify the right one in 75 % (`procedure`), but
    for lapses.
    """

    participant_id: str = described("participant, e.g. 01", pattern="^[0-9A-Za-z]+$")
    screen: str = described("uniform screen: white or gray", pattern="^(white|gray)$")
    factor: float = share("initial brightness factor b of the ramps", above=0.0)
    luminance: float = quantity("cd/m^2", "initial luminance L of the ramps", above=0.0)
    threshold: float = quantity("cd/m^2/s", "rate detected in 75 % of the trials, but for lapses", above=0.0)
    ci_low: float = quantity(
        "cd/m^2/s", "lower end of the threshold's 95 % credible interval", above=0.0, key="ci_low"
    )
    ci_high: float = quantity(
        "cd/m^2/s", "upper end of the threshold's 95 % credible interval", above=0.0, key="ci_high"
    )
    standard_error_ln: float = quantity("1", "posterior standard deviation of ln(threshold)", above=0.0)
    width: float = quantity(
        "1", "width of the psychometric function: ln(rate) from 5 % to 95 % of its rise", above=0.0
    )
    guess_rate: float = share("fitted guess rate: P(yes) with nothing to see")
    lapse_rate: float = share("fitted lapse rate: P(no) with everything to see")
    false_alarm_rate: float | None = share(
        "share of yes in the participant's catch trials; empty if there were none"
    )
    n_trials: int = count("trials with a ramp", minimum=1)
    n_catch: int = count("catch trials of the participant")
    flag: ThresholdFlag = described("why to look at it before use; empty for none")
    direction: Direction = described("which way the luminance went", default=Direction.DOWN)
    ramp_duration: float = quantity("s", "duration of the ramps", above=0.0, default=5.0)
    procedure: Procedure = described(
        "what was asked; of two intervals, yes means the right one", default=Procedure.YES_NO
    )
    d_prime: float | None = quantity(
        "1", "d′ at the threshold; empty in yes/no without catch trials", default=None
    )
    criterion: float | None = quantity(
        "1",
        "yes/no: criterion z(1 - false alarms); two intervals: bias c, above 0 towards the first",
        default=None,
    )
    threshold_d_prime_1: float | None = quantity(
        "cd/m^2/s",
        "rate at which d′ is 1, whatever the criterion; empty if not known",
        above=0.0,
        default=None,
    )
    deviance: float | None = quantity(
        "1",
        "deviance of the answers from the fitted function; empty with too few rates",
        minimum=0.0,
        default=None,
    )
    deviance_p: float | None = share(
        "share of data sets simulated from that function with at least this deviance", default=None
    )
    drift_ratio: float | None = quantity(
        "1",
        "participant's threshold at the end of the trials over that at the beginning",
        above=0.0,
        default=None,
    )
    drift_p: float | None = share("probability of so clear a drift by chance", default=None)
    level_n_catch: int = count("catch trials at this level", default=0)
    level_false_alarm_rate: float | None = share(
        "share of yes in the catch trials at this level; empty if there were none", default=None
    )

    def __post_init__(self) -> None:
        if not self.ci_low <= self.threshold <= self.ci_high:
            raise ValueError(
                f"need ci_low <= threshold <= ci_high, "
                f"got {self.ci_low:g}, {self.threshold:g}, {self.ci_high:g}"
            )
