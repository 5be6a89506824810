"""Average power of the passes through a video, and what they say of its versions."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from evenlight.analysis.measurement.pass_comparison import CONFIDENCE, Estimate, PassComparison
from evenlight.analysis.measurement.power_recording import Flips
from evenlight.data_schema.frame_energy import FrameEnergy
from evenlight.data_schema.played_power import EqualPower, PassPower, VersionPower
from evenlight.data_schema.power_log import PowerLog

ENOUGH = 0.95  # share of a video that must be measured for a pass to count
EQUAL_SHARE = 0.01  # of full brightness: powers closer than this count as equal


def pass_powers(energies: Sequence[FrameEnergy], flips: Flips, log: PowerLog) -> tuple[PassPower, ...]:
    """Return the power of each time through the video.

    The mean is energy over time, so that frames and samples count by how long they were.

    Parameters
    ----------
    energies : sequence of FrameEnergy
        The frames, in order.
    flips : Flips
        The refreshes that showed them.
    log : PowerLog
        What they were measured on.
    """
    found = []
    for index in dict.fromkeys(frame.pass_index for frame in energies):
        frames = [frame for frame in energies if frame.pass_index == index]
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


def version_powers(
    energies: Sequence[FrameEnergy],
    comparison: PassComparison,
    predict: Callable[[float], float] | None = None,
) -> tuple[VersionPower, ...]:
    """Return what was measured of each version that has a pass that counts.

    Parameters
    ----------
    energies : sequence of FrameEnergy
        The frames of all passes.
    comparison : PassComparison
        Of the passes.
    predict : callable, optional
        Power that a model has for a mean brightness factor [W].
    """
    return tuple(_version_power(name, energies, comparison, predict) for name in comparison.versions)


def _version_power(
    version: str,
    energies: Sequence[FrameEnergy],
    comparison: PassComparison,
    predict: Callable[[float], float] | None,
) -> VersionPower:
    """Return what was measured of a version."""
    own = [one for one in comparison.passes if one.version == version]
    places = {one.pass_index for one in own}
    frames = [f for f in energies if f.pass_index in places and f.energy is not None]
    spent = [f.energy for f in frames if f.energy is not None]
    mean, factor, sd = _mean_power(frames), _mean_factor(frames), _sd_power(own)
    low, high = Estimate(mean, None if sd is None else sd / len(own) ** 0.5, len(own) - 1).interval()
    saving, share = comparison.difference("full", version), comparison.saving(version)
    ends = (None, None) if share is None else share.interval()
    return VersionPower(
        version=version,
        n_passes=len(own),
        mean_power=mean,
        sd_power=sd,
        ci_low=low,
        ci_high=high,
        saving=None if saving is None else saving.value,
        saving_percent=None if share is None else 100 * share.value,
        saving_percent_ci_low=None if ends[0] is None else 100 * ends[0],
        saving_percent_ci_high=None if ends[1] is None else 100 * ends[1],
        frame_energy_min=min(spent),
        frame_energy_max=max(spent),
        mean_factor=factor,
        predicted_power=predict(factor) if predict else None,
    )


def equal_power(comparison: PassComparison, full_power: float | None) -> EqualPower | None:
    """Return whether ours and baseline take the same power; None where one of them was not measured.

    Parameters
    ----------
    comparison : PassComparison
        Of the passes.
    full_power : float or None
        Of full brightness, whose share the margin is [W].
    """
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


def _mean_power(frames: Sequence[FrameEnergy]) -> float:
    """Return energy over time, of frames that have an energy [W]."""
    return sum(f.energy for f in frames if f.energy is not None) / sum(f.duration for f in frames)


def _mean_factor(frames: Sequence[FrameEnergy]) -> float:
    """Return the mean over time of the brightness factor."""
    return min(sum(f.factor * f.duration for f in frames) / sum(f.duration for f in frames), 1.0)


def _sd_power(passes: Sequence[PassPower]) -> float | None:
    """Return the standard deviation of passes' means [W]; None of a single one."""
    means = [one.mean_power for one in passes]
    return float(np.std(np.array(means, dtype=np.float64), ddof=1)) if len(means) > 1 else None
