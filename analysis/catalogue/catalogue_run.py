"""A catalogue, made on the workers of a cluster: what is to be done next, and what came of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from evenlight.analysis.catalogue.results import (
    CatalogueTask,
    OpenedVideo,
    Outcome,
    analysed_part,
    begins_of_parts,
    contents_of_part,
    finished,
    loss_curves_for,
    result_there,
    results_of,
)
from evenlight.analysis.catalogue.shared import budget_table, without_budget
from evenlight.analysis.tracks.objective_words import less_or_more
from evenlight.cluster import AHEAD, SchedulerLostError, WorkerLostError, Workers, result_of
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.catalogue import CatalogueRow
from evenlight.method.optimizer.shared_price import BudgetTable, shared_budgets
from evenlight.progress import Progress

if TYPE_CHECKING:
    from distributed import Future

LOOK_EVERY = 1.0  # [s] for what is done of the parts of long videos
DEFECT = "a defect of Evenlight, or of a package that it uses"
Step = Callable[..., Any]  # a function of a task, and others of its arguments, which workers do


def run_catalogue(tasks: Sequence[CatalogueTask], workers: Workers, progress: Progress) -> list[CatalogueRow]:
    """Make the results of all videos, and return a row for each; one that fails stops no other.

    Raises
    ------
    InputError
        If the scheduler has gone.
    """
    progress.step("looking for results that are there", len(tasks))
    found = _Run(tasks, workers, progress).each(result_there)
    to_do = [k for k, outcome in enumerate(found) if not isinstance(outcome, Outcome) or outcome.row.error]
    progress.step("videos, and parts of long ones", len(to_do))
    made = _Run([tasks[k] for k in to_do], workers, progress, tells=True).videos(results_of)
    rows = {k: outcome.row for k, outcome in enumerate(found) if isinstance(outcome, Outcome)}
    rows |= {k: outcome.row for k, outcome in zip(to_do, made, strict=True)}
    return [rows[k] for k in range(len(tasks))]


def share_budget(
    tasks: Sequence[CatalogueTask], workers: Workers, progress: Progress
) -> tuple[list[CatalogueTask], dict[int, CatalogueRow]]:
    """Return the tasks with each video's own share of a budget for all, and the rows of those that failed.

    The loss curves are made first, unless they are there; then each video's losses at a few budgets.

    Raises
    ------
    InputError
        If all together cannot have that budget.
    """
    asked = tasks[0].video.asked
    first = [without_budget(task) for task in tasks]
    progress.step("loss curves of videos, and of parts of long ones", len(tasks))
    made = _Run(first, workers, progress, tells=True).videos(loss_curves_for)
    failed = {k: outcome.row for k, outcome in enumerate(made) if outcome.row.error}
    left = [k for k in range(len(tasks)) if k not in failed]
    progress.step("losses at other budgets", len(left))
    found = _Run([first[k] for k in left], workers, progress).each(budget_table, asked.budget_unit)
    failed |= {k: one.row for k, one in zip(left, found, strict=True) if isinstance(one, Outcome)}
    tables = {k: one for k, one in zip(left, found, strict=True) if isinstance(one, BudgetTable)}
    if not tables:
        return [], failed
    budgets = shared_budgets(list(tables.values()), asked.budget)
    own = zip(tables, budgets, strict=True)
    return [_with_budget(tasks[number], float(budget)) for number, budget in own], failed


def _with_budget(task: CatalogueTask, budget: float) -> CatalogueTask:
    """Return a task with another budget."""
    asked = replace(task.video.asked, budget=budget)
    return replace(task, video=replace(task.video, asked=asked))


@dataclass(slots=True)
class _Run:
    """A run over the videos of a catalogue, few of them under way at a time.

    Attributes
    ----------
    tasks, workers, progress : sequence of CatalogueTask, Workers, Progress
        What is wanted, who does it, and what is told of it.
    tells : bool
        Whether a line is told of each video.
    """

    tasks: Sequence[CatalogueTask]
    workers: Workers
    progress: Progress
    tells: bool = False
    # what is under way, and whose result it is to be; of a long video, with the tasks of its parts
    under_way: dict[Future, int] = field(default_factory=dict)
    parts: dict[Future, list[Future]] = field(default_factory=dict)
    done_parts: int = 0  # of videos that are finished

    def videos(self, step: Step) -> list[Outcome]:
        """Return the outcome of a step for each video; where there are fewer than workers, in parts."""
        return self.each(step, len(self.tasks) < self.workers.places())

    def each(self, step: Step, *given: Any) -> list[Any]:
        """Return what a step gives for each video; the outcome that says so, where it failed."""
        waiting, found = deque(range(len(self.tasks))), dict[int, Any]()
        try:
            while waiting or self.under_way:
                while waiting and len(self.under_way) < AHEAD * self.workers.places():
                    number = waiting.popleft()
                    self.under_way[self.workers.submit(step, self.tasks[number], *given)] = number
                for future in self.workers.done_of(self.under_way, LOOK_EVERY):
                    self._take(future, found, step)
                self._tell(len(found))
        finally:
            self.workers.client.cancel(list(self.under_way))
        return [found[number] for number in range(len(self.tasks))]

    def _take(self, future: Future, found: dict[int, Any], step: Step) -> None:
        """Take what came of a video; one that was only opened goes on in parts."""
        number = self.under_way.pop(future)
        self.done_parts += len(self.parts.pop(future, ()))
        one = self._outcome(future, self.tasks[number])
        if isinstance(one, OpenedVideo):
            self._divide(number, future, len(one.parts), step is loss_curves_for)
            return
        found[number] = one
        if self.tells and isinstance(one, Outcome) and (one.row.frames or one.row.error):
            self.progress.note(in_words(one))

    def _divide(self, number: int, opened: Future, count: int, curves_only: bool) -> None:
        """Have a long video analysed in parts; what was opened stays on its worker."""
        submit = self.workers.submit
        new = [submit(contents_of_part, opened, k) for k in range(count)]
        begins = submit(begins_of_parts, opened, *new)
        made = [submit(analysed_part, opened, begins, k) for k in range(count)]
        last = submit(finished, opened, begins, curves_only, *made)
        self.under_way[last], self.parts[last] = number, [*new, *made]

    def _outcome(self, future: Future, task: CatalogueTask) -> Any:
        """Return what a task has returned; if it failed, the outcome that says so."""
        try:
            return result_of(future)
        except SchedulerLostError:
            raise
        except (InputError, WorkerLostError) as error:
            return _failed(task, str(error))
        except MemoryError:
            return _failed(task, "needs more memory than its worker has")
        except Exception as error:  # whatever it is, it must not stop the others
            return _failed(task, f"{DEFECT}: {type(error).__name__}: {error}")

    def _tell(self, videos: int) -> None:
        """Tell how many videos and parts are done."""
        parts = [part for some in self.parts.values() for part in some]
        done = self.done_parts + sum(part.done() for part in parts)
        self.progress.at(videos + done, len(self.tasks) + self.done_parts + len(parts))


def _failed(task: CatalogueTask, message: str) -> Outcome:
    """Return the outcome of a video that failed, with a message of one line."""
    video = task.video
    error = " ".join(message.split()) or "unknown"
    return Outcome(CatalogueRow(video.name, video.shown, error=error), anew=True)


def in_words(outcome: Outcome) -> str:
    """Return what came of a video, in a line.

    >>> in_words(Outcome(CatalogueRow("a", "a.mkv", error="a.mkv is empty"), anew=True))
    'a: failed: a.mkv is empty'
    """
    row = outcome.row
    name = "".join(letter if letter.isprintable() else "?" for letter in row.name)
    if row.error:
        return f"{name}: failed: {row.error}"
    gain = "nothing to gain" if row.gain is None else f"{less_or_more(row.gain)} spread than constant dimming"
    return f"{name}: {row.frames} frames, {gain}{'' if outcome.anew else ' (unchanged)'}"
