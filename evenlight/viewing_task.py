"""Viewing tasks of someone else: one record that declares all of a task, and how its file is loaded."""

from __future__ import annotations

import dataclasses
import importlib.util
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS, TASKS, TaskRecords

if TYPE_CHECKING:
    from evenlight.analysis.dataset_findings import FindingsOf
    from evenlight.experiments.sessions.task import SessionSetting, Task
    from evenlight.experiments.viewing.simulated_viewers import OpenViewing

GROUP, VARIABLE = "evenlight.tasks", "EVENLIGHT_TASKS"  # of entry points; of the environment
DESIGN_FIELDS = {"sequences", "adaptation_duration", "max_dropped_share", "repeat_flagged"} | {
    "trials_between_breaks"
}
PAGES = ("consent", "instructions", "practice_end", "question")


@dataclass(frozen=True, slots=True)
class ViewingTaskDeclaration:
    """A viewing task, all of it: `examples/which_looks_better.py` declares one.

    Attributes
    ----------
    name : str
        On the command line, in manifests and file names: small letters, digits and underscores.
    title : str
        In the report of `evenlight analyze`, and in the name of simulated data sets.
    design : type
        Record of what is shown, how often, how: fields of `quantity` and `described`, all with defaults;
        `sequences`, `adaptation_duration`, `max_dropped_share`, `repeat_flagged` and `trials_between_breaks`
        among them.
    trial : type
        Record of a trial, a `data_schema.recordings.ramp.Trial`, with the columns of every viewing task.
    task : callable
        Makes the `ViewingTask` that a session conducts from a `SessionSetting`: as a rule a `ClipTask`.
    observer : callable
        Makes the `Viewing` of simulated participants from a `SessionSetting`.
    findings : callable
        Makes `Findings` of a `TaskData` and `AnalysisOptions`.
    pages : mapping of str to mapping of str to str
        By language, English among them: `instructions` and `question`, and where the pages of all tasks do
        not serve, `consent` and `practice_end`.
    """

    name: str
    title: str
    design: type[Any]
    trial: type[Any]
    task: Callable[[SessionSetting], Task]
    observer: OpenViewing
    findings: FindingsOf
    pages: Mapping[str, Mapping[str, str]]

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or self.name != self.name.lower() or self.name in BUILT_IN_TASKS:
            raise InputError(
                "the name of a task must be of small letters, digits and underscores, and none of "
                f"{', '.join(BUILT_IN_TASKS)}, got {self.name!r}"
            )
        for name, record in (("design", self.design), ("trial", self.trial)):
            if not (isinstance(record, type) and dataclasses.is_dataclass(record)):
                raise InputError(f"{name} of the task {self.name!r} must be a dataclass, got {record!r}")
        missing = DESIGN_FIELDS - {field.name for field in dataclasses.fields(self.design)}
        if missing:
            raise InputError(f"the design of the task {self.name!r} lacks {', '.join(sorted(missing))}")
        for name in ("task", "observer", "findings"):
            if not callable(getattr(self, name)):
                raise InputError(f"{name} of the task {self.name!r} must be callable")
        for language in {"en", *self.pages}:
            pages = set(self.pages.get(language, {}))
            if not {"instructions", "question"} <= pages <= set(PAGES):
                raise InputError(
                    f"the pages of the task {self.name!r} in {language!r} must be instructions and question, "
                    f"and may be consent and practice_end, got {', '.join(sorted(pages)) or 'none'}"
                )


def register_task(task: ViewingTaskDeclaration) -> None:
    """Make a task known to run, simulate, validate, export and analyze; one of the same name is replaced.

    Parameters
    ----------
    task : ViewingTaskDeclaration
        The task.
    """
    if not isinstance(task, ViewingTaskDeclaration):
        raise InputError(f"expected a ViewingTaskDeclaration, got a {type(task).__name__}")
    from evenlight.analysis.dataset_findings import ANALYSES, TaskAnalysis
    from evenlight.experiments.experiment_kinds import EXPERIMENTS, Experiment

    pages = {
        language: {f"{page}_{task.name}": text for page, text in texts.items()}
        for language, texts in task.pages.items()
    }
    TASKS[task.name] = TaskRecords(task.design, task.trial)
    EXPERIMENTS[task.name] = Experiment(task.title, task.task, task.observer, pages=pages)
    ANALYSES[task.name] = TaskAnalysis(task.title, task.findings)


def load_tasks() -> None:
    """Load the tasks of installed packages, and of the files that EVENLIGHT_TASKS names.

    A package names a module that calls `register_task` in its entry points of the group `evenlight.tasks`.

    Raises
    ------
    InputError
        If one cannot be loaded.
    """
    for entry in metadata.entry_points(group=GROUP):
        try:
            entry.load()
        except Exception as error:
            raise InputError(f"the task {entry.name!r} of an installed package: {error}") from error
    for name in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        path = Path(name)
        module = f"evenlight_task_{path.stem}"
        spec = importlib.util.spec_from_file_location(module, path)
        if not path.is_file() or spec is None or spec.loader is None:
            raise InputError(f"{VARIABLE}: {path}: no such file; expected a Python file with a task")
        sys.modules[module] = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(sys.modules[module])
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{VARIABLE}: {path}: {type(error).__name__}: {error}") from error
