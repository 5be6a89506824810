"""Simulated raters: what a video loses, what rating that makes, and that a population is what it is told."""

from pathlib import Path

import numpy as np
import pytest
from example_tracks import example_track, header_of
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.rating_observer import (
    DetailViews,
    RatingObserver,
    RatingPopulation,
    draw_rater,
    pooled_loss,
)
from evenlight.experiments.viewing.viewing_task import planned_clips

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
MEDIAN = RatingObserver(RatingPopulation().cuts, 1.0, RatingPopulation().noise, 0.0)
losses = st.floats(0.0, 1.0)


def curves(at_half: list[float], visible: list[float], durations: list[float] | None = None) -> LossCurves:
    """Return curves that fall linearly from some loss at factor 0.5 to none at factor 1."""
    n = len(at_half)
    return LossCurves(
        video="v",
        display=LAB,
        times=np.arange(n) * 1.0,
        durations=np.array(durations or [1.0] * n),
        factors=np.array([0.5, 1.0]),
        loss=np.column_stack([at_half, np.zeros(n)]),
        visible_contrast=np.array(visible),
        mean_luminance=np.full(n, 10.0),
        channel_means=np.full((n, 3), 0.1),
        provenance=Provenance(),
    )


def mean_rating(who: RatingObserver, loss: float) -> float:
    return float(who.probabilities(loss) @ np.arange(1, 6))


def test_the_loss_of_a_video_is_a_minkowski_mean_weighted_by_visible_contrast_by_hand() -> None:
    # ((0.1 · 0.6⁴ + 0.3 · 0.2⁴) / 0.4)^(1/4) = 0.0336^(1/4); at factor 0.75 all losses are half as large.
    two = curves([0.6, 0.2], [0.1, 0.3])
    assert pooled_loss(two, np.array([0.5, 0.5])) == pytest.approx(0.0336**0.25)
    assert pooled_loss(two, np.array([0.75, 0.75])) == pytest.approx(0.0336**0.25 / 2)
    # A frame that lasts three times as long counts as three frames.
    longer = curves([0.6, 0.2], [0.1, 0.1], durations=[1.0, 3.0])
    assert pooled_loss(longer, np.array([0.5, 0.5])) == pytest.approx(((0.1296 + 3 * 0.0016) / 4) ** 0.25)


def test_a_frame_without_visible_contrast_does_not_count_and_none_at_all_is_no_loss() -> None:
    assert pooled_loss(curves([0.9, 0.2], [0.0, 0.3]), np.array([0.5, 0.5])) == pytest.approx(0.2)
    assert pooled_loss(curves([0.9, 0.2], [0.0, 0.0]), np.array([0.5, 0.5])) == 0.0


def test_an_excerpt_is_its_beginning_only() -> None:
    three = curves([0.1, 0.1, 0.9], [0.2, 0.2, 0.2])
    assert pooled_loss(three, np.full(3, 0.5), seconds=2.0) == pytest.approx(0.1)
    assert pooled_loss(three, np.full(3, 0.5), seconds=99.0) == pooled_loss(three, np.full(3, 0.5))


@given(st.lists(losses, min_size=2, max_size=6))
def test_the_loss_of_a_video_lies_between_the_mean_and_the_worst_of_its_frames(at_half: list[float]) -> None:
    pooled = pooled_loss(curves(at_half, [0.5] * len(at_half)), np.full(len(at_half), 0.5))
    assert np.mean(at_half) - 1e-9 <= pooled <= max(at_half) + 1e-9


@given(losses, losses)
def test_who_loses_less_is_never_rated_lower(one: float, other: float) -> None:
    less, more = sorted((one, other))
    upper = [np.cumsum(MEDIAN.probabilities(loss)[::-1]) for loss in (less, more)]
    assert (upper[0] >= upper[1] - 1e-12).all()  # every rating or a better one is at least as frequent


def test_at_a_cut_point_half_of_the_ratings_are_above_it() -> None:
    # Kept visible contrast 0.9 is the cut between 3 and 4, and the next cuts are ten deviations away.
    who = RatingObserver((0.5, 0.7, 0.9, 1.1), 1.0, 0.02, 0.0)
    np.testing.assert_allclose(who.probabilities(0.1), [0, 0, 0.5, 0.5, 0], atol=1e-9)
    # Half the sensitivity: the same of twice the loss.
    numb = RatingObserver((0.5, 0.7, 0.9, 1.1), 0.5, 0.02, 0.0)
    np.testing.assert_allclose(numb.probabilities(0.2), [0, 0, 0.5, 0.5, 0], atol=1e-9)


def test_a_lapse_makes_every_rating_as_frequent() -> None:
    blind = RatingObserver(MEDIAN.cuts, 1.0, 0.02, 1.0)
    np.testing.assert_allclose(blind.probabilities(0.5), 0.2)
    rng = np.random.default_rng(3)
    counts = np.bincount([blind.answer(0.5, rng) for _ in range(5000)], minlength=6)[1:] / 5000
    np.testing.assert_allclose(counts, 0.2, atol=4 * np.sqrt(0.2 * 0.8 / 5000))


def test_ratings_are_as_frequent_as_their_probabilities_say() -> None:
    who = RatingObserver(MEDIAN.cuts, 1.3, 0.05, 0.05)
    rng, n = np.random.default_rng(4), 5000
    counts = np.bincount([who.answer(0.1, rng) for _ in range(n)], minlength=6)[1:] / n
    expected = who.probabilities(0.1)
    assert expected.sum() == pytest.approx(1.0)
    assert (np.abs(counts - expected) <= 4 * np.sqrt(expected * (1 - expected) / n) + 1e-9).all()


@pytest.mark.parametrize("sensitivity", [1.0, 2.0])
def test_the_sensitivity_of_a_population_is_recovered_from_its_ratings(sensitivity: float) -> None:
    """P(4 or 5) = Φ((1 - s·loss - cut) / σ), σ² = noise² + leniency²: two losses give s."""
    people = RatingPopulation(
        sensitivity=sensitivity, sensitivity_sd=0.0, spread_sd=0.0, lapse=(1.0, 1e9), leniency_sd=0.03
    )
    sigma, shown, n = np.hypot(people.noise, people.leniency_sd), (0.03, 0.06), 4000
    rng = np.random.default_rng(5)
    raters = [draw_rater(rng, people) for _ in range(n)]
    high = np.array([np.mean([who.answer(loss, rng) >= 4 for who in raters]) for loss in shown])
    z = special.ndtri(high)
    recovered = (z[0] - z[1]) * sigma / (shown[1] - shown[0])
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    # The same raters saw both, so the errors partly cancel; taken as independent they are an upper bound.
    error = np.sqrt(np.sum(high * (1 - high) / n / density**2)) * sigma / (shown[1] - shown[0])
    assert recovered == pytest.approx(sensitivity, abs=4 * error)
    assert 4 * error < 0.5  # the two populations are told apart


def test_twice_the_sensitivity_is_twice_the_loss() -> None:
    twice = RatingObserver(MEDIAN.cuts, 2.0, MEDIAN.noise, 0.0)
    np.testing.assert_allclose(twice.probabilities(0.04), MEDIAN.probabilities(0.08))


def test_the_population_rates_in_the_order_of_magnitude_of_the_papers_table() -> None:
    """Means of 3.2 to 4.3, and standard errors of .15 to .26 with 17 raters (detail-quality table).

    The losses are those of the four sequences at their budgets, pooled: from about 0.02 to 0.1.
    """
    rng = np.random.default_rng(6)
    raters = [draw_rater(rng) for _ in range(2000)]
    for loss in (0.02, 0.05, 0.1):
        ratings = np.array([who.answer(loss, rng) for who in raters])
        assert 3.0 < ratings.mean() < 4.4
        assert 0.15 < ratings.std() / np.sqrt(17) < 0.26


def test_personal_cut_points_rise_and_scatter_as_told() -> None:
    rng, people = np.random.default_rng(7), RatingPopulation()
    cuts = np.array([draw_rater(rng, people).cuts for _ in range(2000)])
    assert (np.diff(cuts, axis=1) > 0).all()
    # Standard error of a standard deviation of 2000: 1.6 %; four of them.
    assert cuts.mean(axis=1).std() == pytest.approx(people.leniency_sd, rel=0.064)
    apart = np.log((cuts[:, 3] - cuts[:, 0]) / (people.cuts[3] - people.cuts[0]))
    assert apart.std() == pytest.approx(people.spread_sd, rel=0.064)


def loaded(folder: Path, factors: list[float], at_half: list[float], baseline: float) -> LoadedStimulus:
    """Return a stimulus whose loss curves lie in a folder, and which was not read from there."""
    write_loss_curves(folder / "loss_curves.npz", curves(at_half, [0.5] * len(at_half)))
    n, b = len(factors), np.array(factors)
    track = example_track(b, 1.0, header_of(LAB), mean_luminance=10 * b, rate_limit=1.0, power=1.0)
    stimulus = Stimulus("v", "", "0" * 64, n, float(n), float(b.mean()), baseline)
    return LoadedStimulus(stimulus, folder, track)


def test_each_version_is_rated_by_what_it_loses_itself(tmp_path: Path) -> None:
    views = DetailViews([loaded(tmp_path, [0.5, 1.0], [0.8, 0.2], baseline=0.75)])
    ours = views.of(planned_clips([Version.OURS], sequence="v", block=1))
    baseline = views.of(planned_clips([Version.BASELINE], sequence="v", block=1))
    assert ours == pytest.approx((0.8**4 / 2) ** 0.25)
    assert baseline == pytest.approx(((0.4**4 + 0.1**4) / 2) ** 0.25)
    assert views.of(planned_clips([Version.OURS], 1.0, sequence="v", block=1)) == pytest.approx(0.8)
    assert mean_rating(MEDIAN, baseline) > mean_rating(MEDIAN, ours)


def test_equal_versions_get_equal_ratings(tmp_path: Path) -> None:
    views = DetailViews([loaded(tmp_path, [0.75, 0.75], [0.2, 0.4], baseline=0.75)])
    lost = [views.of(planned_clips([version], sequence="v", block=1)) for version in Version]
    assert lost[0] == lost[1]
    rng = np.random.default_rng
    assert [MEDIAN.answer(lost[0], rng(k)) for k in range(50)] == [
        MEDIAN.answer(lost[1], rng(k)) for k in range(50)
    ]


def test_loss_curves_of_another_track_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"loss curves are of 2 frames, its track of 3"):
        DetailViews([loaded(tmp_path, [0.5, 0.6, 0.7], [0.2, 0.2], baseline=0.6)])


def test_a_track_dimmer_than_its_loss_curves_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"begin at the factor 0\.5, and it is dimmed to 0\.3.*--min-factor 0\.3"
    ):
        DetailViews([loaded(tmp_path, [0.3, 0.6], [0.2, 0.2], baseline=0.6)])
