"""The luminance of a display over the factor of its backlight, and a backlight that is set by luminance."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep_fit import LuminanceLevel
from evenlight.data_schema.storage.tables import read_rows
from evenlight.hardware.backlights import ROUNDING, WrappedBacklight, require_factor
from evenlight.hardware.protocols import Backlight, InstrumentError

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

FEWEST = 3  # levels: two show no bend
FULL = 1e-6  # a backlight at its highest step is at factor 1
TOLERANCE = 1e-12  # of the logarithm of a factor: far finer than any device
LOOKED_AT = 200  # settings of a device, for its widest step of luminance


@dataclass(frozen=True, slots=True)
class BacklightCurve:
    """What a backlight makes of the factors that it is set to; both rise."""

    factors: tuple[float, ...]  # factors that the device had taken, in (0, 1]; the last is 1
    # what the backlight made of the white screen then, without reflected light [cd/m^2], or its share
    luminances: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.factors) != len(self.luminances) or len(self.factors) < FEWEST:
            raise ValueError(f"need at least {FEWEST} levels with a luminance each, got {len(self.factors)}")
        if abs(self.factors[-1] - 1) > FULL:
            raise ValueError(f"the levels must end at factor 1, the full backlight, got {self.factors[-1]:g}")
        if self.factors[0] <= 0 or self.luminances[0] <= 0:
            raise ValueError(
                f"factors and luminances must lie above 0, got {self.factors[0]:g} and {self.luminances[0]:g}"
            )
        levels = zip(self.factors, self.luminances, strict=True)
        for (factor, luminance), (higher_factor, higher) in itertools.pairwise(levels):
            if not (factor < higher_factor and luminance < higher):
                raise ValueError(
                    f"luminance must rise with the factor, got {luminance:g} at {factor:g} and {higher:g} at "
                    f"{higher_factor:g}; measure those levels again, with more readings"
                )

    def interpolator(self) -> PchipInterpolator:
        """Return ln of the share of the full luminance over ln of the factor.

        Piecewise cubic and monotone (Fritsch & Carlson 1980). In logarithms, since what counts of a dim
        level is its relative error, and since a power law is a straight line there.
        """
        from scipy.interpolate import PchipInterpolator

        full = self.luminances[-1]
        return PchipInterpolator(
            [math.log(factor / self.factors[-1]) for factor in self.factors],
            [math.log(luminance / full) for luminance in self.luminances],
        )


def read_backlight_curve(path: Path) -> BacklightCurve:
    """Return the curve that a table of a luminance sweep (`brightness.csv`) holds.

    Parameters
    ----------
    path : Path
        A table of `LuminanceLevel`: the columns factor, achieved_factor and luminance_cd_m2 at least. Its
        column share, where it is filled, counts instead of the luminance, since reflected light is taken
        off there. Levels that were too dark for the meter, and those of pixel values, are left out.

    Raises
    ------
    InputError
        If it is no such table, or its luminances do not rise up to factor 1.
    """
    rows = [row for row in read_rows(LuminanceLevel, path) if row.factor is not None and row.luminance]
    shared = all(row.share is not None for row in rows)
    rows.sort(key=lambda row: row.achieved_factor)
    factors = tuple(row.achieved_factor for row in rows)
    try:
        measured = BacklightCurve(factors, tuple(float(row.luminance or 0.0) for row in rows))
        return BacklightCurve(factors, tuple(row.share or 0.0 for row in rows)) if shared else measured
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


class LinearizedBacklight(WrappedBacklight):
    """A backlight, set by the share of the full luminance that it is to make.

    Parameters
    ----------
    inner : Backlight
        The device; it is closed with this.
    curve : BacklightCurve
        What luminance it makes of its factors. Below the lowest that was measured nothing is guessed.

    >>> from evenlight.hardware.simulated.panel import SimulatedBacklight
    >>> square = BacklightCurve((0.1, 0.5, 1.0), (2.0, 50.0, 200.0))
    >>> backlight = LinearizedBacklight(SimulatedBacklight(lambda: 0.0, steps=100), square)
    >>> round(backlight.set_factor(0.25), 6), round(backlight.smallest_factor(), 6)
    (0.25, 0.01)
    """

    def __init__(self, inner: Backlight, curve: BacklightCurve) -> None:
        super().__init__(inner)
        self._log_share = curve.interpolator()
        self._lowest = max(curve.factors[0], inner.smallest_factor())
        self._refused = self._lowest - inner.step() / 2 - ROUNDING  # no step of the device is nearer

    def set_factor(self, factor: float) -> float:
        """Set the share of the full luminance, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such share, it was not measured so far down, or the device refuses.
        """
        require_factor(factor, self.smallest_factor(), "the backlight with its measured curve")
        return self._share(self._inner.set_factor(self._device_factor(factor)))

    def read_factor(self) -> float:
        """Return the share of the full luminance that the device reports by its factor."""
        return self._share(self._inner.read_factor())

    def smallest_factor(self) -> float:
        """Return the lowest share above 0 that was measured and can be set."""
        return self._share(self._lowest)

    def step(self) -> float:
        """Return the widest distance between the shares of two neighbouring settings."""
        step = self._inner.step()
        count = min(LOOKED_AT, round((1 - self._lowest) / step))
        lower = [self._lowest + (1 - step - self._lowest) * k / max(count - 1, 1) for k in range(count)]
        return max((self._share(one + step) - self._share(one) for one in lower), default=1.0)

    def _share(self, factor: float) -> float:
        if factor < self._refused:
            raise InstrumentError(
                f"the backlight stands at its factor {factor:.4g}, below {self._lowest:.4g}, the lowest that "
                "its curve was measured at; measure the curve further down, or ask for more"
            )
        return min(1.0, math.exp(float(self._log_share(math.log(min(factor, 1.0))))))

    def _device_factor(self, share: float) -> float:
        """Return the device's own factor for a share of the full luminance: the curve's inverse."""
        from scipy.optimize import brentq

        wanted, lowest = math.log(min(share, 1.0)), math.log(self._lowest)
        if wanted >= 0.0:
            return 1.0
        if wanted <= float(self._log_share(lowest)):
            return self._lowest
        root = brentq(lambda x: float(self._log_share(x)) - wanted, lowest, 0.0, xtol=TOLERANCE)
        return math.exp(float(root))
