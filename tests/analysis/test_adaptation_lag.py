"""The ablation on visual adaptation: luminance of a video that streams past, and how far cones lag."""

import numpy as np
import pytest
from adapting_responses import response_differences

from evenlight.analysis.reproduction.adaptation import (
    INTEGRAL,
    LAG_RATIO,
    LARGE,
    MEAN,
    ROOT_MEAN_SQUARE,
    Cones,
    Dimming,
    LuminanceMaps,
    adaptation_findings,
    bar_edges,
    block_means,
    lag,
    unconstrained_factors,
)
from evenlight.analysis.results import Analysis
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.preset_files import load_display

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0, reflected_luminance=1.5)
LARGEST, SHARE_LARGE = "largest difference", f"share of the time with a difference above {LARGE:g}"


def noise(dtype: type, shape: tuple[int, int] = (18, 32)) -> np.ndarray:
    values = np.random.default_rng(1).uniform(size=(*shape, 3))
    if np.issubdtype(dtype, np.integer):
        return (values * np.iinfo(dtype).max).astype(dtype)
    return values.astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_block_has_the_mean_of_the_luminance_of_its_pixels(dtype: type) -> None:
    pixels = noise(dtype)
    maps = LuminanceMaps(LAB, width=8)
    list(maps.watch([Frame(0.0, 0.04, pixels)]))
    whole, (blocks,) = emitted_luminance(pixels, LAB), maps.emitted
    assert blocks.shape == (4, 8)  # 18 / 32 · 8 = 4.5, to even
    assert blocks[0, 0] == pytest.approx(whole[:4, :4].mean(), rel=1e-6)
    assert blocks[-1, -1] == pytest.approx(whole[13:, 28:].mean(), rel=1e-6)


def test_frames_pass_through_and_a_source_may_fill_them_again() -> None:
    pixels = np.empty((4, 8, 3), np.uint8)

    def refilled():
        for value in (0, 128, 255):
            pixels[:] = value
            yield Frame(value / 100, 0.5, pixels)

    maps = LuminanceMaps(LAB, width=4)
    assert [frame.time for frame in maps.watch(refilled())] == [0.0, 1.28, 2.55]
    assert maps.durations == [0.5] * 3
    assert [float(maps.emitted[k].mean()) for k in (0, 2)] == pytest.approx([0.1, 100.0], rel=1e-6)


def test_no_more_blocks_than_pixels() -> None:
    maps = LuminanceMaps(LAB)
    list(maps.watch([Frame(0.0, 0.04, noise(np.uint8, (3, 5)))]))
    assert maps.emitted[0].shape == (3, 5)


def test_blocks_of_unequal_size_lose_no_pixel() -> None:
    values = np.random.default_rng(2).uniform(size=(2, 7, 11))
    means = block_means(values, (3, 4))
    rows, columns = np.array([0, 2, 4, 7]), np.array([0, 2, 5, 8, 11])
    sizes = np.outer(np.diff(rows), np.diff(columns))
    np.testing.assert_allclose((means * sizes).sum(axis=(1, 2)), values.sum(axis=(1, 2)))
    assert means[1, 2, 3] == pytest.approx(values[1, 4:, 8:].mean())


def maps_of(luminance: np.ndarray, seconds: float = 0.1, display: Display | None = None) -> LuminanceMaps:
    maps = LuminanceMaps(display or load_display("varjo-xr3"))
    maps.emitted = [frame.astype(np.float32) for frame in luminance]
    maps.durations = [seconds] * len(luminance)
    return maps


def test_reflected_light_is_not_dimmed() -> None:
    maps = maps_of(np.array([[[100.0, 10.0]], [[50.0, 0.0]]]), display=LAB)
    assert maps.seen(np.array([0.5, 1.0]), Cones.PIXEL).tolist() == [[[51.5, 6.5]], [[51.5, 1.5]]]


def test_factors_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="expected a factor for each of 2 frames, got 3"):
        maps_of(np.ones((2, 1, 1))).seen(np.ones(3), Cones.PIXEL)


def still(n: int = 40, **tracks: np.ndarray) -> tuple[LuminanceMaps, dict[Dimming, np.ndarray]]:
    """A picture that does not change: what differs is the modulation's."""
    picture = np.exp(np.random.default_rng(1).normal(3.0, 0.8, (4, 6)))
    constant = np.full(n, 0.5)
    slow = constant * 1.003 ** np.arange(n)  # 3 % per second
    jumping = np.where(np.arange(n) % 10 < 5, 0.4, 0.6)
    made = {"constant": constant, "constrained": slow, "unconstrained": jumping, **tracks}
    return maps_of(np.repeat(picture[None], n, axis=0)), {d: made[d.name.lower()] for d in Dimming}


def lag_of(sequence, dimming: Dimming, cones: Cones) -> dict[str, float]:
    maps, factors = sequence
    return lag(maps.seen(factors[dimming], cones), maps.durations)[0]


def test_differences_are_the_integrals_of_the_model() -> None:
    light = np.exp(np.random.default_rng(2).normal(2.0, 1.0, (9, 3, 5)))
    durations = np.linspace(0.02, 0.3, 9)
    found, _ = lag(light, durations.tolist())
    parts = response_differences(light, durations)
    assert found[INTEGRAL] == pytest.approx(parts.sum(axis=0).mean(), rel=1e-12)
    assert found[MEAN] == pytest.approx(found[INTEGRAL] / durations.sum(), rel=1e-12)
    assert found[MEAN] <= found[ROOT_MEAN_SQUARE] <= found[LARGEST] < 1


def test_the_bars_hold_all_time_and_fit_the_mean() -> None:
    light = np.exp(np.random.default_rng(3).normal(2.0, 1.0, (20, 3, 5)))
    found, shares = lag(light, [0.1] * 20)
    edges = bar_edges()
    assert len(shares) == len(edges) - 1 == 20  # five bars to each of four factors of ten
    assert shares.sum() == pytest.approx(1.0, rel=1e-12)
    assert shares @ edges[:-1] <= found[MEAN] + 1e-5  # the lowest bar holds all that is smaller
    assert shares[:-1] @ edges[1:-1] + shares[-1] * found[LARGEST] >= found[MEAN]  # the last, all larger
    assert found[SHARE_LARGE] == pytest.approx(shares[edges[:-1] > 0.0099].sum(), rel=1e-9)


def test_constant_dimming_of_a_still_picture_makes_no_difference() -> None:
    # float32 factors: luminances of equal frames are equal
    for cones in Cones:
        assert lag_of(still(), Dimming.CONSTANT, cones)[LARGEST] < 1e-15


def test_a_jumping_track_lags_more_than_a_slow_one() -> None:
    for cones in Cones:
        slow, jumping = (lag_of(still(), way, cones) for way in (Dimming.CONSTRAINED, Dimming.UNCONSTRAINED))
        assert jumping[MEAN] > 5 * slow[MEAN]
        assert jumping[LARGEST] > 20 * slow[LARGEST]


def test_frame_mean_is_the_mean_luminance_not_the_mean_response() -> None:
    # Two halves that swap: their mean, and so its response, never changes.
    swap = np.array([[[10.0, 30.0]], [[30.0, 10.0]]] * 5)
    sequence = maps_of(swap), dict.fromkeys(Dimming, np.ones(10))
    assert lag_of(sequence, Dimming.CONSTANT, Cones.FRAME_MEAN)[LARGEST] < 1e-15
    assert lag_of(sequence, Dimming.CONSTANT, Cones.PIXEL)[MEAN] > 1e-3


@pytest.fixture(scope="module")
def found() -> Analysis:
    """The basement, and a sequence that the paper has not, in which nothing ever changes."""
    constant = np.full(40, 0.5)
    odd = still(constrained=constant, unconstrained=constant)
    return adaptation_findings({"basement": still(), "walk through $1 {x}": odd})


@pytest.mark.slow
def test_findings_say_the_order_and_set_the_published_beside_it(found: Analysis) -> None:
    ordering = [row for row in found.rows if row.table == "ordering"]
    assert [(row.value, row.n, row.origin) for row in ordering] == [
        (1, 2, Origin.COMPUTED), (1, 2, Origin.COMPUTED), (1, 1, Origin.PUBLISHED),
    ]  # fmt: skip
    printed = {r.what: r for r in found.rows if r.origin is Origin.PUBLISHED and r.table == "adaptation"}
    assert {row.group for row in printed.values()} == {"basement"}
    values = [row.value for row in printed.values()]
    assert values == [0.3368, 1.4984, pytest.approx(1.4984 / 0.3368)]  # Table 2
    beyond = [row.value for row in printed.values() if "beyond what two responses" in row.flag]
    assert beyond == [1.4984]
    assert "1.4984 is beyond what two responses" in found.sections[0].paragraphs[1]
    ours = {row.what: row for row in found.rows if row.origin is Origin.COMPUTED and row.group == "basement"}
    held, free = (
        ours[f"{INTEGRAL}: per pixel, {way}"].value
        for way in ("within the rate limit", "without a rate limit")
    )
    assert ours[LAG_RATIO].value == pytest.approx(free / held)
    assert ours[LAG_RATIO].flag == "partly determined: budgets and rate limit"
    shown = {row[1]: row for row in found.sections[0].tables[0].rows}
    ratio = shown[f"{LAG_RATIO} [1]"]
    assert ratio[:3] == ("Basement", f"{LAG_RATIO} [1]", "4.45")
    assert ratio[5:] == ("computed", "partly determined", "budgets and rate limit", "no")
    # Of the two numbers themselves the paper prints no unit: they are not judged.
    absolute = shown["average difference, within the rate limit [1]"]
    assert absolute[2] == "0.337"
    assert absolute[3].endswith(" s")
    assert absolute[-1] is None


def test_the_figure_shows_what_its_points_say(found: Analysis) -> None:
    (drawing,) = found.drawings
    assert drawing.name == "adaptation_histogram"
    shares: dict[tuple[str, str], float] = {}
    for point in drawing.points:
        if point.y is not None:
            key = point.panel, point.series
            shares[key] = shares.get(key, 0.0) + point.y
    assert len(shares) == 2 * len(Cones) * len(Dimming)
    assert list(shares.values()) == pytest.approx([1.0] * len(shares))
    means = {p.x for p in drawing.points if p.y is None and p.panel == "basement, per pixel"}
    told = [r for r in found.rows if r.group == "basement" and r.what.startswith(f"{MEAN}: per pixel")]
    assert means == {r.value for r in told}


def test_without_anything_that_changes_there_is_no_ratio_and_it_is_said(found: Analysis) -> None:
    excess = [row for row in found.rows if row.what.startswith("excess") and row.group != "basement"]
    assert len(excess) == 4
    assert all(row.value is None and "no ratio" in row.flag for row in excess)


@pytest.mark.slow
def test_the_track_without_limit_is_freer_than_the_one_within(make_problem, make_curves) -> None:
    problem = make_problem(make_curves(np.random.default_rng(4).uniform(0.1, 0.5, 12)), 0.5)
    free = unconstrained_factors(problem)
    assert problem.rate_ratio(free) > 1
    assert problem.objective(free) < problem.objective(problem.baseline())
