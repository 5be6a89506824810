"""The measured power of a played video: each version's average, as the paper's power table, and in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evenlight.analysis.measurement.played_power.clock_fit import fit_clock
from evenlight.analysis.measurement.played_power.clock_line import line_of
from evenlight.analysis.measurement.played_power.pass_power import (
    ENOUGH,
    VERSIONS,
    PassComparison,
    equal_power,
    frame_energies,
    frame_spans,
    pass_powers,
    version_powers,
)
from evenlight.analysis.measurement.played_power.power_recording import Recording, count_samples
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.instrument_logs import PowerLog
from evenlight.data_schema.recordings.played_power import (
    ClockFit,
    FrameEnergy,
    FrameFlag,
    PassPower,
    PlayedPower,
    SampleCount,
    VersionPower,
)

FAR_OFF = 0.1  # of what a power model predicts
FINEST = 0.001  # [ms] that is said of a clock: no flip is known better
MANY_LOST = 0.05  # share of the time that had to be bridged
KNOWN = 0.01  # to which a frame's energy should be known
NAMES = {"ours": "ours", "baseline": "baseline", "full": "full brightness"}


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredPower:
    """What was measured of a played video.

    Attributes
    ----------
    power, energies : PlayedPower, sequence of FrameEnergy
        Passes, versions and clock; and the frames.
    """

    power: PlayedPower
    energies: Sequence[FrameEnergy]


def measure_power(
    recording: Recording, power_model: PowerModel | None = None, origin: Provenance | None = None
) -> MeasuredPower:
    """Return energies of frames and average powers of versions.

    Parameters
    ----------
    recording, origin : Recording, Provenance, optional
        What was played and sampled, and where it comes from.
    power_model : PowerModel, optional
        Whose prediction is shown beside it.

    Raises
    ------
    InputError
        If no pass was measured well enough.
    """
    log = recording.log
    clock = fit_clock(recording)
    spans = frame_spans(recording.flips, log.refresh_rate)
    energies = frame_energies(recording.samples, spans, line_of(clock))
    passes = pass_powers(energies, recording.flips, log)
    comparison = PassComparison(passes)
    versions = version_powers(energies, comparison, _prediction(power_model))
    if not versions:
        raise InputError(_nothing_measured(recording, passes))
    samples = count_samples(recording.samples, recording.n_duplicated)
    full = next((one.mean_power for one in versions if one.version == "full"), None)
    power = PlayedPower(
        simulated=log.simulated,
        video=log.video,
        duration=log.duration,
        refresh_rate=log.refresh_rate,
        sample_rate=log.sample_rate,
        clock=clock,
        samples=samples,
        passes=passes,
        versions=versions,
        equal_power=equal_power(comparison, full),
        drift_w_h=comparison.drift,
        power_model="" if power_model is None else power_model.name,
        notes=_notes(log, clock, samples, energies, passes, versions, power_model),
        provenance=origin or Provenance(),
    )
    return MeasuredPower(power, energies)


def _prediction(model: PowerModel | None) -> Callable[[float], float] | None:
    """Return what a model predicts of a mean factor: nothing of an OLED panel, whose content decides."""
    if model is None or model.kind is PanelKind.OLED:
        return None
    slope = model.power_per_luminance * model.peak_luminance
    return lambda factor: model.base_power + slope * factor


def _nothing_measured(recording: Recording, passes: Sequence[PassPower]) -> str:
    """Return why no pass counts."""
    best = max(one.measured_share for one in passes)
    samples, flips = recording.samples, recording.flips
    lasted = float(samples.device_time[-1] - samples.device_time[0])
    played = float(flips.flip[-1] - flips.flip[0])
    return (
        f"{recording.where}: no pass has power for {100 * ENOUGH:.0f} % of the video (at most "
        f"{100 * best:.0f} %); samples came for {lasted:.3g} s, and {played:.3g} s were "
        "played. Measure again, with the meter on from the first marker to the last"
    )


def _notes(
    log: PowerLog,
    clock: ClockFit,
    samples: SampleCount,
    energies: Sequence[FrameEnergy],
    passes: Sequence[PassPower],
    versions: Sequence[VersionPower],
    model: PowerModel | None,
) -> tuple[str, ...]:
    """Return what a reader should be warned of, as sentences."""
    n, flags = len(energies), Counter(frame.flag for frame in energies)
    lasts = sorted(frame.duration for frame in energies)[n // 2]
    used = Counter(one.version for one in passes if one.used)
    ratios = [v.mean_power / v.predicted_power for v in versions if v.predicted_power and v.mean_power > 0]
    return prose(
        "power_notes",
        log=log,
        clock=clock,
        samples=samples,
        passes=passes,
        model=model,
        n=n,
        outside=flags[FrameFlag.OUTSIDE],
        in_gaps=flags[FrameFlag.GAP],
        unresolved=flags[FrameFlag.UNRESOLVED],
        off=0.0 if clock.bound is None else (0.25 / log.sample_rate + clock.bound) / lasts,
        unmeasured=[version for version in VERSIONS if not used[version]],
        dropped=sum(one.n_dropped for one in passes),
        repeated=any(count > 1 for count in used.values()),
        ratios=ratios if any(abs(ratio - 1) > FAR_OFF for ratio in ratios) else (),
        many_lost=MANY_LOST,
        known=KNOWN,
        enough=ENOUGH,
        finest=FINEST,
        names=NAMES,
    )


def closing_lines(power: PlayedPower) -> tuple[str, ...]:
    """Return what came out, line by line."""
    return prose("power_lines", power=power, clock=clock_in_words(power.clock), names=NAMES, mw=_mw)


def main_findings(power: PlayedPower) -> str:
    """Return what came out, in a sentence or two: the lead of the report."""
    words = _comparisons(power)
    if not words:
        words = tuple(f"{NAMES[one.version]} takes {one.mean_power:.4g} W" for one in power.versions)
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in words).replace(" %", "\u00a0%")


def heading_in_words(power: PlayedPower) -> str:
    """Return what came out as the subtitle of a figure."""
    words = "; ".join(_comparisons(power)) or "one version was measured, and compared with no other"
    return words[0].upper() + words[1:]


def _comparisons(power: PlayedPower) -> tuple[str, ...]:
    """Return what ours saves, and whether it takes the same power as the baseline."""
    return prose("power_comparisons", power=power, mw=_mw)


def _mw(power: float) -> str:
    """Return a power in mW, with two decimals where it is small.

    >>> _mw(-0.000236), _mw(0.01718), _mw(0.1718), _mw(-0.000001)
    ('-0.24', '17.2', '172', '0.00')
    """
    value = 1000 * power
    decimals = 2 if abs(value) < 10 else 1 if abs(value) < 100 else 0
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # 0.0 is added for -0.0, which reads as less than 0


def clock_in_words(clock: ClockFit) -> str:
    """Return how the meter's clock was put on the computer's."""
    return prose("power_clock", clock=clock, finest=FINEST)[0]
