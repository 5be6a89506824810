"""Claims about the report: a page that needs nothing else, says what is simulated, and escapes all text."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from made_summary import made_summary

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.fit_report import write_pictures
from evenlight.analysis.calibration.ramp_findings import ramp_findings
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.figure_style import new_figure, png_bytes
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.report import (
    SIMULATED_NOTE,
    Picture,
    Report,
    Section,
    Table,
    report_html,
    write_report,
)
from evenlight.analysis.report_prose import section
from evenlight.analysis.report_sections import (
    files_section,
    provenance_section,
)
from evenlight.analysis.results import Analysis
from evenlight.analysis.tracks.closed_loop import (
    contrast_map_section,
    origins_of,
    track_section,
)
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.experiments.viewing.simulate_viewing import ViewingSimulation, simulate_viewing
from evenlight.method.preset_files import load_display, load_rate_limit

HASH = "ab" * 32
VOID = {"meta", "img", "br", "link", "wbr"}
PNG = png_bytes(new_figure(height=0.1))


class Page(HTMLParser):
    """What a page holds: its elements, its text, and everything that it points to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""
        self.targets: list[str] = []
        self.ids: set[str] = set()
        self.open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "wbr":  # within a word
            self.text = self.text.removesuffix(" ")
        for name, value in attrs:
            if name in {"src", "href", "srcset", "data", "poster", "action"}:
                self.targets.append(value or "")
            if name == "id":
                self.ids.add(value or "")
            assert not name.startswith("on"), f"<{tag} {name}> would run a script"
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        if self.open[-1:] != ["style"]:
            self.text += f"{data} "


def summary(**changed: object) -> OptimizationSummary:
    """A summary in which every number is another one."""
    given = {
        "video": "clip.mp4", "display": "varjo-xr3", "rate_limit": "calibration", "power_model": "surace2025",
        "frames": 241, "duration": 9.64, "budget": 0.51, "achieved": 0.512, "objective": 0.0123,
        "objective_baseline": 0.0456, "lower_bound": 0.0019, "max_rate_ratio": 0.997,
        "mean_contrast_loss": 0.0781, "mean_contrast_loss_baseline": 0.0812, "mean_factor": 0.513,
        "baseline_factor": 0.514, "mean_power": 0.991, "baseline_power": 0.982, "full_power": 1.69,
        "simulated": True, "iterations": 48, "solve_s": 0.132, "curves_s": 5.76,
    }  # fmt: skip
    return made_summary(**{**given, **changed})


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    folder = tmp_path_factory.mktemp("report") / "dataset"
    design = RampDesign(factors=(0.4, 1.0), repetitions=3)
    simulate_viewing(ViewingSimulation(2, 5, "ramp", load_display("varjo-xr3"), design), folder)
    return calibrate(load_ramp_data(folder), RateLimitOptions(degree=1))


@pytest.fixture(scope="module")
def found(calibration: Calibration) -> Analysis:
    return ramp_findings(calibration, load_rate_limit("surace2025"))


@pytest.fixture(scope="module")
def whole(found: Analysis) -> Report:
    origin = Provenance(
        software_version="0.1.0", seed=5, inputs={"video": "ab" * 32}, versions={"numpy": "2"}
    )
    return Report(
        "A report",
        "What came out.",
        (
            section("demo_introduction"),
            *found.sections,
            track_section(summary(), PNG),
            contrast_map_section(PNG),
            provenance_section({"track": origin}),
            files_section({"track.csv": "the track"}),
        ),
    )


def test_the_page_is_well_formed_and_points_to_nothing_outside(whole: Report) -> None:
    html = report_html(whole)
    page = Page(html)
    assert not page.open
    assert page.targets
    for target in page.targets:
        assert target.startswith("data:image/png;base64,") or target[1:] in page.ids, target[:60]
    assert {"script", "link", "iframe", "object", "base"}.isdisjoint(page.tags)
    style = html.split("<style>")[1].split("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style
    assert re.search("https?://", html) is None


def test_every_picture_is_inside_as_it_was_given(whole: Report) -> None:
    pictures = [t.split(",")[1] for t in Page(report_html(whole)).targets if t.startswith("data:")]
    given = [picture.png for section in whole.sections for picture in section.pictures]
    assert len(given) == 4
    assert [base64.b64decode(picture) for picture in pictures] == given


def test_all_text_is_escaped() -> None:
    evil = '<script>alert("&")</script>'
    section = Section(
        evil, (evil,), (Table(evil, (evil,), ((evil,),)),), (Picture(PNG, evil),), (evil,), simulated=True
    )
    html = report_html(Report(evil, evil, (section, section)))
    assert "<script" not in html
    page = Page(html)
    assert not page.open
    # title and heading, lead; of each section: contents, heading, paragraph, note, table (3), caption
    assert page.text.count(evil) == 3 + 2 * 8


def test_only_a_report_with_simulated_participants_is_called_so(
    calibration: Calibration, whole: Report
) -> None:
    page = Page(report_html(whole))
    assert SIMULATED_NOTE in page.text
    assert "2 simulated participants" in page.text
    recorded = Report(
        "A report", "x", (section("demo_introduction"), track_section(summary(simulated=False), PNG))
    )
    assert "simulated" not in Page(report_html(recorded)).text.lower()


def test_the_key_figures_of_a_track_are_in_its_section() -> None:
    page = Page(report_html(Report("t", "l", (track_section(summary(), PNG),))))
    shown = ["0.51", "0.512", "1.23", "4.56", "0.19", "99.7", "7.81", "8.12", "0.513", "0.514",
             "0.991", "0.982", "1.69", "241", "9.64", "0.132", "5.76"]  # fmt: skip
    for figure in shown:
        assert re.search(rf"(?<![\d.]){re.escape(figure)}(?!\d)", page.text), figure
    for words in ("clip.mp4", "varjo-xr3", "surace2025", "calibration", "splitting, 48 iterations"):
        assert words in page.text


def test_the_caption_of_the_rate_limit_names_the_published_curve(found: Analysis) -> None:
    (picture,) = found.sections[0].pictures
    assert "dash-dotted: the published rate limit surace2025" in picture.caption
    assert picture.caption.endswith("population's yes/no thresholds were drawn around the published limit.")


def test_frames_with_nothing_to_lose_are_remarked_upon() -> None:
    assert track_section(summary(), PNG).notes == ()
    (note,) = track_section(summary(frames_without_contrast=7), PNG).notes
    assert note.startswith("7 of 241 frames")


def test_every_level_and_participant_of_a_calibration_has_a_row(found: Analysis) -> None:
    levels, people = found.sections[1].tables
    in_order_of_luminance = ["gray, b = 0.4", "gray, b = 1", "white, b = 0.4", "white, b = 1"]
    assert [row[0] for row in levels.rows] == in_order_of_luminance
    assert [row[0] for row in people.rows] == ["01", "02"]


def test_ramps_and_catch_trials_are_counted_apart(calibration: Calibration, found: Analysis) -> None:
    (text,) = found.sections[1].paragraphs
    ramps = sum(fit.threshold.n_trials for fit in calibration.thresholds)  # without catch trials
    catches = len(calibration.data.trials) - ramps
    assert catches > 0
    assert f"saw {ramps} ramps of luminance and {catches} catch trials" in text


def test_the_table_of_the_limit_spans_the_measured_range(calibration: Calibration, found: Analysis) -> None:
    table = found.sections[0].tables[0]
    luminance = [row[0] for row in table.rows]
    assert (luminance[0], luminance[-1]) == pytest.approx(calibration.rate_limit.limit.luminance_range)


def test_what_the_fit_remarks_upon_is_in_the_section(calibration: Calibration, found: Analysis) -> None:
    """Two people, whose differences are hardly known: that comes first."""
    notes = found.sections[0].notes
    assert notes[0].startswith("The rate limit is not for use: at ")
    assert "comes from other studies" in notes[1]
    assert notes[2:] == calibration.rate_limit.notes


def test_the_figures_of_a_calibration_are_written(found: Analysis, tmp_path: Path) -> None:
    write_pictures(found, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["psychometric.png", "rate_limit.png"]


def test_hashes_versions_and_seeds_are_in_the_provenance(whole: Report) -> None:
    text = Page(report_html(whole)).text
    for part in (HASH, "numpy 2", "0.1.0"):
        assert part in text


def test_the_origin_of_a_report_names_the_seed_and_the_data_set(calibration: Calibration) -> None:
    fit = Provenance(inputs={"dataset": calibration.data.sha256})
    origins = origins_of(calibration, fit, summary())
    assert origins["data set"].seed == 5  # what the data set was simulated with
    section = provenance_section(origins)
    assert [row[0] for row in section.tables[0].rows] == ["data set", "rate limit", "track"]
    assert ("rate limit", "dataset", calibration.data.sha256) in section.tables[1].rows


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="needs 2 cells, got 1"):
        Table("t", ("a", "b"), (("x",),))


@pytest.mark.parametrize(
    ("cells", "right"),
    [((1.5, None), True), (("2 of 10", "12 of 12"), True), (("01", "02"), False), (("0.1.0",), False),
     ((None, None), False), (("5 %", "12 %"), True), (("1.2 to 3.4",), True)],
)  # fmt: skip
def test_columns_of_numbers_are_aligned_to_the_right_and_names_are_not(
    cells: tuple[str | float | None, ...], right: bool
) -> None:
    table = Table("t", ("a",), tuple((cell,) for cell in cells))
    assert ('<td class="number">' in report_html(Report("t", "l", (Section("s", (), (table,)),)))) == right


def test_the_same_report_is_the_same_file(whole: Report, tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", whole)
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report_html(whole)
