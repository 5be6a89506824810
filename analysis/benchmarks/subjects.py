"""What can be measured, by name."""

from __future__ import annotations

import enum
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.benchmarks.measured import Subject


class SubjectName(enum.Enum):
    """What `evenlight bench` measures."""

    CURVES = "curves"
    OPTIMIZER = "optimizer"
    FIT = "fit"
    ONLINE = "online"
    ALL = "all"


def subjects(name: SubjectName) -> dict[str, Subject]:
    """Return the subjects of a name, imported only now: each brings its peers."""
    names = [n for n in SubjectName if n is not SubjectName.ALL] if name is SubjectName.ALL else [name]
    found = {n.value: importlib.import_module(f"analysis.benchmarks.{n.value}_subject") for n in names}
    return {key: module.measure for key, module in found.items()}
