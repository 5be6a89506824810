"""The measured power of a played video: its passes, and its versions as the paper's power table has them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from evenlight.analysis.played_power.clock_fit import fit_clock
from evenlight.analysis.played_power.clock_line import line_of
from evenlight.analysis.played_power.pass_power import (
    CONFIDENCE,
    VERSIONS,
    PassComparison,
    PowerEstimate,
    frame_energies,
)
from evenlight.analysis.played_power.power_recording import Flips, Recording, count_samples, load_recording
from evenlight.analysis.played_power.power_views import EQUAL_SHARE, MANY_LOST, NAMES, REPORT, MeasuredPower
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.instrument_logs import PowerLog
from evenlight.data_schema.recordings.played_power import (
    EqualPower,
    FrameEnergy,
    FrameFlag,
    PassPower,
    PlayedPower,
    VersionPower,
)

ENOUGH = 0.95  # share of a video that must be measured for a pass to count
FAR_OFF = 0.1  # of what a power model predicts
KNOWN = 0.01  # to which a frame's energy should be known


def write_power_results(
    folder: Path, out: Path, power_model: PowerModel | None = None, *, force: bool = False
) -> list[str]:
    """Write table, energies, figure and report of a played video's power, and return lines that sum it up.

    Parameters
    ----------
    folder, out : Path
        The recording, as `evenlight measure played` writes it, and where to; it may be the same.
    power_model : PowerModel, optional
        Whose prediction is shown beside what was measured.
    force : bool, optional
        As of `Result.save`.

    Raises
    ------
    InputError
        If the recording cannot be used; it names the file and what is wrong.
    """
    measured = measure_power(load_recording(folder), power_model)
    if out == folder:
        measured.write(out)
    else:
        measured.save(out, force=force)
    return [*measured.lines, f"power of the video: {out / REPORT}"]


def measure_power(recording: Recording, power_model: PowerModel | None = None) -> MeasuredPower:
    """Return energies of frames and average powers of versions.

    Parameters
    ----------
    recording : Recording
        What was played and sampled.
    power_model : PowerModel, optional
        Whose prediction is shown beside it: nothing of an OLED panel, whose content decides.

    Raises
    ------
    InputError
        If no pass was measured well enough.
    """
    log, clock = recording.log, fit_clock(recording)
    energies = frame_energies(recording.samples, recording.flips, log.refresh_rate, line_of(clock))
    passes = _pass_powers(energies, recording.flips, log)
    comparison = PassComparison(passes)
    lcd = power_model if power_model and power_model.kind is not PanelKind.OLED else None
    versions = _version_powers(energies, comparison, lcd)
    if not versions:
        raise InputError(_nothing_measured(recording, passes))
    full = next((one.mean_power for one in versions if one.version == "full"), None)
    used = {f"power model {power_model.name}": sha256_of_record(power_model)} if power_model else {}
    power = PlayedPower(
        simulated=log.simulated,
        video=log.video,
        duration=log.duration,
        refresh_rate=log.refresh_rate,
        sample_rate=log.sample_rate,
        clock=clock,
        samples=count_samples(recording.samples, recording.n_duplicated),
        passes=passes,
        versions=versions,
        equal_power=_equal_power(comparison, full),
        drift_w_h=comparison.drift,
        power_model=power_model.name if power_model else "",
        provenance=provenance_now(inputs={**recording.inputs, **used}),
    )
    return MeasuredPower(replace(power, notes=_notes(log, power, energies, power_model)), energies)


def _nothing_measured(recording: Recording, passes: Sequence[PassPower]) -> str:
    samples, flips = recording.samples, recording.flips
    lasted, played = (float(times[-1] - times[0]) for times in (samples.device_time, flips.flip))
    best = max(one.measured_share for one in passes)
    return (
        f"{recording.where}: no pass has power for {100 * ENOUGH:.0f} % of the video (at most "
        f"{100 * best:.0f} %); samples came for {lasted:.3g} s, and {played:.3g} s were played. Measure "
        "again, with the meter on from the first marker to the last"
    )


def _pass_powers(energies: Sequence[FrameEnergy], flips: Flips, log: PowerLog) -> tuple[PassPower, ...]:
    found = []
    for index, shown in groupby(energies, key=lambda frame: frame.pass_index):
        frames = list(shown)
        known = [frame for frame in frames if frame.energy is not None]
        steps = np.diff(flips.flip[flips.pass_index == index]) * log.refresh_rate
        duration, lasted = (sum(f.duration for f in some) for some in (frames, known))
        bridged = sum(f.bridged_share * f.duration for f in known)
        found.append(
            PassPower(
                pass_index=index,
                version=frames[0].version,
                begun=frames[0].begun,
                duration=duration,
                mean_power=_mean_power(known) if known else None,
                mean_factor=_mean_factor(frames),
                n_frames=len(frames),
                n_left_out=len(frames) - len(known),
                n_dropped=int(np.maximum(np.rint(steps) - 1, 0).sum()),
                measured_share=lasted / log.duration,
                bridged_share=min(bridged / lasted, 1.0) if known else 0.0,
                used=bool(known) and lasted >= ENOUGH * log.duration,
            )
        )
    return tuple(found)


def _version_powers(
    energies: Sequence[FrameEnergy], comparison: PassComparison, model: PowerModel | None
) -> tuple[VersionPower, ...]:
    found = []
    for version in comparison.versions:
        own = [one for one in comparison.passes if one.version == version]
        places = {one.pass_index for one in own}
        frames = [f for f in energies if f.pass_index in places and f.energy is not None]
        spent = [f.energy for f in frames if f.energy is not None]
        mean, factor = _mean_power(frames), _mean_factor(frames)
        means = np.array([one.mean_power for one in own], dtype=np.float64)
        sd = float(np.std(means, ddof=1)) if len(own) > 1 else None
        error = None if sd is None else sd / len(own) ** 0.5
        low, high = PowerEstimate(mean, error, len(own) - 1).interval()
        saving, share = comparison.difference("full", version), comparison.saving(version)
        ends = share.interval() if share else (None, None)
        predicted = None
        if model:
            predicted = model.base_power + model.power_per_luminance * model.peak_luminance * factor
        found.append(
            VersionPower(
                version=version,
                n_passes=len(own),
                mean_power=mean,
                sd_power=sd,
                ci_low=low,
                ci_high=high,
                saving=saving.value if saving else None,
                saving_percent=100 * share.value if share else None,
                saving_percent_ci_low=None if ends[0] is None else 100 * ends[0],
                saving_percent_ci_high=None if ends[1] is None else 100 * ends[1],
                frame_energy_min=min(spent),
                frame_energy_max=max(spent),
                mean_factor=factor,
                predicted_power=predicted,
            )
        )
    return tuple(found)


def _mean_power(frames: Sequence[FrameEnergy]) -> float:
    """Return energy over time, of frames that have an energy [W]."""
    return sum(f.energy for f in frames if f.energy is not None) / sum(f.duration for f in frames)


def _mean_factor(frames: Sequence[FrameEnergy]) -> float:
    """Return the mean over time of the brightness factor."""
    return min(sum(f.factor * f.duration for f in frames) / sum(f.duration for f in frames), 1.0)


def _equal_power(comparison: PassComparison, full_power: float | None) -> EqualPower | None:
    """Return whether ours and baseline take the same power; without that of full brightness, no margin."""
    difference = comparison.difference("ours", "baseline")
    if difference is None:
        return None
    low, high = difference.interval()
    margin = None if full_power is None else EQUAL_SHARE * full_power
    p = None if margin is None else difference.probability_beyond(margin)
    return EqualPower(
        difference=difference.value,
        ci_low=low,
        ci_high=high,
        degrees_of_freedom=difference.degrees,
        margin=margin,
        p=p,
        equal=None if p is None else p < 1 - CONFIDENCE,
    )


def _notes(
    log: PowerLog, power: PlayedPower, energies: Sequence[FrameEnergy], model: PowerModel | None
) -> tuple[str, ...]:
    """Return what a reader should be warned of, as sentences."""
    clock, flags = power.clock, Counter(frame.flag for frame in energies)
    lasts = sorted(frame.duration for frame in energies)[len(energies) // 2]
    used = Counter(one.version for one in power.passes if one.used)
    predicted = ((one.mean_power, one.predicted_power) for one in power.versions)
    ratios = [mean / by_model for mean, by_model in predicted if by_model and mean > 0]
    return prose(
        "power_notes",
        log=log,
        power=power,
        model=model,
        n=len(energies),
        outside=flags[FrameFlag.OUTSIDE],
        in_gaps=flags[FrameFlag.GAP],
        unresolved=flags[FrameFlag.UNRESOLVED],
        off=0.0 if clock.bound is None else (0.25 / log.sample_rate + clock.bound) / lasts,
        unmeasured=[version for version in VERSIONS if not used[version]],
        repeated=any(count > 1 for count in used.values()),
        ratios=ratios if any(abs(ratio - 1) > FAR_OFF for ratio in ratios) else (),
        many_lost=MANY_LOST,
        known=KNOWN,
        enough=ENOUGH,
        names=NAMES,
    )
