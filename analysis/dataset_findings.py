"""The statistics of whatever tasks a data set holds, and the report on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from evenlight.analysis.assumed_effects import with_assumed
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.inference.binomial_tests import DEFAULT_MARGIN
from evenlight.analysis.integrity.concern import Concern, ConcernKind, cautious
from evenlight.analysis.integrity.gate import checked
from evenlight.analysis.report import KeyFigure, Report, Section
from evenlight.analysis.report_sections import files_section, plan_section, provenance_section, roll_section
from evenlight.analysis.results import Analysis
from evenlight.analysis.session_loading import TaskData, load_task, undamaged_roll
from evenlight.analysis.wording import listed
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.provenance import Provenance, require_seed
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.assumed_effect import assumed_effects_in
from evenlight.data_schema.recordings.dataset_layout import DESCRIPTION
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse
from evenlight.data_schema.recordings.session import TASKS

SIMULATED = (
    "Simulated: the answers come from simulated participants. They show how the experiments and their "
    "analysis work, and say nothing about people."
)


DEFAULT_SLOWING = 0.25  # share of the search time


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """How a data set is analysed.

    Attributes
    ----------
    seed : int
        Seed of the permutations and bootstrap samples.
    margin : float
        Shares of choosing ours within 0.5 ± margin count as no difference (comparison).
    slowing : float
        Search times that are longer by less than this share count as no slowing.
    tasks : tuple of str
        Which tasks; empty for all that there are.
    compared : RateLimit or None
        A rate limit that is drawn beside that of a calibration.
    preregistered : Path or None
        The pre-registration to compare with; None for those in the data set.
    """

    seed: int = 1
    margin: float = DEFAULT_MARGIN
    slowing: float = DEFAULT_SLOWING
    tasks: tuple[str, ...] = ()
    compared: RateLimit | None = None
    preregistered: Path | None = None

    def __post_init__(self) -> None:
        require_seed(self.seed)
        if not 0 < self.slowing <= 9:
            raise ArgumentError("slowing", f"must lie above 0 and not above 9, got {self.slowing:g}")
        if not 0 < self.margin < 0.5:
            raise ArgumentError("margin", f"must lie between 0 and 0.5, got {self.margin:g}")


FindingsOf = Callable[[TaskData[Any], AnalysisOptions], Analysis]


@dataclass(frozen=True, slots=True)
class TaskAnalysis:
    """The analysis of a task: its title in the report, and what makes the findings of its trials.

    Those of ramps are made by a calibration, which writes files of its own.
    """

    title: str
    findings: FindingsOf | None


def _rating(data: TaskData[Any], options: AnalysisOptions) -> Analysis:
    """Analyse ratings; each of the three imports its analysis when it is first made."""
    from evenlight.analysis.rating.rating_findings import rating_findings

    return rating_findings(data, options.seed)


def _comparison(data: TaskData[Any], options: AnalysisOptions) -> Analysis:
    from evenlight.analysis.comparison.comparison_findings import comparison_findings

    return comparison_findings(data, options.seed, options.margin)


def _search(data: TaskData[Any], options: AnalysisOptions) -> Analysis:
    from evenlight.analysis.search.search_findings import search_findings

    return search_findings(data, options.slowing)


# By the names of `data_schema.recordings.session.TASKS`.
ANALYSES = {
    "ramp": TaskAnalysis("How fast a change is noticed", None),
    "rating": TaskAnalysis("Quality of details", _rating),
    "comparison": TaskAnalysis("Noticing the modulation", _comparison),
    "search": TaskAnalysis("Finding things", _search),
}


@dataclass(frozen=True, slots=True)
class DatasetFindings:
    """What a data set shows.

    Attributes
    ----------
    findings : dict of str to Analysis
        By task.
    refused : dict of str to str
        Tasks whose data cannot be analysed, and why.
    simulated : dict of str to bool
        Whether simulated participants answered, by task.
    inputs : dict of str to str
        SHA-256 of what was read, by task.
    participants : dict of str to int
        How many there are, by task.
    roll : RollCall or None
        The sessions of the data set, those that are left out too.
    departures : tuple of str
        From what was pre-registered, in words.
    """

    findings: dict[str, Analysis] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    simulated: dict[str, bool] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    participants: dict[str, int] = field(default_factory=dict)
    roll: RollCall | None = None
    departures: tuple[str, ...] = ()

    @property
    def concerns(self) -> tuple[Concern, ...]:
        """What is wrong with the trials of all tasks, and with sessions that are not read for it."""
        own = tuple(own for findings in self.findings.values() for own in findings.concerns)
        entries = self.roll.sessions if self.roll else ()
        wrong = sum(entry.use is SessionUse.WRONG for entry in entries)
        if not wrong:
            return own
        verb, them = ("is", "it") if wrong == 1 else ("are", "them")
        words = f"{wrong} of {len(entries)} sessions {verb} not read, as something is wrong with {them}"
        return (*own, Concern(ConcernKind.UNREAD, words))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong but does not forbid the use, each once."""
        said = (words for findings in self.findings.values() for words in findings.warnings)
        refused = (f"{task} is left out: {why}" for task, why in self.refused.items())
        return tuple(dict.fromkeys((*said, *refused, *(self.roll.warnings if self.roll else ()))))


def find_in_dataset(
    dataset: Path,
    options: AnalysisOptions,
    folder: Path,
    report: Callable[[str], None] = lambda task: None,
) -> DatasetFindings:
    """Analyse each task of a data set.

    Parameters
    ----------
    dataset : Path
        Sessions of one task or of several.
    options : AnalysisOptions
        How.
    folder : Path
        Where a calibration writes the files that other programs read: `thresholds.csv`, `rate_limit.json`.
    report : callable, optional
        Called with the task that is begun.

    Raises
    ------
    InputError
        If there is nothing to analyse, a task asked for is not there, or no task can be analysed.
    """
    from evenlight.analysis.plans.preregistration import Run, departures_of, registered_in

    roll = undamaged_roll(dataset)
    present = roll.tasks
    missing = [task for task in options.tasks if task not in present]
    if missing or not present:
        found = f"holds {', '.join(present)}" if present else _no_session(dataset, roll)
        wanted = f"expected sessions of {', '.join(missing)}; it " if missing else "it "
        raise InputError(f"{dataset}: {wanted}{found}")
    plans = registered_in(dataset, options.tasks or present, options.preregistered)
    result, runs = DatasetFindings(), dict[str, Run]()
    for task in options.tasks or present:
        report(task)
        try:
            findings, data = _analysed(dataset, task, options, folder, roll)
        except InputError as error:
            result.refused[task] = str(error)
            continue
        roll = data.roll or roll
        runs[task] = data, options if ANALYSES[task].findings else RateLimitOptions()
        result.findings[task] = findings
        result.simulated[task], result.inputs[task] = data.simulated, data.sha256
        result.participants[task] = len(data.participant_ids)
    if not result.findings:
        raise InputError("; ".join(result.refused.values()))
    return replace(result, roll=roll, departures=departures_of(plans, runs))


def _no_session(dataset: Path, roll: RollCall) -> str:
    """Return what a folder without sessions holds instead, if that may be what was meant."""
    inside = sorted(path.parent.name for path in dataset.glob(f"*/{DESCRIPTION}"))
    if inside:
        return f"holds data sets in folders of their own: {', '.join(inside)}; give one of them"
    if unknown := sorted(
        {e.task for e in roll.sessions if e.use is SessionUse.LEFT_OUT and e.task} - set(TASKS)
    ):
        return f"holds sessions of {', '.join(unknown)}, which is not registered (EVENLIGHT_TASKS)"
    if roll.sessions:
        return f"holds no session that can be read: {roll.warnings[0]}"
    return "holds no session (sub-*/ses-*/manifest.json)"


def _analysed(
    dataset: Path, task: str, options: AnalysisOptions, folder: Path, roll: RollCall
) -> tuple[Analysis, TaskData[Any]]:
    if task != "ramp":
        data = load_task(dataset, task, TASKS[task].trial, roll)
        assumed = assumed_effects_in(dataset) if data.simulated else ()
        return with_assumed(task_findings(data, options), assumed), data
    from evenlight.analysis.calibration.calibration import NoRateLimitError, calibrate
    from evenlight.analysis.calibration.fit_report import write_calibration, write_thresholds
    from evenlight.analysis.calibration.ramp_findings import findings_without_limit, ramp_findings
    from evenlight.analysis.ramp_loading import load_ramp_data
    from evenlight.data_schema.provenance import provenance_now

    ramps = load_ramp_data(dataset, roll)
    try:
        calibration = calibrate(ramps)
    except NoRateLimitError as refused:
        write_thresholds(refused.fits, folder)
        return findings_without_limit(refused), ramps
    write_calibration(calibration, folder, provenance_now(inputs={"dataset": ramps.sha256}))
    return ramp_findings(calibration, options.compared), ramps


def task_findings(data: TaskData[Any], options: AnalysisOptions) -> Analysis:
    """Analyse the trials of one viewing task; no file is read or written.

    Parameters
    ----------
    data : TaskData
        From `load_task`, or from trials in memory (`task_data_of`).
    options : AnalysisOptions
        How.

    Raises
    ------
    InputError
        If the trials cannot be analysed; or of another task.
    """
    how = ANALYSES[data.task].findings
    if how is None:
        others = [name for name, analysis in ANALYSES.items() if analysis.findings]
        known = f"{', '.join(others[:-1])} and {others[-1]}"
        raise InputError(f"there is no analysis of the task {data.task!r} here, only of {known}")
    data, concerns = checked(data)
    found = how(data, options)
    said = tuple(concern.words for concern in concerns)
    return replace(
        found,
        lead=cautious(concerns, found.lead),
        concerns=concerns,
        warnings=(*said, *found.warnings),
    )


def dataset_report(found: DatasetFindings, origin: Provenance) -> Report:
    """Return the report on a data set.

    Parameters
    ----------
    found : DatasetFindings
        What it shows.
    origin : Provenance
        Software, seed and inputs of the analysis.
    """
    lead, key_figures = _first_lines(found)
    parts = (_part(task, findings, found) for task, findings in found.findings.items())
    return Report(
        "What the data show",
        lead,
        (
            *plan_section(found.departures),
            *to_be_looked_at(found),
            *(section for part in parts for section in part),
            *((roll_section(found.roll),) if found.roll else ()),
            provenance_section({"analysis": origin}),
            files_section(_files(found)),
        ),
        SIMULATED,
        key_figures=key_figures,
    )


def _first_lines(found: DatasetFindings) -> tuple[str, tuple[KeyFigure, ...]]:
    """Return what came out: of a single task, or in a word of several, whose parts begin with their own."""
    if len(found.findings) == 1:
        (lead, key_figures), *_ = (findings.first_lines for findings in found.findings.values())
        unread = (own for own in found.concerns if own.kind is ConcernKind.UNREAD)
        return cautious(unread, lead), key_figures
    titles = listed([ANALYSES[task].title.lower() for task in found.findings])
    lead = f"{len(found.findings)} experiments: {titles}. Each part begins with what came out."
    firsts = (own for findings in found.findings.values() for own in findings.key_figures[:1])
    return cautious(found.concerns, lead), tuple(firsts)


def _part(task: str, findings: Analysis, found: DatasetFindings) -> tuple[Section, ...]:
    """Return the sections of a task; below a heading of its own where there are several tasks."""
    if len(found.findings) == 1:
        return findings.sections
    head = Section(
        ANALYSES[task].title,
        (findings.lead,),
        simulated=found.simulated[task],
        key_figures=findings.key_figures,
    )
    return (head, *(replace(own, below=True) for own in findings.sections))


def to_be_looked_at(found: DatasetFindings) -> tuple[Section, ...]:
    """Return what the reader should be warned of first; of sessions the roll-call tells."""
    told = found.roll.warnings if found.roll else ()
    notes = tuple(words for words in found.warnings if words not in told)
    simulated = any(found.simulated.values())
    return (Section("To be looked at", notes=notes, simulated=simulated),) if notes else ()


def _files(found: DatasetFindings) -> dict[str, str]:
    """Return the files that were written, with what they hold."""
    files = {}
    for task, findings in found.findings.items():
        files[f"{findings.name}_statistics.csv"] = f"every number of {ANALYSES[task].title.lower()}"
        for drawing in findings.drawings:
            files[f"{drawing.name}.png, {drawing.name}_points.csv"] = drawing.caption
    if "ramp" in found.findings:
        files["thresholds.csv"] = "thresholds of each participant and level, with 95 % credible intervals"
        files["rate_limit.json"] = "the fitted rate limit, for `evenlight optimize --rate-limit`"
        files["fit_summary.json"] = "what the fit rests on, for programs"
    return files
