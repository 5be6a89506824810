"""What a live controller did, refresh by refresh."""

from __future__ import annotations

from dataclasses import dataclass

from data_schema.quantities import check_limits, quantity


@dataclass(frozen=True, slots=True)
class LiveRefresh:
    """A refresh of the display under the live controller; a row of `live_control.csv`.

    Attributes
    ----------
    refresh : int
        From 0 on.
    flip_time : float
        When it appeared, since the first [s].
    factor : float
        Brightness factor b that it was shown with.
    contrast_loss : float or None
        The loss that the controller knew last; None before the first.
    measured_refresh : int or None
        The refresh whose loss that is.
    mean_luminance : float or None
        Of that refresh at factor 1 [cd/m^2].
    rate : float or None
        Luminance change per second that the modulation made from the refresh before, at that luminance;
        signed [cd/m^2/s].
    rate_limit : float or None
        What it might be [cd/m^2/s].
    """

    refresh: int = quantity("1", "number of the refresh, from 0 on", minimum=0)
    flip_time: float = quantity("s", "when it appeared, since the first", minimum=0.0)
    factor: float = quantity("1", "brightness factor", above=0.0, maximum=1.0)
    contrast_loss: float | None = quantity(
        "1", "contrast loss known last", minimum=0.0, maximum=1.0, default=None
    )
    measured_refresh: int | None = quantity("1", "refresh whose loss that is", minimum=0, default=None)
    mean_luminance: float | None = quantity(
        "cd/m^2", "its mean luminance at factor 1", minimum=0.0, default=None
    )
    rate: float | None = quantity(
        "cd/m^2/s", "change by the modulation, from the refresh before", default=None
    )
    rate_limit: float | None = quantity("cd/m^2/s", "largest such change allowed", minimum=0.0, default=None)

    def __post_init__(self) -> None:
        check_limits(self)
