"""Pixel values to luminance: the display model (Eq. 1), colour, and dimming."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.contrast_model import PixelToLuminance
from evenlight.data_schema.display import Display

LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)  # of linear R, G, B; ITU-R BT.709-6


def displayed_luminance(pixel_values: ArrayLike, display: Display) -> NDArray[np.float64]:
    """Return the luminance L that reaches the eye for gamma-encoded pixel values L' (Eq. 1).

    Parameters
    ----------
    pixel_values : array_like, any shape
        L', in [0, 1].
    display : Display
        The display that shows them; its reflected light is part of the result.

    Returns
    -------
    array, same shape
        L [cd/m^2].

    >>> lab = Display("lab", peak_luminance=100.0, black_level=0.1, gamma=2.2, pixels_per_degree=60.0)
    >>> displayed_luminance([0, 1], lab).tolist()
    [0.1, 100.0]
    """
    linear = np.asarray(pixel_values, dtype=np.float64) ** display.gamma
    return dimmed_luminance(_emitted(linear, display), 1.0, display)


def dimmed_luminance(emitted: ArrayLike, factor: ArrayLike, display: Display) -> NDArray[np.float64]:
    """Return the luminance D = b · I + L_refl that reaches the eye from a dimmed display.

    Decision (docs/decisions/pixel-to-luminance.md): b scales everything that the backlight makes, the black
    level included; reflected light comes from elsewhere and is not scaled.

    Parameters
    ----------
    emitted : array_like, any shape
        I, luminance emitted at b = 1 [cd/m^2].
    factor : array_like, broadcast with `emitted`
        Brightness factor b, in (0, 1].
    display : Display
        The display, for L_refl.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0, reflected_luminance=1.0)
    >>> dimmed_luminance(100.0, 0.5, lab).item()
    51.0
    """
    return np.asarray(factor) * np.asarray(emitted, dtype=np.float64) + display.reflected_luminance


def drawn_luminance(emitted: ArrayLike, factor: ArrayLike, display: Display) -> NDArray[np.float64]:
    """Return the luminance that reaches the eye where pixels dim: none makes less than L_black.

    Decision (docs/decisions/dimmed-playback.md): D = max(b · I, L_black) + L_refl, for each channel as if all
    three had its level.

    Parameters
    ----------
    emitted, factor, display : array_like, array_like, Display
        As in `dimmed_luminance`.

    >>> lab = Display("lab", 100.0, 1.0, 2.2, pixels_per_degree=60.0, reflected_luminance=4.0)
    >>> drawn_luminance([1.0, 100.0], 0.5, lab).tolist()
    [5.0, 54.0]
    """
    dimmed = np.asarray(factor) * np.asarray(emitted, dtype=np.float64)
    return np.asarray(np.maximum(dimmed, display.black_level) + display.reflected_luminance)


def emitted_luminance(
    pixel_values: NDArray[Any],
    display: Display,
    order: PixelToLuminance = PixelToLuminance.LINEAR_FIRST,
) -> NDArray[np.float64]:
    """Return the luminance I that a display emits for a colour frame at b = 1, reflections excluded.

    Decision (docs/decisions/pixel-to-luminance.md): each channel is linearized with the display's gamma,
    and the linear channels are weighed to luminance.

    Parameters
    ----------
    pixel_values : array, (height, width, 3)
        Gamma-encoded R, G, B: uint8 or uint16 over the full range, or floats in [0, 1].
    display : Display
        The display that shows it.
    order : PixelToLuminance
        Which comes first, linearizing or weighing.

    Returns
    -------
    array, (height, width)
        I [cd/m^2].

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> emitted_luminance(np.full((1, 1, 3), 255, np.uint8), lab).round(9).tolist()
    [[100.0]]
    """
    weights = np.array(LUMINANCE_WEIGHTS)
    if order is PixelToLuminance.LUMA_FIRST:
        return _emitted((unit_pixel_values(pixel_values) @ weights) ** display.gamma, display)
    return _emitted(linear_channels(pixel_values, display.gamma) @ weights, display)


def linear_channels(pixel_values: NDArray[Any], gamma: float) -> NDArray[np.float64]:
    """Return linear R, G, B in [0, 1] for gamma-encoded ones, (..., 3).

    >>> linear_channels(np.array([[0.0, 0.5, 1.0]]), gamma=2.0).tolist()
    [[0.0, 0.25, 1.0]]
    """
    return np.asarray(unit_pixel_values(pixel_values) ** gamma)


def channel_means(pixel_values: NDArray[Any], gamma: float) -> NDArray[np.float64]:
    """Return the means of the linear R, G, B channels of a frame, (3,); an OLED's power follows them.

    >>> channel_means(np.array([[[0.0, 0.5, 1.0]]]), gamma=2.0).tolist()
    [0.0, 0.25, 1.0]
    """
    return np.asarray(linear_channels(pixel_values, gamma).mean(axis=(0, 1)))


def unit_pixel_values(pixel_values: NDArray[Any]) -> NDArray[np.float64]:
    """Return pixel values L' in [0, 1]: integers are divided by the largest of their type.

    >>> unit_pixel_values(np.array([0, 255], np.uint8)).tolist()
    [0.0, 1.0]
    """
    values = np.asarray(pixel_values, dtype=np.float64)
    if np.issubdtype(pixel_values.dtype, np.integer):
        return np.asarray(values / np.iinfo(pixel_values.dtype).max)
    return values


def _emitted(linear: NDArray[np.float64], display: Display) -> NDArray[np.float64]:
    return linear * (display.peak_luminance - display.black_level) + display.black_level
