"""What was shown of an interval, noted frame by frame."""

from __future__ import annotations

import numpy as np

from evenlight.experiments.refreshes import Refreshes
from evenlight.experiments.stage import ShownInterval

LUMINANCE_DECIMALS = 6  # [cd/m^2] a thousandth of what dithering leaves; frames are drawn from what is logged
PROBES = 12  # frames of an interval that are read back


class RampRecording:
    """Notes each frame of an interval as it is shown.

    Parameters
    ----------
    refresh_rate : float
        Of the display [Hz].

    >>> recording = RampRecording(refresh_rate=50.0)
    >>> for flip in (10.0, 10.02, 10.08):
    ...     recording.note(flip, intended=100.0)
    >>> recording.result().flip_times, recording.result().frames_dropped
    ((0.0, 0.02, 0.08), 2)
    """

    def __init__(self, refresh_rate: float) -> None:
        self.refreshes = Refreshes(refresh_rate)
        self._intended: list[float] = []
        self._factors: list[float] = []
        self._probes: list[tuple[int, float]] = []

    def __len__(self) -> int:
        """Return how many frames were shown."""
        return len(self.refreshes)

    def note(
        self, flip: float, intended: float, factor: float | None = None, probed: float | None = None
    ) -> None:
        """Note a frame.

        Parameters
        ----------
        flip : float
            When it appeared [s].
        intended : float
            The luminance L that it was to have [cd/m^2].
        factor : float, optional
            Brightness factor that the backlight reported.
        probed : float, optional
            Mean luminance read back from the window [cd/m^2].
        """
        if probed is not None:
            self._probes.append((len(self), round(probed, LUMINANCE_DECIMALS)))
        if factor is not None:
            self._factors.append(factor)
        self.refreshes.note(flip)
        self._intended.append(intended)

    def result(self) -> ShownInterval:
        """Return what was shown."""
        return ShownInterval(
            onset=self.refreshes.onset,
            flip_times=self.refreshes.times(),
            intended_luminance=tuple(self._intended),
            probe_frames=tuple(frame for frame, _ in self._probes),
            probe_luminance=tuple(luminance for _, luminance in self._probes),
            backlight_factors=tuple(self._factors),
            frames_dropped=self.refreshes.dropped(),
        )


def probe_places(n_frames: int) -> list[int]:
    """Return the places in an interval that are read back: the first, the last, and even ones between.

    >>> probe_places(420)[:3], probe_places(420)[-1], probe_places(3)
    ([0, 38, 76], 419, [0, 1, 2])
    """
    return sorted({round(place) for place in np.linspace(0, n_frames - 1, PROBES).tolist()})
