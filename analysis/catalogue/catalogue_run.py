"""A catalogue, made on the workers of a cluster: what is to be done next, and what came of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from evenlight.analysis.catalogue.results import (
    CatalogueTask,
    OpenedVideo,
    Outcome,
    analysed_part,
    contents_of_part,
    finished,
    results_of,
)
from evenlight.analysis.catalogue.shared import budget_table
from evenlight.analysis.tracks.objective_words import less_or_more
from evenlight.cluster import AHEAD, SchedulerLostError, WorkerLostError, Workers, result_of
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.catalogue import CatalogueRow
from evenlight.method.optimizer.shared_price import BudgetTable, shared_budgets
from evenlight.progress import Progress

if TYPE_CHECKING:
    from distributed import Future

LOOK_EVERY = 1.0  # [s] for what is done of the parts of long videos
DEFECT = "a defect of Evenlight, or of a package that it uses"


def run_catalogue(
    tasks: Sequence[CatalogueTask], workers: Workers, progress: Progress, curves_do: bool = False
) -> list[CatalogueRow]:
    """Make the results of all videos, and return a row for each; one that fails stops no other.

    Parameters
    ----------
    tasks, workers : sequence of CatalogueTask, Workers
        What is wanted, and who does it.
    progress : Progress
        Is told of each video.
    curves_do : bool
        As of `results_of`.

    Raises
    ------
    InputError
        If the scheduler has gone.
    """
    return _Run(tasks, workers, progress, curves_do).rows()


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
    # A budget that every video can have, for now.
    full = asked.budget if asked.budget_unit is BudgetUnit.WATT else 1.0
    first = [_with_budget(task, full) for task in tasks]
    progress.step("loss curves", len(tasks))
    rows = run_catalogue(first, workers, progress, curves_do=True)
    failed = {number: row for number, row in enumerate(rows) if row.error}
    left = [number for number in range(len(tasks)) if number not in failed]
    if not left:
        return [], failed
    progress.step("losses at other budgets", len(left))
    tables: list[BudgetTable] = []
    for table in workers.mapped(budget_table, [first[number] for number in left]):
        tables.append(table)
        progress.at(len(tables))
    budgets = shared_budgets(tables, asked.budget)
    own = zip(left, budgets, strict=True)
    return [_with_budget(tasks[number], float(budget)) for number, budget in own], failed


def _with_budget(task: CatalogueTask, budget: float) -> CatalogueTask:
    """Return a task with another budget."""
    asked = replace(task.video.asked, budget=budget)
    return replace(task, video=replace(task.video, asked=asked))


@dataclass(slots=True)
class _Run:
    """A run over the videos of a catalogue, few of them under way at a time."""

    tasks: Sequence[CatalogueTask]
    workers: Workers
    progress: Progress
    curves_do: bool
    # what is under way, and whose result it is to be; of a long video, with the tasks of its parts
    under_way: dict[Future, int] = field(default_factory=dict)
    parts: dict[Future, list[Future]] = field(default_factory=dict)
    done_parts: int = 0  # of videos that are finished

    def rows(self) -> list[CatalogueRow]:
        """Return the row of each video."""
        waiting, rows = deque(range(len(self.tasks))), dict[int, CatalogueRow]()
        try:
            while waiting or self.under_way:
                places = self.workers.places()
                while waiting and len(self.under_way) < AHEAD * places:
                    number = waiting.popleft()
                    # Where there are more videos than workers, each is done whole: that takes less in all.
                    divide = len(waiting) + len(self.under_way) < places
                    task = self.tasks[number]
                    self.under_way[self.workers.submit(results_of, task, divide, self.curves_do)] = number
                for future in self.workers.done_of(self.under_way, LOOK_EVERY):
                    self._take(future, rows)
                self._tell(len(rows))
        finally:
            self.workers.client.cancel(list(self.under_way))
        return [rows[number] for number in range(len(self.tasks))]

    def _take(self, future: Future, rows: dict[int, CatalogueRow]) -> None:
        """Take what came of a video; one that was only opened goes on in parts."""
        number = self.under_way.pop(future)
        self.done_parts += len(self.parts.pop(future, ()))
        found = self._outcome(future, self.tasks[number])
        if isinstance(found, OpenedVideo):
            self._divide(number, future, len(found.parts))
            return
        rows[number] = found.row
        self.progress.note(in_words(found))

    def _divide(self, number: int, opened: Future, count: int) -> None:
        """Have a long video analysed in parts; what was opened stays on its worker."""
        submit = self.workers.submit
        new = [submit(contents_of_part, opened, k) for k in range(count)]
        made = [submit(analysed_part, opened, k, *new) for k in range(count)]
        last = submit(finished, opened, *made)
        self.under_way[last], self.parts[last] = number, [*new, *made]

    def _outcome(self, future: Future, task: CatalogueTask) -> Outcome | OpenedVideo:
        """Return what a task has returned; if it failed, the row that says so."""
        try:
            found: Outcome | OpenedVideo = result_of(future)
        except SchedulerLostError:
            raise
        except (InputError, WorkerLostError) as error:
            return _failed(task, str(error))
        except MemoryError:
            return _failed(task, "needs more memory than its worker has")
        except Exception as error:  # whatever it is, it must not stop the others
            return _failed(task, f"{DEFECT}: {type(error).__name__}: {error}")
        return found

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
    if row.error:
        return f"{row.name}: failed: {row.error}"
    gain = "nothing to gain" if row.gain is None else f"{less_or_more(row.gain)} spread than constant dimming"
    return f"{row.name}: {row.frames} frames, {gain}{'' if outcome.anew else ' (unchanged)'}"
