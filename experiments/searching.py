"""A search as it goes on: where one looks, when the key was pressed, when it is over."""

from __future__ import annotations

from collections.abc import Iterable

from evenlight.data_schema.rig import Rig
from evenlight.experiments.refreshes import DECIMALS, Refreshes
from evenlight.experiments.stage import KEY_DECIMALS, Searched, SearchView
from evenlight.hardware.protocols import KeyPress
from evenlight.stimuli.looking import LookingAround

ANGLE_DECIMALS = 6  # [deg] a thousandth of a pixel


class Searching:
    """Follows the keys, and notes each refresh, of one search.

    Parameters
    ----------
    view : SearchView
        What is searched.
    rig : Rig
        Refresh rate and keys.
    pixels_per_degree : float
        Of the display, for movements of a mouse.
    """

    def __init__(self, view: SearchView, rig: Rig, pixels_per_degree: float) -> None:
        self._time_limit, self._found_key = view.time_limit, rig.keys.found
        self._half_a_refresh = 0.5 / rig.refresh_rate
        self._turns = {
            rig.keys.turn_left: (-1, 0),
            rig.keys.turn_right: (1, 0),
            rig.keys.turn_up: (0, 1),
            rig.keys.turn_down: (0, -1),
        }
        self.looking = LookingAround(view.camera.altitude, view.field_of_view, pixels_per_degree)
        self.refreshes = Refreshes(rig.refresh_rate)
        self._directions: list[tuple[float, float]] = []
        self._factors: list[float] = []
        self._last_flip = 0.0
        self._found_after: float | None = None

    @property
    def over(self) -> bool:
        """Whether the key was pressed, or the last refresh before the time limit was shown."""
        if self._found_after is not None:
            return True
        shown = len(self.refreshes) > 0
        return shown and self._last_flip - self.refreshes.onset >= self._time_limit - self._half_a_refresh

    def direction(self, now: float) -> tuple[float, float]:
        """Return the direction of view at a time: azimuth from the first one, and altitude [deg]."""
        azimuth, altitude = self.looking.direction(now)
        return round(azimuth, ANGLE_DECIMALS), round(altitude, ANGLE_DECIMALS)

    def note(self, flip: float, direction: tuple[float, float], factor: float | None = None) -> None:
        """Note a refresh: when it appeared [s], where one looked, and what the backlight reported."""
        self.refreshes.note(flip)
        self._last_flip = flip
        self._directions.append(direction)
        if factor is not None:
            self._factors.append(factor)

    def take(self, presses: Iterable[KeyPress]) -> None:
        """Take keys that were pressed since the last refresh, each at its own time."""
        for press in presses:
            if press.name in self._turns:
                right, up = self._turns[press.name]
                self.looking.turn(right, up, press.time)
            elif press.name == self._found_key and self._found_after is None:
                after = round(press.time - self.refreshes.onset, KEY_DECIMALS)
                # What was pressed before the scene was there, or too late, finds nothing.
                if 0 <= after <= self._time_limit:
                    self._found_after = after

    def result(self, background_luminance: float) -> Searched:
        """Return how it went."""
        return Searched(
            onset=self.refreshes.onset,
            found_after=self._found_after,
            flip_times=self.refreshes.times(),
            azimuths=tuple(azimuth for azimuth, _ in self._directions),
            altitudes=tuple(altitude for _, altitude in self._directions),
            background_luminance=round(background_luminance, DECIMALS),
            backlight_factors=tuple(self._factors),
            frames_dropped=self.refreshes.dropped(),
        )
