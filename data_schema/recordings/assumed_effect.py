"""What a simulated population is assumed to show: the truth that an analysis of its answers estimates.

`evenlight simulate` writes it beside the data, in `simulated_truth.json`, so that a report can say "assumed"
beside "estimated". No analysis uses it to estimate anything.
"""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.quantities import described, quantity, record
from evenlight.data_schema.recordings.dataset_layout import SIMULATED_TRUTH
from evenlight.data_schema.storage.text_files import read_json

RATED = "mean rating, ours less baseline"
CHOSEN = "chance of choosing ours"
CHOSEN_UNMASKED = "chance of choosing ours, if the content's changes hid nothing"
TIME_RATIO = "ratio of search times, ours to baseline"
NOTHING_TO_SEE = 0.05  # chances of choosing ours so near to one half are a coin's, for any usual sample


@record
class AssumedEffect:
    """One true effect in a simulated population."""

    what: str = described("which effect")
    group: str = described("of which sequence, or of which locations of a search")
    value: float = quantity("1", "the effect, in its unit")
    unit: str = described("rating points, or 1 for a share or a ratio")

    @property
    def is_a_coin(self) -> bool:
        """Whether it is a chance of choosing ours that is all but one half."""
        return self.what == CHOSEN and abs(self.value - 0.5) < NOTHING_TO_SEE


def assumed_effects_in(dataset: Path) -> tuple[AssumedEffect, ...]:
    """Return what is assumed of the participants of a simulated data set; nothing of one that does not say.

    Raises
    ------
    InputError
        If the file is there, and is not as it should be.
    """
    path = dataset / SIMULATED_TRUTH
    if not path.is_file():
        return ()
    content = read_json(path, "what is true of the simulated participants")
    assumed = content.get("assumed", []) if isinstance(content, dict) else []
    return tuple(record_from_mapping(AssumedEffect, row, str(path)) for row in assumed)
