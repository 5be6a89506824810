"""The colours of a day that breaks, by the altitude of the sun."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

# Linear light as shares of the display's peak (Rec. 709 primaries), chosen by eye after photographs of clear
# mornings, with the exposure of a camera that follows the light: what is 10^6 in nature is about 60 here.
ALTITUDES = (-12.0, -7.0, -3.0, 0.0, 3.0, 7.0, 12.0, 22.0)
COLOURS = {
    "zenith": "0.0035 0.0062 0.0145 | 0.008 0.0145 0.036 | 0.028 0.046 0.105 | 0.065 0.10 0.20 | "
    "0.11 0.17 0.32 | 0.14 0.24 0.45 | 0.15 0.29 0.56 | 0.14 0.31 0.64",
    "middle": "0.0055 0.0088 0.0185 | 0.019 0.020 0.042 | 0.105 0.080 0.125 | 0.27 0.18 0.21 | "
    "0.40 0.33 0.36 | 0.40 0.44 0.52 | 0.37 0.49 0.66 | 0.32 0.50 0.76",
    "horizon": "0.010 0.013 0.024 | 0.050 0.033 0.043 | 0.27 0.13 0.10 | 0.60 0.30 0.16 | "
    "0.80 0.46 0.21 | 0.84 0.60 0.34 | 0.80 0.72 0.55 | 0.66 0.75 0.82",
    "glow": "0.002 0.001 0.0005 | 0.07 0.026 0.008 | 0.48 0.17 0.04 | 1.0 0.42 0.10 | "
    "1.25 0.62 0.18 | 1.1 0.66 0.25 | 0.72 0.54 0.30 | 0.40 0.37 0.30",
    "cloud_lit": "0.011 0.015 0.026 | 0.075 0.042 0.050 | 0.58 0.22 0.15 | 1.15 0.52 0.27 | "
    "1.25 0.82 0.50 | 1.15 0.98 0.78 | 1.05 1.02 0.95 | 1.0 1.0 0.99",
    "cloud_dark": "0.0055 0.008 0.016 | 0.020 0.019 0.034 | 0.095 0.070 0.105 | 0.21 0.16 0.20 | "
    "0.33 0.29 0.34 | 0.40 0.42 0.48 | 0.46 0.51 0.58 | 0.52 0.59 0.68",
    "ambient": "0.036 0.054 0.10 | 0.050 0.058 0.10 | 0.12 0.11 0.155 | 0.22 0.21 0.26 | "
    "0.30 0.32 0.38 | 0.36 0.41 0.50 | 0.40 0.47 0.57 | 0.42 0.50 0.62",
    "sun": "0.0005 0.0002 0.0001 | 0.002 0.0008 0.0003 | 0.02 0.006 0.002 | 0.42 0.12 0.03 | "
    "1.25 0.56 0.20 | 1.7 1.15 0.66 | 2.0 1.65 1.2 | 2.2 2.0 1.7",
    "disc": "3 0.5 0.05 | 3 0.5 0.05 | 3 0.6 0.06 | 3.5 0.7 0.08 | "
    "4 1.1 0.15 | 5 2.0 0.45 | 7 4.5 2.0 | 9 8 6.5",
}


@dataclass(frozen=True, slots=True)
class Daylight:
    """Colours of one moment, each three shares of the display's peak: R, G, B.

    Attributes
    ----------
    zenith, middle, horizon, glow, cloud_lit, cloud_dark, ambient, sun, disc : array, (3,)
        Of the sky above, half-way and at the horizon; of the glow below the sun; of clouds towards the sun
        and away from it; of the light that falls on the land from the sky and from the sun; of the sun.
    """

    zenith: NDArray[np.float32]
    middle: NDArray[np.float32]
    horizon: NDArray[np.float32]
    glow: NDArray[np.float32]
    cloud_lit: NDArray[np.float32]
    cloud_dark: NDArray[np.float32]
    ambient: NDArray[np.float32]
    sun: NDArray[np.float32]
    disc: NDArray[np.float32]


def daylight(altitude: float) -> Daylight:
    """Return the colours for an altitude of the sun [degrees], from -12 to 22; the eye sees ratios, so logs.

    >>> daylight(22.0).zenith.tolist() == daylight(30.0).zenith.tolist()
    True
    """
    at = min(max(altitude, ALTITUDES[0]), ALTITUDES[-1])
    return Daylight(**{name: np.exp(curve(at)).astype(np.float32) for name, curve in _CURVES.items()})


def _curve(colours: str) -> PchipInterpolator:
    """Return the smooth curve through the logarithms of some colours."""
    table = np.array([[float(part) for part in colour.split()] for colour in colours.split("|")])
    return PchipInterpolator(ALTITUDES, np.log(table))


_CURVES = {name: _curve(colours) for name, colours in COLOURS.items()}
