"""What a power sweep tells: the power model P(L), and how far it can be trusted."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evenlight.analysis.measurement.sweeps.luminance_sweep import SIMULATED, named
from evenlight.analysis.measurement.sweeps.power_fit import (
    TOLERATED_DEVIATION,
    LineFit,
    PowerPoints,
    fit_line,
    points_of,
    slope_through,
)
from evenlight.analysis.measurement.sweeps.repeated_readings import (
    Noise,
    RelativeChange,
    Repeats,
    change_at_the_end,
    drifted,
    late_change,
    unsteady,
    untold,
)
from evenlight.analysis.measurement.sweeps.suspects import without_suspects
from evenlight.analysis.measurement.sweeps.sweep_loading import Sweep
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.sweep import PowerReading, PowerSweepDesign, SweepPhase
from evenlight.data_schema.recordings.sweep_fit import LuminanceSource, PowerFit, PowerLevel, SweepFlag

MOST_LOST = 0.01  # share of samples: time-weighted means stand more, but something is wrong

Quantity = Callable[[PowerReading], float | None]


@dataclass(frozen=True, slots=True)
class PowerSweepFit:
    """A power sweep and all that was made of it.

    Attributes
    ----------
    sweep, used : Sweep, tuple of PowerReading
        What was read, and the readings that the line was fitted to.
    points, line : PowerPoints, LineFit
        Their luminance and power, and the fitted line.
    levels, record : tuple of PowerLevel, PowerFit
        Brightness factors, and the result.
    """

    sweep: Sweep[PowerReading]
    used: tuple[PowerReading, ...]
    points: PowerPoints
    line: LineFit
    levels: tuple[PowerLevel, ...]
    record: PowerFit


def fit_power_sweep(sweep: Sweep[PowerReading]) -> PowerSweepFit:
    """Return the power model of a power sweep.

    Raises
    ------
    InputError
        If there is neither a luminance nor a peak luminance to go by, too few levels have one, or power does
        not rise with it.
    """
    sweep = without_suspects(sweep)
    source = _source(sweep)
    luminance_of = _luminance(sweep, source)
    counted = [r for r in sweep.readings if r.phase is not SweepPhase.WARM_UP]
    pairs = [(r, luminance) for r in counted if (luminance := luminance_of(r)) is not None]
    used = tuple(r for r, _ in pairs)
    points = points_of([L for _, L in pairs], [r.power for r in used], [r.factor for r in used])
    line = _with_possible_base(fit_line(points), points)
    return PowerSweepFit(
        sweep=sweep,
        used=used,
        points=points,
        line=line,
        levels=tuple(_level_rows(used, points, line, source)),
        record=_record(sweep, used, points, line, source),
    )


def power_model_of(result: PowerSweepFit) -> PowerModel:
    """Return the measured power model; a simulated one says so in its name and source."""
    manifest, record = result.sweep.manifest, result.record
    by = {
        LuminanceSource.METER: f"luminance by {manifest.rig.luminance_meter}",
        LuminanceSource.FACTOR: f"luminance as factor times {record.peak_luminance:g} cd/m^2",
    }[record.luminance_source]
    source = (
        f"power sweep {manifest.session_id} with {manifest.rig.power_meter}, {by}: {record.n_readings} "
        f"readings of {record.n_levels} brightness factors"
    )
    if result.sweep.left_out:
        source += f"; suspect readings left out: {len(result.sweep.left_out)}"
    if not record.is_linear:
        source += f"; not linear, a level deviates by {100 * record.largest_deviation:+.1f} %"
    return PowerModel(
        name=record.display_name,
        kind=PanelKind.LCD,
        base_power=record.base_power,
        power_per_luminance=record.power_per_luminance,
        peak_luminance=record.peak_luminance,
        source=f"{SIMULATED} {source}" if manifest.simulated else source,
        measured="" if manifest.simulated else manifest.started,
        provenance=record.provenance,
    )


def _source(sweep: Sweep[PowerReading]) -> LuminanceSource:
    """Return where the luminances come from: the meter, if there was one."""
    if any(r.luminance_status is not None for r in sweep.readings):
        return LuminanceSource.METER
    if sweep.manifest.peak_luminance is None:
        raise InputError(
            f"power sweep {sweep.manifest.session_id}: has no luminances, and its display has no peak "
            "luminance to go by; measure with a luminance meter, or give the rig a measured display"
        )
    return LuminanceSource.FACTOR


def _luminance(sweep: Sweep[PowerReading], source: LuminanceSource) -> Quantity:
    """Return what tells the luminance of a reading, without reflected light [cd/m^2]."""
    design, peak = sweep.manifest.design, sweep.manifest.peak_luminance
    assert isinstance(design, PowerSweepDesign)
    reflected = design.reflected_luminance
    if source is LuminanceSource.METER:
        return lambda r: None if r.luminance is None else r.luminance - reflected
    return lambda r: r.achieved_factor * (peak or 0.0)


def _with_possible_base(line: LineFit, points: PowerPoints) -> LineFit:
    """Return the line, with a base power of 0 if it would be below and may as well be 0.

    Raises
    ------
    InputError
        If it is clearly below 0: no panel gives power.
    """
    low, high = line.base_power_interval
    if line.base_power >= 0:
        return replace(line, base_power_interval=(max(low, 0.0), high))
    if high < 0:
        raise InputError(
            f"the line through power over luminance crosses zero luminance at {line.base_power:.4g} W "
            f"({low:.4g} to {high:.4g} W), and no panel gives power; is there an offset in the power meter, "
            "or reflected light in the luminances?"
        )
    slope = slope_through(points, 0.0)
    ends = (min(line.slope_interval[0], slope), max(line.slope_interval[1], slope))
    return replace(line, base_power=0.0, base_power_interval=(0.0, high), slope=slope, slope_interval=ends)


def _level_rows(
    used: Sequence[PowerReading], points: PowerPoints, line: LineFit, source: LuminanceSource
) -> Iterable[PowerLevel]:
    """Return a row of `power_levels.csv` for each brightness factor."""
    for level in range(points.n_levels):
        own = points.level == level
        readings = [r for r, is_own in zip(used, own, strict=True) if is_own]
        luminance, power = points.luminance[own], points.power[own]
        model = float(line.power(luminance.mean()))
        metered = source is LuminanceSource.METER and luminance.size > 1
        yield PowerLevel(
            factor=readings[0].factor,
            achieved_factor=float(np.mean([r.achieved_factor for r in readings])),
            luminance=float(luminance.mean()),
            luminance_sd=statistics.stdev(luminance.tolist()) if metered else None,
            power=float(power.mean()),
            power_sd=statistics.stdev(power.tolist()) if power.size > 1 else None,
            n_readings=int(power.size),
            model_power=model,
            residual=float(power.mean()) - model,
        )


def _peak(used: Sequence[PowerReading], points: PowerPoints) -> float:
    """Return the luminance at b = 1: that of the highest factor, in proportion if it is below 1 [cd/m^2]."""
    highest = max(r.achieved_factor for r in used)
    at_top = np.array([r.achieved_factor == highest for r in used])
    return float(points.luminance[at_top].mean()) / highest


def _record(
    sweep: Sweep[PowerReading],
    used: Sequence[PowerReading],
    points: PowerPoints,
    line: LineFit,
    source: LuminanceSource,
) -> PowerFit:
    """Return the result as a record."""
    manifest, design = sweep.manifest, sweep.manifest.design
    changes = _changes(sweep, points, _luminance(sweep, source), source)
    drift, of_luminance, warm_up = changes
    left_out = sum(r.phase is not SweepPhase.WARM_UP for r in sweep.readings) - len(used)
    assert isinstance(design, PowerSweepDesign)
    return PowerFit(
        display_name=named(manifest.display_name, manifest.simulated),
        session_id=manifest.session_id,
        simulated=manifest.simulated,
        luminance_source=source,
        base_power=line.base_power,
        base_power_interval=line.base_power_interval,
        power_per_luminance=line.slope,
        power_per_luminance_interval=line.slope_interval,
        peak_luminance=_peak(used, points),
        reflected_luminance=design.reflected_luminance if source is LuminanceSource.METER else 0.0,
        n_readings=len(used),
        n_levels=points.n_levels,
        n_left_out=left_out,
        n_samples=sum(r.n_samples for r in used),
        n_lost=sum(r.n_lost for r in used),
        n_duplicated=sum(r.n_duplicated for r in used),
        residual_sd=line.residual_sd,
        r_squared=line.r_squared,
        lack_of_fit_f=line.lack_of_fit_f,
        lack_of_fit_p=line.lack_of_fit_p,
        bend=line.bend,
        bend_p=line.bend_p,
        largest_deviation=float(line.deviations[line.worst_level]),
        largest_deviation_luminance=float(line.level_luminance[line.worst_level]),
        is_linear=line.is_linear,
        drift=drift.share if drift else None,
        drift_interval=drift.interval if drift else None,
        luminance_drift=of_luminance.share if of_luminance else None,
        luminance_drift_interval=of_luminance.interval if of_luminance else None,
        warm_up_change=warm_up.share if warm_up else None,
        warm_up_interval=warm_up.interval if warm_up else None,
        flags=tuple(_flags(sweep, used, line, changes)),
        provenance=provenance_now(seed=manifest.provenance.seed, inputs=sweep.inputs),
        suspects=sweep.suspects,
    )


def _changes(
    sweep: Sweep[PowerReading], points: PowerPoints, luminance_of: Quantity, source: LuminanceSource
) -> tuple[RelativeChange | None, RelativeChange | None, RelativeChange | None]:
    """Return the changes of power and of luminance at the end, and that late in the warm-up."""
    metered = source is LuminanceSource.METER
    of_power, of_luminance = _noise(points, points.power), _noise(points, points.luminance)
    drift = change_at_the_end(_repeated(sweep, lambda r: r.power), of_power)
    luminance_drift = change_at_the_end(_repeated(sweep, luminance_of), of_luminance) if metered else None
    warm = sweep.of_phase(SweepPhase.WARM_UP)
    if metered:
        return drift, luminance_drift, late_change(_repeats(warm, luminance_of), of_luminance)
    return drift, luminance_drift, late_change(_repeats(warm, lambda r: r.power), of_power)


def _noise(points: PowerPoints, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Noise:
    """Return the noise of one number per reading; of readings without repeats, that of 1 %."""
    if np.bincount(points.level).max() < 2:
        return Noise(0.0, 0.01, 0)
    return points.noise_of(values)


def _repeated(sweep: Sweep[PowerReading], value: Quantity) -> list[tuple[Repeats, Repeats]]:
    """Return the readings of each factor that was repeated at the end: in the sweep, and then."""
    swept, last = sweep.of_phase(SweepPhase.SWEEP), sweep.of_phase(SweepPhase.DRIFT)
    return [
        (
            _repeats([r for r in swept if r.factor == factor], value),
            _repeats([r for r in last if r.factor == factor], value),
        )
        for factor in sorted({r.factor for r in last})
    ]


def _repeats(readings: Sequence[PowerReading], value: Quantity) -> Repeats:
    """Return one number and the time [s] of each reading that has it."""
    pairs = [(number, (r.begun + r.ended) / 2) for r in readings if (number := value(r)) is not None]
    values = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return Repeats(values[:, 0], values[:, 1])


def _flags(
    sweep: Sweep[PowerReading],
    used: Sequence[PowerReading],
    line: LineFit,
    changes: tuple[RelativeChange | None, RelativeChange | None, RelativeChange | None],
) -> Iterable[SweepFlag]:
    """Return what to look at."""
    drift, luminance_drift, warm_up = changes
    counted = [r for r in sweep.readings if r.phase is not SweepPhase.WARM_UP]
    lost = sum(r.n_lost for r in used)
    found = {
        SweepFlag.INCOMPLETE: not sweep.complete,
        SweepFlag.NOT_LINEAR: not line.is_linear,
        SweepFlag.DRIFTED: drifted(drift) or drifted(luminance_drift),
        SweepFlag.UNSTEADY: unsteady(warm_up),
        SweepFlag.WARM_UP_UNKNOWN: untold(warm_up),
        SweepFlag.SUSPECT_READINGS: bool(sweep.suspects),
        SweepFlag.REPEATS_APART: _apart(sweep),
        SweepFlag.LUMINANCE_MISSING: len(used) < len(counted),
        SweepFlag.SAMPLES_LOST: lost > MOST_LOST * (lost + sum(r.n_samples for r in used)),
        SweepFlag.BASE_POWER_ZERO: line.base_power == 0,
    }
    return (flag for flag, is_so in found.items() if is_so)


def _apart(sweep: Sweep[PowerReading]) -> bool:
    """Return whether the power readings of any level differ by more than 1 %."""
    by_level: dict[float, list[float]] = {}
    for reading in sweep.of_phase(SweepPhase.SWEEP):
        by_level.setdefault(reading.factor, []).append(reading.power)
    return any(max(v) - min(v) > TOLERATED_DEVIATION * abs(float(np.mean(v))) for v in by_level.values())
