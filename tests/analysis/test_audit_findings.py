"""The audit as a whole: its numbers, words and files."""

import dataclasses
import re
import struct
from pathlib import Path

import pytest

from evenlight.analysis.audit.audit_findings import audit_findings, contradictions, left_open
from evenlight.analysis.audit.conventions import CONVENTIONS, conventions_that_allow
from evenlight.analysis.audit.distribution_section import CELLS
from evenlight.analysis.audit.pairings import MAIN_TEST, PairedTest, Verdict
from evenlight.analysis.audit.table_ratings import holm_ranges, printed_cell, table_ratings
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.findings import Findings, write_findings
from evenlight.analysis.published import SEQUENCES, published
from evenlight.analysis.report import Report, report_html
from evenlight.data_schema.analysis_results import Origin, PlottedPoint, Statistic
from evenlight.data_schema.storage.tables import read_rows

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def findings() -> Findings:
    return audit_findings(dataclasses.replace(PAGE, dots_per_inch=40.0))  # how sharp is not the point


def number(findings: Findings, table: str, group: str, what: str) -> float:
    (found,) = [s for s in findings.statistics if (s.table, s.group, s.what) == (table, group, what)]
    assert found.value is not None
    return found.value


@pytest.mark.slow
def test_every_number_has_its_origin_says_how_and_stands_once(findings: Findings) -> None:
    keys = [(s.table, s.group, s.what) for s in findings.statistics]
    repeated = {key for key in keys if keys.count(key) > 1}
    assert repeated <= {("choices", "all", "number of people for whom 53 % and 47 % are counts")}
    assert all(s.method for s in findings.statistics)
    kinds = {Origin.PUBLISHED, Origin.AUTHORS, Origin.COMPUTED}
    assert {s.origin for s in findings.statistics} == kinds
    assert {p.origin for d in findings.drawings for p in d.points} == kinds


def test_what_needs_the_authors_samples_or_their_peak_says_so(findings: Findings) -> None:
    # The paper prints P(L) and Table 3; it prints neither the eight samples nor 750 cd/m².
    theirs = {(s.table, s.what) for s in findings.statistics if s.origin is Origin.AUTHORS}
    needs = ("750", "samples", "refitted")
    assert theirs == {
        (s.table, s.what) for s in findings.statistics if any(word in s.what for word in needs)
    }  # fmt: skip
    assert len(theirs) == 5
    nominal = {s.origin for s in findings.statistics if s.what == "nominal brightness factor"}
    assert nominal == {Origin.PUBLISHED}  # Table 2


def test_the_audit_does_not_conclude_that_no_ratings_are_missing(findings: Findings) -> None:
    words = " ".join((findings.lead, *findings.sections[0].paragraphs, (DOCS / "audit.md").read_text()))
    assert "no ratings are missing" not in words
    assert "every number follows from printed ones" not in words
    assert "(in the gym 13 and 14), so the table does not say whether ratings are missing" in findings.lead
    fitting = findings.sections[0].tables[0]
    assert fitting.rows[-1][2:] == ("17", "none")
    page = (DOCS / "audit.md").read_text()
    for sequence, version, *numbers in fitting.rows[:-1]:
        cell = re.search(rf"^\| {str(sequence).lower()}, {version} \|.*$", page, re.MULTILINE)
        assert cell is not None
        assert [c.strip() for c in cell[0].strip("|").split("|")][2:] == numbers


@pytest.mark.slow
def test_seventeen_is_the_only_number_of_people_that_fits_every_cell(findings: Findings) -> None:
    fitting = {s.n: s.value for s in findings.statistics if s.table == "numbers_of_people"}
    assert min(fitting) == 2
    assert max(fitting) == 30
    assert [n for n, cells in fitting.items() if cells == 8] == [17]


def test_two_numbers_are_a_digit_off_and_are_told_with_what_they_would_be(findings: Findings) -> None:
    # 55/17 = 3.2353. Sums of squares 243 and 245 of 17 ratings that add up to 63: SEM of the population
    # 0.1816 and 0.1997, of the sample 0.1872 and 0.2059 (cut off: 0.18 and 0.20).
    words = findings.sections[0].paragraphs[3]
    assert "3.23 of the gym, baseline, is 55/17 = 3.2353 and would be 3.24;" in words
    assert "0.19 of the gym, ours, would be 0.18 or 0.20: 1 unit of the last digit away" in words
    assert "in the row of the gym alone" in words


def test_no_convention_holds_for_all_cells_and_the_best_fail_in_the_gym_alone() -> None:
    failing = {
        str(c): [cell for cell in CELLS if c not in conventions_that_allow(printed_cell(*cell))]
        for c in CONVENTIONS
    }
    assert all(failing.values())
    gym = [("gym", "baseline"), ("gym", "ours")]
    assert [name for name, cells in failing.items() if cells == gym] == [
        "means rounded, SEM of the sample SD cut off",
        "means rounded, SEM of the population SD rounded",
    ]


def test_after_holm_no_sequence_differs_whatever_the_pairing_and_the_library_in_none(findings) -> None:
    corrected = [s for s in findings.statistics if s.table == "paired" and s.p_adjusted is not None]
    assert len(corrected) == 4 * 5 * 2  # sequences, tests, ends
    assert all(s.p_adjusted >= s.p_value for s in corrected)
    assert min(s.p_adjusted for s in corrected if s.what.startswith("largest")) > 0.05
    assert min(s.p_adjusted for s in corrected if s.group == "library") > 0.05


def test_the_verdicts_in_the_prose_are_those_of_the_ranges() -> None:
    # The text of the section and of the lead is fixed: it must say of each test what its ranges say.
    ratings = table_ratings()
    raw = {test: [r.ranges[test].verdict for r in ratings] for test in PairedTest}
    corrected = {test: [p.verdict for p in ranges] for test, ranges in holm_ranges(ratings).items()}
    differs, none, depends = Verdict.DIFFERS, Verdict.NOT_SHOWN, Verdict.OPEN
    assert [r.sequence for r in ratings] == ["library", "gym", "living_room", "basement"]
    assert raw[MAIN_TEST] == [none, depends, depends, differs]
    assert corrected[MAIN_TEST] == [none, depends, none, depends]
    for test in (PairedTest.SIGNED_RANK_DROPPED, PairedTest.SIGN):
        assert raw.pop(test) == [none, depends, depends, depends]
    assert all(verdicts == raw[MAIN_TEST] for verdicts in raw.values())
    for test in (PairedTest.T, PairedTest.SIGNED_RANK, PairedTest.SIGN):
        assert corrected.pop(test) == [none, depends, depends, depends]
    assert all(verdicts == corrected[MAIN_TEST] for verdicts in corrected.values())


def test_what_seventeen_answers_show_is_what_the_page_tells(findings: Findings) -> None:
    text = " ".join((DOCS / "audit.md").read_text().split())
    what = "smallest margin within which the share is shown to be one half"
    margins = [number(findings, "choices", group, what) for group in ("library", "all")]
    assert f"within ±{margins[0]:.2f} of one half, and no closer (±{margins[1]:.2f} if all 68 were" in text
    power, fewest = (
        number(findings, "power_of_choices", "17 answers", what)
        for what in ("power for a share of 0.75", "fewest choices of ours that differ from one half")
    )
    assert f"needs {fewest:.0f}, and would find a true share of 0.75 in {100 * power:.0f} % of" in text


def test_the_page_tells_the_ranges_that_are_found(findings: Findings) -> None:
    text = (DOCS / "audit.md").read_text()
    for sequence in ("library", "gym", "living_room", "basement"):
        (line,) = re.findall(rf"^\| {sequence.replace('_', ' ')} \|.*$", text, re.MULTILINE)
        cells = [cell.strip(" *") for cell in line.strip("|").split("|")]
        difference = number(findings, "paired", sequence, "mean difference of ratings")
        assert cells[1] == f"{difference:.2f}"
        for cell, test in zip(cells[2:4], ("sign-flip test of the mean", "t test"), strict=True):
            for told, end in zip(cell.split(" to "), ("smallest", "largest"), strict=True):
                p = number(findings, "paired", sequence, f"{end} p of the {test}")
                if told.startswith("< "):
                    assert p < float(told[2:])
                else:
                    assert float(told) == pytest.approx(
                        p, abs=0.5 * 10 ** -len(told.split(".")[1]) if "." in told else 0.0
                    )
    total = len(contradictions().rows) + len(left_open().rows)
    assert f"lists {total} of them" in text


def test_the_page_and_the_lead_tell_what_the_other_tests_and_holm_make_of_it(findings: Findings) -> None:
    text = " ".join((DOCS / "audit.md").read_text().split())
    rows = {(s.group, s.what): s for s in findings.statistics if s.table == "paired"}
    flips, others = "p of the sign-flip test of the mean", ("sign test", "signed ranks, zeros dropped")
    best = {g: s.p_adjusted for (g, what), s in rows.items() if what == f"smallest {flips}"}
    assert {g for g, p in best.items() if p is not None and p > 0.05} == {"library", "living_room"}
    assert f"the library ({best['library']:.2g}) or the living room ({best['living_room']:.2g})" in text
    worst = [rows["basement", f"largest p of the {test}"].value for test in others]
    assert f"the basement open too (up to {worst[0]:.2g} and {worst[1]:.2g})" in text
    section = findings.sections[1].paragraphs[1]
    for told in (findings.lead, section):
        assert "the library and living room differ in none; the gym and basement depend" in told
    assert (
        "the basement depends on the pairing in the signed ranks with zeros dropped and sign test" in section
    )


def test_the_page_tells_the_powers_that_are_found(findings: Findings) -> None:
    text = " ".join((DOCS / "audit.md").read_text().split())
    full = [number(findings, "power", f"{s}, full", "luminance on P(L)") for s in SEQUENCES]
    assert f"is {min(full):.0f} to {max(full):.0f} cd/m² on P(L)" in text
    more = number(findings, "power", "library", "power of ours less baseline")
    share = number(findings, "power", "library", "power of ours over baseline, less 1")
    assert f"in the library ours took {1000 * more:.0f} mW ({share:.1f} %) more" in text
    low = [
        number(findings, "power", f"{s}, {v}", "nominal brightness factor")
        - number(findings, "power", f"{s}, {v}", "factor on P(L), full brightness as in Table 3")
        for s in SEQUENCES
        for v in ("baseline", "ours")
    ]
    assert f"have factors {min(low):.2f} to {max(low):.2f} below" in text
    # The row of full brightness stands apart: the line through the dimmed rows lies below all of it.
    at_full = number(findings, "power_model", "all", "power at factor 1 on the nominal line")
    assert at_full < min(published(f"power.{s}.full").number for s in SEQUENCES)


def test_the_samples_bend_upwards_as_currents_rise_faster_at_the_top(findings: Findings) -> None:
    # 440 to 750 cd/m²: 0.13 A for 310 cd/m²; 48 to 440: 0.14 A for 392.
    assert 0.13 / 310 > 0.14 / 392
    assert "They bend upwards" in findings.sections[3].paragraphs[0]
    assert "too low" in findings.sections[3].paragraphs[0]


def test_every_page_that_an_open_point_names_is_there() -> None:
    for point in (*contradictions().rows, *left_open().rows):
        assert all(point)
        assert (DOCS / "decisions" / str(point[3])).is_file(), point


def test_the_pages_pictures_are_small() -> None:
    for name in ("distributions", "pairings", "choices", "power"):
        width = struct.unpack(">I", (DOCS / "pictures" / f"audit-{name}.png").read_bytes()[16:20])[0]
        assert 600 < width <= 1000


def test_files_are_written_and_read_back(findings: Findings, tmp_path: Path) -> None:
    write_findings(tmp_path, findings)
    assert tuple(read_rows(Statistic, tmp_path / "audit_statistics.csv")) == findings.statistics
    for drawing in findings.drawings:
        assert tuple(read_rows(PlottedPoint, tmp_path / f"{drawing.name}_points.csv")) == drawing.points
        assert drawing.points


def test_the_report_reads_whole(findings: Findings) -> None:
    page = report_html(Report("title", findings.lead, findings.sections))
    assert page.count("<figure>") == 4
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page).lower().split()
    assert "simulated</span>" not in page
