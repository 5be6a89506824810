"""The numbers that the paper prints, each with the table, equation, figure or section that it stands in.

Every published number that this code uses or is compared with has its one home in
`published/surace2025.published.csv`. Places that begin with "the authors' program" are not in the paper: they
come from the short program that its authors published.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from evenlight.data_schema.quantities import described, record
from evenlight.data_schema.storage.tables import read_rows

SURACE_2025 = Path(__file__).parent / "published" / "surace2025.published.csv"
SEQUENCES = ("library", "gym", "living_room", "basement")  # in the order of Table 1


@record
class PublishedValue:
    """A number as the paper prints it."""

    name: str = described(
        "table or figure, row and column, e.g. detail_quality.library.ours_mean",
        pattern=r"^[a-z0-9_]+(\.[a-z0-9_]+)+$",
    )
    text: str = described(
        "the digits as printed: how many there are says how it was rounded",
        pattern=r"^-?[0-9]+(\.[0-9]+)?(e-?[0-9]+)?$",
    )
    unit: str = described("1 for a pure number, % for a percentage")
    place: str = described("table, equation, figure or section it stands in")
    note: str = described("what one should know of it; empty for nothing", default="")

    @property
    def number(self) -> float:
        """The number that is printed."""
        return float(self.text)


def published(name: str) -> PublishedValue:
    """Return a published number by its name.

    Raises
    ------
    KeyError
        If the paper has no number of that name.

    >>> value = published("detail_quality.gym.baseline_mean")
    >>> value.text, value.number, value.unit, value.place
    ('3.23', 3.23, '1', 'Table 1')
    """
    values = _values()
    if name not in values:
        raise KeyError(f"{SURACE_2025.name} has no value {name!r}")
    return values[name]


def published_values(prefix: str = "") -> tuple[PublishedValue, ...]:
    """Return the published numbers whose names begin with the parts of `prefix`, in the order of the file.

    >>> [value.text for value in published_values("adaptation.library")]
    ['0.5', '0.4189', '0.7311']
    """
    inside = f"{prefix}." if prefix else ""
    return tuple(v for v in _values().values() if v.name == prefix or v.name.startswith(inside))


@cache
def _values() -> dict[str, PublishedValue]:
    return {value.name: value for value in read_rows(PublishedValue, SURACE_2025)}
