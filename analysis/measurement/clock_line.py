"""A meter's clock on the computer's, as a line, and what there is to say of how it was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame_energy import ClockFit, ClockFlag, ClockMethod


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Computer's time = reference + offset + (1 + drift) · (meter's time - reference).

    Attributes
    ----------
    reference : float
        On the meter's clock [s].
    offset : float
        Computer's time less the meter's, there [s].
    drift : float
        Seconds of the computer in one of the meter, less 1.
    """

    reference: float
    offset: float
    drift: float = 0.0

    def to_computer(self, device_time: ArrayLike) -> Array:
        """Return times of the meter's clock on the computer's [s].

        >>> ClockLine(reference=10.0, offset=100.0, drift=0.5).to_computer([10.0, 12.0]).tolist()
        [110.0, 113.0]
        """
        since = np.asarray(device_time, dtype=np.float64) - self.reference
        return np.asarray(self.reference + self.offset + (1 + self.drift) * since)

    def to_meter(self, computer_time: ArrayLike) -> Array:
        """Return times of the computer's clock on the meter's [s].

        >>> ClockLine(reference=10.0, offset=100.0, drift=0.5).to_meter([110.0, 113.0]).tolist()
        [10.0, 12.0]
        """
        since = np.asarray(computer_time, dtype=np.float64) - self.reference - self.offset
        return np.asarray(self.reference + since / (1 + self.drift))

    def inverse(self) -> ClockLine:
        """Return the line from the computer's clock to the meter's.

        >>> line = ClockLine(reference=10.0, offset=100.0, drift=0.5)
        >>> line.inverse().to_computer([113.0]).tolist(), line.to_meter([113.0]).tolist()
        ([12.0], [12.0])
        """
        return ClockLine(self.reference + self.offset, -self.offset, 1 / (1 + self.drift) - 1)


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """A line with what it rests on; fields as of `ClockFit`."""

    method: ClockMethod
    line: ClockLine
    residual_sd: float | None
    bound: float | None
    n_used: int
    n_rejected: int = 0
    flags: tuple[ClockFlag, ...] = ()

    def record(self, earlier: tuple[ClockFlag, ...] = ()) -> ClockFit:
        """Return the estimate as a record, with the flags of methods that were tried before."""
        return ClockFit(
            method=self.method,
            reference=self.line.reference,
            offset=self.line.offset,
            drift_ppm=1e6 * self.line.drift,
            residual_sd=self.residual_sd,
            bound=self.bound,
            n_used=self.n_used,
            n_rejected=self.n_rejected,
            flags=(*earlier, *self.flags),
        )


def line_of(fit: ClockFit) -> ClockLine:
    """Return the line of a record."""
    return ClockLine(fit.reference, fit.offset, 1e-6 * fit.drift_ppm)
