"""Claims about the noise of a meter, as its repeats tell it."""

import numpy as np
import pytest

from evenlight.analysis.sweeps.repeated_readings import (
    Repeats,
    noise_of,
    scattered_rounding,
    shared_rounding,
)
from evenlight.method.suspect_readings import last_digits

LEVELS = 200 * (np.arange(17) / 16) ** 2.2 + 0.2


def repeats(
    noise: tuple[float, float], rng: np.random.Generator, n: int = 3, step: float = 0.0
) -> list[Repeats]:
    floor, share = noise
    read = [L + np.hypot(floor, share * L) * rng.standard_normal(n) for L in LEVELS]
    if step:
        read = [np.round(values / step) * step for values in read]
    return [Repeats(values, np.zeros(n)) for values in read]


def test_many_repeats_tell_floor_and_share() -> None:
    # A standard deviation is known to 1/sqrt(2 · df); about 4 levels tell the floor: df = 4 · 399.
    noise = noise_of(repeats((0.02, 0.002), np.random.default_rng(1), n=400))
    assert noise.floor == pytest.approx(0.02, rel=0.06)
    assert noise.share == pytest.approx(0.002, rel=0.06)
    assert noise.freedom == pytest.approx(17 * 399 / 2, rel=0.02)  # two numbers: half of it for each level


def test_levels_alike_tell_one_number_by_all_their_repeats() -> None:
    rng = np.random.default_rng(8)
    alike = [Repeats(100 + 0.3 * rng.standard_normal(3), np.zeros(3)) for _ in range(10)]
    assert noise_of(alike).freedom == pytest.approx(20, rel=0.1)


def test_the_freedom_says_how_uncertain_the_variance_of_a_level_is_on_average() -> None:
    # Variances of known parts, told 300 times by three readings of 17 levels: their relative errors squared
    # are 2/ν on average, in a logarithm somewhat more (the trigamma function: 2/ν + 2/ν², ν = 17: 0.125).
    rng = np.random.default_rng(9)
    true = 0.02**2 + (0.002 * LEVELS) ** 2
    told = [noise_of(repeats((0.02, 0.002), rng)) for _ in range(300)]
    errors = np.log([noise.variance(LEVELS) for noise in told]) - np.log(true)
    freedom = np.mean([noise.freedom for noise in told])
    assert np.var(errors, axis=0).mean() == pytest.approx(2 / freedom + 2 / freedom**2, rel=0.25)


def test_three_repeats_do_not_make_the_darkest_readings_exact() -> None:
    # Likelihood alone puts the floor below a fifth of its size in one sweep of twenty: 10 of these 200.
    rng = np.random.default_rng(2)
    floors = [noise_of(repeats((0.002, 0.002), rng)).floor for _ in range(200)]
    assert np.sum(np.array(floors) < 0.002 / 5) <= 2
    assert np.median(floors) == pytest.approx(0.002, rel=0.3)


def test_rounding_is_not_taken_for_noise() -> None:
    # Noise of 0.002 under digits of 0.1: the few readings that fall to another digit scatter by 0.05.
    rng = np.random.default_rng(3)
    floors = [noise_of(repeats((0.002, 0.0002), rng, step=0.1), 0.1).floor for _ in range(50)]
    assert np.median(floors) < 0.02


def test_a_drift_that_is_taken_out_is_no_noise() -> None:
    times = np.linspace(0, 100, 50)
    steady = [Repeats(L * (1 + 1e-4 * times), times) for L in (50.0, 100.0)]
    assert noise_of(steady).share == pytest.approx(1e-4 * np.std(times, ddof=1), rel=0.1)
    assert noise_of(steady, slope=1e-4).share < 1e-4


def test_levels_that_were_read_once_are_refused() -> None:
    with pytest.raises(ValueError, match="no level was read twice"):
        noise_of([Repeats(np.array([1.0]), np.array([0.0]))])


def test_noise_blurs_the_error_of_rounding_that_repeats_share() -> None:
    # Simulated: readings of random levels, rounded to whole numbers; their mean errs by what they share.
    rng = np.random.default_rng(4)
    for deviation in (0.05, 0.2, 0.4):
        true = rng.uniform(0, 1, 4000)
        read = np.round(true[:, None] + deviation * rng.standard_normal((4000, 400)))
        error = read - true[:, None]
        shared = float(shared_rounding([deviation], [1.0])[0])
        apart = float(scattered_rounding([deviation], [1.0])[0])
        # Of 400 readings the mean has (deviation² + apart)/400 besides; 4000 levels tell a variance to 7 %.
        of_means = np.var(error.mean(axis=1)) - (deviation**2 + apart) / 400
        assert of_means == pytest.approx(shared, rel=0.12, abs=2e-4)
        assert np.mean(error.var(axis=1, ddof=1)) == pytest.approx(deviation**2 + apart, rel=0.1)


def test_readings_in_full_precision_have_no_last_digit() -> None:
    assert last_digits([np.pi, 100 * np.sqrt(2)]).tolist() == [0.0, 0.0]


def test_a_reading_of_zero_takes_the_digit_of_the_next_brighter_one() -> None:
    assert last_digits([0.0, 0.013, 5.2]) == pytest.approx([0.001, 0.001, 0.1])
