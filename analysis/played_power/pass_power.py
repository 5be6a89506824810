"""From samples to the power of versions: energies of frames, averages of passes, differences of versions.

The energy of a frame is the integral of power from its flip to the next frame's. Versions are played in turn,
and the drift that they share is taken out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import PchipInterpolator

from evenlight.analysis.played_power.clock_line import ClockLine
from evenlight.analysis.played_power.power_recording import Flips, Samples, energy_knots
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.played_power import (
    LEFT_OUT,
    DevicePass,
    FrameEnergy,
    FrameFlag,
    PassPower,
)

VERSIONS = ("baseline", "ours", "full")  # in the order of the paper's table
CONFIDENCE = 0.95
LONGEST_BRIDGE = 0.05  # [s] power may do anything in a longer time without samples


def frame_energies(samples: Samples, flips: Flips, refresh_rate: float, line: ClockLine) -> list[FrameEnergy]:
    """Return the energy of each frame that some refreshes showed.

    A frame lasts until the next one appears; the last one of a pass until the refresh after its last flip.
    After a dropped refresh that is longer, and so is the frame.

    Energy is known at the end of each sample, as samples are means since the sample before. Between, it is
    interpolated by a cubic that rises where it does (PCHIP): power then has no steps, and the mean of each
    sample is kept. Where samples are longer than frames, that would make waves that were not measured, and
    energy is interpolated linearly: a frame has its share of a mean.

    Parameters
    ----------
    samples, flips : Samples, Flips
        Each sample once, and what was shown when, on the computer's clock.
    refresh_rate : float
        Of the display [Hz].
    line : ClockLine
        The meter's clock on the computer's.
    """
    first, gone, factor = _frames(flips, refresh_rate)
    appeared = flips.flip[first]
    lasts = gone - appeared
    knots = energy_knots(samples)
    times, energy = line.to_computer(knots.times), knots.energy * (1 + line.drift)
    covered = (appeared >= times[0]) & (gone <= times[-1])
    begun, ended = (np.clip(edge, times[0], times[-1]) for edge in (appeared, gone))
    if samples.interval < np.median(lasts):
        curve = PchipInterpolator(times - times[0], energy)
        energies = curve(ended - times[0]) - curve(begun - times[0])
    else:
        energies = np.interp(ended, times, energy) - np.interp(begun, times, energy)
    starts, ends = line.to_computer(knots.gap_starts), line.to_computer(knots.gap_ends)
    long = ends - starts > LONGEST_BRIDGE
    bridged = np.clip(_overlap(begun, ended, starts, ends) / lasts, 0.0, 1.0)
    in_long = _overlap(begun, ended, starts[long], ends[long])
    sampled = np.searchsorted(line.to_computer(samples.device_time), np.stack([begun, ended]), side="right")
    counts = sampled[1] - sampled[0]
    kinds = np.select([~covered, in_long > 0, (counts == 0) | (lasts < samples.interval)], [0, 1, 2], 3)
    order = (FrameFlag.OUTSIDE, FrameFlag.GAP, FrameFlag.UNRESOLVED, FrameFlag.OK)
    flags = [order[kind] for kind in kinds]
    return [
        FrameEnergy(
            pass_index=int(flips.pass_index[row]),
            version=str(flips.version[row]),
            video_frame=int(flips.video_frame[row]),
            begun=float(appeared[k]),
            duration=float(lasts[k]),
            energy=None if flag in LEFT_OUT else float(energies[k]),
            power=None if flag in LEFT_OUT else float(energies[k] / lasts[k]),
            factor=float(factor[k]),
            n_samples=int(counts[k]),
            bridged_share=float(bridged[k]),
            flag=flag,
        )
        for k, (row, flag) in enumerate(zip(first, flags, strict=True))
    ]


def _frames(flips: Flips, refresh_rate: float) -> tuple[NDArray[np.int64], Array, Array]:
    """Return the first flip of each frame, when the frame had gone, and its mean b."""
    new_pass = np.append(True, np.diff(flips.pass_index) != 0)
    first = np.flatnonzero(new_pass | np.append(True, np.diff(flips.video_frame) != 0))
    following = np.append(flips.flip[1:], np.inf)
    last_of_pass = np.append(new_pass[1:], True)
    ends = np.where(last_of_pass, np.minimum(flips.flip + 1 / refresh_rate, following), following)
    lasts = ends - flips.flip
    means = np.add.reduceat(flips.achieved_factor * lasts, first) / np.add.reduceat(lasts, first)
    return first, ends[np.append(first[1:], len(ends)) - 1], np.clip(means, 0.0, 1.0)


def _overlap(begun: Array, ended: Array, starts: Array, ends: Array) -> Array:
    """Return how long some spans overlap gaps that do not overlap each other [s]."""
    if len(starts) == 0:
        return np.zeros(len(begun))
    corners = np.column_stack([starts, ends]).ravel()
    inside = np.column_stack([np.cumsum(ends - starts) - (ends - starts), np.cumsum(ends - starts)]).ravel()
    return np.asarray(np.interp(ended, corners, inside) - np.interp(begun, corners, inside))


class PowerEstimate(NamedTuple):
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


class PassComparison:
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

    def __init__(self, passes: Sequence[PassPower | DevicePass], versions: Sequence[str] = VERSIONS) -> None:
        self.passes = [one for one in passes if one.used]
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
