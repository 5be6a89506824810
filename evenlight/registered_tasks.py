"""Tasks of someone else: one record that declares all of a task, and how packages and files are loaded."""

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

from evenlight.data_schema.errors import InputError, shown_kind
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS, TASKS, TaskRecords
from evenlight.data_schema.recordings.viewing import ClipLog

if TYPE_CHECKING:
    from evenlight.analysis.dataset_findings import FindingsOf
    from evenlight.experiments.sessions.task import SessionSetting, Task
    from evenlight.experiments.viewing.simulated_viewers import OpenViewing

GROUP, VARIABLE = "evenlight.tasks", "EVENLIGHT_TASKS"  # of entry points; of the environment
# What records must have: designs that show sequences, for `ViewingTask`; trials and frames, for a session.
VIEWING = "sequences adaptation_duration max_dropped_share repeat_flagged trials_between_breaks"
TRIAL = "participant_id session_id trial_index simulated practice attempt flag onset n_frames"
FRAMES = "trial_index attempt interval"
PAGES = ("consent", "instructions", "practice_end")  # and `question`, or several that begin so


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskDeclaration:
    """A task, all of it; docs/extending.md describes each part.

    Attributes
    ----------
    name : str
        On the command line, in manifests and file names: small letters, digits and underscores.
    title : str
        In the report of `evenlight analyze`, and in the name of simulated data sets.
    design : type
        Record of what is shown, how often, how: fields of `quantity` and `described`, all with defaults. One
        with `sequences` makes it a viewing task, whose videos `--stimuli` names.
    trial : type
        Record of a trial, a `data_schema.recordings.ramp.Trial`.
    task : callable
        Makes the `Task` that a session conducts from a `SessionSetting`: of videos, as a rule a `ClipTask`.
    pages : mapping of str to mapping of str to str
        By language, English among them: `instructions` and `question`, and where the pages of all tasks do
        not serve, `consent` and `practice_end`.
    observer : callable, optional
        Makes the `Viewing` of simulated participants from a `SessionSetting`; without it, none are simulated.
    findings : callable, optional
        Makes `Analysis` of a `TaskData` and `AnalysisOptions`; without it, `analyze` says that it
        has none for the task.
    frames : type, optional
        Record of what the display showed in an interval of a trial; that of videos if left out.
    """

    name: str
    title: str
    design: type[Any]
    trial: type[Any]
    task: Callable[[SessionSetting], Task]
    pages: Mapping[str, Mapping[str, str]]
    observer: OpenViewing | None = None
    findings: FindingsOf | None = None
    frames: type[Any] = ClipLog

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InputError(f"name must be a text, got {self.name!r}")
        if not self.name.isidentifier() or self.name != self.name.lower() or self.name in BUILT_IN_TASKS:
            raise InputError(
                "the name of a task must be of small letters, digits and underscores, and none of "
                f"{', '.join(BUILT_IN_TASKS)}, got {self.name!r}"
            )
        for name, needed in (("design", VIEWING), ("trial", TRIAL), ("frames", FRAMES)):
            record = getattr(self, name)
            if not (isinstance(record, type) and dataclasses.is_dataclass(record)):
                raise InputError(f"{name} of the task {self.name!r} must be a dataclass, got {record!r}")
            fields = {field.name for field in dataclasses.fields(record)}
            missing = set(needed.split()) - fields
            if missing and (name != "design" or "sequences" in fields):
                raise InputError(f"the {name} of the task {self.name!r} lacks {', '.join(sorted(missing))}")
        for name in ("task", "observer", "findings"):
            part = getattr(self, name)
            if not callable(part) and (part is not None or name == "task"):
                raise InputError(f"{name} of the task {self.name!r} must be callable")
        for language in {"en", *self.pages}:
            pages = set(self.pages.get(language, {}))
            unknown = [page for page in pages if page not in PAGES and not page.startswith("question")]
            if not {"instructions", "question"} <= pages or unknown:
                raise InputError(
                    f"the pages of the task {self.name!r} in {language!r} must be instructions and question, "
                    "and may be consent, practice_end and more that begin with question, got "
                    f"{', '.join(sorted(pages)) or 'none'}"
                )


ViewingTaskDeclaration = TaskDeclaration  # its name when tasks of others had to show videos


def register_task(task: TaskDeclaration) -> None:
    """Make a task known to run, simulate, validate, export and analyze; one of the same name is replaced.

    Parameters
    ----------
    task : TaskDeclaration
        The task.
    """
    if not isinstance(task, TaskDeclaration):
        raise InputError(f"expected a TaskDeclaration, got {shown_kind(task)}")
    from evenlight.analysis.dataset_findings import ANALYSES, TaskAnalysis
    from evenlight.experiments.experiment_kinds import EXPERIMENTS, Experiment

    pages = {
        language: {f"{page}_{task.name}": text for page, text in texts.items()}
        for language, texts in task.pages.items()
    }
    TASKS[task.name] = TaskRecords(task.design, task.trial, task.frames)
    EXPERIMENTS[task.name] = Experiment(task.title, task.task, task.observer, pages=pages)
    ANALYSES[task.name] = TaskAnalysis(task.title, task.findings)


def load_tasks() -> None:
    """Load the tasks of installed packages, and of the files that EVENLIGHT_TASKS names.

    A package names in its entry points of the group `evenlight.tasks` a `TaskDeclaration`, as
    `flicker = "my_package:FLICKER"`, or a module that calls `register_task`.

    One of a package that cannot be loaded is told of: what needs nothing of it goes on.

    Raises
    ------
    InputError
        If a file cannot be loaded.
    """
    for entry in metadata.entry_points(group=GROUP):
        package = entry.dist.name if entry.dist else "of no name"
        where = f"the installed package {package}: its task {entry.name!r} ({entry.value})"
        try:
            found = entry.load()
            if isinstance(found, TaskDeclaration):
                register_task(found)
            wrong = "" if entry.name in TASKS else "is no TaskDeclaration of that name, and registers none"
        except Exception as error:
            wrong = f"cannot be loaded: {type(error).__name__}: {error}"
        if wrong:
            print(f"evenlight: note: {where} {wrong}", file=sys.stderr)
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
