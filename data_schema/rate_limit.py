"""The rate limit ΔL(L): the fastest luminance change allowed, as fitted to detection thresholds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING, ClassVar

from evenlight.data_schema.arguments import numbers
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import ArgumentError
from evenlight.data_schema.notebook import limit_html
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import Array, described, quantity, record, share
from evenlight.data_schema.rate_limit_kinds import BandKind as BandKind
from evenlight.data_schema.rate_limit_kinds import RateLimitForm as RateLimitForm
from evenlight.data_schema.rate_limit_kinds import RateLimitModel as RateLimitModel
from evenlight.data_schema.rate_limit_kinds import Sigmoid as Sigmoid
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.data_schema.storage.text_files import save_record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from evenlight.data_schema.arrays import Array

LOWEST_LUMINANCE = 1e-6  # [cd/m^2] the dark-adapted eye sees nothing below
LARGEST_LN_RATE = 50.0  # either way: e^50 is 5e21, far from any eye and from overflow
LARGEST_RATE = 1e9  # [cd/m^2/s] a thousand times a blinding luminance, within a second
ROUNDING = 1e-6  # relative, of numbers written with few digits
# Of what a fit wrote, the curve lies in its band, and its thresholds on average within a factor of 2 of what
# is known (660 limits of simulated data sets; docs/decisions/wide-bands.md).
BAND_SLACK = 0.02  # share of the rate: coefficients copied with three digits
FARTHEST_POINTS = math.log(3.0)  # mean distance from thresholds to the band, or to a curve without one
POINTS_BEYOND = 1.1  # times the luminances measured: a display measured again joins levels 5 % apart
MEND = "take the file as `evenlight fit` wrote it, or fit again"
MOST_GUESSES, MOST_LAPSES = 0.74, 0.24  # with more, no rate is detected in 75 % of the trials
SAMPLES = 201  # positions at which the polynomial is looked at: finer than a polynomial of degree 20 bends
# Upper over lower edge: as far as thresholds of 95 % of people reach (SD 0.35 of ln: e^(2 · 1.96 · 0.35)).
# A wider band tells no more of the median than one person picked at random (docs/decisions/wide-bands.md).
WIDEST_USABLE_BAND = 4.0


@record
class RateLimit:
    """The rate of luminance change ΔL that is detected in 75 % of the trials, as a function of luminance L.

    It is the paper's definition, for the median participant, who watches a plain screen for it and never
    lapses; half of the participants detect slower changes as often. What "detected" means is the task's: in
    yes/no, as in the paper, the change is noticed in 75 % of the trials; of two intervals the right one is
    identified in 75 % (d′ = 0.95), which slower changes allow. Limits of the two tasks do not compare.

    With z = L (or ln L for `LOG_LOG`) mapped linearly from `luminance_range` to [-1, 1], the polynomial is
    Σ_k coefficients[k] · P_k(z), P_k the Legendre polynomials. Outside the measured range it is not used:
    below, the relative rate is held constant; above, the rate is (see `method.rate_limit`). A rate limit
    can be called: `limit(luminance)` is ΔL there.
    """

    SAVED_AS: ClassVar = ".json"
    save = save_record
    name: str = described("name of the rate limit")
    display_name: str = described("display that it was fitted on; it holds for no other")
    display_fingerprint: str = described("identity of that display's photometry")
    form: RateLimitForm = described("what the polynomial describes, and over what")
    coefficients: tuple[float, ...] = quantity(
        "1",
        "Legendre coefficients, constant term first: of ln(cd/m^2/s), or of cd/m^2/s for the form rate",
        min_items=1,
    )
    luminance_range: tuple[float, float] = quantity(
        "cd/m^2", "lowest and highest luminance measured; the same for a constant", minimum=LOWEST_LUMINANCE
    )
    band_luminance: tuple[float, ...] = quantity(
        "cd/m^2", "luminances at which the band is sampled; empty without a band", above=0.0, default=()
    )
    band_lower: tuple[float, ...] = quantity(
        "cd/m^2/s", "lower edge of the confidence band", minimum=0.0, default=()
    )
    band_upper: tuple[float, ...] = quantity(
        "cd/m^2/s", "upper edge of the confidence band", minimum=0.0, default=()
    )
    band_level: float = share("confidence level of the band, by its kind", above=0.0, default=0.95)
    point_luminance: tuple[float, ...] = quantity(
        "cd/m^2", "luminances of the thresholds that it was fitted to", above=0.0, default=()
    )
    point_rate: tuple[float, ...] = quantity(
        "cd/m^2/s", "thresholds that it was fitted to", above=0.0, default=()
    )
    condition_number: float | None = quantity(
        "1", "condition number of the least-squares design in this basis", minimum=1.0, default=None
    )
    display_fingerprints: tuple[str, ...] = described(
        "identities of all calibrations of that display that its ramps were shown on; empty if it is one",
        default=(),
    )
    simulated: bool = described("true if the participants were simulated", default=False)
    source: str = described("where it comes from", default="")
    provenance: Provenance | None = described("how the file was made", default=None)
    procedure: Procedure | None = described(
        "what the participants were asked; null if not known", default=None
    )
    direction: Direction | None = described(
        "which way the luminance of the ramps went; null if not known", default=None
    )
    ramp_duration: float | None = quantity(
        "s", "duration of the ramps; null if not known", above=0.0, default=None
    )
    model: RateLimitModel | None = described(
        "how answers became the curve: joint, individual or pooled; null if not known", default=None
    )
    band_kind: BandKind = described(
        "what the band holds at its level: the curve at any one luminance, or all of it",
        default=BandKind.POINTWISE,
    )
    monotone: bool = described(
        "true if the curve was kept from falling with luminance, and its band narrowed to such curves if it "
        "holds any",
        default=False,
    )
    width: float | None = quantity(
        "1",
        "width of the median participant's psychometric function: ln(rate) from 5 % to 95 % of its rise; "
        "null if not known",
        above=0.0,
        default=None,
    )
    guess_rate: float | None = quantity(
        "1",
        "their guess rate: P(yes) with nothing to see, or chance of two intervals; null if not known",
        minimum=0.0,
        maximum=MOST_GUESSES,
        default=None,
    )
    lapse_rate: float | None = quantity(
        "1",
        "their lapse rate: P(no) with everything to see; null if not known",
        minimum=0.0,
        maximum=MOST_LAPSES,
        default=None,
    )
    width_range: tuple[float, float] | None = quantity(
        "1", "95 % interval of that width; null if not known", above=0.0, default=None, later=True
    )
    participant_sd: float | None = quantity(
        "1",
        "standard deviation of ln(threshold) between people at one luminance; null if not known",
        minimum=0.0,
        default=None,
        later=True,
    )
    noticed: float | None = share(
        "share of detections, beyond guesses and lapses, that the curve was moved to; null: as fitted, 75 % "
        "of the trials",
        above=0.0,
        default=None,
        later=True,
    )
    display: Display | None = described(
        "the display that it was fitted on; null in files of earlier versions", default=None, unhashed=True
    )

    def __post_init__(self) -> None:
        low, high = self.luminance_range
        if not (low < high or (low == high and len(self.coefficients) == 1)):
            raise ValueError(
                f"luminance_range_cd_m2 must rise (or be one luminance, for a constant), "
                f"got {low:g} to {high:g}"
            )
        if not len(self.band_luminance) == len(self.band_lower) == len(self.band_upper):
            raise ValueError("the three band lists must be equally long")
        if len(self.point_luminance) != len(self.point_rate):
            raise ValueError("point_luminance_cd_m2 and point_rate_cd_m2_s must be equally long")
        if self.display is not None and not self.holds_for(self.display):
            raise ValueError(
                f"display has other photometry ({self.display.fingerprint}) than display_fingerprint "
                f"({self.display_fingerprint}); {MEND}"
            )
        self._check_band()
        self._check_size()
        self._check_curve_in_band()
        self._check_points()

    def __repr__(self) -> str:
        low, high = self.luminance_range
        form = f"{self.form.value} of degree {len(self.coefficients) - 1}"
        return f"<RateLimit {self.name!r}: {form}, {low:g} to {high:g} cd/m^2, display {self.display_name!r}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the limit at five luminances, with its band."""
        return limit_html(self)

    def __call__(self, luminance: ArrayLike) -> Array:
        """Return ΔL [cd/m^2/s] at luminances L.

        Outside the measured luminances the polynomial means nothing. Below them the relative rate ΔL/L is
        held (thresholds are near-Weber), above them the rate is (see
        docs/decisions/rate-constraint.md).

        Parameters
        ----------
        luminance : array_like, any shape
            L [cd/m^2], at least 0.

        Returns
        -------
        array, shape of luminance
            ΔL [cd/m^2/s]; 0 at L = 0, and where a polynomial of the rate itself falls below 0.

        >>> flat = RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0))
        >>> flat([5.0, 10.0, 50.0, 200.0]).tolist()
        [1.0, 2.0, 2.0, 2.0]
        """
        import numpy as np  # records are light to import: commands know them all before they do anything
        from numpy.polynomial import legendre

        values = numbers("luminance", luminance)
        if (values < 0).any():
            raise ArgumentError("luminance", f"must be at least 0 cd/m^2, got {values.min():g}")
        low, high = self.luminance_range
        held = np.minimum(values, low) / low
        inside = np.clip(values, low, high)
        if self.form is RateLimitForm.LOG_LOG:
            inside, low, high = np.log(inside), math.log(low), math.log(high)
        position = (2 * inside - low - high) / ((high - low) or 1.0)  # of one luminance: 0
        value = legendre.legval(position, np.asarray(self.coefficients))
        rate = np.maximum(value, 0.0) if self.form is RateLimitForm.RATE else np.exp(value)
        return np.asarray(rate * held)

    def holds_for(self, display: Display) -> bool:
        """Return whether it was fitted on a display, by any of the calibrations that its ramps ran on."""
        return display.fingerprint in (self.display_fingerprint, *self.display_fingerprints)

    @property
    def at_limit_in_words(self) -> str:
        """What happens to a change at the limit, as its task has it, for a sentence."""
        if self.noticed is not None:
            return f"noticed in {100 * self.noticed:g} % of the trials, beyond guesses and lapses"
        found = {Procedure.YES_NO: "noticed", Procedure.TWO_INTERVAL: "identified correctly"}
        return f"{found[self.procedure] if self.procedure else 'detected'} in 75 % of the trials"

    @property
    def task_in_words(self) -> str:
        """What was asked and shown; empty if that is not known.

        >>> asked = {"procedure": Procedure.YES_NO, "direction": Direction.DOWN, "ramp_duration": 5.0}
        >>> RateLimit("r", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0), **asked).task_in_words
        'yes/no, falling ramps of 5 s'
        """
        asked = {Procedure.YES_NO: "yes/no", Procedure.TWO_INTERVAL: "two intervals"}
        words = [asked[self.procedure]] if self.procedure else []
        if self.direction and self.ramp_duration:
            way = "falling" if self.direction is Direction.DOWN else "rising"
            words.append(f"{way} ramps of {self.ramp_duration:g} s")
        return ", ".join(words)

    @property
    def band_words(self) -> str:
        """The level and the kind of the band, for a sentence."""
        return f"{100 * self.band_level:g} % {self.band_kind.value} band"

    @property
    def widest_band(self) -> tuple[float, float, float] | None:
        """Where the band is widest [cd/m^2], and its edges there [cd/m^2/s]; None without a band.

        >>> band = {"band_luminance": (1.0, 9.0), "band_lower": (0.5, 0.1), "band_upper": (1.0, 1.0)}
        >>> RateLimit("r", "d", "", RateLimitForm.RATE, (0.7,), (1.0, 9.0), **band).widest_band
        (9.0, 0.1, 1.0)
        """
        places = zip(self.band_luminance, self.band_lower, self.band_upper, strict=True)
        return max(places, key=_width, default=None)

    @property
    def wide_band(self) -> str:
        """How wide the band is, in words, if that is too wide for use; else empty.

        A limit that a model gave, but without a band, is known no better. Of presets, older files and tables
        of points nothing is known, and nothing said.
        """
        widest = self.widest_band
        if widest is None:
            return f"fitted by the {self.model.value} model, it has no band" if self.model else ""
        if _width(widest) <= WIDEST_USABLE_BAND:
            return ""
        at, lower, upper = widest
        ratio = f", a ratio of {_width(widest):.3g}" if lower else ""
        return (
            f"at {at:.4g} cd/m^2 its {self.band_words} reaches from {lower:.3g} to {upper:.3g} cd/m^2/s"
            f"{ratio}; at most {WIDEST_USABLE_BAND:g} is of use"
        )

    def _check_band(self) -> None:
        luminance, (low, high) = self.band_luminance, self.luminance_range
        if not luminance:
            return
        if not all(a < b for a, b in itertools.pairwise(luminance)):
            raise ValueError("band_luminance_cd_m2 must rise from number to number")
        if luminance[0] > low * (1 + ROUNDING) or luminance[-1] < high * (1 - ROUNDING):
            raise ValueError(
                f"band_luminance_cd_m2 must cover luminance_range_cd_m2, {low:g} to {high:g}, "
                f"got {luminance[0]:g} to {luminance[-1]:g}"
            )
        for at, lower, upper in zip(luminance, self.band_lower, self.band_upper, strict=True):
            if lower > upper:
                raise ValueError(
                    f"need band_lower_cd_m2_s <= band_upper_cd_m2_s, "
                    f"got {lower:g} and {upper:g} at {at:g} cd/m^2"
                )

    def _check_size(self) -> None:
        """Refuse coefficients whose rate no eye could have, and no computer could write down."""
        import numpy as np
        from numpy.polynomial import legendre

        with np.errstate(all="ignore"):  # of what is too large by far
            values = legendre.legval(np.linspace(-1, 1, SAMPLES), np.asarray(self.coefficients))
        worst = float(values[np.argmax(np.where(np.isfinite(values), np.abs(values), math.inf))])
        if self.form is RateLimitForm.RATE:  # below 0 it counts as 0, so only its height matters
            worst = float(values.max()) if math.isfinite(worst) else worst
            if not -math.inf < worst <= LARGEST_RATE:
                raise ValueError(
                    f"coefficients give a rate of {worst:.4g} cd/m^2/s within luminance_range_cd_m2; "
                    f"need at most {LARGEST_RATE:g}"
                )
            if worst < 0:
                raise ValueError(
                    f"coefficients give a rate below 0 at all of luminance_range_cd_m2, at most {worst:.4g} "
                    "cd/m^2/s: no change would be slow enough; need one of 0 or more somewhere"
                )
        elif not abs(worst) <= LARGEST_LN_RATE:
            raise ValueError(
                f"coefficients give ln(rate) = {worst:.4g} within luminance_range_cd_m2; need "
                f"{-LARGEST_LN_RATE:g} to {LARGEST_LN_RATE:g} (is it the rate itself? then form = rate)"
            )

    def _check_curve_in_band(self) -> None:
        """Refuse a curve that leaves its own band: one of the two was changed."""
        low, high = self.luminance_range
        band = zip(self.band_luminance, self.band_lower, self.band_upper, strict=True)
        for (at, lower, upper), rate in zip(band, self._curve(self.band_luminance), strict=True):
            measured = low * (1 - ROUNDING) <= at <= high * (1 + ROUNDING)
            if measured and not lower * (1 - BAND_SLACK) <= rate <= upper * (1 + BAND_SLACK):
                raise ValueError(
                    f"the curve contradicts its own band: at {at:.4g} cd/m^2 the coefficients give "
                    f"{rate:.3g} cd/m^2/s, and the band reaches from {lower:.3g} to {upper:.3g}; {MEND}"
                )

    def _check_points(self) -> None:
        """Refuse thresholds that are of another curve: far from its band, or from itself without one."""
        low, high = self.luminance_range
        levels: dict[float, list[float]] = {}
        for at, rate in zip(self.point_luminance, self.point_rate, strict=True):
            if not low / POINTS_BEYOND <= at <= high * POINTS_BEYOND:
                raise ValueError(
                    f"point_luminance_cd_m2 must lie in luminance_range_cd_m2, {low:g} to {high:g}, "
                    f"got {at:g}; {MEND}"
                )
            levels.setdefault(at, []).append(rate)
        curve = dict(zip(levels, self._curve(tuple(levels)), strict=True))
        distances = {at: self._distance(at, rates, curve[at]) for at, rates in levels.items()}
        if levels and fmean(distances.values()) > FARTHEST_POINTS:
            worst = max(distances, key=lambda at: distances[at])
            rates = levels[worst]
            raise ValueError(
                f"the {'band' if self.band_luminance else 'curve'} contradicts the points that it was fitted "
                f"to: at {worst:.4g} cd/m^2 the curve is {curve[worst]:.3g} cd/m^2/s, and the "
                f"thresholds there are {min(rates):.3g} to {max(rates):.3g}; {MEND}"
            )

    def _distance(self, at: float, rates: Sequence[float], curve: float) -> float:
        """Return how far the thresholds at a luminance lie from what is known there, as a logarithm.

        Of a polynomial of the rate itself, whose errors are not relative, as a share of the mean threshold.
        """
        import numpy as np

        known = [curve]
        if self.band_luminance:
            edges = (self.band_lower, self.band_upper)
            known = [float(np.interp(at, self.band_luminance, edge)) for edge in edges]
        above, below = min(rates) - max(known), min(known) - max(rates)
        if above <= 0 and below <= 0:
            return 0.0
        if self.form is RateLimitForm.RATE:
            return max(above, below) / fmean(self.point_rate)
        return math.log(min(rates) / max(known) if above > 0 else min(known) / max(rates))

    def _curve(self, luminances: tuple[float, ...]) -> list[float]:
        """Return the polynomial's rates at luminances, which are moved into those measured [cd/m^2/s]."""
        if not luminances:
            return []
        import numpy as np

        rates: list[float] = self(np.clip(luminances, *self.luminance_range)).tolist()
        return rates


def _width(edges: tuple[float, float, float]) -> float:
    """Return the ratio of upper to lower edge of (luminance, lower, upper)."""
    _, lower, upper = edges
    return upper / lower if lower > 0 else math.inf
