"""Looking around from one point: where mouse and keys turn the view, and how far."""

from __future__ import annotations

from dataclasses import dataclass

STEP = 10.0  # [deg] that a press of a key turns
TURNING = 0.25  # [s] that it takes
HIGHEST = 60.0  # [deg] altitude, to both sides


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn by the keys: when it began [s], and by how much azimuth and altitude change [deg]."""

    begun: float
    azimuth: float
    altitude: float


class LookingAround:
    """The direction of view of someone who turns on the spot.

    Parameters
    ----------
    altitude : float
        Of the first view [deg].
    field_of_view : float
        How far one may turn from the first azimuth, to each side [deg].
    pixels_per_degree : float
        Of the display; a movement of the mouse by some pixels turns the view by as many in its middle.

    >>> looking = LookingAround(altitude=0.0, field_of_view=15.0, pixels_per_degree=20.0)
    >>> looking.moved(right=40, up=-10)
    >>> looking.direction(now=0.0)
    (2.0, -0.5)
    >>> looking.turn(right=1, up=0, now=0.0)
    >>> looking.direction(now=0.125), looking.direction(now=0.25)
    ((7.0, -0.5), (12.0, -0.5))
    >>> looking.turn(right=1, up=0, now=1.0)  # as far as the field of view goes
    >>> looking.direction(now=2.0)
    (15.0, -0.5)
    """

    def __init__(self, altitude: float, field_of_view: float, pixels_per_degree: float) -> None:
        self._widest, self._pixels_per_degree = field_of_view, pixels_per_degree
        # A first view beyond the limits may be kept.
        self._lowest, self._highest = min(-HIGHEST, altitude), max(HIGHEST, altitude)
        self._azimuth, self._altitude = 0.0, altitude  # where the view will be when all turns are over
        self._turns: list[Turn] = []

    def moved(self, right: float, up: float) -> None:
        """Turn the view at once, by a movement of the mouse [pixels]."""
        self._go(right / self._pixels_per_degree, up / self._pixels_per_degree)

    def turn(self, right: int, up: int, now: float) -> None:
        """Begin to turn the view by steps of `STEP`, to the right and up, at a time [s]."""
        azimuth, altitude = self._go(right * STEP, up * STEP)
        self._turns.append(Turn(now, azimuth, altitude))

    def direction(self, now: float) -> tuple[float, float]:
        """Return the direction of view at a time [s]: azimuth from the first one, and altitude [deg]."""
        self._turns = [turn for turn in self._turns if now - turn.begun < TURNING]
        left = [(turn, 1 - eased((now - turn.begun) / TURNING)) for turn in self._turns]
        azimuth = self._azimuth - sum(share * turn.azimuth for turn, share in left)
        altitude = self._altitude - sum(share * turn.altitude for turn, share in left)
        # A mouse that moves back while a turn lasts could leave the limits for a moment.
        return (
            min(max(azimuth, -self._widest), self._widest),
            min(max(altitude, self._lowest), self._highest),
        )

    def _go(self, right: float, up: float) -> tuple[float, float]:
        """Change where the view will be, as far as the limits allow, and return by how much [deg]."""
        azimuth = min(max(self._azimuth + right, -self._widest), self._widest)
        altitude = min(max(self._altitude + up, self._lowest), self._highest)
        change = azimuth - self._azimuth, altitude - self._altitude
        self._azimuth, self._altitude = azimuth, altitude
        return change


def eased(share: float) -> float:
    """Return how much of a turn is done after a share of its time: slow at both ends.

    >>> eased(-0.1), eased(0.5), eased(1.0)
    (0.0, 0.5, 1.0)
    """
    share = min(max(share, 0.0), 1.0)
    return share * share * (3 - 2 * share)


def steps_to(azimuth: float, altitude: float, first_altitude: float = 0.0) -> tuple[int, int]:
    """Return how often the keys turn right and up until the view is nearest to a direction [deg].

    >>> steps_to(azimuth=-23.0, altitude=12.0)
    (-2, 1)
    """
    return round(azimuth / STEP), round((altitude - first_altitude) / STEP)
