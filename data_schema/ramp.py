"""The ramp experiment: its design and its trials (Section 3.4 of the paper)."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from data_schema.quantities import check_limits, described, quantity


class Response(enum.Enum):
    """The answer to "did the brightness change?"."""

    YES = "yes"
    NO = "no"


@dataclass(frozen=True, slots=True)
class RampDesign:
    """Which ramps are shown, and how often.

    Attributes
    ----------
    factors : tuple of float
        Initial brightness factors B of the paper.
    white_pixel_value, gray_pixel_value : float
        Pixel values of the two uniform screens, in [0, 1].
    relative_rates : tuple of float
        Rates of decrease as a share of the initial luminance per second [1/s].
    repetitions : int
        Trials per screen, factor and rate.
    catch_share : float
        Share of all trials without any change.
    ramp_duration, hold_duration : float
        Of the decrease and of the constant end [s].
    """

    factors: tuple[float, ...] = quantity(
        "1",
        "initial brightness factors",
        above=0.0,
        maximum=1.0,
        min_items=1,
        default=(0.2, 0.4, 0.6, 0.8, 1.0),
    )
    white_pixel_value: float = quantity(
        "1", "pixel value of the white screen", above=0.0, maximum=1.0, default=1.0
    )
    gray_pixel_value: float = quantity(
        "1", "pixel value of the gray screen", above=0.0, maximum=1.0, default=0.46
    )
    relative_rates: tuple[float, ...] = quantity(
        "1/s",
        "rates of decrease as a share of the initial luminance per second",
        above=0.0,
        min_items=1,
        default=(0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12),
        key="relative_rates_per_s",
    )
    repetitions: int = quantity("1", "trials per screen, factor and rate", minimum=1, default=6)
    catch_share: float = quantity(
        "1", "share of trials without change", minimum=0.0, maximum=0.9, default=0.2
    )
    ramp_duration: float = quantity("s", "duration of the decrease", above=0.0, default=5.0)
    hold_duration: float = quantity("s", "duration of the constant end", minimum=0.0, default=1.0)

    def __post_init__(self) -> None:
        check_limits(self)
        fastest = max(self.relative_rates)
        if fastest * self.ramp_duration >= 1:
            raise ValueError(
                f"a decrease of {fastest:g} of the initial luminance per second for {self.ramp_duration:g} s "
                f"would end below black; the fastest must stay below {1 / self.ramp_duration:g}"
            )


@dataclass(frozen=True, slots=True)
class RampTrial:
    """One trial of the ramp experiment, as one line of `trials.jsonl`.

    Attributes
    ----------
    participant_id, session_id : str
        Whose trial it is.
    trial_index : int
        Place in the session, from 0.
    screen : str
        "white" or "gray".
    factor : float
        Initial brightness factor.
    initial_luminance, final_luminance : float
        Before and after the ramp [cd/m^2].
    rate : float
        Rate of decrease; 0 in a catch trial [cd/m^2/s].
    duration : float
        Of the ramp [s].
    is_catch : bool
        Whether nothing changed.
    response : Response
        The answer.
    response_time : float or None
        From the end of the presentation to the answer; None from a simulation without a clock [s].
    simulated : bool
        Whether a simulated observer answered.
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    trial_index: int = quantity("1", "place in the session, from 0", minimum=0)
    screen: str = described("white or gray", pattern="^(white|gray)$")
    factor: float = quantity("1", "initial brightness factor", above=0.0, maximum=1.0)
    initial_luminance: float = quantity("cd/m^2", "before the ramp", above=0.0)
    final_luminance: float = quantity("cd/m^2", "after the ramp", minimum=0.0)
    rate: float = quantity("cd/m^2/s", "rate of decrease; 0 in a catch trial", minimum=0.0)
    duration: float = quantity("s", "duration of the ramp", above=0.0)
    is_catch: bool = described("true if nothing changed")
    response: Response = described("did the brightness change?")
    response_time: float | None = quantity("s", "from the end of the ramp to the answer", minimum=0.0)
    simulated: bool = described("true if a simulated observer answered")

    def __post_init__(self) -> None:
        check_limits(self)
        if self.is_catch != (self.rate == 0):
            raise ValueError(f"a catch trial has rate 0 and only a catch trial has, got rate {self.rate:g}")
