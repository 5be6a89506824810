"""Measures of what dimming loses, side by side: choices of the contrast model with one question."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.data_schema.contrast_model import (
    DEFAULT_MODEL,
    ContrastModel,
    LossForm,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.errors import InputError

MEASURES = {
    "relative": DEFAULT_MODEL,
    "soft": ContrastModel(visibility=Visibility.SOFT),
    "castle": ContrastModel(sensitivity=SensitivityModel.CASTLE),
    "absolute": ContrastModel(loss=LossForm.ABSOLUTE),
    "suprathreshold": ContrastModel(loss=LossForm.SUPRATHRESHOLD),
}
COUNTED = {  # as lost, by each measure
    "relative": "pairs of pixel and frequency band that are visible at full brightness and not when dimmed, "
    "as a share of the visible ones: the default",
    "soft": "as relative, with a probability of being seen in place of a sharp threshold",
    "castle": "as relative, with castleCSF for the sensitivity of the eye in place of Barten's function",
    "absolute": "as relative, as a share of all pairs, not of the visible ones",
    "suprathreshold": "how much of the perceived contrast above threshold goes, not how many pairs",
}
ROBUST = ("relative", "castle", "suprathreshold")  # a robust track's, unless others are asked for


def measures_named(names: Sequence[str]) -> tuple[str, ...]:
    """Return two or more names of measures, each once; raise `InputError` if they are not that."""
    for name in names:
        measure_named(name)
    if len(set(names)) < 2 or len(set(names)) != len(names):
        raise InputError(f"a robust track needs two measures or more, each once, got {', '.join(names)}")
    return tuple(names)


def measure_named(name: str) -> ContrastModel:
    """Return the contrast model of a measure; raise `InputError` if there is none of that name."""
    if name not in MEASURES:
        raise InputError(f"there is no measure {name!r}; give one of {', '.join(MEASURES)}")
    return MEASURES[name]
