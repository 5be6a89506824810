"""The polynomial of the rate limit ΔL(L): its basis, its band, and where it falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Direction, Procedure

WIDEST_BAND = 100.0  # upper over lower end; beyond it an interval says nothing
BAND_SAMPLES = 97  # linear interpolation between them errs by less than 1e-3 of the rate
MONOTONE_SAMPLES = 1001
SLIGHT_FALL = 0.01  # share of the rate
SHORT_FALL = 0.02  # share of the measured range
LARGEST_LN = 700.0  # exp() of more overflows; a band may reach there before it is refused
PAPER_DEGREE = 4  # may meet every one of five luminances, as the paper's does
SPARE_LUMINANCES = 2  # that a higher degree has to leave, to show whether its swings are real
WORST_CONDITION = 1e6  # of the design; the covariance squares it, and four of sixteen digits are left


@dataclass(frozen=True, slots=True)
class RateLimitOptions:
    """How a rate limit is fitted."""

    form: RateLimitForm | None = None  # what the polynomial describes; None for the choice of the model
    # None for the choice of the model: the joint one's by predictive score, else the paper's 4 of ln(rate),
    # or with fewer than five luminances a line in log-log.
    degree: int | None = None
    band_level: float = 0.95
    # Of the ramps whose limit is wanted, where there are several [s]. Where neither duration nor direction is
    # given, the condition with the lowest thresholds is taken.
    ramp_duration: float | None = None
    direction: Direction | None = None
    procedure: Procedure | None = None  # task whose answers are fitted, where there are several
    model: RateLimitModel = RateLimitModel.JOINT
    monotone: bool = False  # whether the curve may not fall with luminance; of the joint model alone
    sigmoid: Sigmoid = Sigmoid.LOGISTIC  # of the joint model's psychometric functions

    def __post_init__(self) -> None:
        if self.degree is not None and not 0 <= self.degree <= 8:
            raise InputError(f"the degree of the rate limit must lie in 0 to 8, got {self.degree}")
        if not 0 < self.band_level < 1:
            raise InputError(f"the band's level must lie between 0 and 1, got {self.band_level:g}")
        if self.monotone and self.model is not RateLimitModel.JOINT:
            raise InputError(f"a monotone curve is for the model joint, not for {self.model.value}")
        if self.sigmoid is not Sigmoid.LOGISTIC and self.model is not RateLimitModel.JOINT:
            raise InputError(f"another sigmoid is for the model joint, not for {self.model.value}")

    def shape(self, luminances: int) -> tuple[RateLimitForm, int]:
        """Return form and degree of a curve through thresholds at so many luminances.

        >>> RateLimitOptions().shape(10), RateLimitOptions().shape(2)
        ((<RateLimitForm.LN_RATE: 'ln_rate'>, 4), (<RateLimitForm.LOG_LOG: 'log_log'>, 1))
        """
        if self.form is None and self.degree is None and luminances <= PAPER_DEGREE:
            return RateLimitForm.LOG_LOG, min(1, luminances - 1)
        return self.form or RateLimitForm.LN_RATE, PAPER_DEGREE if self.degree is None else self.degree


def default_model(form: RateLimitForm | None) -> RateLimitModel:
    """Return the model where none is named: joint, but for the rate itself, which joint has not."""
    return RateLimitModel.INDIVIDUAL if form is RateLimitForm.RATE else RateLimitModel.JOINT


def shape_name(form: RateLimitForm, degree: int) -> str:
    """Return what a curve of a form and degree is called.

    >>> shape_name(RateLimitForm.LOG_LOG, 1), shape_name(RateLimitForm.LN_RATE, 4)
    ('power law', 'polynomial of degree 4 of ln(rate)')
    """
    if degree == 0:
        return "constant"
    if (form, degree) == (RateLimitForm.LOG_LOG, 1):
        return "power law"
    of = {RateLimitForm.LN_RATE: "of ln(rate)", RateLimitForm.RATE: "of the rate"}
    return f"polynomial of degree {degree} {of.get(form, 'in log-log')}"


@dataclass(frozen=True, slots=True)
class CurveBasis:
    """Legendre polynomials over the measured luminances, and the scale on which the curve is a sum of them.

    Monomials of L in cd/m^2 have a condition number of 1e9 to 1e10 for the paper's luminances, Legendre
    polynomials one below 5.
    """

    form: RateLimitForm
    degree: int
    luminance_range: tuple[float, float]  # [cd/m^2], mapped to -1 and 1; both the same for a constant

    def design(self, luminance: ArrayLike) -> Array:
        """Return the Legendre polynomials at luminances [cd/m^2], shape (n, degree + 1).

        >>> CurveBasis(RateLimitForm.RATE, 2, (10.0, 90.0)).design([10, 50, 90]).tolist()
        [[1.0, -1.0, 1.0], [1.0, 0.0, -0.5], [1.0, 1.0, 1.0]]
        """
        values = np.asarray(luminance, dtype=np.float64)
        low, high = self.luminance_range
        if self.form is RateLimitForm.LOG_LOG:
            values, low, high = np.log(values), float(np.log(low)), float(np.log(high))
        position = (2 * values - low - high) / ((high - low) or 1.0)
        return np.asarray(legendre.legvander(position, self.degree), dtype=np.float64)

    def ordinate(self, rate: ArrayLike) -> Array:
        """Return rates [cd/m^2/s] on the polynomial's scale: their logarithm, or as they are for `RATE`."""
        values = np.asarray(rate, dtype=np.float64)
        return values if self.form is RateLimitForm.RATE else np.log(values)

    def rate(self, ordinate: ArrayLike) -> Array:
        """Return the rates [cd/m^2/s] for values on the polynomial's scale; never below 0."""
        values = np.asarray(ordinate, dtype=np.float64)
        if self.form is RateLimitForm.RATE:
            return np.maximum(values, 0.0)
        return np.asarray(np.exp(np.clip(values, -LARGEST_LN, LARGEST_LN)), dtype=np.float64)


def basis_for(luminance: ArrayLike, options: RateLimitOptions, levels: int | None = None) -> CurveBasis:
    """Return the basis for thresholds at these luminances [cd/m^2].

    `levels`: how many levels these are, where a display was measured again; else each luminance is one.

    Raises
    ------
    InputError
        If there are too few different luminances for the degree: one more than the degree up to the paper's,
        three more above it; or if they crowd together so much that the polynomial is lost in rounding.
    """
    distinct = np.unique(np.asarray(luminance, dtype=np.float64))
    levels = levels or distinct.size
    form, degree = options.shape(levels)
    needed = luminances_needed(degree)
    if levels < needed:
        raise InputError(
            f"a rate limit of degree {degree} needs thresholds at {needed} or more luminances, "
            f"got {levels}; measure more levels, or choose a lower `degree`"
        )
    basis = CurveBasis(form, degree, (float(distinct[0]), float(distinct[-1])))
    condition = float(np.linalg.cond(basis.design(distinct)))
    if condition > WORST_CONDITION:
        raise InputError(
            f"a rate limit of degree {degree} is not known from luminances spread as these are, "
            f"{distinct[0]:.4g} to {distinct[-1]:.4g} cd/m^2: condition number {condition:.1e}, at most "
            f"{WORST_CONDITION:.0e}; choose the form log_log, a lower degree, or measure levels in between"
        )
    return basis


def luminances_needed(degree: int) -> int:
    """Return how many different luminances a polynomial of a degree needs.

    >>> luminances_needed(4), luminances_needed(5)
    (5, 8)
    """
    return degree + 1 + (SPARE_LUMINANCES if degree > PAPER_DEGREE else 0)


def band_luminances(low: float, high: float) -> Array:
    """Return where a band is sampled [cd/m^2]: denser where the curve is steeper; once for one luminance."""
    sampled = np.unique(np.linspace(low**0.5, high**0.5, BAND_SAMPLES) ** 2)
    sampled[[0, -1]] = low, high
    return sampled


def bounds(low: float | None, high: float | None, form: str = ".3g") -> str | None:
    """Return an interval in words; one that says nothing is not bounded.

    >>> bounds(0.2, 0.4), bounds(0.18, 2.6e11), bounds(None, None)
    ('0.2 to 0.4', 'not bounded', None)
    """
    if low is None or high is None:
        return None
    return f"{low:{form}} to {high:{form}}" if high <= WIDEST_BAND * low else "not bounded"


def curve_band(
    basis: CurveBasis, coefficients: Array, covariance: Array | None, df: float, level: float
) -> tuple[Array, Array, Array]:
    """Return luminances [cd/m^2] and the curve's pointwise band at them [cd/m^2/s], lower and upper.

    The half-width is t · sqrt(xᵀ Cov(β) x), t the quantile of Student's t. All three are empty where the
    covariance is unknown.
    """
    if covariance is None:
        return np.empty(0), np.empty(0), np.empty(0)
    luminance = band_luminances(*basis.luminance_range)
    design = basis.design(luminance)
    variance = np.einsum("ij,jk,ik->i", design, covariance, design)
    half = special.stdtrit(df, (1 + level) / 2) * np.sqrt(variance)
    middle = design @ coefficients
    return luminance, basis.rate(middle - half), basis.rate(middle + half)


def falling_stretches(basis: CurveBasis, coefficients: Array) -> tuple[tuple[float, float], ...]:
    """Return the stretches of luminance [cd/m^2] within the measured range where the curve falls.

    A fall is reported if it is more than 1 % of the rate over more than 2 % of the range: less is within any
    threshold's error. There a brighter display would have to change more slowly, which no threshold study
    suggests: an optimizer would take such a dip for a place to stay in.

    >>> rising_then_falling = np.array([0.0, 0.0, -1.0])  # -P_2: its maximum is at the middle, 50
    >>> falling_stretches(CurveBasis(RateLimitForm.RATE, 2, (10.0, 90.0)), rising_then_falling)
    ((50.0, 90.0),)
    """
    luminance = np.linspace(*basis.luminance_range, MONOTONE_SAMPLES)
    ordinate = basis.design(luminance) @ coefficients
    rate = basis.rate(ordinate)
    falls = np.diff(ordinate) < -1e-12
    edges = np.flatnonzero(np.diff(np.concatenate([[False], falls, [False]]).astype(np.int8)))
    return tuple(
        (float(luminance[a]), float(luminance[b]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if rate[b] < (1 - SLIGHT_FALL) * rate[a] and b - a > SHORT_FALL * (MONOTONE_SAMPLES - 1)
    )
