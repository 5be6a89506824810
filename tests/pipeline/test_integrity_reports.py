"""What is wrong with trials stands first: in reports and summaries, on the terminal, in Python."""

from __future__ import annotations

import dataclasses
import html
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import clean_answers as made
import numpy as np
import pytest

import evenlight
from evenlight import command as command_line
from evenlight.analysis.calibration.calibration import calibrate
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.dataset_findings import ANALYSES, AnalysisOptions, TaskAnalysis, task_findings
from evenlight.analysis.integrity.concern import Concern, ConcernKind, cautious
from evenlight.analysis.results import Analysis
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.recordings.dataset_layout import TRIALS
from evenlight.data_schema.recordings.viewing import Version

Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def rated(tmp_path_factory: pytest.TempPathFactory, make_stimulus: Callable[..., None]) -> Path:
    """Ratings of 12 simulated participants."""
    folder = tmp_path_factory.mktemp("rated")
    for place, name in enumerate(made.NAMES):
        make_stimulus(folder / "stimuli" / name, [0.35 + 0.1 * place, 0.55 + 0.1 * place] * 5)
    simulate("rating", folder / "data", "--stimuli", folder / "stimuli", "--participants", 12)
    return folder / "data"


def simulate(task: str, out: Path, *more: object) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main(["simulate", task, *map(str, more), "--out", str(out), "--quiet"])
    assert not ended.value.code


def changed(dataset: Path, copy: Path, change: Callable[[str, Rows], Rows]) -> Path:
    """A copy of a data set whose rows, of each participant, were changed."""
    shutil.copytree(dataset, copy)
    for path in sorted(copy.glob(f"sub-*/ses-*/{TRIALS}")):
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        rows = change(path.parts[-3], rows)
        path.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    return copy


def lead_on_page(report: Path) -> str:
    found = re.search(r'<p class="lead">(.*?)</p>', report.read_text(), re.DOTALL)
    assert found
    return html.unescape(found[1])


def ours_second(who: str, rows: Rows) -> Rows:
    return [row | {"place_in_pair": 2 if row["version"] == "ours" else 1} for row in rows]


def test_ours_always_second_is_the_first_thing_said_and_no_effect_of_the_version_is_claimed(
    rated: Path, command: Callable[..., Any], blank_pictures: None, tmp_path: Path
) -> None:
    outcome = command("analyze", changed(rated, tmp_path / "data", ours_second), "--out", tmp_path / "out")
    order = "in the ratings the track was shown second in all 48 pairs"
    warned = f"{order}, so that an effect of the version and one of the order cannot be told apart"
    said = f"Caution: {order}, so order and version cannot be told apart. The track "
    assert outcome.code == 0
    assert outcome.err.splitlines()[0] == f"evenlight: warning: {warned}"
    assert outcome.out.startswith(f"rating: {said}")
    lead = lead_on_page(tmp_path / "out" / "report.html")
    assert lead.startswith(said)
    assert lead.count("told apart") == 1
    assert "differ beyond chance" not in lead
    summary = json.loads((tmp_path / "out" / "analysis.json").read_text())
    assert summary["warnings"][0] == warned
    assert summary["leads"]["rating"] == lead


def test_a_repeated_row_changes_no_number(
    rated: Path, command: Callable[..., Any], blank_pictures: None, tmp_path: Path
) -> None:
    def again(who: str, rows: Rows) -> Rows:
        return [*rows, rows[2] | {"trial_index": 50}] if who == "sub-03" else rows

    doubled = changed(rated, tmp_path / "data", again)
    for data, out in ((rated, "before"), (doubled, "after")):
        outcome = command("analyze", data, "--out", tmp_path / out, "--quiet")
        assert outcome.code == 0
    assert "1 of 97 ratings repeats" in outcome.err
    assert lead_on_page(tmp_path / "after" / "report.html").startswith("Caution: 1 of 97 ratings repeats")
    tables = [(tmp_path / out / "rating_statistics.csv").read_bytes() for out in ("before", "after")]
    assert tables[0] == tables[1]


def test_nothing_wrong_is_nothing_said(
    rated: Path, command: Callable[..., Any], blank_pictures: None, tmp_path: Path
) -> None:
    assert command("analyze", rated, "--out", tmp_path / "out", "--quiet").code == 0
    assert lead_on_page(tmp_path / "out" / "report.html").startswith("The track ")


def test_swapped_keys_stand_first_in_the_report_of_a_fit(
    command: Callable[..., Any], blank_pictures: None, short_ramps: Path, tmp_path: Path
) -> None:
    simulate("ramp", tmp_path / "ramps", "--participants", 2, "--design", short_ramps)
    other = {"yes": "no", "no": "yes"}

    def swapped(who: str, rows: Rows) -> Rows:
        return [row | {"response": other[row["response"]]} for row in rows] if who == "sub-02" else rows

    data = changed(tmp_path / "ramps", tmp_path / "data", swapped)
    outcome = command("fit", data, "--out", tmp_path / "out", "--quiet")
    said = "participant 02 reported fast ramps less often than slow ones, as if the keys were swapped"
    assert outcome.code == 0
    assert outcome.err.splitlines()[0] == f"evenlight: warning: {said}"
    assert lead_on_page(tmp_path / "out" / "report.html").startswith(f"Caution: {said}. On ")
    assert json.loads((tmp_path / "out" / "fit_summary.json").read_text())["warnings"][0] == said


def test_a_threshold_that_grows_fivefold_is_a_concern_of_the_calibration() -> None:
    """Of ramps the drift of the thresholds says whether a session changed."""
    design = made.ramp_design(factors=(0.2, 0.4, 0.6, 1.0))
    trials = made.ramps(np.random.default_rng(3), design, 3)
    last = 4 * 60  # ramps and catch trials of a participant
    tired = [
        made.ramp(1, t.trial_index, (t.factor, t.rate / t.initial_luminance), tired_answer(t, last))
        if t.participant_id == "01" and not t.is_catch else t
        for t in trials
    ]  # fmt: skip
    options = RateLimitOptions(degree=1)
    assert not calibrate(made.ramp_data_of(trials, design), options).concerns
    (concern,) = calibrate(made.ramp_data_of(tired, design), options).concerns
    assert concern.kind is ConcernKind.HALVES
    assert concern.words.startswith("participant 01: thresholds at the end of the trials are")


def tired_answer(trial: Any, last: int) -> bool:
    """What is seen above a threshold that goes from 0.012 to 0.06 of the luminance per second."""
    threshold = 0.012 * 5 ** (trial.trial_index / last)
    return bool(trial.rate / trial.initial_luminance > threshold)


def test_python_says_it_as_well() -> None:
    trials = made.ratings(np.random.default_rng(1))
    table = [
        mapping_from_record(trial) | {"place_in_pair": 1 + (trial.version is Version.OURS)}
        for trial in trials
    ]
    analysis = evenlight.analyze(table)
    assert analysis.lead.startswith("Caution: in the ratings the track was shown second in all 68 pairs")
    assert analysis.warnings[0].startswith("in the ratings the track was shown second in all 68 pairs")


def test_comparisons_and_searches_in_one_order_claim_no_effect_either() -> None:
    compared = [
        made.comparison(k, name, 2, s < 3 or k % 2 == 0, (1, s))
        for k in range(17)
        for s, name in enumerate(made.NAMES)
    ]
    lead = task_findings(made.data_of("comparison", compared), AnalysisOptions()).lead
    assert lead.startswith("Caution: in the comparisons the track was shown second in ")
    assert lead.count("cannot be told") == 1
    assert "differ from a coin" not in lead
    searched = [
        dataclasses.replace(trial, version=Version.OURS if trial.block == 1 else Version.BASELINE)
        for trial in made.searches(np.random.default_rng(5), 8)
    ]
    lead = task_findings(made.data_of("search", searched), AnalysisOptions()).lead
    assert lead.startswith("Caution: in the searches the track was shown first in all ")
    assert lead.count("order and version cannot be told apart") == 1
    assert "Where the track" not in lead


def wrong_ratings() -> list[Any]:
    """Ours always second, one rating twice, and four people who always give a 3."""
    trials = [
        dataclasses.replace(
            trial,
            place_in_pair=1 + (trial.version is Version.OURS),
            rating=3 if trial.participant_id in ("00", "01", "02", "03") else 1 + trial.rating % 5,
        )
        for trial in made.ratings(np.random.default_rng(1))
    ]
    return [*trials, dataclasses.replace(trials[0], trial_index=50)]


def wrong_comparisons() -> list[Any]:
    """Ours always second, one comparison twice, and ours chosen in the first half of each session only."""
    trials = [
        made.comparison(k, made.NAMES[(k + s) % 4], 2, s < 2, (1, s)) for k in range(17) for s in range(4)
    ]
    return [*trials, dataclasses.replace(trials[0], trial_index=50)]


def wrong_searches() -> list[Any]:
    """Ours always first, one search twice, and a person who finds nothing."""
    trials = [
        dataclasses.replace(trial, version=Version.OURS if trial.block == 1 else Version.BASELINE)
        for trial in made.searches(np.random.default_rng(5), 8)
    ]
    lost = {"found": False, "reported_orientation": None, "response_time": None}
    trials = [
        dataclasses.replace(t, **lost, search_time=t.time_limit) if t.participant_id == "00" else t
        for t in trials
    ]
    return [*trials, dataclasses.replace(trials[-1], trial_index=500)]


@pytest.mark.parametrize("wrong", [wrong_ratings, wrong_comparisons, wrong_searches])
def test_a_lead_is_short_whatever_is_wrong_and_the_warnings_say_all(wrong: Callable[[], list[Any]]) -> None:
    task = wrong.__name__.removeprefix("wrong_").removesuffix("s").replace("searche", "search")
    found = task_findings(made.data_of(task, wrong()), AnalysisOptions())
    assert len(found.concerns) >= 3
    assert found.concerns[0].kind is ConcernKind.VERSION_ORDER
    assert len(found.lead.split()) <= 60
    assert found.lead.count("Caution") == found.lead.count("order and version cannot be told apart") == 1
    assert found.warnings[: len(found.concerns)] == tuple(own.words for own in found.concerns)


def test_what_is_wrong_is_named_by_its_kind_where_there_is_no_room_for_its_figures() -> None:
    long = [Concern(kind, " ".join([f"words of {kind.name}"] * 5)) for kind in list(ConcernKind)[1:6]]
    lead = cautious(long, "Ours is better " * 10)
    assert lead.startswith(
        f"Caution: {long[0].words}; more trials than the design has; and 3 more warnings. Ours"
    )
    assert len(lead.split()) <= 60


@dataclasses.dataclass(frozen=True)
class Preference:
    """A trial of a registered task with columns of the comparison, and none of its properties."""

    participant_id: str
    session_id: str
    trial_index: int
    sequence: str
    repetition: int
    ours_interval: int
    response: Any
    simulated: bool = False


def test_a_registered_task_is_checked_by_its_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = tuple(
        Preference(t.participant_id, "01", t.trial_index, t.sequence, 1, 1, t.response)
        for t in made.comparisons(np.random.default_rng(2))
    )
    seen = []

    def findings(data: Any, options: AnalysisOptions) -> Analysis:
        seen.extend(data.trials)
        return Analysis("preference", "Something came out.", (), (), ())

    monkeypatch.setitem(ANALYSES, "preference", TaskAnalysis("Preference", findings))
    twice = dataclasses.replace(rows[0], trial_index=9)
    data = dataclasses.replace(made.data_of("comparison", []), task="preference", rows=(*rows, twice))
    found = task_findings(data, AnalysisOptions())
    assert [concern.kind for concern in found.concerns] == [
        ConcernKind.VERSION_ORDER,
        ConcernKind.REPEATED_ROWS,
    ]
    assert found.lead.startswith("Caution: in the preferences the track was shown first in all 68 pairs")
    assert tuple(seen) == rows
