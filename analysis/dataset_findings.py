"""The statistics of whatever tasks a data set holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from evenlight.analysis.findings import Findings
from evenlight.analysis.inference.binomial_tests import DEFAULT_MARGIN
from evenlight.analysis.session_loading import load_task, tasks_in
from evenlight.data_schema.dataset_layout import DESCRIPTION
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.search import SearchTrial
from evenlight.data_schema.seeds import require_seed
from evenlight.data_schema.viewing import ComparisonTrial, RatingTrial


@dataclass(frozen=True, slots=True)
class AnalysisOptions:
    """How a data set is analysed.

    Attributes
    ----------
    seed : int
        Of what is drawn at random: permutations, bootstrap samples.
    margin : float
        Shares of choosing ours within 0.5 ± margin count as no difference (comparison).
    slowing : float
        Search times that are longer by less than this share count as no slowing.
    tasks : tuple of str
        Which tasks; empty for all that there are.
    compared : RateLimit or None
        A rate limit that is drawn beside that of a calibration.
    """

    seed: int = 1
    margin: float = DEFAULT_MARGIN
    slowing: float = 0.25
    tasks: tuple[str, ...] = ()
    compared: RateLimit | None = None

    def __post_init__(self) -> None:
        require_seed(self.seed)
        if not 0 < self.slowing <= 9:
            raise InputError(f"--slowing must lie above 0 and not above 9, got {self.slowing:g}")
        if not 0 < self.margin < 0.5:
            raise InputError(f"--margin must lie between 0 and 0.5, got {self.margin:g}")


@dataclass(frozen=True, slots=True)
class DatasetFindings:
    """What a data set shows.

    Attributes
    ----------
    findings : dict of str to Findings
        By task.
    refused : dict of str to str
        Tasks whose data cannot be analysed, and why.
    simulated : dict of str to bool
        Whether simulated participants answered, by task.
    inputs : dict of str to str
        SHA-256 of what was read, by task.
    participants : dict of str to int
        How many there are, by task.
    """

    findings: dict[str, Findings] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    simulated: dict[str, bool] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    participants: dict[str, int] = field(default_factory=dict)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is amiss but does not forbid the use, each once."""
        said = (words for findings in self.findings.values() for words in findings.warnings)
        refused = (f"{task} is left out: {why}" for task, why in self.refused.items())
        return tuple(dict.fromkeys((*said, *refused)))


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
    present = tasks_in(dataset)
    missing = [task for task in options.tasks if task not in present]
    if missing or not present:
        found = f"holds {', '.join(present)}" if present else _no_session(dataset)
        wanted = f"expected sessions of {', '.join(missing)}; it " if missing else "it "
        raise InputError(f"{dataset}: {wanted}{found}")
    result = DatasetFindings()
    for task in options.tasks or present:
        report(task)
        try:
            findings, simulated, sha256, participants = _ANALYSES[task](dataset, options, folder)
        except InputError as error:
            result.refused[task] = str(error)
            continue
        result.findings[task] = findings
        result.simulated[task], result.inputs[task] = simulated, sha256
        result.participants[task] = participants
    if not result.findings:
        raise InputError("; ".join(result.refused.values()))
    return result


def _no_session(dataset: Path) -> str:
    """Return what a folder without sessions holds instead, if that may be what was meant."""
    inside = sorted(path.parent.name for path in dataset.glob(f"*/{DESCRIPTION}"))
    if inside:
        return f"holds data sets in folders of their own: {', '.join(inside)}; give one of them"
    return "holds no session (sub-*/ses-*/manifest.json)"


_Analysed = tuple[Findings, bool, str, int]


def _ramp(dataset: Path, options: AnalysisOptions, folder: Path) -> _Analysed:
    from evenlight.analysis.calibration.calibration import calibrate, write_calibration
    from evenlight.analysis.calibration.ramp_findings import ramp_findings
    from evenlight.analysis.loading import load_ramp_data
    from evenlight.data_schema.provenance import provenance_now

    data = load_ramp_data(dataset)
    calibration = calibrate(data)
    write_calibration(calibration, folder, provenance_now(inputs={"dataset": data.sha256}))
    return (
        ramp_findings(calibration, options.compared),
        data.simulated,
        data.sha256,
        len(data.participant_ids),
    )


def _rating(dataset: Path, options: AnalysisOptions, folder: Path) -> _Analysed:
    from evenlight.analysis.rating.rating_findings import rating_findings

    data = load_task(dataset, "rating", RatingTrial)
    return rating_findings(data, options.seed), data.simulated, data.sha256, len(data.participant_ids)


def _comparison(dataset: Path, options: AnalysisOptions, folder: Path) -> _Analysed:
    from evenlight.analysis.comparison.comparison_findings import comparison_findings

    data = load_task(dataset, "comparison", ComparisonTrial)
    findings = comparison_findings(data, options.seed, options.margin)
    return findings, data.simulated, data.sha256, len(data.participant_ids)


def _search(dataset: Path, options: AnalysisOptions, folder: Path) -> _Analysed:
    from evenlight.analysis.search.search_findings import search_findings

    data = load_task(dataset, "search", SearchTrial)
    findings = search_findings(data, options.seed, options.slowing)
    return findings, data.simulated, data.sha256, len(data.participant_ids)


_ANALYSES: dict[str, Callable[[Path, AnalysisOptions, Path], _Analysed]] = {
    "ramp": _ramp,
    "rating": _rating,
    "comparison": _comparison,
    "search": _search,
}
