"""A reading of a luminance meter by itself, as `evenlight measure luminance` takes it."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described, quantity


@dataclass(frozen=True, slots=True)
class MeterReading:
    """One reading of a luminance meter, a row of a table.

    Attributes
    ----------
    index : int
        Which reading, from 1.
    utc : str
        When it ended (ISO 8601); empty from a simulation without a clock.
    begun, ended : float
        Right before and right after the reading, since the first began [s].
    luminance : float
        As the meter gave it, reflected light included [cd/m^2].
    meter : str
        The instrument as it was named; a simulated one begins with "simulated".
    meter_status : str
        The meter's own word or code.
    chromaticity_x, chromaticity_y : float or None
        CIE 1931, of meters that measure them.
    """

    index: int = quantity("1", "which reading, from 1", minimum=1)
    utc: str = described("when it ended, UTC (ISO 8601); empty without a clock")
    begun: float = quantity("s", "right before the reading, since the first began", minimum=0.0)
    ended: float = quantity("s", "right after it", minimum=0.0)
    luminance: float = quantity("cd/m^2", "as the meter gave it, reflected light included", minimum=0.0)
    meter: str = described("the instrument as it was named; a simulated one begins with simulated")
    meter_status: str = described("the meter's own word or code", default="")
    chromaticity_x: float | None = quantity("1", "CIE 1931 x", default=None)
    chromaticity_y: float | None = quantity("1", "CIE 1931 y", default=None)

    def __post_init__(self) -> None:
        check_limits(self)
        if self.ended < self.begun:
            raise ValueError(f"need begun <= ended, got {self.begun:g} and {self.ended:g} s")
