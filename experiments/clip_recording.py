"""What was shown of a clip, noted refresh by refresh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.experiments.ramp_recording import LUMINANCE_DECIMALS
from evenlight.experiments.refreshes import DECIMALS, Refreshes
from evenlight.experiments.stage import Clip, ShownClip
from evenlight.stimuli.ramp import frame_count

ROUNDING = 1e-6  # [s] of a time that was computed


@dataclass(frozen=True, slots=True)
class Probe:
    """What was read back at a refresh, and what it was to be: mean luminances [cd/m^2]."""

    luminance: float
    intended: float


class ClipRecording:
    """Notes what each refresh showed of a clip.

    Parameters
    ----------
    refresh_rate : float
        Of the display [Hz].
    waited : float, optional
        How long the clip was waited for [s].
    """

    def __init__(self, refresh_rate: float, waited: float = 0.0) -> None:
        self.refreshes, self._waited = Refreshes(refresh_rate), waited
        self._frames: list[int] = []
        self._factors: list[float] = []
        self._reported: list[float] = []
        self._probes: list[tuple[int, Probe]] = []

    def note(
        self,
        flip: float,
        frame: int,
        factor: float,
        reported: float | None = None,
        probe: Probe | None = None,
    ) -> None:
        """Note a refresh.

        Parameters
        ----------
        flip : float
            When it appeared [s].
        frame : int
            Frame of the video that it showed.
        factor : float
            Brightness factor b that it showed.
        reported : float, optional
            Brightness factor that the backlight reported.
        probe : Probe, optional
            What was read back.
        """
        if probe is not None:
            self._probes.append((len(self.refreshes), probe))
        if reported is not None:
            self._reported.append(reported)
        self.refreshes.note(flip)
        self._frames.append(frame)
        self._factors.append(factor)

    def result(self) -> ShownClip:
        """Return what was shown."""
        return ShownClip(
            onset=self.refreshes.onset,
            flip_times=self.refreshes.times(),
            video_frames=tuple(self._frames),
            factors=tuple(self._factors),
            backlight_factors=tuple(self._reported),
            probe_refreshes=tuple(place for place, _ in self._probes),
            probe_luminance=tuple(round(probe.luminance, LUMINANCE_DECIMALS) for _, probe in self._probes),
            probe_intended=tuple(round(probe.intended, LUMINANCE_DECIMALS) for _, probe in self._probes),
            frames_dropped=self.refreshes.dropped(),
            waited=round(self._waited, DECIMALS),
        )


def frames_of_refreshes(clip: Clip, refresh_rate: float) -> NDArray[np.int64]:
    """Return which frame of a clip is due at each refresh, if none is dropped.

    Parameters
    ----------
    clip : Clip
        The clip.
    refresh_rate : float
        Of the display [Hz].
    """
    seconds = clip.duration if clip.seconds is None else min(clip.seconds, clip.duration)
    times = np.arange(max(1, frame_count(seconds, refresh_rate))) / refresh_rate
    return np.maximum(np.searchsorted(clip.times, times + ROUNDING, side="right") - 1, 0)
