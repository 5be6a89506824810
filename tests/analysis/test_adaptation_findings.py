"""The ablation on visual adaptation: what is compared, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from evenlight.analysis.findings import Findings
from evenlight.analysis.reproduction.adaptation_figures import bar_edges, bars
from evenlight.analysis.reproduction.adaptation_findings import adaptation_findings
from evenlight.analysis.reproduction.adaptation_lag import (
    AdaptationInput,
    ConeInput,
    DimmingCondition,
    LuminanceMaps,
    ResponseDifferences,
    adaptation_input,
    bin_edges,
    differences,
    differences_of,
)
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.errors import InputError
from evenlight.method.adaptation import response_differences
from evenlight.method.optimizer.splitting import SplittingSolver
from evenlight.method.preset_files import load_display

pytestmark = pytest.mark.slow


def maps_of(luminance: np.ndarray, seconds: float = 0.1) -> LuminanceMaps:
    maps = LuminanceMaps(load_display("varjo-xr3"))
    maps.emitted = [frame.astype(np.float32) for frame in luminance]
    maps.durations = [seconds] * len(luminance)
    return maps


def still(n: int = 40, **tracks: np.ndarray) -> AdaptationInput:
    """A picture that does not change: what differs is the modulation's."""
    picture = np.exp(np.random.default_rng(1).normal(3.0, 0.8, (4, 6)))
    constant = np.full(n, 0.5)
    slow = constant * 1.003 ** np.arange(n)  # 3 % per second
    jumping = np.where(np.arange(n) % 10 < 5, 0.4, 0.6)
    made = {"constrained": slow, "unconstrained": jumping, "constant": constant, **tracks}
    return AdaptationInput("library", 0.5, maps_of(np.repeat(picture[None], n, axis=0)), **made)


def test_differences_are_the_integrals_of_the_model() -> None:
    light = np.exp(np.random.default_rng(2).normal(2.0, 1.0, (9, 3, 5)))
    durations = np.linspace(0.02, 0.3, 9)
    found = differences(light, durations)
    parts = response_differences(light, durations)
    assert found.integral == pytest.approx(parts.sum(axis=0).mean(), rel=1e-12)
    assert found.mean == pytest.approx(found.integral / durations.sum(), rel=1e-12)
    assert found.mean <= found.root_mean_square <= found.largest < 1


def test_the_histogram_holds_all_time_and_fits_the_mean() -> None:
    light = np.exp(np.random.default_rng(3).normal(2.0, 1.0, (20, 3, 5)))
    found = differences(light, np.full(20, 0.1))
    edges = bin_edges()
    assert found.shares.sum() == pytest.approx(1.0, rel=1e-12)
    assert found.shares @ edges[:-1] <= found.mean + 1e-6  # the lowest bin holds all that is smaller
    assert found.shares @ edges[1:] >= found.mean
    assert found.large == pytest.approx(found.shares[edges[:-1] > 0.0099].sum(), rel=1e-9)


def test_the_bars_hold_all_time_and_lie_where_the_differences_are() -> None:
    shares = np.zeros(60)  # ten bins to a factor of ten, from 1e-6
    shares[[0, 9, 30, 31, 59]] = 0.1, 0.2, 0.3, 0.15, 0.25
    shown = bars(ResponseDifferences(0.0, 0.0, 0.0, 0.0, 0.0, shares, 1, 1))
    edges = bar_edges()
    assert len(shown) == len(edges) - 1
    assert shown.sum() == pytest.approx(1.0)
    assert shown[0] == pytest.approx(0.3)  # all below 1e-5
    assert shown[-1] == pytest.approx(0.25)  # all above 0.1
    assert edges[np.argmax(shown)] == pytest.approx(1e-3)


def test_constant_dimming_of_a_still_picture_makes_no_difference() -> None:
    # float32 factors: luminances of equal frames are equal
    for place in ConeInput:
        assert differences_of(still(), DimmingCondition.CONSTANT, place).largest < 1e-15


def test_a_jumping_track_lags_more_than_a_slow_one() -> None:
    for place in ConeInput:
        slow, jumping = (
            differences_of(still(), dimming, place)
            for dimming in (DimmingCondition.CONSTRAINED, DimmingCondition.UNCONSTRAINED)
        )
        assert jumping.mean > 5 * slow.mean
        assert jumping.largest > 20 * slow.largest


def test_frame_mean_is_the_mean_luminance_not_the_mean_response() -> None:
    # Two halves that swap: their mean, and so its response, never changes.
    swap = np.array([[[10.0, 30.0]], [[30.0, 10.0]]] * 5)
    one = np.ones(10)
    sequence = AdaptationInput("made", 1.0, maps_of(swap), one, one, one)
    assert differences_of(sequence, DimmingCondition.CONSTANT, ConeInput.FRAME_MEAN).largest < 1e-15
    assert differences_of(sequence, DimmingCondition.CONSTANT, ConeInput.PIXEL).mean > 1e-3


def test_coarser_maps_hide_detail_that_moves() -> None:
    stripes = np.array([np.roll(np.tile([10.0, 30.0], (4, 4)), k, axis=1) for k in range(10)])
    one = np.ones(10)
    sequence = AdaptationInput("made", 1.0, maps_of(stripes), one, one, one)
    assert differences_of(sequence, DimmingCondition.CONSTANT, ConeInput.PIXEL, coarser=2).largest < 1e-15
    assert differences_of(sequence, DimmingCondition.CONSTANT, ConeInput.PIXEL).mean > 1e-3


@pytest.fixture(scope="module")
def found() -> Findings:
    """The library, and a sequence that the paper has not, in which nothing ever changes."""
    constant = np.full(40, 0.5)
    odd = replace(still(constrained=constant, unconstrained=constant), name="walk through $1 {x}")
    return adaptation_findings([still(), odd])


def test_findings_say_the_order_and_set_the_published_beside_it(found: Findings) -> None:
    ordering = [row for row in found.statistics if row.table == "ordering"]
    assert [(row.value, row.n, row.origin) for row in ordering] == [
        (1, 2, Origin.COMPUTED), (1, 2, Origin.COMPUTED), (1, 1, Origin.PUBLISHED),
    ]  # fmt: skip
    printed = [r for r in found.statistics if r.origin is Origin.PUBLISHED and r.table == "adaptation"]
    assert [row.value for row in printed] == [0.4189, 0.7311]  # Table 2, library
    assert all(row.group == "library" and "no unit" in row.flag for row in printed)
    table = found.sections[0].tables[0]
    column = table.columns.index("published: constr.")
    assert "beyond what" not in found.sections[0].paragraphs[2]  # both numbers are below 1
    assert [row[column] for row in table.rows if row[1] == ConeInput.PIXEL.value] == ["0.4189", None]


def test_only_the_number_beyond_the_range_of_a_response_is_called_so() -> None:
    basement = adaptation_findings([replace(still(), name="basement")])
    flags = {r.value: r.flag for r in basement.statistics if r.origin is Origin.PUBLISHED and r.flag}
    assert {value: "beyond" in flag for value, flag in flags.items()} == {0.3368: False, 1.4984: True}
    assert "1.4984 is beyond what two responses" in basement.sections[0].paragraphs[2]


def test_figures_show_what_their_points_say(found: Findings) -> None:
    assert [drawing.name for drawing in found.drawings] == ["adaptation_histogram", "adaptation_step"]
    assert all(drawing.png.startswith(b"\x89PNG") for drawing in found.drawings)
    shares: dict[tuple[str, str], float] = {}
    for point in found.drawings[0].points:
        if point.y is not None:
            key = point.panel, point.series
            shares[key] = shares.get(key, 0.0) + point.y
    assert len(shares) == 2 * len(ConeInput) * len(DimmingCondition)
    assert list(shares.values()) == pytest.approx([1.0] * len(shares))
    means = {p.x for p in found.drawings[0].points if p.y is None and p.panel == "library, per pixel"}
    told = [r for r in found.statistics if r.group == "library" and r.what.startswith("mean of |static")]
    assert means == {r.value for r in told if "per pixel" in r.what}


def test_without_anything_that_changes_there_is_no_ratio_and_it_is_said(found: Findings) -> None:
    excess = [row for row in found.statistics if row.what.startswith("excess") and row.group != "library"]
    assert len(excess) == 4
    assert all(row.value is None and "no ratio" in row.flag for row in excess)


def test_tracks_that_do_not_fit_are_refused() -> None:
    with pytest.raises(
        InputError, match="library, within the rate limit: expected a factor for each of 40 frames, got 3"
    ):
        still(constrained=np.ones(3))
    with pytest.raises(InputError, match="at least one sequence"):
        adaptation_findings([])


def test_the_track_without_limit_is_freer_than_the_one_within(make_problem, make_curves) -> None:
    rng = np.random.default_rng(4)
    problem = make_problem(make_curves(rng.uniform(0.1, 0.5, 12)), 0.5)
    maps = maps_of(np.full((12, 2, 3), 50.0), 0.04)
    sequence = adaptation_input(problem, problem.baseline(), maps, SplittingSolver())
    assert problem.rate_ratio(sequence.unconstrained) > 1
    assert problem.objective(sequence.unconstrained) < problem.objective(sequence.constrained)
    assert sequence.constant.tolist() == [0.5] * 12
