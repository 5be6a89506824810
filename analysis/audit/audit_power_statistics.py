"""The table of powers and what else the paper prints, in rows: what follows from the printed numbers."""

from __future__ import annotations

from evenlight.analysis.audit.audit_power_table import (
    CURRENT_STEP,
    PRINTED_STEP,
    TablePower,
    nominal_line,
    refitted_line,
    sample_luminance,
    table_powers,
)
from evenlight.analysis.audit.audit_statistics import ALL, row
from evenlight.analysis.published import SEQUENCES, published
from evenlight.data_schema.statistic import Statistic

OF_FULL = "factor on P(L), full brightness as in Table 3"
OF_PEAK = "factor on P(L), peak of 750 cd/m^2"
OF_SAMPLES = "factor between the samples, peak of 750 cd/m^2"
ON_LINE = "P(L) = 0.001858 L + 0.2945 W inverted; bounds from the printed digits"


def power_statistics() -> tuple[Statistic, ...]:
    """Return every number of the section on power."""
    powers = table_powers()
    rows = [s for power in powers for s in _rows_of(power)]
    for sequence in SEQUENCES:
        ours, baseline = (published(f"power.{sequence}.{v}").number for v in ("ours", "baseline"))
        more = {"ci_low": ours - baseline - PRINTED_STEP, "ci_high": ours - baseline + PRINTED_STEP}
        rows.append(
            row(
                "power",
                sequence,
                "power of ours less baseline",
                ours - baseline,
                unit="W",
                interval=1.0,
                method="bounds from the printed digits",
                **more,
            )
        )
        share = 100 * (ours / baseline - 1)
        rows.append(
            row("power", sequence, "power of ours over baseline, less 1", share, unit="%", method="Table 3")
        )
    fit, line = refitted_line(), nominal_line()
    n, how = len(sample_luminance()), "least squares through the authors' samples"
    for what, value, ends, unit in (
        ("slope, fitted anew", fit.slope, fit.slope_interval, "W m^2/cd"),
        ("base power, fitted anew", fit.base_power, fit.base_power_interval, "W"),
    ):
        rows.append(
            row(
                "power_model",
                ALL,
                what,
                value,
                unit=unit,
                ci_low=ends[0],
                ci_high=ends[1],
                interval=0.95,
                n=n,
                method=how,
            )
        )
    rows.append(
        row(
            "power_model",
            ALL,
            "bend of the samples against a straight line",
            fit.bend,
            p_value=fit.bend_p,
            n=n,
            method="height of the best parabola over its chord, as a share of the power that light adds",
        )
    )
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
        row("power", group, "nominal brightness factor", power.nominal_factor, method="Table 2"),
        row("power", group, OF_FULL, power.factor_of_full, method=ON_LINE),
        row("power", group, OF_PEAK, power.factor_of_peak, method=ON_LINE),
        row("power", group, OF_SAMPLES, between, method=resolution,
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
    rows.append(
        row(
            "online",
            "house",
            "standard deviation of contrast loss, ours over baseline",
            ours / baseline,
            ci_low=low,
            ci_high=high,
            interval=1.0,
            n=1,
            method="bounds from the printed digits",
            flag="one session; how far the ratio is known is not printed",
        )
    )
    return tuple(rows)
