"""Moves a backlight to the factor of the frame on screen, never faster than the rate limit.

Each setting is a step of the modulation as `method.rate_limit` has it, whatever the film does (a seek, a cut,
another speed): |Δb| · (mean of Ī before and after) / Δt ≤ ΔL at either end. Δt is the time since the setting
before, but no more than a frame lasts, or than the backlight takes between two settings: one that has stood
still, or a program that was held up, has saved up no jump.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.data_schema.tracks.loaded_track import LoadedTrack, frame_durations
from evenlight.hardware.protocols import Backlight
from evenlight.method.choices import ModulatedLuminance
from evenlight.method.detectability import limit_at_share
from evenlight.method.preset_files import load_rate_limit, preset_names
from evenlight.method.rate_limit import ScalarRateLimit, furthest_factor

SHORTEST = 0.01  # [s] between two settings: 100 a second follow any film
LONGEST = 0.25  # [s] since the setting before that a step may make up for
FORESEEN = 0.25  # [s] steps of the time that is foreseen
FURTHEST = 300.0  # [s] that is foreseen at most
NEAR = 0.005  # of a factor: what is foreseen is not known better
REACHED = 1e-4  # of a factor: nearer than anybody sees, and than most backlights can be set


@dataclass(frozen=True, slots=True, eq=False)
class FilmLight:
    """What is wanted of the backlight while a film plays."""

    times: Array  # (N,): when its frames appear, on the clock of its file, as players tell positions [s]
    durations: Array  # (N,): for how long [s]
    factors: Array  # (N,): b of each
    luminance: Array  # (N,): Ī, the luminance at factor 1 that the rate limit is about [cd/m^2]
    white: float  # that of a white screen [cd/m^2], for what is on screen when the film is not
    reading: FilmReading = field(default_factory=FilmReading)  # which video it is, where its stamps begin


def film_light(loaded: LoadedTrack, display: Display, reading: FilmReading) -> FilmLight:
    """Return what a track wants of a display's backlight, for a film that begins as it was read."""
    track = loaded.track
    times, factors = np.asarray(track.times) + reading.picture_start, np.asarray(track.factors)
    luminance = np.maximum(np.asarray(track.mean_luminance) - display.reflected_luminance, 0.0) / factors
    if loaded.modulated == ModulatedLuminance.WHITE_FIELD.value:
        luminance = np.full(len(factors), display.peak_luminance)
    durations = frame_durations(track)
    return FilmLight(times, durations, factors, luminance, display.peak_luminance, reading)


def track_rate_limit(track: BrightnessTrack, given: str | None, noticed: float | None = None) -> RateLimit:
    """Return the rate limit that a track was made with, for the same share of detections or another one.

    Parameters
    ----------
    track : BrightnessTrack
        The track.
    given : str or None
        Preset or file; None for the preset that the track names.
    noticed : float, optional
        Share of detections; else that of the track.

    Raises
    ------
    InputError
        If it is not known, or another one.
    """
    header = track.header
    if given is None and header.rate_limit not in preset_names("rate_limit"):
        raise InputError(
            f"the track was made with the rate limit {header.rate_limit!r}, which is no preset: give its "
            "file with --rate-limit"
        )
    limit = load_rate_limit(given or header.rate_limit)
    if header.provenance.inputs.get("rate_limit", sha256_of_record(limit)) != sha256_of_record(limit):
        raise InputError(
            f"the track was made with the rate limit {header.rate_limit!r}, and {given or limit.name} is "
            "another one: give that file with --rate-limit"
        )
    noticed = header.noticed if noticed is None else noticed
    return limit if noticed is None else limit_at_share(limit, noticed)


@dataclass(eq=False)
class LimitedBacklight:
    """Sets a backlight for the frame on screen; refuses a film that wants less than its lowest factor."""

    backlight: Backlight  # open; its factors are shares of luminance
    film: FilmLight  # what is wanted of it
    rate_limit: ScalarRateLimit  # ΔL [cd/m^2/s] of an emitted luminance [cd/m^2]

    def __post_init__(self) -> None:
        lowest, dimmest = self.backlight.smallest_factor(), float(self.film.factors.min())
        if dimmest < lowest - self.backlight.step() / 2:
            raise InputError(
                f"the track goes down to the factor {dimmest:.3g}, and this backlight, as far as it is "
                f"known, to {lowest:.3g}: measure its curve further down, or take another backlight"
            )
        self._lowest = lowest
        self.interval = max(self.backlight.min_interval(), SHORTEST)  # between two settings, at least [s]
        # what it had before, was last set to, and made of that
        self.found = self.factor = self.achieved = self.backlight.read_factor()
        self._luminance, self._changed = self.film.white, -np.inf
        if self.factor < lowest:  # it was off
            self._set(lowest)

    def wanted(self, frame: int | None) -> float:
        """Return the factor of a frame; without the film, the one that was found, if it can be set."""
        return max(self.found if frame is None else float(self.film.factors[frame]), self._lowest)

    def step(self, frame: int | None, now: float) -> bool:
        """Set the backlight as near to the factor wanted as the limit allows; return whether it was set.

        Parameters
        ----------
        frame : int or None
            On screen; None without the film.
        now : float
            The time, not before that of the last call [s].
        """
        lasts = float(self.film.durations[(frame or 0) - 1])  # of the film's first, and without it: the last
        passed = min(now - self._changed, max(lasts, self.interval), LONGEST)
        before, self._luminance = self._luminance, self._light(frame)
        factor = self._next(self.factor, self.wanted(frame), (before, self._luminance), passed)
        if factor == self.factor:
            return False
        self._set(factor)
        self._changed = now
        return True

    def reached(self, frame: int | None) -> bool:
        """Return whether the backlight is where it is wanted."""
        return abs(self.factor - self.wanted(frame)) <= REACHED

    def seconds_to(self, frame: int | None, speed: float) -> float:
        """Return how long it takes to catch up with a film that goes on from a frame, at a speed [s]."""
        times, factor, seconds = self.film.times, self.factor, 0.0
        goal, light = self.wanted(frame), self._light(frame)
        while seconds < FURTHEST and abs(goal - factor) > NEAR:
            factor = self._next(factor, goal, (light, light), FORESEEN)
            seconds += FORESEEN
            if frame is not None:
                now = int(np.searchsorted(times, times[frame] + speed * seconds, side="right")) - 1
                goal, light = self.wanted(now), self._light(now)
        return seconds

    def _light(self, frame: int | None) -> float:
        return self.film.white if frame is None else float(self.film.luminance[frame])

    def _next(self, factor: float, goal: float, luminance: tuple[float, float], passed: float) -> float:
        """Return the factor nearest to a goal that the limit allows after some time [s]."""
        furthest = furthest_factor(factor, goal, luminance, passed, self.rate_limit)
        return min(goal, furthest) if goal > factor else max(goal, furthest)

    def _set(self, factor: float) -> None:
        self.achieved = self.backlight.set_factor(factor)
        self.factor = factor
