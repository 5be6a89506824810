"""From samples to the power of versions: energies of frames, averages of passes, differences of versions.

The energy of a frame is the integral of power from its flip to the next frame's. Versions are played in turn,
and the drift that they share is taken out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import PchipInterpolator

from evenlight.analysis.measurement.played_power.clock_line import ClockLine
from evenlight.analysis.measurement.played_power.power_recording import Flips, Samples, energy_knots
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.device_saving import DevicePass
from evenlight.data_schema.recordings.instrument_logs import PowerLog
from evenlight.data_schema.recordings.played_power import (
    LEFT_OUT,
    EqualPower,
    FrameEnergy,
    FrameFlag,
    PassPower,
    VersionPower,
)

ENOUGH = 0.95  # share of a video that must be measured for a pass to count
EQUAL_SHARE = 0.01  # of full brightness: powers closer than this count as equal
VERSIONS = ("baseline", "ours", "full")  # in the order of the paper's table
CONFIDENCE = 0.95
Pass = TypeVar("Pass", PassPower, DevicePass)
LONGEST_BRIDGE = 0.05  # [s] power may do anything in a longer time without samples


def pass_powers(energies: Sequence[FrameEnergy], flips: Flips, log: PowerLog) -> tuple[PassPower, ...]:
    """Return the power of each time through the video.

    The mean is energy over time, so that frames and samples count by how long they were.

    Parameters
    ----------
    energies, flips : sequence of FrameEnergy, Flips
        The frames, in order, and the refreshes that showed them.
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
    comparison: PassComparison[PassPower],
    predict: Callable[[float], float] | None = None,
) -> tuple[VersionPower, ...]:
    """Return what was measured of each version that has a pass that counts.

    Parameters
    ----------
    energies, comparison : sequence of FrameEnergy, PassComparison
        The frames of all passes, and their comparison.
    predict : callable, optional
        Power that a model has for a mean brightness factor [W].
    """
    return tuple(_version_power(name, energies, comparison, predict) for name in comparison.versions)


def _version_power(
    version: str,
    energies: Sequence[FrameEnergy],
    comparison: PassComparison[PassPower],
    predict: Callable[[float], float] | None,
) -> VersionPower:
    """Return what was measured of a version."""
    own = [one for one in comparison.passes if one.version == version]
    places = {one.pass_index for one in own}
    frames = [f for f in energies if f.pass_index in places and f.energy is not None]
    spent = [f.energy for f in frames if f.energy is not None]
    mean, factor, means = _mean_power(frames), _mean_factor(frames), [one.mean_power for one in own]
    sd = float(np.std(np.array(means, dtype=np.float64), ddof=1)) if len(own) > 1 else None
    low, high = PowerEstimate(mean, None if sd is None else sd / len(own) ** 0.5, len(own) - 1).interval()
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


def equal_power(comparison: PassComparison[PassPower], full_power: float | None) -> EqualPower | None:
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


@dataclass(frozen=True, slots=True)
class PowerEstimate:
    """A number, its standard error where passes were repeated, and the degrees of freedom of that."""

    value: float
    error: float | None
    degrees: int

    def interval(self) -> tuple[float, float] | tuple[None, None]:
        """Return the 95 % confidence interval (Student's t); none without repetitions.

        >>> low, high = PowerEstimate(2.0, 0.5, 1).interval()  # t(0.975, 1) = tan(0.475 π) = 12.706
        >>> round(low, 3), round(high, 3)
        (-4.353, 8.353)
        """
        if self.error is None:
            return None, None
        half = self.error * float(stats.t.ppf((1 + CONFIDENCE) / 2, self.degrees))
        return self.value - half, self.value + half

    def probability_beyond(self, margin: float) -> float | None:
        """Return how probable as small a value is if the true one is the margin: of two t-tests, the greater.

        What is to be shown, that the value is within the margin, is the alternative (Schuirmann 1987).
        """
        if self.error is None:
            return None
        room = margin - abs(self.value)
        return float(stats.t.sf(room / self.error, self.degrees)) if self.error > 0 else float(room <= 0)


class PassComparison(Generic[Pass]):
    """Means of versions at one and the same time, by least squares: one level each, one slope over time.

    Versions are played in turn, so a panel that warms up or ages would make the later of two look different;
    its straight drift is common to all passes, and is known from repetitions of the same version.

    Parameters
    ----------
    passes : sequence of PassPower or DevicePass
        The passes; those that do not count are left out.
    versions : sequence of str, optional
        What there may be, "full" among them.
    """

    def __init__(self, passes: Sequence[Pass], versions: Sequence[str] = VERSIONS) -> None:
        self.passes: list[Pass] = [one for one in passes if one.used]
        self.versions = [name for name in versions if any(one.version == name for one in self.passes)]
        times = np.array([one.begun + one.duration / 2 for one in self.passes])
        powers = np.array([one.mean_power for one in self.passes], dtype=np.float64)
        levels = np.array([[float(one.version == name) for name in self.versions] for one in self.passes])
        repeated = len(self.passes) > len(self.versions)
        columns = [levels, (times - times.mean())[:, None]] if repeated else [levels]
        design = np.hstack(columns) if self.passes else np.empty((0, 0))
        self._fitted = np.linalg.lstsq(design, powers, rcond=None)[0]
        self._degrees = len(powers) - design.shape[1]
        self._covariance: Array | None = None
        if self._degrees > 0:
            left = powers - design @ self._fitted
            self._covariance = float(left @ left) / self._degrees * np.linalg.inv(design.T @ design)
        self.drift = 3600 * float(self._fitted[-1]) if repeated else None  # [W/h]

    def level(self, version: str) -> float:
        """Return the power of a version that was measured, at the middle of all passes [W]."""
        return float(self._weights(version) @ self._fitted)

    def difference(self, version: str, other: str) -> PowerEstimate | None:
        """Return the power of a version less that of another [W]; None if one of them was not measured."""
        if version not in self.versions or other not in self.versions or version == other:
            return None
        weights = self._weights(version) - self._weights(other)
        return self._estimate(float(weights @ self._fitted), weights)

    def saving(self, version: str) -> PowerEstimate | None:
        """Return by which share a version takes less than full brightness; None if that was not measured."""
        if "full" not in self.versions or version not in self.versions or version == "full":
            return None
        own, full = self._weights(version), self._weights("full")
        ratio = float(own @ self._fitted) / float(full @ self._fitted)
        # The derivatives of 1 - own / full: errors of a ratio to first order.
        return self._estimate(1 - ratio, (ratio * full - own) / float(full @ self._fitted))

    def _weights(self, version: str) -> Array:
        """Return what takes the level of a version from the fitted numbers."""
        weights = np.zeros(len(self._fitted))
        weights[self.versions.index(version)] = 1.0
        return weights

    def _estimate(self, value: float, weights: Array) -> PowerEstimate:
        """Return a value with the standard error of a combination of the fitted numbers."""
        if self._covariance is None:
            return PowerEstimate(value, None, 0)
        return PowerEstimate(value, float(np.sqrt(weights @ self._covariance @ weights)), self._degrees)


@dataclass(frozen=True, slots=True, eq=False)
class FrameSpans:
    """Frames as they were shown.

    Attributes
    ----------
    pass_index, video_frame : array of int, (N,)
        Which time through the video, and which frame of it.
    version : array of str, (N,)
        How it was dimmed.
    begun, ended : array, (N,)
        When it appeared and when it had gone, on the computer's clock [s].
    factor : array, (N,)
        Brightness factor b that was achieved, its mean over that time.
    """

    pass_index: NDArray[np.int64]
    video_frame: NDArray[np.int64]
    version: NDArray[np.str_]
    begun: Array
    ended: Array
    factor: Array


def frame_spans(flips: Flips, refresh_rate: float) -> FrameSpans:
    """Return the frames that some refreshes showed.

    A frame lasts until the next one appears; the last one of a pass until the refresh after its last flip.
    After a dropped refresh that is longer, and so is the frame.

    Parameters
    ----------
    flips : Flips
        What was shown when.
    refresh_rate : float
        Of the display [Hz].
    """
    new_pass = np.append(True, np.diff(flips.pass_index) != 0)
    first = np.flatnonzero(new_pass | np.append(True, np.diff(flips.video_frame) != 0))
    following = np.append(flips.flip[1:], np.inf)
    last_of_pass = np.append(new_pass[1:], True)
    ends = np.where(last_of_pass, np.minimum(flips.flip + 1 / refresh_rate, following), following)
    lasts = ends - flips.flip
    sums = np.add.reduceat(flips.factor * lasts, first)
    return FrameSpans(
        pass_index=flips.pass_index[first],
        video_frame=flips.video_frame[first],
        version=flips.version[first],
        begun=flips.flip[first],
        ended=ends[np.append(first[1:], len(ends)) - 1],
        factor=np.clip(sums / np.add.reduceat(lasts, first), 0.0, 1.0),
    )


def frame_energies(samples: Samples, spans: FrameSpans, line: ClockLine) -> list[FrameEnergy]:
    """Return the energy of each frame.

    Energy is known at the end of each sample, as samples are means since the sample before. Between, it is
    interpolated by a cubic that rises where it does (PCHIP): power then has no steps, and the mean of each
    sample is kept. Where samples are longer than frames, that would make waves that were not measured, and
    energy is interpolated linearly: a frame has its share of a mean.

    Parameters
    ----------
    samples, spans : Samples, FrameSpans
        Each sample once, and the frames, on the computer's clock.
    line : ClockLine
        The meter's clock on the computer's.
    """
    knots = energy_knots(samples)
    times, energy = line.to_computer(knots.times), knots.energy * (1 + line.drift)
    covered = (spans.begun >= times[0]) & (spans.ended <= times[-1])
    begun, ended = (np.clip(edge, times[0], times[-1]) for edge in (spans.begun, spans.ended))
    if samples.interval < np.median(spans.ended - spans.begun):
        curve = PchipInterpolator(times - times[0], energy)
        energies = curve(ended - times[0]) - curve(begun - times[0])
    else:
        energies = np.interp(ended, times, energy) - np.interp(begun, times, energy)
    starts, ends = line.to_computer(knots.gap_starts), line.to_computer(knots.gap_ends)
    long = ends - starts > LONGEST_BRIDGE
    bridged = _overlap(begun, ended, starts, ends)
    in_long = _overlap(begun, ended, starts[long], ends[long])
    sampled = np.searchsorted(line.to_computer(knots.sample_times), np.stack([begun, ended]), side="right")
    unresolved = (sampled[1] == sampled[0]) | (spans.ended - spans.begun < samples.interval)
    kinds = np.select([~covered, in_long > 0, unresolved], [0, 1, 2], 3)
    order = (FrameFlag.OUTSIDE, FrameFlag.GAP, FrameFlag.UNRESOLVED, FrameFlag.OK)
    return _records(spans, energies, bridged, sampled[1] - sampled[0], [order[kind] for kind in kinds])


def _overlap(begun: Array, ended: Array, starts: Array, ends: Array) -> Array:
    """Return how long some spans overlap gaps that do not overlap each other [s]."""
    if len(starts) == 0:
        return np.zeros(len(begun))
    corners = np.column_stack([starts, ends]).ravel()
    inside = np.column_stack([np.cumsum(ends - starts) - (ends - starts), np.cumsum(ends - starts)]).ravel()
    return np.asarray(np.interp(ended, corners, inside) - np.interp(begun, corners, inside))


def _records(
    spans: FrameSpans, energies: Array, bridged: Array, counts: NDArray[np.int64], flags: Sequence[FrameFlag]
) -> list[FrameEnergy]:
    """Return the energies as records."""
    lasts = spans.ended - spans.begun
    return [
        FrameEnergy(
            pass_index=int(spans.pass_index[k]),
            version=str(spans.version[k]),
            video_frame=int(spans.video_frame[k]),
            begun=float(spans.begun[k]),
            duration=float(lasts[k]),
            energy=None if flag in LEFT_OUT else float(energies[k]),
            power=None if flag in LEFT_OUT else float(energies[k] / lasts[k]),
            factor=float(spans.factor[k]),
            n_samples=int(counts[k]),
            bridged_share=float(np.clip(bridged[k] / lasts[k], 0.0, 1.0)),
            flag=flag,
        )
        for k, flag in enumerate(flags)
    ]
