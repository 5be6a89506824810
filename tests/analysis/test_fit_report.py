"""Claims about the report of a calibration: it holds what an experimenter has to judge the limit by."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.calibration_sections import curve_table
from evenlight.analysis.calibration.fit_report import write_calibration, write_fit
from evenlight.analysis.calibration.psychometric.serial_dependence import SerialDependence
from evenlight.analysis.calibration.ramp_findings import first_lines, ramp_findings
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, bounds
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.report import SIMULATED_NOTE, Section
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.recordings.ramp import Direction, Procedure, RampDesign
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.viewing.simulate_viewing import ViewingSimulation, simulate_viewing
from evenlight.method.preset_files import load_display
from evenlight.method.rate_limit import rate_limit_at

LINE = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1)
LIMIT, THRESHOLDS, EVERY = 0, 1, 2  # the sections


def section(calibration: Calibration, which: int) -> Section:
    return ramp_findings(calibration).sections[which]


def made(folder: Path, design: RampDesign, participants: int = 3) -> Calibration:
    asked = ViewingSimulation(participants, 5, "ramp", load_display("varjo-xr3"), design)
    simulate_viewing(asked, folder / "dataset")
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


def test_a_last_answer_that_is_avoided_is_not_given_again_in_a_negative_share(yes_no: Calibration) -> None:
    for share, told in ((-0.02, "0.0 %"), (0.02, "2.0 %")):
        serial = SerialDependence(share, 0.3, 0.0, 0.9, 100)
        methods = section(dataclasses.replace(yes_no, serial=serial), 1).methods
        assert any(f"The last answer is given again in {told}" in one for one in methods)


@pytest.fixture(scope="module")
def page(yes_no: Calibration, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("page")
    write_fit(yes_no, folder, Provenance(inputs={"dataset": "ab" * 32}))
    return (folder / "report.html").read_text()


def test_the_page_says_that_it_is_simulated_and_where_it_comes_from(page: str) -> None:
    assert SIMULATED_NOTE in page
    assert "ab" * 32 in page.replace("<wbr>", "")
    assert page.count("data:image/png;base64,") == 2  # answers and rate limit, inside


def test_every_threshold_has_a_row_with_its_interval_and_goodness_of_fit(yes_no: Calibration) -> None:
    (table,) = section(yes_no, EVERY).tables
    assert len(table.rows) == len(yes_no.thresholds) == 12
    first = dict(zip(table.columns, table.rows[0], strict=True))
    threshold = yes_no.thresholds[0].threshold
    assert first["threshold [cd/m²/s]"] == threshold.threshold
    assert first["95 % credible interval"] == f"{threshold.ci_low:.3g} to {threshold.ci_high:.3g}"
    assert first["p"] == f"{threshold.deviance_p:.2f}"


def test_false_alarms_criterion_and_d_prime_of_each_participant_are_shown(yes_no: Calibration) -> None:
    people = section(yes_no, THRESHOLDS).tables[1]
    for row in people.rows:
        shown = dict(zip(people.columns, row, strict=True))
        own = yes_no.criteria[str(shown["participant"])]
        assert shown["false alarms"] == f"{100 * own.false_alarm_rate:.0f} %"
        assert shown["criterion"] == f"{own.criterion:.2f}"
        assert shown["d′ at threshold"] == f"{own.d_prime_at_threshold:.2f}"


def test_lapses_are_shown_before_and_after_the_answers(yes_no: Calibration, both_ways: Calibration) -> None:
    """Mean and SD of Beta(1, 30), and of Beta(1, 60) in two intervals, where lapses show half as often."""
    for calibration, prior in ((yes_no, "3.2 ± 3.1 %"), (both_ways, "1.6 ± 1.6 %")):
        people = section(calibration, THRESHOLDS).tables[1]
        assert f"before the first answer {prior} are assumed" in people.caption.replace("\n", " ")
        joint = calibration.models.joint
        assert joint is not None
        for person, row in zip(joint.participants, people.rows, strict=True):
            shown = dict(zip(people.columns, row, strict=True))["lapses"]
            assert shown == f"{100 * person.lapse_rate:.1f} ± {100 * person.lapse_sd:.1f} %"
            assert 0 < person.lapse_sd < person.lapse_rate + person.lapse_sd < 0.2


def test_the_three_estimates_of_each_level_stand_side_by_side(yes_no: Calibration) -> None:
    shown = section(yes_no, THRESHOLDS)
    rows = [dict(zip(shown.tables[0].columns, row, strict=True)) for row in shown.tables[0].rows]
    luminance = [row["luminance [cd/m²]"] for row in rows]
    assert luminance == sorted(level.level.luminance for level in yes_no.levels)
    lowest = min(yes_no.levels, key=lambda level: level.level.luminance)
    assert lowest.random is not None
    assert rows[0]["population"] == lowest.random.threshold
    assert (rows[0]["pooled"], rows[0]["mean of fits"]) == (lowest.pooled, lowest.mean_of_fits)
    assert any("pooled fit lies" in paragraph for paragraph in shown.paragraphs)


def test_two_intervals_are_described_as_such(both_ways: Calibration) -> None:
    shown = section(both_ways, THRESHOLDS)
    assert "in which of two intervals" in shown.paragraphs[0]
    assert "catch" not in shown.paragraphs[0]
    assert "correct answers" in shown.pictures[0].caption
    assert "bias" in shown.tables[1].columns
    assert "false alarms" not in shown.tables[1].columns


def test_a_limit_says_which_task_and_which_ramps_it_is_for(
    yes_no: Calibration, both_ways: Calibration, tmp_path: Path
) -> None:
    write_calibration(yes_no, tmp_path, Provenance())
    limit = read_json_record(RateLimit, tmp_path / "rate_limit.json")
    assert (limit.procedure, limit.direction, limit.ramp_duration) == (Procedure.YES_NO, Direction.DOWN, 5.0)
    assert limit.source == "ramp calibration with 3 simulated participants: yes/no, falling ramps of 5 s"
    reference = both_ways.rate_limit.reference
    assert reference is not None
    write_calibration(both_ways, tmp_path, Provenance())
    limit = read_json_record(RateLimit, tmp_path / "rate_limit.json")
    assert (limit.procedure, limit.direction) == (Procedure.TWO_INTERVAL, reference.direction)
    assert limit.source.endswith(f": two intervals, {reference.words}")


def test_a_limit_of_two_intervals_is_told_right_and_not_noticed(
    yes_no: Calibration, both_ways: Calibration
) -> None:
    seen, right = "noticed", "identified correctly"
    for calibration, word, other in ((yes_no, seen, right), (both_ways, right, seen)):
        caption = section(calibration, LIMIT).pictures[0].caption
        assert f"is {word} in 75 % of the trials" in caption
        assert other not in caption
        assert "but for lapses." in " ".join(section(calibration, THRESHOLDS).paragraphs)


def test_what_pooling_does_is_told_as_it_was_found(yes_no: Calibration, both_ways: Calibration) -> None:
    """75 % is half way up from 50 %, the point of a symmetric function that flattening leaves alone."""

    def methods(calibration: Calibration, pooled: float | None = None) -> str:
        levels = calibration.levels
        if pooled is not None:
            levels = tuple(dataclasses.replace(level, pooled=pooled) for level in levels)
        return " ".join(section(dataclasses.replace(calibration, levels=levels), THRESHOLDS).methods)

    assert "hardly moves for it" in methods(both_ways)
    assert "here it lies below" in methods(yes_no, 1e-3)
    assert "here it lies below" not in methods(yes_no, 1e3)
    assert "which moves its 75 % point above" in methods(yes_no, 1e3)


def test_other_ramps_are_compared_with_those_that_the_limit_is_for(both_ways: Calibration) -> None:
    shown = section(both_ways, LIMIT)
    (effect,) = both_ways.rate_limit.effects
    told = (*shown.paragraphs, *shown.notes)
    assert not any("the threshold rate of" in words for words in told)  # once, in the table
    (row,) = shown.tables[-1].rows
    assert row[:2] == (effect.condition.words, f"{effect.ratio:.2f}")
    levels = section(both_ways, THRESHOLDS).tables[0]
    assert {str(row[0]).split(", ")[2] for row in levels.rows} == {"down", "up"}


def test_one_kind_of_ramp_has_no_table_of_effects(yes_no: Calibration) -> None:
    captions = [table.caption for table in section(yes_no, LIMIT).tables]
    assert len(captions) == 2  # the limit, and the curves that were compared
    assert not any("Thresholds of other ramps" in caption for caption in captions)


def test_the_first_lines_say_what_came_out_how_sure_and_what_is_wrong(yes_no: Calibration) -> None:
    lead, figures = first_lines(yes_no)
    assert len(lead.split()) <= 60
    assert 3 <= len(figures) <= 4
    low, high = (float(yes_no.rate_limit.limit(L)) for L in yes_no.rate_limit.limit.luminance_range)
    assert f"changes of {low:.3g} cd/m²/s at" in lead
    assert f"and of {high:.3g} cd/m²/s at" in lead
    fit = dataclasses.replace(yes_no.rate_limit, falling=((164.0, 300.0),))
    models = dataclasses.replace(yes_no.models, fits={yes_no.models.chosen: fit})
    lead, figures = first_lines(dataclasses.replace(yes_no, models=models))
    assert lead.endswith("Implausible: falls from 164 to 300 cd/m²; try `evenlight fit --monotone`.")
    assert figures[-1].warns
    assert (
        figures[-1].in_words
        == "the limit falls from 164 to 300 cd/m²: Implausible (try `evenlight fit --monotone`)"
    )


def test_a_band_too_wide_for_use_is_what_is_wrong_first(yes_no: Calibration) -> None:
    fit = yes_no.rate_limit
    lower = tuple(edge / 10 for edge in fit.limit.band_lower)
    wide = dataclasses.replace(fit, limit=dataclasses.replace(fit.limit, band_lower=lower), falling=())
    models = dataclasses.replace(yes_no.models, fits={yes_no.models.chosen: wide})
    lead, figures = first_lines(dataclasses.replace(yes_no, models=models))
    assert lead.endswith("It is not known well enough for use.")
    assert (figures[0].warns, figures[-1].value) == (True, "Not for use")


def test_a_bound_that_the_answers_do_not_give_is_none() -> None:
    assert bounds(0.18, 261030938266.88) == "not bounded"
    assert bounds(0.18, 0.22) == "0.18 to 0.22"


def test_the_curves_that_could_serve_stand_in_one_table(yes_no: Calibration) -> None:
    table = curve_table(yes_no.models)
    assert table.rows[0][0] == "joint: power law"
    assert table.rows[0][-1] == "the limit"
    others = {str(row[0]): str(row[-1]) for row in table.rows[1:]}
    assert {"individual: power law", "pooled: power law", "joint: polynomial of degree 2 in log-log"} <= set(
        others
    )
    assert all(re.fullmatch(r"[+−]\d+ % at [\d.]+ cd/m²", words) for words in others.values())
    individual = yes_no.models.fits[RateLimitModel.INDIVIDUAL].limit
    own, limit = (rate_limit_at(curve, [L]) for curve in (individual, yes_no.rate_limit.limit)
                  for L in [float(others["individual: power law"].split()[-2])])  # fmt: skip
    said = float(others["individual: power law"].split()[0].replace("−", "-"))
    assert 100 * (own[0] / limit[0] - 1) == pytest.approx(said, abs=1.0)
