"""The safe rate limit: the lower edge of the band, as a curve of its own that the optimizer can be given."""

from __future__ import annotations

import dataclasses

import numpy as np

from evenlight.analysis.calibration.rate_limit_curve import CurveBasis
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.method.choices import LimitCurve
from evenlight.method.rate_limit import rate_limit_at

SAFE_DEGREE = 12  # the edge is a polynomial less the root of one: this degree meets it to about 0.3 %
COMPARED_AT = 2001  # luminances


def safe_limit(limit: RateLimit) -> RateLimit | None:
    """Return the lower edge of a limit's band as a rate limit; None where there is none above 0.

    Of the 95 % bands of repeated experiments, one in forty lies above the population's curve at a given
    luminance. The edge is no polynomial but nearly one; the curve returned is lowered until it is nowhere
    above the edge, and so errs to the slow side.

    Parameters
    ----------
    limit : RateLimit
        With a band.

    >>> from evenlight.data_schema.rate_limit import RateLimitForm
    >>> band = dict(band_luminance=(1.0, 9.0), band_lower=(0.5, 0.5), band_upper=(2.0, 2.0))
    >>> flat = RateLimit("r", "d", "", RateLimitForm.LN_RATE, (0.0,), (1.0, 9.0), **band)
    >>> rate_limit_at(safe_limit(flat), [1.0, 4.0, 9.0]).round(9).tolist()
    [0.5, 0.5, 0.5]
    """
    if not limit.band_luminance or min(limit.band_lower) <= 0:  # a band of the rate itself can reach 0
        return None
    basis = CurveBasis(limit.form, SAFE_DEGREE, limit.luminance_range)
    low, high = limit.luminance_range
    luminance = (low + high - (high - low) * np.cos(np.linspace(0.0, np.pi, COMPARED_AT))) / 2
    design = basis.design(luminance)
    edge = basis.ordinate(rate_limit_at(limit, luminance, LimitCurve.SAFE))
    coefficients = np.linalg.lstsq(design, edge, rcond=None)[0]
    coefficients[0] -= max(0.0, float(np.max(design @ coefficients - edge)))
    return dataclasses.replace(
        limit,
        name=f"{limit.name}, lower edge",
        coefficients=tuple(coefficients.tolist()),
        band_luminance=(),
        band_lower=(),
        band_upper=(),
        condition_number=None,
        source=f"lower edge of the {100 * limit.band_level:g} % band of: {limit.source or limit.name}",
    )
