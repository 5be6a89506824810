"""The frame of the benchmarks, and what they say of curves and files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import (
    apply_subject,
    curves_subject,
    decoding_points,
    fit_subject,
    video_definition,
    video_points,
)
from benchmarks.chart import SCREEN, chart_figure
from benchmarks.compare import read_page, slower_rows
from benchmarks.curves_memory import DISPLAY
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
from benchmarks.scale_subject import ScaleSizes, _of_curves
from benchmarks.stopwatch import Times, timed_in_turn
from evenlight.analysis.figure_style import look
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.method.contrast.loss_curves import analyze_frames

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
        patch.setattr(fit_subject, "REFERENCE_NODES", (60, 40, 20, 14))  # a twelfth of the work
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


def test_more_nodes_are_nearer_and_fewer_further(fit_folder: Path) -> None:
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


# --- curves benchmark


def a_point_of_curves_benchmark(
    task: str, name: str, role: Role, time: float, error: float
) -> BenchmarkPoint:
    times = Times(np.array([time]), np.array([time]), np.array([time]))  # ratios to one second
    return point(Approach(task, name, role, 100, "pixels"), times, error, "of loss")


def test_the_film_has_a_still_shot_with_grain_a_pan_a_fade_and_a_flash() -> None:
    frames = [frame.pixel_values.astype(float) for frame in video_points.film(64, 36, 40, 1)]
    assert len(frames) == 40
    assert 0 < np.abs(frames[1] - frames[0]).mean() < 10  # grain alone
    np.testing.assert_array_equal(np.roll(frames[12], 2, axis=1), frames[13])  # the pan
    assert frames[28].mean() < 0.3 * frames[20].mean()  # the fade
    assert frames[35].mean() > frames[34].mean() + 30  # the flash


def test_one_frame_in_ten_is_right_where_it_is_sampled_and_linear_in_between() -> None:
    frames = list(video_points.film(64, 36, 24, 1))
    whole = analyze_frames(frames, "film", DISPLAY).loss
    found = video_points._one_in_ten(frames, DISPLAY, np.interp)
    for k in (0, 10, 20, 23):
        np.testing.assert_array_equal(found[k], whole[k])
    np.testing.assert_allclose(found[5], (whole[0] + whole[10]) / 2, atol=1e-12)


@pytest.mark.parametrize(("at", "apart", "met"), [(2e-4, 9e-4, (True, True)), (2e-3, 3e-3, (False, False))])
def test_what_a_user_gets_is_held_to_the_worst_of_all_videos(
    at: float, apart: float, met: tuple[bool, bool]
) -> None:
    good = video_definition.DefaultErrors("a", np.full((2, 3), 1e-5), np.full((2, 4), 1e-5))
    between = np.array([[apart, 0.0, 0.0, 0.0]])
    bad = video_definition.DefaultErrors("b", np.array([[0.0, at]]), between)
    verdicts = video_definition.default_claims([good, bad])
    assert tuple(verdict.met for verdict in verdicts) == met
    assert tuple(verdict.measured for verdict in verdicts) == (at, apart)
    assert "2 of a, 1 of b" in verdicts[0].note
    share = "0.0%" if apart < 1e-3 else "8.3%"  # one of twelve
    assert f"median 1e-05, {share} above 0.001: single pixels" in verdicts[1].note
    assert [verdict.met for verdict in video_definition.default_claims([])] == [None, None]


FRAMES = [
    a_point_of_curves_benchmark("one frame of 640 x 360", "one pass", Role.DEFAULT, 0.02, 2e-5),
    a_point_of_curves_benchmark(curves_subject.LARGE, "one pass", Role.DEFAULT, 0.05, 3e-5),
    a_point_of_curves_benchmark(curves_subject.LARGE, "the definition, 9 factors", Role.REFERENCE, 5.0, 0.0),
]


@pytest.mark.parametrize(("time", "met"), [(0.05, True), (0.11, False)])
def test_a_frame_is_held_to_its_processor_time(time: float, met: bool) -> None:
    # The wall time may be long: another program may have had the core.
    large = replace(FRAMES[1], processor_time=time, time=1.0, time_high=1.0)
    of_time, of_error = curves_subject._frame_claims([FRAMES[0], large, FRAMES[2]])
    assert (of_time.measured, of_time.met) == (time, met)
    assert (of_error.measured, of_error.met) == (3e-5, True)


def test_a_file_is_timed_stage_by_stage_beside_ffmpeg_and_its_planes_are_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(decoding_points, "QUICK_SIZES", ((64, 36),))
    points = decoding_points.decoding_points(RunSettings(quick=True), DISPLAY)
    by_name = {p.approach: p for p in points}
    assert all(p.size == 64 * 36 and p.time > 0 for p in points)
    expected = [p.time / by_name[decoding_points.FFMPEG].time for p in points[:-1]]
    assert [p.ratio for p in points] == [*map(pytest.approx, expected), None]  # the last is cited
    assert by_name[decoding_points.OF_PLANES].error == 0
    slow = replace(by_name[decoding_points.ONE_JOB], approach=decoding_points.TWO_JOBS)  # as long as one
    assert [c.met for c in decoding_points.decoding_claims([*points, slow])] == [True, False]


# --- comparison with a stored page


def a_page(machine: str, *points: BenchmarkPoint) -> str:
    return page({"processor": machine}, [SubjectResults("curves", "Curves", "", points, ())], False, "")


def test_what_is_slower_than_a_stored_page_is_told_by_times_of_the_same_machine(tmp_path: Path) -> None:
    slow, within = replace(POINTS[0], time=1.2, time_high=1.2), replace(POINTS[1], time=0.057, time_high=1.0)
    told = slower_rows(a_page("a", slow, within), a_page("a", *POINTS))
    assert told[0] == "compared 2 of 3 times, on the same machine; 1 more than 15 % above the stored"
    assert told[1:] == ["One frame: by definition (reference): 1.33 times"]
    (tmp_path / "page.md").write_text("# No page of times", encoding="utf-8")
    with pytest.raises(InputError, match="holds no times"):
        read_page(tmp_path / "page.md")


def test_on_another_machine_ratios_to_what_is_not_ours_are_compared() -> None:
    decoded, ours = replace(POINTS[0], ratio=1.0), replace(POINTS[2], ratio=2.0)
    later = [replace(p, time=2 * p.time, time_high=2 * p.time) for p in (decoded, replace(ours, ratio=3.0))]
    told = slower_rows(a_page("b", *later), a_page("a", decoded, ours))
    assert told[1:] == ["One frame: half the pixels: 1.50 times"]
    with pytest.raises(InputError, match="no row that can be compared"):
        slower_rows(a_page("b", *POINTS), a_page("a", *POINTS))


# --- apply benchmark


def test_every_codec_has_its_error_and_the_lossless_one_the_smallest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apply_subject, "QUICK_SIZE", (64, 48))
    monkeypatch.setattr(apply_subject, "QUICK_FRAMES", 4)
    measured = apply_subject.measure(RunSettings(quick=True))
    errors = {p.approach: p.error for p in measured.points}
    assert errors.pop(apply_subject.DEFINITION) is None
    assert set(errors) == set(apply_subject.NAMES.values())
    assert min(errors, key=lambda name: errors[name] or 0) == "FFV1, 10 bits, without loss"
    assert [p.role for p in measured.points].count(Role.DEFAULT) == 1
    assert measured.claims[0].measured == errors["FFV1, 10 bits, without loss"]


@pytest.mark.slow
def test_a_catalogue_of_loss_curves_is_made_and_timed_once_more_when_all_is_there(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    (first, again), _ = _of_curves(RunSettings(quick=True), ScaleSizes(1, 1, 1, 3), tmp_path)
    assert (first.size, again.size) == (3, 3)
    assert len(list((tmp_path / "out").rglob("track.csv"))) == 3
