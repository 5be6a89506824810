"""The paper's table of powers: which luminance, brightness factor and saving each of its watts stands for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.analysis.measurement.power_fit import LineFit, fit_line, points_of
from evenlight.analysis.published import SEQUENCES, published, published_values

PRINTED_STEP = 0.001  # [W] of the table
CURRENT_STEP = 0.01  # [A] of the samples behind P(L)


@dataclass(frozen=True, slots=True)
class TablePower:
    """One power of the table.

    Attributes
    ----------
    sequence, version : str
        Which; the version is "baseline", "ours" or "full".
    power, full_power : float
        As printed, and that of the sequence at full brightness [W].
    nominal_factor : float
        The brightness factor that the version was made for; 1 for full brightness.
    """

    sequence: str
    version: str
    power: float
    full_power: float
    nominal_factor: float

    @property
    def luminance(self) -> float:
        """L on the published line P(L) [cd/m^2]."""
        return float(line_luminance(self.power))

    @property
    def factor_of_full(self) -> float:
        """Luminance over that at full brightness, both on the published line [1]."""
        return self.luminance / float(line_luminance(self.full_power))

    @property
    def factor_of_peak(self) -> float:
        """Luminance on the published line over the panel's measured peak [1]."""
        return self.luminance / max(sample_luminance())

    @property
    def factor_of_samples(self) -> float | None:
        """The same with L read between the measured samples in place of the line; None beyond them [1]."""
        luminance, power = sample_luminance(), sample_power()
        if not min(power) <= self.power <= max(power):
            return None
        between = np.interp(self.power, power[::-1], luminance[::-1])
        return float(between) / max(luminance)

    @property
    def saving(self) -> float:
        """Power saved against full brightness, as a share of it [1]."""
        return 1 - self.power / self.full_power


def line_luminance(power: float) -> float:
    """Return the luminance at which the published line has a power [cd/m^2].

    >>> round(line_luminance(1.800))  # (1.800 - 0.2945) / 0.001858
    810
    """
    return (power - published("power_model.base").number) / published("power_model.slope").number


def table_powers() -> tuple[TablePower, ...]:
    """Return the powers of the table, sequence by sequence: baseline, ours, full."""
    return tuple(
        TablePower(
            sequence,
            version,
            published(f"power.{sequence}.{version}").number,
            published(f"power.{sequence}.full").number,
            1.0 if version == "full" else published(f"adaptation.{sequence}.factor").number,
        )
        for sequence in SEQUENCES
        for version in ("baseline", "ours", "full")
    )


def sample_luminance() -> tuple[float, ...]:
    """Return the luminances of the samples behind P(L), falling [cd/m^2]."""
    samples = published_values("authors_power")
    return tuple(value.number for value in samples if value.name.endswith(".luminance"))


def sample_power() -> tuple[float, ...]:
    """Return the powers of the samples behind P(L), falling [W].

    >>> sample_power()[0]  # 5 V times 0.35 A
    1.75
    """
    voltage = published("authors_power.voltage").number
    samples = published_values("authors_power")
    return tuple(voltage * value.number for value in samples if value.name.endswith(".current"))


def refitted_line() -> LineFit:
    """Return the straight line through the samples behind P(L), fitted anew."""
    luminance = sample_luminance()
    return fit_line(points_of(luminance, sample_power(), [L / max(luminance) for L in luminance]))


@dataclass(frozen=True, slots=True)
class NominalLine:
    """A straight line through the baseline's powers over the factors that they were made for.

    Attributes
    ----------
    base, slope : float
        At factor 0, and for a factor of 1 more [W].
    largest_miss : float
        Of the four powers [W].
    at_full : float
        What it has at factor 1 [W].
    """

    base: float
    slope: float
    largest_miss: float
    at_full: float


def nominal_line() -> NominalLine:
    """Return the line through the baseline's powers over their nominal factors."""
    baseline = [p for p in table_powers() if p.version == "baseline"]
    factors, powers = [p.nominal_factor for p in baseline], [p.power for p in baseline]
    slope, base = np.polyfit(factors, powers, 1)
    miss = np.abs(np.polyval([slope, base], factors) - powers).max()
    return NominalLine(float(base), float(slope), float(miss), float(base + slope))
