"""Claims about the report of a calibration: it holds what an experimenter has to judge the limit by."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.calibration_sections import (
    calibration_section,
    population_section,
    thresholds_section,
)
from evenlight.analysis.calibration.choices.limit_choices import limit_choices
from evenlight.analysis.calibration.choices.limit_choices_report import choices_section
from evenlight.analysis.calibration.fit_report import (
    FitResults,
    write_calibration,
    write_figures,
    write_fit_report,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit_section import rate_limit_section
from evenlight.analysis.figure_style import PAGE, new_figure, png_bytes
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.report import SIMULATED_NOTE
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampDesign
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.ramp.ramp_observer import ObserverPopulation
from evenlight.experiments.ramp.simulate_ramp import RampSimulation, simulate_dataset
from evenlight.method.preset_files import load_display, load_rate_limit

PNG = png_bytes(new_figure(PAGE, height=0.1))
LINE = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1)


def made(folder: Path, design: RampDesign, participants: int = 3) -> Calibration:
    display, limit = load_display("varjo-xr3"), load_rate_limit("surace2025")
    simulate_dataset(
        RampSimulation(participants, 5, display, design, limit, ObserverPopulation()), folder / "dataset"
    )
    return calibrate(load_ramp_data(folder / "dataset"), LINE)


@pytest.fixture(scope="module")
def yes_no(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    return made(tmp_path_factory.mktemp("yes_no"), RampDesign(factors=(0.4, 1.0), repetitions=3))


@pytest.fixture(scope="module")
def both_ways(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    design = RampDesign(
        procedure=Procedure.TWO_INTERVAL,
        screens=("white",),
        factors=(0.3, 0.6),
        directions=(Direction.DOWN, Direction.UP),
        repetitions=3,
    )
    return made(tmp_path_factory.mktemp("both_ways"), design)


@pytest.fixture(scope="module")
def page(yes_no: Calibration, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("page")
    write_figures(yes_no, folder)
    results = FitResults(yes_no, limit_choices(yes_no, LINE), None, Provenance(inputs={"dataset": "ab" * 32}))
    write_fit_report(folder, results)
    return (folder / "report.html").read_text()


@pytest.mark.slow
def test_the_page_says_that_it_is_simulated_and_where_it_comes_from(page: str) -> None:
    assert SIMULATED_NOTE in page
    assert "ab" * 32 in page.replace("<wbr>", "")
    assert page.count("data:image/png;base64,") == 3  # answers, rate limit, choices: all inside


def test_every_threshold_has_a_row_with_its_interval_and_goodness_of_fit(yes_no: Calibration) -> None:
    (table,) = thresholds_section(yes_no).tables
    assert len(table.rows) == len(yes_no.thresholds) == 12
    first = dict(zip(table.columns, table.rows[0], strict=True))
    threshold = yes_no.thresholds[0].threshold
    assert first["threshold [cd/m²/s]"] == threshold.threshold
    assert first["95 % credible interval"] == f"{threshold.ci_low:.3g} to {threshold.ci_high:.3g}"
    assert first["p"] == f"{threshold.deviance_p:.2f}"


def test_false_alarms_criterion_and_d_prime_of_each_participant_are_shown(yes_no: Calibration) -> None:
    people = calibration_section(yes_no, PNG).tables[1]
    for row in people.rows:
        shown = dict(zip(people.columns, row, strict=True))
        own = yes_no.criteria[str(shown["participant"])]
        assert shown["false alarms"] == f"{100 * own.false_alarm_rate:.0f} %"
        assert shown["criterion"] == f"{own.criterion:.2f}"
        assert shown["d′ at threshold"] == f"{own.d_prime_at_threshold:.2f}"


def test_the_three_estimates_of_each_level_stand_side_by_side(yes_no: Calibration) -> None:
    section = population_section(yes_no.levels, simulated=True)
    (table,) = section.tables
    assert len(table.rows) == 4
    luminance = [row[2] for row in table.rows]
    assert luminance == sorted(luminance)
    lowest = min(yes_no.levels, key=lambda level: level.level.luminance)
    assert lowest.random is not None
    assert table.rows[0][3] == lowest.random.threshold
    assert table.rows[0][6] == lowest.pooled
    assert any("pooled fit lies" in paragraph for paragraph in section.paragraphs)


def test_two_intervals_are_described_as_such(both_ways: Calibration) -> None:
    section = calibration_section(both_ways, PNG)
    assert "in which of two intervals" in section.paragraphs[0]
    assert "catch" not in section.paragraphs[0]
    assert "correct answers" in section.pictures[0].caption
    assert "bias" in section.tables[1].columns
    assert "false alarms" not in section.tables[1].columns


def test_a_limit_says_which_task_and_which_ramps_it_is_for(
    yes_no: Calibration, both_ways: Calibration, tmp_path: Path
) -> None:
    write_calibration(yes_no, tmp_path, Provenance())
    limit = read_json_record(RateLimit, tmp_path / "rate_limit.json")
    assert (limit.procedure, limit.direction, limit.ramp_duration) == (Procedure.YES_NO, Direction.DOWN, 5.0)
    assert limit.source == "ramp calibration with 3 simulated participants: yes/no, falling ramps of 5 s"
    reference = both_ways.rate_limit.reference
    assert reference is not None
    for choice in limit_choices(both_ways, LINE).choices:
        assert choice.limit.procedure is Procedure.TWO_INTERVAL
        assert choice.limit.direction is reference.direction
        assert choice.limit.source.endswith(f": two intervals, {reference.words}")


def test_a_limit_of_two_intervals_is_told_right_and_not_noticed(
    yes_no: Calibration, both_ways: Calibration
) -> None:
    seen, right = "noticed", "identified correctly"
    for calibration, word, other in ((yes_no, seen, right), (both_ways, right, seen)):
        caption = rate_limit_section(calibration, PNG).pictures[0].caption
        assert f"is {word} in 75 % of the trials" in caption
        assert other not in caption


def test_what_pooling_does_is_told_as_it_was_found(yes_no: Calibration, both_ways: Calibration) -> None:
    """75 % is half way up from 50 %, the point of a symmetric function that flattening leaves alone."""
    words = population_section(both_ways.levels, simulated=True).paragraphs[0]
    assert "hardly moves for it" in words
    lowered = tuple(dataclasses.replace(level, pooled=1e-3) for level in yes_no.levels)
    raised = tuple(dataclasses.replace(level, pooled=1e3) for level in yes_no.levels)
    assert "here it lies below" in population_section(lowered, simulated=True).paragraphs[0]
    assert "here it lies below" not in population_section(raised, simulated=True).paragraphs[0]
    assert "which moves its 75 % point above" in population_section(raised, simulated=True).paragraphs[0]


def test_other_ramps_are_compared_with_those_that_the_limit_is_for(both_ways: Calibration) -> None:
    section = rate_limit_section(both_ways, PNG)
    (effect,) = both_ways.rate_limit.effects
    assert " ".join(section.paragraphs).count("Rising ramps of 5 s have ") == 1
    assert not any("the threshold rate of" in note for note in section.notes)  # told once
    (row,) = section.tables[-1].rows
    assert row[:2] == (effect.condition.words, f"{effect.ratio:.2f}")
    levels = calibration_section(both_ways, PNG).tables[0]
    assert {row[0] for row in levels.rows} == {"falling ramps of 5 s", "rising ramps of 5 s"}


def test_one_kind_of_ramp_has_no_table_of_effects(yes_no: Calibration) -> None:
    captions = [table.caption for table in rate_limit_section(yes_no, PNG).tables]
    assert len(captions) == 2  # the limit, and the shapes that were compared
    assert not any("Thresholds of other ramps" in caption for caption in captions)


def test_curves_that_could_not_be_fitted_are_named(yes_no: Calibration) -> None:
    section = choices_section(limit_choices(yes_no, LINE), None, PNG)
    assert any(note.startswith("Not fitted, ln_rate_4: ") for note in section.notes)
    assert section.tables[0].rows[0][0] == "fitted: joint model, power law (line in log-log)"
