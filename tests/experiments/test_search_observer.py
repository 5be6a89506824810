"""Simulated searchers: how visible a ring is, when it is found, and whether its gap is told."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.search_stage import RingPicture
from evenlight.experiments.viewing.ring_views import RingViews, angle_between, ring_alone, ring_visibility
from evenlight.experiments.viewing.search_observer import (
    RingSight,
    SearchObserver,
    SearchPopulation,
    draw_searcher,
)
from evenlight.method.contrast.csf import contrast_sensitivity
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    band_frequencies,
    gaussian_pyramid,
    laplacian_bands,
)
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.scene import Vector

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=24.0)
PEOPLE = SearchPopulation()
MEDIAN = SearchObserver(PEOPLE)


def ring(contrast: float = -0.3, orientation: int = 90, gap: float = 10.0) -> Ring:
    return Ring(0.0, 0.0, gap, contrast, orientation)


def on_uniform_ground(shown: Ring, luminance: float, factor: float, side: int = 80) -> float:
    alone = ring_alone(shown, luminance, side, LAB)
    return ring_visibility(alone, alone, factor, LAB)


def visibility_as_printed(emitted: Array, factor: float) -> float:
    """Equations 2 and 3 pixel by pixel, the largest |C_t| of all bands."""
    D = factor * emitted
    frequencies = band_frequencies(D.shape, LAB)
    gaussian = gaussian_pyramid(D, len(frequencies) + 2)
    largest = 0.0
    for level, f in enumerate(frequencies):
        adaptation = adaptation_luminance(gaussian, level)
        C = laplacian_bands(gaussian[:-1])[level] / (adaptation + 1e-6) * contrast_sensitivity(f, adaptation)
        for y, x in np.ndindex(C.shape):
            near = np.abs(C[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3])
            masking = sum(c**0.2 for c in near.ravel()) / near.size
            largest = max(largest, abs(C[y, x]) ** 0.7 / (1 + masking))
    return largest


@pytest.mark.parametrize("factor", [0.2, 1.0])
def test_on_a_uniform_ground_a_rings_visibility_is_the_perceived_contrast_as_printed(factor: float) -> None:
    alone = ring_alone(ring(), 20.0, 40, LAB)
    assert ring_visibility(alone, alone, factor, LAB) == pytest.approx(visibility_as_printed(alone, factor))


def test_the_dimmer_the_scene_and_the_fainter_the_ring_the_less_visible_it_is() -> None:
    factors = [on_uniform_ground(ring(), 20.0, factor) for factor in (1.0, 0.7, 0.4, 0.2)]
    assert factors == sorted(factors, reverse=True)
    assert len(set(factors)) == 4
    contrasts = [on_uniform_ground(ring(c), 20.0, 0.5) for c in (-0.9, -0.3, -0.1, -0.01)]
    assert contrasts == sorted(contrasts, reverse=True)
    assert contrasts[-1] < 1 < contrasts[0]  # a percent is not seen, ninety are


def test_dimming_by_b_is_the_same_as_a_scene_of_b_times_the_luminance() -> None:
    assert on_uniform_ground(ring(), 40.0, 0.25) == pytest.approx(on_uniform_ground(ring(), 10.0, 1.0))


def test_texture_of_the_rings_own_scale_masks_it() -> None:
    alone = ring_alone(ring(), 20.0, 80, LAB)
    blobs = np.kron(np.random.default_rng(1).choice([0.6, 1.4], (20, 20)), np.ones((4, 4)))
    assert ring_visibility(alone, alone * blobs, 1.0, LAB) < 0.9 * ring_visibility(alone, alone, 1.0, LAB)


@pytest.mark.slow
def test_the_direction_of_the_gap_changes_visibility_by_less_than_12_percent() -> None:
    for display in (LAB, Display("fine", 100.0, 0.1, 2.2, pixels_per_degree=72.0)):
        for luminance in (0.2, 20.0):
            seen = []
            for orientation in ORIENTATIONS:
                alone = ring_alone(ring(orientation=orientation), luminance, 240, display)
                seen.append(ring_visibility(alone, alone, 1.0, display))
            assert max(seen) < 1.12 * min(seen)


def test_a_ring_drawn_alone_has_its_size_and_contrast() -> None:
    # Area by hand: π (2.5² - 1.5²) less the gap, 2 ∫ sqrt(r²-y²) between radii 1.5 and 2.5 for |y| < 1/2.
    # At 24 pixels per degree and 30 arcmin a gap is 12 pixels.
    def strip(r: float) -> float:
        return math.sqrt(r * r - 0.25) + 2 * r * r * math.asin(0.5 / r)

    area = math.pi * 4 - (strip(2.5) - strip(1.5)) / 2
    drawn = ring_alone(ring(-0.3, gap=30.0), 20.0, 120, LAB)
    assert drawn.min() == pytest.approx(14.0)
    assert drawn[0, 0] == 20.0
    assert (20.0 - drawn).sum() / 6.0 / 144 == pytest.approx(area, rel=0.01)


def sight(visibility: float, eccentricity: float = 25.0) -> RingSight:
    return RingSight(visibility, eccentricity, 135, 20.0)


def searched(who: SearchObserver, what: RingSight, limit: float = 30.0, n: int = 4000) -> list[float | None]:
    rng = np.random.default_rng(2)
    return [who.answer(what, limit, rng).found_after for _ in range(n)]


def test_median_times_by_hand() -> None:
    # 30 s at threshold, inversely with visibility, e^0.02 per degree.
    assert MEDIAN.median_time(sight(1.0)) == pytest.approx(30.0)
    assert MEDIAN.median_time(sight(6.0)) == pytest.approx(5.0)
    assert MEDIAN.median_time(sight(6.0, 45.0)) == pytest.approx(5.0 * math.exp(0.4))
    slow = SearchObserver(PEOPLE, slowness=1.5, sensitivity=2.0)
    assert slow.median_time(sight(6.0)) == pytest.approx(5.0 * 1.5 / 2)


def test_search_times_are_log_normal_about_their_median() -> None:
    times = np.log([t for t in searched(MEDIAN, sight(20.0), limit=1e9) if t is not None])
    assert len(times) > 3950  # P(findable) is logistic: 1 - 19^(-2 ln 20 / 0.8) is 1 to nine digits
    # Standard error of a median of 4000: 1.25 σ / sqrt(4000) = 0.012; of the deviation 1.1 %.
    assert np.median(times) == pytest.approx(math.log(1.5), abs=0.05)
    assert times.std() == pytest.approx(PEOPLE.time_sd, rel=0.045)


def test_the_gain_of_a_population_is_recovered_from_its_search_times() -> None:
    for gain in (0.5, 1.0, 2.0):
        # So slow that no time comes near the shortest one that a person can press in.
        who = SearchObserver(dataclasses.replace(PEOPLE, gain=gain, threshold_time=3000.0))
        visibilities = np.array([5.0, 10.0, 20.0])
        means = []
        for visibility in visibilities:
            times = [t for t in searched(who, sight(float(visibility)), limit=1e9) if t is not None]
            means.append(np.mean(np.log(times)))
        slope = np.polyfit(np.log(visibilities), means, 1)[0]
        # Standard error: 0.6 / sqrt(4000) over the root of Σ (ln v - mean)², 0.98, is 0.01.
        assert -slope == pytest.approx(gain, abs=0.04)


@given(st.floats(0.05, 20.0), st.floats(0.05, 20.0))
def test_the_further_above_threshold_the_sooner_found_and_the_better_reported_direction(
    one: float, other: float
) -> None:
    less, more = (sight(visibility) for visibility in sorted((one, other)))
    assert MEDIAN.median_time(more) <= MEDIAN.median_time(less)
    assert MEDIAN.findable(more) >= MEDIAN.findable(less)
    assert MEDIAN.identified(more) >= MEDIAN.identified(less)


def test_the_share_found_within_the_limit_follows_the_distribution() -> None:
    for visibility in (1.0, 2.0, 4.0):
        expected = MEDIAN.findable(sight(visibility)) * special.ndtr(math.log(visibility) / PEOPLE.time_sd)
        found = np.mean([t is not None for t in searched(MEDIAN, sight(visibility))])
        assert found == pytest.approx(expected, abs=4 * math.sqrt(0.25 / 4000))


def test_no_time_exceeds_the_limit_nor_is_shorter_than_anybody_can_press() -> None:
    for visibility in (0.5, 3.0, 500.0):
        found = [t for t in searched(SearchObserver(PEOPLE, guess_rate=0.5), sight(visibility), 10.0) if t]
        assert found
        assert 0.25 <= min(found) <= max(found) < 10.0


def test_a_ring_far_below_threshold_is_found_by_guessing_only() -> None:
    # At a third of the threshold, 19^(-2 ln 3 / 0.8) = 0.0003 could be found.
    assert MEDIAN.findable(sight(1 / 3)) < 0.001
    assert sum(t is not None for t in searched(MEDIAN, sight(1 / 3))) <= 6
    guesser = SearchObserver(PEOPLE, guess_rate=0.1)
    pressed = np.mean([t is not None for t in searched(guesser, sight(0.0))])
    assert pressed == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / 4000))


def test_who_only_guesses_tells_one_gap_in_eight() -> None:
    rng, guesser = np.random.default_rng(3), SearchObserver(PEOPLE, guess_rate=1.0)
    answers = [guesser.answer(sight(0.0), 30.0, rng).orientation for _ in range(4000)]
    counts = np.array([answers.count(orientation) for orientation in ORIENTATIONS]) / 4000
    np.testing.assert_allclose(counts, 1 / 8, atol=4 * math.sqrt(0.11 / 4000))


def test_a_gap_is_told_by_chance_at_no_visibility_and_by_all_but_lapses_at_much() -> None:
    assert MEDIAN.identified(sight(1e-3)) == pytest.approx(1 / 8, abs=1e-6)
    assert MEDIAN.identified(sight(PEOPLE.gap_visibility)) == pytest.approx(1 / 8 + 7 / 16)
    assert SearchObserver(PEOPLE, lapse_rate=0.08).identified(sight(1e3)) == pytest.approx(1 - 0.07)
    rng = np.random.default_rng(4)
    answers = [MEDIAN.answer(sight(50.0), 30.0, rng).orientation for _ in range(500)]
    assert answers.count(135) > 495


def test_nothing_found_is_nothing_reported_direction() -> None:
    rng = np.random.default_rng(5)
    answers = [MEDIAN.answer(sight(1.5), 30.0, rng) for _ in range(500)]
    assert {(a.found_after is None, a.orientation is None) for a in answers} == {(True, True), (False, False)}


def test_personal_traits_scatter_as_reported_direction() -> None:
    rng = np.random.default_rng(6)
    drawn = [draw_searcher(rng) for _ in range(2000)]
    # Standard error of a standard deviation of 2000: 1.6 %; four of them.
    assert np.std(np.log([who.slowness for who in drawn])) == pytest.approx(PEOPLE.speed_sd, rel=0.064)
    assert np.std(np.log([who.sensitivity for who in drawn])) == pytest.approx(
        PEOPLE.sensitivity_sd, rel=0.064
    )
    assert np.mean([who.guess_rate for who in drawn]) == pytest.approx(1 / 41, rel=0.1)


class PaintedByHand:
    """Paints rings on a uniform ground, and counts them."""

    def __init__(self) -> None:
        self.painted: list[Ring] = []

    def picture(self, scene: str, position: Vector, shown: Ring) -> RingPicture:
        self.painted.append(shown)
        return RingPicture(ring_alone(shown, 20.0, 80, LAB), 20.0)


def planned(factor: float, azimuth: float = 20.0, orientation: int = 90) -> PlannedTrial:
    ring, camera = Ring(azimuth, 0.0, 10.0, -0.3, orientation), Camera((0.0, 0.0, 1.65), 350.0)
    return PlannedTrial({"ring": ring, "scene": "/home/anna/walk.json", "camera": camera}, factor=factor)


def test_each_ring_is_painted_once_whatever_its_factor_or_direction() -> None:
    painter = PaintedByHand()
    views = RingViews(painter, LAB)
    bright, dim = views.of(planned(0.9)), views.of(planned(0.3))
    turned = views.of(planned(0.9, orientation=225))
    assert len(painter.painted) == 1
    views.of(planned(0.9, azimuth=-10.0))
    assert len(painter.painted) == 2
    assert bright.visibility > dim.visibility
    assert turned == dataclasses.replace(bright, orientation=225)
    assert bright.visibility == pytest.approx(on_uniform_ground(ring(orientation=0), 20.0, 0.9))


def test_eccentricity_is_the_angle_between_the_first_view_and_the_ring() -> None:
    assert RingViews(PaintedByHand(), LAB).of(planned(0.5)).eccentricity == pytest.approx(30.0)
    # Spherical law of cosines: 60 degrees east at 45 degrees up, seen from the horizon: cos 60 · cos 45.
    camera = Camera((0.0, 0.0, 1.65), 0.0)
    raised = Ring(60.0, 45.0, 10.0, -0.3, 0)
    assert angle_between(camera, raised) == pytest.approx(math.degrees(math.acos(0.5 * math.sqrt(0.5))))


def test_where_pixels_dim_nothing_is_darker_than_black_and_a_dark_ring_is_less_visible() -> None:
    """b = 0.004 of 20 cd/m^2 is 0.08, black 0.1: ring and ground are both drawn black, and nothing is left.

    At b = 0.006, 0.12 and 0.084 become 0.12 and 0.1. A backlight dims the black as well.
    """
    by_pixels = RingViews(PaintedByHand(), LAB)
    by_backlight = RingViews(PaintedByHand(), LAB, Actuator.BACKLIGHT)
    assert by_pixels.of(planned(0.004)).visibility == pytest.approx(0.0, abs=1e-9)
    assert 0 < by_pixels.of(planned(0.006)).visibility < by_backlight.of(planned(0.006)).visibility
    assert by_pixels.of(planned(0.5)) == by_backlight.of(planned(0.5))


def test_the_truth_names_every_ring_that_was_seen() -> None:
    """Scenes by name: not in which folder of this computer the file of a path lies."""
    views = RingViews(PaintedByHand(), LAB)
    views.prepare([planned(0.9), planned(0.3), planned(0.3, orientation=225)])
    table = views.table()
    assert [(row["scene"], row["factor"]) for row in table] == [("walk", 0.9), ("walk", 0.3)]
    assert table[0]["visibility"] == views.of(planned(0.9)).visibility
    assert table[0]["background_luminance_cd_m2"] == 20.0
