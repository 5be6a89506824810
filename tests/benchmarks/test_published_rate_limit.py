"""The paper's calibration curve, from its eight published thresholds."""

import numpy as np
from numpy.polynomial import legendre

from benchmarks.published_rate_limit import (
    PUBLISHED_LUMINANCE,
    published_fit,
    published_rate_limit,
    published_rates,
)
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_points
from evenlight.analysis.published import published_values
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.method.preset_files import PRESETS, load_display
from evenlight.method.rate_limit import LimitCurve, rate_limit_at

# The authors' fitted curve, as printed by their program: luminance [cd/m^2], rate [cd/m^2/s].
FITTED_AS_PUBLISHED = {
    8.8: 0.264,
    14.1: 0.430,
    23.4: 0.807,
    43.5: 1.631,
    63.6: 2.139,
    83.9: 2.529,
    104.4: 2.787,
}


def preset() -> RateLimit:
    return read_json_record(RateLimit, PRESETS / "surace2025.rate_limit.json")


def test_least_squares_on_ln_rate_gives_the_published_fitted_rates() -> None:
    limit = published_fit(load_display("varjo-xr3")).limit
    fitted = rate_limit_at(limit, list(FITTED_AS_PUBLISHED))
    np.testing.assert_allclose(fitted, list(FITTED_AS_PUBLISHED.values()), rtol=0, atol=0.5e-3)


def test_the_legendre_coefficients_are_the_published_monomials() -> None:
    # ln ΔL as a polynomial in L is unique, whatever basis it was fitted in.
    limit = published_fit(load_display("varjo-xr3")).limit
    low, high = limit.luminance_range
    in_position = np.polynomial.Polynomial(legendre.leg2poly(limit.coefficients), domain=[low, high])
    monomials = in_position.convert(domain=[-1, 1]).coef[::-1]
    # The authors' polynomial: ln(ΔL) = Σ c_k L^k, highest power first, L in cd/m^2.
    authors = [v.number for v in published_values("authors_rate_limit")]
    np.testing.assert_allclose(monomials, authors, rtol=1e-8)


def test_the_published_thresholds_are_near_three_percent_per_second() -> None:
    # Drop over 5 s, relative to the initial luminance, as in the authors' table: 2.6 to 4.2 %/s.
    share = np.array(published_rates()) / np.array(PUBLISHED_LUMINANCE)
    np.testing.assert_allclose(
        100 * share, [2.95, 3.40, 2.95, 3.25, 4.23, 3.02, 3.17, 2.64], rtol=0, atol=0.006
    )


def test_the_committed_preset_is_what_the_thresholds_give() -> None:
    fresh = mapping_from_record(published_rate_limit(load_display("varjo-xr3")))
    committed = mapping_from_record(preset())
    assert fresh.keys() == committed.keys()
    for key, value in fresh.items():
        if isinstance(value, list | float):
            np.testing.assert_allclose(committed[key], value, rtol=1e-10, err_msg=key)
        else:
            assert committed[key] == value, key


def test_the_presets_band_holds_the_curve_and_three_degrees_of_freedom() -> None:
    # Half-width at any L is t(0.975, df = 8 - 5) s sqrt(h): the ratio of a 95 % to a 50 % band is that of the
    # t quantiles, 3.182446 / 0.764892 (tables of Student's t, 3 degrees of freedom).
    display = load_display("varjo-xr3")
    limit = preset()
    middle = rate_limit_at(limit, limit.band_luminance)
    assert (np.array(limit.band_lower) < middle).all()
    assert (middle < np.array(limit.band_upper)).all()
    narrow = fit_points(
        PUBLISHED_LUMINANCE, published_rates(), display, RateLimitOptions(band_level=0.5)
    ).limit
    ratio = np.log(limit.band_upper / middle) / np.log(narrow.band_upper / middle)
    np.testing.assert_allclose(ratio, 3.182446 / 0.764892, rtol=1e-5)


def test_the_safe_curve_of_the_preset_lies_below_every_published_threshold_but_never_at_zero() -> None:
    safe = rate_limit_at(preset(), PUBLISHED_LUMINANCE, LimitCurve.SAFE)
    assert (safe < np.array(published_rates())).all()
    assert (safe > 0.01 * np.array(PUBLISHED_LUMINANCE)).all()


def test_the_fit_says_that_it_is_well_conditioned() -> None:
    # The authors' monomials: 2.7e9 and more for 8 to 10 points; Legendre: below 5.
    condition = preset().condition_number
    assert condition is not None
    assert condition < 5
    L = np.array(PUBLISHED_LUMINANCE)
    assert np.linalg.cond(np.vander(L, 5)) > 1e8
