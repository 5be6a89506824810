"""The paper's table of powers: which luminance, brightness factor and saving each of its watts stands for.

Also what follows from the printed numbers on adaptation and online control.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenlight.analysis.audit.rows import ALL, row
from evenlight.analysis.measurement.sweeps.power_fit import LineFit, fit_line, points_of
from evenlight.analysis.published import SEQUENCES, published, published_values
from evenlight.data_schema.analysis_results import Origin, Statistic

PRINTED_STEP = 0.001  # [W] of the table
CURRENT_STEP = 0.01  # [A] of the samples behind P(L)
OF_FULL = "factor on P(L), full brightness as in Table 3"
OF_PEAK = "factor on P(L), peak of 750 cd/m^2"
OF_SAMPLES = "factor between the samples, peak of 750 cd/m^2"
ON_LINE = "P(L) = 0.001858 L + 0.2945 W inverted; bounds from the printed digits"


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
    """Return the straight line through the samples behind P(L), fitted again."""
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


def power_statistics() -> tuple[Statistic, ...]:
    """Return every number of the section on power."""
    powers = table_powers()
    rows = [s for power in powers for s in _rows_of(power)]
    digits = "bounds from the printed digits"
    for sequence in SEQUENCES:
        ours, baseline = (published(f"power.{sequence}.{v}").number for v in ("ours", "baseline"))
        more, share = ours - baseline, 100 * (ours / baseline - 1)
        rows += [
            row("power", sequence, "power of ours less baseline", more, unit="W", ci_low=more - PRINTED_STEP,
                ci_high=more + PRINTED_STEP, interval=1.0, method=digits),
            row("power", sequence, "power of ours over baseline, less 1", share, unit="%", method="Table 3"),
        ]  # fmt: skip
    fit, line = refitted_line(), nominal_line()
    n, how = len(sample_luminance()), "least squares through the authors' samples"
    bend = "height of the best parabola over its chord, as a share of the power that light adds"
    rows += [
        row("power_model", ALL, what, value, unit=unit, ci_low=ends[0], ci_high=ends[1], interval=0.95, n=n,
            method=how, origin=Origin.AUTHORS)
        for what, value, ends, unit in (
            ("slope, refitted", fit.slope, fit.slope_interval, "W m^2/cd"),
            ("base power, refitted", fit.base_power, fit.base_power_interval, "W"),
        )
    ]  # fmt: skip
    rows.append(
        row("power_model", ALL, "bend of the samples against a straight line", fit.bend, p_value=fit.bend_p,
            n=n, method=bend, origin=Origin.AUTHORS)
    )  # fmt: skip
    through = "straight line through the baseline's powers over their nominal factors"
    for what, value in (
        ("power at factor 0 on the nominal line", line.base),
        ("power at factor 1 on the nominal line", line.at_full),
        ("largest miss of the nominal line", line.largest_miss),
    ):
        rows.append(row("power_model", ALL, what, value, unit="W", n=len(SEQUENCES), method=through))
    return tuple(rows)


def _rows_of(power: TablePower) -> list[Statistic]:
    """Return what one power of the table stands for."""
    group = f"{power.sequence}, {power.version}"
    half = PRINTED_STEP / 2 / published("power_model.slope").number
    bounds = {"ci_low": power.luminance - half, "ci_high": power.luminance + half, "interval": 1.0}
    rows = [
        row("power", group, "luminance on P(L)", power.luminance, unit="cd/m^2", method=ON_LINE, **bounds)
    ]
    if power.version == "full":
        return rows
    between = power.factor_of_samples
    resolution = f"read between the samples, whose current is known to {1000 * CURRENT_STEP:g} mA"
    return [
        *rows,
        row("power", group, "nominal brightness factor", power.nominal_factor, method="Table 2",
            origin=Origin.PUBLISHED),
        row("power", group, OF_FULL, power.factor_of_full, method=ON_LINE),
        row("power", group, OF_PEAK, power.factor_of_peak, method=ON_LINE, origin=Origin.AUTHORS),
        row("power", group, OF_SAMPLES, between, method=resolution, origin=Origin.AUTHORS,
            flag="" if between is not None else "beyond the samples"),
        row("power", group, "power saved against full brightness", 100 * power.saving, unit="%",
            method="Table 3"),
    ]  # fmt: skip


def other_statistics() -> tuple[Statistic, ...]:
    """Return what follows from the tables of adaptation and of online control."""
    rows = []
    for sequence in SEQUENCES:
        name = f"adaptation.{sequence}"
        constrained, free = (published(f"{name}.{c}").number for c in ("constrained", "unconstrained"))
        method = "constrained over unconstrained difference of cone responses, Table 2"
        rows.append(
            row("adaptation", sequence, "share left by the constraint", constrained / free, method=method)
        )
    ours, baseline = (published(f"online.sd_{v}").number for v in ("ours", "baseline"))
    low, high = ((ours - s * 0.005) / (baseline + s * 0.005) for s in (1, -1))
    what = "standard deviation of contrast loss, ours over baseline"
    flag = "one session; how far the ratio is known is not printed"
    rows.append(
        row("online", "house", what, ours / baseline, ci_low=low, ci_high=high, interval=1.0, n=1,
            method="bounds from the printed digits", flag=flag)
    )  # fmt: skip
    return tuple(rows)
