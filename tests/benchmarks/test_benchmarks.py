"""The frame of the benchmarks: times in turn, memory, growth, claims, the page and its figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fit_subject
from benchmarks.chart import SCREEN, chart_figure
from benchmarks.fit_subject import TO_TRUTH, TWO_INTERVAL, YES_NO, simulated
from benchmarks.measured import (
    Approach,
    Chart,
    RunSettings,
    SubjectResults,
    claim,
    growth,
    not_measured,
    point,
)
from benchmarks.page import page
from benchmarks.peak_memory import peak_memory
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, BenchmarkSummary, Role
from benchmarks.results import measure_all
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.analysis.figure_style import look
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record

COMPANIONS = Path(__file__).parents[1] / "companions"


def a_point(name: str, role: Role, time: float, error: float | None, size: int = 10) -> BenchmarkPoint:
    times = Times(np.array([time]), np.array([time]), np.ones(1))
    return point(Approach("one frame", name, role, size, "frames"), times, error, "difference of loss")


POINTS = (
    a_point("by definition", Role.REFERENCE, 0.9, 0.0),
    a_point("one pass | all knots", Role.DEFAULT, 0.05, 2e-5),
    a_point("half the pixels", Role.VARIANT, 0.01, 4e-3),
)


def test_approaches_are_timed_in_turn_after_a_turn_that_does_not_count() -> None:
    order: list[str] = []
    times = timed_in_turn({name: lambda name=name: order.append(name) for name in "ab"}, repeats=3)
    assert order == ["a", "b"] * 4
    assert times["b"].wall.shape == (3,)
    np.testing.assert_array_equal(times["a"].ratio, 1.0)
    np.testing.assert_allclose(times["b"].ratio, times["b"].wall / times["a"].wall)


def test_a_point_takes_medians_so_that_one_slow_run_does_not_count() -> None:
    times = Times(np.array([1.0, 1.0, 1.0, 50.0, 1.0]), np.full(5, 0.5), np.array([2.0, 2.0, 2.0, 99.0, 2.0]))
    made = point(Approach("t", "ours", Role.DEFAULT, 1, "frames"), times)
    assert (made.time, made.time_high, made.ratio, made.repeats) == (1.0, 1.0, 2.0, 5)


def test_memory_is_that_of_the_task_and_not_of_what_was_imported_or_of_the_one_who_asks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(COMPANIONS))
    mine = bytearray(b"1") * (200 << 20)  # this process is large while it asks
    assert len(mine) > 0
    used = peak_memory("much_memory:hold", "64")
    assert used is not None
    assert 60 < used < 90  # 64 MiB, and a little


def test_growth_finds_the_exponent_that_times_were_made_with_and_its_interval_holds_it() -> None:
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(200):  # a 95 % confidence interval misses more than 22 of 200 with a probability of 1e-4
        sizes = [100, 300, 1000, 3000, 10000]
        rows = tuple(
            a_point("ours", Role.DEFAULT, 1e-5 * n**1.1 * float(np.exp(0.1 * rng.normal())), None, n)
            for n in sizes
        )
        fitted = growth(rows)
        assert fitted.exponent_low is not None
        assert fitted.exponent_high is not None
        held += fitted.exponent_low <= 1.1 <= fitted.exponent_high
    assert held >= 178


@pytest.mark.parametrize("sizes", [(10, 20), (10, 20, 40)])
def test_fewer_than_four_sizes_give_an_exponent_without_an_interval(sizes: tuple[int, ...]) -> None:
    rows = tuple(a_point("ours", Role.DEFAULT, (n / 10) ** 3, None, n) for n in sizes)
    fitted = growth(rows)
    assert fitted.exponent == pytest.approx(3.0)
    assert fitted.exponent_low is None


def test_growth_over_tasks_that_name_their_sizes_has_a_name_without_one() -> None:
    rows = (a_point("ours", Role.DEFAULT, 1.0, None, 10), a_point("ours", Role.DEFAULT, 8.0, None, 20))
    assert growth(rows).task == "one frame"
    assert growth(rows, "frames, by size").task == "frames, by size"


def test_a_claim_says_itself_whether_it_is_met_and_cannot_say_otherwise() -> None:
    assert claim("fast", 0.1, 0.1, "s").met is True
    assert claim("fast", 0.1, 0.11, "s").met is False
    with pytest.raises(ValueError, match=r"0\.2 against 0\.1, but met is True"):
        BenchmarkClaim("fast", 0.1, 0.2, "s", True)
    with pytest.raises(ValueError, match="needs a note"):
        BenchmarkClaim("fast", 0.1, None, "s", None)


def test_the_page_says_what_is_missed_and_what_was_not_measured() -> None:
    claims = (
        claim("a frame", 0.1, 0.2, "s", "too many bands"),
        not_measured("on a GPU", 2, "ms", "no GPU here"),
    )
    subject = SubjectResults(
        "curves", "Loss curves", "Slow.", POINTS, (Chart("x", "A frame", ("one frame",)),), claims
    )
    text = page({"processor": "abacus"}, [subject], quick=False, pictures="pictures/")
    assert "processor: abacus" in text
    assert "| a frame | 0.1 s | 0.2 s | **missed** | too many bands |" in text
    assert "| on a GPU | 2 ms | – | not measured | no GPU here |" in text
    assert "one pass \\| all knots" in text  # a bar would end the cell
    assert "![A frame](pictures/bench-x.png)" in text
    assert "quick run" not in text


def test_a_figure_lists_every_approach_with_time_and_error_and_sets_apart_what_does_not_err() -> None:
    with look(SCREEN):
        figure = chart_figure(Chart("x", "A frame", ("one frame",)), POINTS)
    words = [text.get_text() for text in figure.texts]
    assert any("by definition: 900 ms, no error" in w for w in words)
    assert any("one pass | all knots: 50 ms, error 2e-05" in w for w in words)
    drawn = [line.get_xydata()[0] for line in figure.axes[0].lines if len(line.get_xydata()) == 1]
    np.testing.assert_allclose(drawn, [(2e-6, 0.9), (2e-5, 0.05), (4e-3, 0.01)])  # none: a tenth of the least


def test_all_words_of_a_figure_lie_within_it_however_long_its_heading_is() -> None:
    meaning = "largest difference of contrast loss from what a very long explanation names at great length"
    rows = [replace(p, error_of=f"{meaning}, {k}") for k, p in enumerate(POINTS)]
    with look(SCREEN):
        figure = chart_figure(Chart("x", "A frame of a rendered sequence " * 4, ("one frame",)), rows)
        figure.canvas.draw()
        lowest = min(text.get_window_extent().y0 for text in figure.texts)
    assert lowest > 0


def test_a_figure_says_what_each_kind_of_error_is_and_calls_a_reference_no_definition() -> None:
    rows = [*POINTS[1:], replace(POINTS[0], error_of="distance from the finest grid")]
    with look(SCREEN):
        figure = chart_figure(Chart("x", "A frame", ("one frame",)), rows)
        marks = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    words = " ".join(text.get_text() for text in figure.texts).replace("\n", " ")
    assert "error: difference of loss; distance from the finest grid" in words
    assert "reference" in marks
    assert not any("definition" in mark for mark in marks)


def test_points_on_one_another_share_a_label_and_the_others_have_their_own() -> None:
    rows = [
        a_point("one", Role.DEFAULT, 0.1, 1e-3),
        a_point("two", Role.VARIANT, 0.1001, 1.001e-3),
        a_point("far", Role.VARIANT, 5.0, 1e-1),
    ]
    with look(SCREEN):
        figure = chart_figure(Chart("x", "A frame", ("one frame",)), rows)
    assert [text.get_text() for text in figure.axes[0].texts] == ["1, 2", "3"]


@pytest.mark.parametrize("spread", [1.2, 3.0, 20.0, 400.0, 1e6])
def test_an_axis_of_time_has_two_labels_at_least_however_near_the_times_lie(spread: float) -> None:
    rows = [a_point("fast", Role.DEFAULT, 0.033, 1e-3), a_point("slow", Role.VARIANT, 0.033 * spread, 2e-3)]
    with look(SCREEN):
        figure = chart_figure(Chart("x", "A frame", ("one frame",)), rows)
        figure.canvas.draw()
    axes = figure.axes[0]
    low, high = axes.get_ylim()
    labels = {
        tick.label1.get_text()
        for tick in axes.yaxis.get_major_ticks()
        if low <= tick.get_loc() <= high and tick.label1.get_text()
    }
    assert len(labels) >= 2


def test_a_figure_over_size_has_a_line_for_each_approach() -> None:
    rows = [
        a_point(n, r, k * 1e-3, None, k)
        for n, r in (("ours", Role.DEFAULT), ("slsqp", Role.PEER))
        for k in (1, 9)
    ]
    with look(SCREEN):
        figure = chart_figure(Chart("y", "Growth", ("one frame",), over_size=True), rows)
    labels = {text.get_text() for text in figure.axes[0].texts}
    assert labels == {"ours", "slsqp"}


def test_simulated_answers_follow_the_threshold_they_are_said_to_have() -> None:
    people = simulated(np.random.default_rng(5), 60, rates=np.array([1e-3, 1e3]))
    lapses = np.array([1 - c.n_yes[1] / c.n_trials[1] for c, _ in people])
    guesses = np.array([c.n_yes[0] / c.n_trials[0] for c, _ in people])
    assert lapses.mean() == pytest.approx(
        0.025, abs=4 * np.sqrt(0.025 / (60 * 80)) + 4 * 0.0144 / np.sqrt(60)
    )
    assert guesses.mean() == pytest.approx(
        0.075, abs=4 * np.sqrt(0.075 / (60 * 80)) + 4 * 0.0433 / np.sqrt(60)
    )


@pytest.fixture(scope="module")
def fit_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit_subject, "REFERENCE_NODES", (80, 52, 25, 17))  # a fifth of the work
        patch.setattr(fit_subject, "peak_memory", lambda task: 5.0)  # two processes, tested above
        (measured,) = measure_all({"fit": fit_subject.measure}, RunSettings(quick=True), folder)
    assert measured.notes[0].startswith("All answers are of simulated participants")
    return folder


def test_a_run_writes_tables_that_can_be_read_back(fit_folder: Path) -> None:
    points = read_rows(BenchmarkPoint, fit_folder / "fit_benchmark.csv")
    assert {p.task for p in points} >= {YES_NO, TWO_INTERVAL, TO_TRUTH}
    claims = read_rows(BenchmarkClaim, fit_folder / "fit_claims.csv")
    assert [c.met for c in claims][1:] == [True, True]  # accuracy; time is for a quiet machine
    summary = read_json_record(BenchmarkSummary, fit_folder / "benchmark.json")
    assert summary.quick
    assert summary.provenance.seed == 1
    for name in ("bench-fit.png", "bench-fit-truth.png", "benchmarks.md"):
        assert (fit_folder / name).exists()


def test_more_nodes_are_slower_and_nearer_fewer_are_faster_and_further(fit_folder: Path) -> None:
    points = {
        p.approach: p for p in read_rows(BenchmarkPoint, fit_folder / "fit_benchmark.csv") if p.task == YES_NO
    }
    half, ours, double = (
        next(p for name, p in points.items() if name.startswith(words))
        for words in ("half the nodes", "posterior on two grids", "twice the nodes")
    )
    assert half.error is not None
    assert ours.error is not None
    assert double.error is not None
    assert half.error > ours.error > double.error
    assert half.time < double.time
