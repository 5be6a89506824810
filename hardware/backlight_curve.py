"""The luminance of a display over the factor that its backlight is set to, as a sweep measured it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.sweep_fit import LuminanceLevel
from evenlight.data_schema.text_files import read_rows

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

FEWEST = 3  # levels: two tell nothing of a bend
FULL = 1e-6  # a backlight at its highest step is at factor 1


@dataclass(frozen=True, slots=True)
class BacklightCurve:
    """What a backlight makes of the factors that it is set to; both rise.

    Attributes
    ----------
    factors : tuple of float
        Factors that the device had taken, in (0, 1]; the last is 1.
    luminances : tuple of float
        What the backlight made of the white screen then, without reflected light [cd/m^2], or its share.
    """

    factors: tuple[float, ...]
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
    levels = sorted((row.achieved_factor, row.share if shared else row.luminance) for row in rows)
    try:
        return BacklightCurve(
            tuple(factor for factor, _ in levels), tuple(float(light or 0.0) for _, light in levels)
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
