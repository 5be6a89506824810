"""Power of a display: what each frame takes at a brightness factor (Section 5 of the paper; OLED)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.power_model import PanelKind, PowerModel


def power_per_factor(model: PowerModel | None, channel_means: ArrayLike) -> NDArray[np.float64]:
    """Return the power that brightness adds, per unit of the factor, for each of N frames [W].

    The power of frame i is P_i = base_power + power_per_factor[i] · b_i, for both kinds of panel.

    Parameters
    ----------
    model : PowerModel or None
        The panel; None: not known, and so is its power (NaN).
    channel_means : array_like, (N, 3)
        Means of the linear R, G, B channels, in [0, 1]; an LCD's backlight does not depend on them.

    >>> lcd = PowerModel("p", PanelKind.LCD, 0.3, power_per_luminance=0.002, peak_luminance=500.0)
    >>> power_per_factor(lcd, [[0, 0, 0], [1, 1, 1]]).tolist()
    [1.0, 1.0]
    """
    means = np.asarray(channel_means, dtype=np.float64)
    if model is None:
        return np.full(len(means), np.nan)
    if model.kind is PanelKind.LCD:
        return np.full(len(means), model.power_per_luminance * model.peak_luminance)
    return np.asarray(means @ np.array([model.red_power, model.green_power, model.blue_power]))


def power(model: PowerModel, factors: ArrayLike, channel_means: ArrayLike) -> NDArray[np.float64]:
    """Return the power P_i of each frame at its brightness factor [W].

    Parameters
    ----------
    model : PowerModel
        The panel.
    factors : array_like, (N,)
        b, in (0, 1].
    channel_means : array_like, (N, 3)
        Means of the linear R, G, B channels, in [0, 1].

    >>> oled = PowerModel("p", PanelKind.OLED, 1.0, red_power=0.5, green_power=1.0, blue_power=2.0)
    >>> power(oled, [1.0, 0.5], [[1, 1, 1], [0, 1, 0]]).tolist()
    [4.5, 1.5]
    """
    return model.base_power + np.asarray(factors, dtype=np.float64) * power_per_factor(model, channel_means)
