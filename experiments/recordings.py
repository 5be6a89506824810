"""What was shown, noted refresh by refresh: when each came, drops, and the frames of ramps and clips."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.experiments.stage import Clip, ShownClip, ShownInterval
from evenlight.hardware.protocols import Window
from evenlight.stimuli.ramp import frame_count

DECIMALS = 9  # of a time [s]: what a clock's reading says, without the rounding of a difference of two
LUMINANCE_DECIMALS = 6  # [cd/m^2] a thousandth of what dithering leaves; frames are drawn from what is logged
Probed = float | Callable[[], float]  # a luminance, or what returns it later
PROBES = 12  # frames of an interval that are read back
TIME_ROUNDING = 1e-6  # [s] of a time that was computed


class Refreshes:
    """Notes when each refresh appeared.

    Parameters
    ----------
    refresh_rate : float
        Of the display [Hz].

    >>> refreshes = Refreshes(refresh_rate=50.0)
    >>> for flip in (10.0, 10.02, 10.08):
    ...     refreshes.note(flip)
    >>> refreshes.times(), refreshes.dropped()
    ((0.0, 0.02, 0.08), 2)
    """

    def __init__(self, refresh_rate: float) -> None:
        self._refresh_rate = refresh_rate
        self._flips: list[float] = []

    def __len__(self) -> int:
        """Return how many there were."""
        return len(self._flips)

    @property
    def onset(self) -> float:
        """When the first appeared [s]."""
        return self._flips[0]

    def note(self, flip: float) -> None:
        """Note when a refresh appeared [s]."""
        self._flips.append(flip)

    def due(self, window: Window) -> Iterator[float]:
        """Yield when the next refresh is due, since the first [s]; note it before the one after is asked for.

        Parameters
        ----------
        window : Window
            Whose flips they are; it says when what is drawn next will appear.
        """
        yield 0.0
        while True:
            yield round(window.due(1 / self._refresh_rate) - self.onset, DECIMALS)

    def times(self) -> tuple[float, ...]:
        """Return when each appeared, since the first [s]."""
        return tuple(round(flip - self.onset, DECIMALS) for flip in self._flips)

    def dropped(self) -> int:
        """Return how many passed without a new frame."""
        missed = np.rint(np.diff(self._flips) * self._refresh_rate).astype(int) - 1
        return int(np.maximum(missed, 0).sum())


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
        self._probes: list[tuple[int, Probed]] = []

    def __len__(self) -> int:
        """Return how many frames were shown."""
        return len(self.refreshes)

    def note(
        self, flip: float, intended: float, factor: float | None = None, probed: Probed | None = None
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
        probed : float or callable, optional
            Mean luminance read back from the window [cd/m^2], or what returns it after the last frame.
        """
        if probed is not None:
            self._probes.append((len(self), probed))
        if factor is not None:
            self._factors.append(factor)
        self.refreshes.note(flip)
        self._intended.append(intended)

    def result(self) -> ShownInterval:
        """Return what was shown."""
        probes = [probed() if callable(probed) else probed for _, probed in self._probes]
        return ShownInterval(
            onset=self.refreshes.onset,
            flip_times=self.refreshes.times(),
            intended_luminance=tuple(self._intended),
            probe_frames=tuple(frame for frame, _ in self._probes),
            probe_luminance=tuple(round(luminance, LUMINANCE_DECIMALS) for luminance in probes),
            backlight_factors=tuple(self._factors),
            frames_dropped=self.refreshes.dropped(),
        )


def probe_places(n_frames: int) -> list[int]:
    """Return the places in an interval that are read back: the first, the last, and even ones between.

    >>> probe_places(420)[:3], probe_places(420)[-1], probe_places(3)
    ([0, 38, 76], 419, [0, 1, 2])
    """
    return sorted({round(place) for place in np.linspace(0, n_frames - 1, PROBES).tolist()})


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
    return np.maximum(np.searchsorted(clip.times, times + TIME_ROUNDING, side="right") - 1, 0)
