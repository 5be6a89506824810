"""How versions of a video differ in power: passes in turn, with the drift that they share taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.played_power import PassPower

VERSIONS = ("baseline", "ours", "full")  # in the order of the paper's table
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number, its standard error where passes were repeated, and the degrees of freedom of that."""

    value: float
    error: float | None
    degrees: int

    def interval(self) -> tuple[float, float] | tuple[None, None]:
        """Return the 95 % interval (Student's t); none without repetitions.

        >>> low, high = Estimate(2.0, 0.5, 1).interval()  # t(0.975, 1) = tan(0.475 π) = 12.706
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
    passes : sequence of PassPower
        The passes; those that do not count are left out.
    """

    def __init__(self, passes: Sequence[PassPower]) -> None:
        self.passes = [one for one in passes if one.used]
        self.versions = [name for name in VERSIONS if any(one.version == name for one in self.passes)]
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

    def difference(self, version: str, other: str) -> Estimate | None:
        """Return the power of a version less that of another [W]; None if one of them was not measured."""
        if version not in self.versions or other not in self.versions or version == other:
            return None
        weights = self._weights(version) - self._weights(other)
        return self._estimate(float(weights @ self._fitted), weights)

    def saving(self, version: str) -> Estimate | None:
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

    def _estimate(self, value: float, weights: Array) -> Estimate:
        """Return a value with the standard error of a combination of the fitted numbers."""
        if self._covariance is None:
            return Estimate(value, None, 0)
        return Estimate(value, float(np.sqrt(weights @ self._covariance @ weights)), self._degrees)
