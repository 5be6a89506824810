"""What an analysis was made of and came to: the record beside its tables and figures."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described


@dataclass(frozen=True, slots=True)
class AnalysisSummary:
    """What an analysis was made of and came to.

    Attributes
    ----------
    simulated : bool
        Whether any of its data come from simulated participants.
    leads : dict of str to str
        What came out, in a sentence or two, by the name of each part.
    refused : dict of str to str
        Parts that could not be analysed, and why.
    warnings : tuple of str
        What is amiss but does not forbid the use.
    provenance : Provenance
        Software and seed, and the SHA-256 of what was read.
    files : tuple of str
        Files that were written beside this one; a later run into the same folder removes those that it does
        not write anew.
    """

    simulated: bool = described("true if any of the data come from simulated participants")
    leads: dict[str, str] = described("what came out, by the name of each part")
    refused: dict[str, str] = described("parts that could not be analysed, and why")
    warnings: tuple[str, ...] = described("what is amiss but does not forbid the use")
    provenance: Provenance = described("how the files were made")
    files: tuple[str, ...] = described("files that were written beside this one", default=())

    def __post_init__(self) -> None:
        check_limits(self)
