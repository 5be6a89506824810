"""A number as the paper prints it: a row of the table of published values."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.quantities import check_limits, described


@dataclass(frozen=True, slots=True)
class PublishedValue:
    """A number as the paper prints it.

    Attributes
    ----------
    name : str
        Table or figure, row and column, e.g. "detail_quality.library.ours_mean".
    text : str
        The digits as printed: how many there are says how it was rounded.
    unit : str
        Its unit; "1" for a pure number, "%" for a percentage.
    place : str
        Table, equation, figure or section it stands in.
    note : str
        What one should know of it; empty for nothing.
    """

    name: str = described("table or figure, row, column", pattern=r"^[a-z0-9_]+(\.[a-z0-9_]+)+$")
    text: str = described("the digits as printed", pattern=r"^-?[0-9]+(\.[0-9]+)?(e-?[0-9]+)?$")
    unit: str = described("1 for a pure number, % for a percentage")
    place: str = described("table, equation, figure or section")
    note: str = described("what one should know of it", default="")

    def __post_init__(self) -> None:
        check_limits(self)

    @property
    def number(self) -> float:
        """The number that is printed."""
        return float(self.text)
