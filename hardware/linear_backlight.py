"""A backlight whose factors are shares of luminance, whatever the device's own steps are linear in."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager

from evenlight.hardware.backlight_curve import BacklightCurve
from evenlight.hardware.backlights import ROUNDING, require_factor
from evenlight.hardware.protocols import Backlight, InstrumentError

TOLERANCE = 1e-12  # of the logarithm of a factor: far finer than any device
LOOKED_AT = 200  # settings of a device, for its widest step of luminance


class LinearizedBacklight(AbstractContextManager["LinearizedBacklight"]):
    """A backlight, set by the share of the full luminance that it is to make.

    Parameters
    ----------
    inner : Backlight
        The device; it is closed with this.
    curve : BacklightCurve
        What luminance it makes of its factors. Below the lowest that was measured nothing is guessed.

    >>> from evenlight.hardware.backlights import SimulatedBacklight
    >>> square = BacklightCurve((0.1, 0.5, 1.0), (2.0, 50.0, 200.0))
    >>> backlight = LinearizedBacklight(SimulatedBacklight(lambda: 0.0, steps=100), square)
    >>> round(backlight.set_factor(0.25), 6), round(backlight.smallest_factor(), 6)
    (0.25, 0.01)
    """

    def __init__(self, inner: Backlight, curve: BacklightCurve) -> None:
        self._inner = inner
        self._log_share = curve.interpolator()
        self._lowest = max(curve.factors[0], inner.smallest_factor())
        self._refused = self._lowest - inner.step() / 2 - ROUNDING  # no step of the device is nearer

    def set_factor(self, factor: float) -> float:
        """Set the share of the full luminance, and return the one achieved: the nearest step of the device.

        Raises
        ------
        InstrumentError
            If the device has no such share, it was not measured so far down, or the device refuses.
        """
        require_factor(factor, self.smallest_factor(), "the backlight with its measured curve")
        return self._share(self._inner.set_factor(self._device_factor(factor)))

    def read_factor(self) -> float:
        """Return the share of the full luminance that the device reports by its factor."""
        return self._share(self._inner.read_factor())

    def smallest_factor(self) -> float:
        """Return the lowest share above 0 that was measured and can be set."""
        return self._share(self._lowest)

    def step(self) -> float:
        """Return the widest distance between the shares of two neighbouring settings."""
        step = self._inner.step()
        count = min(LOOKED_AT, round((1 - self._lowest) / step))
        lower = [self._lowest + (1 - step - self._lowest) * k / max(count - 1, 1) for k in range(count)]
        return max((self._share(one + step) - self._share(one) for one in lower), default=1.0)

    def min_interval(self) -> float:
        """Return the shortest time between two settings [s]."""
        return self._inner.min_interval()

    def close(self) -> None:
        """Leave the device as it was found; more than once does nothing."""
        self._inner.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _share(self, factor: float) -> float:
        """Return the share of the full luminance that the device makes at a factor of its own."""
        if factor < self._refused:
            raise InstrumentError(
                f"the backlight stands at its factor {factor:.4g}, below {self._lowest:.4g}, the lowest that "
                "its curve was measured at; measure the curve further down, or ask for more"
            )
        return min(1.0, math.exp(float(self._log_share(math.log(min(factor, 1.0))))))

    def _device_factor(self, share: float) -> float:
        """Return the device's own factor for a share of the full luminance: the curve's inverse."""
        from scipy.optimize import brentq

        wanted, lowest = math.log(min(share, 1.0)), math.log(self._lowest)
        if wanted >= 0.0:
            return 1.0
        if wanted <= float(self._log_share(lowest)):
            return self._lowest
        root = brentq(lambda x: float(self._log_share(x)) - wanted, lowest, 0.0, xtol=TOLERANCE)
        return math.exp(float(root))
