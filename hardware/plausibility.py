"""What a reading can be: the one place that knows, for each instrument and quantity, which values exist.

Whether a reply has the right form (length, fields, exponent, parity) is its driver's affair. Whether the
number in it can be one is told here, for every driver, also those of other packages: a value outside the
instrument's range, and a chromaticity of no light, are errors (`Fault.IMPLAUSIBLE`), never readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from evenlight.hardware.protocols import Fault, InstrumentError


@dataclass(frozen=True, slots=True)
class Span:
    """The values that an instrument can give."""

    least: float
    most: float
    source: str  # where that is from


ANY_LUMINANCE = Span(0.0, 1e6, "no display is as bright: the sun is 1.6e9 cd/m^2, white paper in it 3e4")
ANY_POWER = Span(-1e4, 1e4, "no panel, and no computer with it, takes as much")
MINOLTA_CATALOGUE = "Konica Minolta's catalogue, FAST, quoted from memory; 0 is what its display begins with"
# By the name of the driver [cd/m^2]; ANY_LUMINANCE for the others, whose data sheets we could not get.
LUMINANCES: dict[str, Span] = {
    "ls100": Span(0.0, 299_900.0, MINOLTA_CATALOGUE),
    "ls110": Span(0.0, 999_900.0, MINOLTA_CATALOGUE),
    "cs100a": Span(0.0, 299_000.0, MINOLTA_CATALOGUE),
}
POWERS: dict[str, Span] = {  # by the name of the driver [W]; ANY_POWER for the others
    "ppk2": Span(-0.05, 5.0, "Nordic's user guide: 0.8 to 5 V, up to 1 A; below 0 a zero error only"),
    "battery": Span(0.05, 500.0, "a computer that shows a film; the largest chargers of laptops have 330 W"),
    "adb": Span(0.02, 25.0, "a phone or headset with its screen on"),
}

# The chromaticities of single wavelengths, 380 to 700 nm: CIE 1931, 2 degrees (CIE 15:2004, table T.4). Those
# of all lights are within, and on the line from the last to the first.
SPECTRAL_LOCUS = (
    *((0.1741, 0.0050), (0.1644, 0.0109), (0.1440, 0.0297), (0.1241, 0.0578), (0.1096, 0.0868)),
    *((0.0913, 0.1327), (0.0687, 0.2007), (0.0454, 0.2950), (0.0235, 0.4127), (0.0082, 0.5384)),
    *((0.0039, 0.6548), (0.0139, 0.7502), (0.0389, 0.8120), (0.0743, 0.8338), (0.1142, 0.8262)),
    *((0.1547, 0.8059), (0.2296, 0.7543), (0.3373, 0.6589), (0.4441, 0.5547), (0.5125, 0.4866)),
    *((0.5752, 0.4242), (0.6270, 0.3725), (0.6915, 0.3083), (0.7347, 0.2653)),
)
COLORIMETER_ERROR = 0.05  # of x and y: filters match narrow-band primaries to some 0.02
DARK_NOISE = 0.02  # [cd/m^2] of X, Y and Z: over the luminance, it is the error of x and y in the dark


def require_luminance(
    driver: str, device: str, luminance: float, chromaticity: tuple[float, float] | None = None
) -> None:
    """Refuse a luminance [cd/m^2] that an instrument cannot have measured, or a chromaticity of no light.

    Parameters
    ----------
    driver : str
        Name of the driver, e.g. "ls100".
    device : str
        The device, as messages name it.
    luminance : float
        What it answered [cd/m^2].
    chromaticity : tuple of float, optional
        CIE 1931 x and y.

    Raises
    ------
    InstrumentError
        IMPLAUSIBLE, with the value and what it can be.
    """
    _require(LUMINANCES.get(driver, ANY_LUMINANCE), device, luminance, "cd/m^2")
    if chromaticity is None:
        return
    x, y = chromaticity
    allowed = COLORIMETER_ERROR + (DARK_NOISE / luminance if luminance > 0 else math.inf)
    if not (math.isfinite(x) and math.isfinite(y) and distance_from_lights(x, y) <= allowed):
        raise InstrumentError(
            f"{device}: sent the chromaticity x {x:g}, y {y:g} with {luminance:g} cd/m^2, which is that of "
            "no light",
            Fault.IMPLAUSIBLE,
        )


def distance_from_lights(x: float, y: float) -> float:
    """Return how far outside the chromaticities of all lights a CIE 1931 chromaticity is; below 0 inside.

    >>> distance_from_lights(0.3127, 0.3290) < 0
    True
    >>> round(distance_from_lights(-0.9, 0.3290), 2)
    0.93
    """
    ends = zip(SPECTRAL_LOCUS, SPECTRAL_LOCUS[1:] + SPECTRAL_LOCUS[:1], strict=True)
    return max(
        ((x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)) / math.hypot(x2 - x1, y2 - y1)
        for (x1, y1), (x2, y2) in ends
    )


def require_power(driver: str, device: str, power: float) -> None:
    """Refuse a power [W] that an instrument cannot have measured; as `require_luminance`."""
    _require(POWERS.get(driver, ANY_POWER), device, power, "W")


def _require(span: Span, device: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and span.least <= value <= span.most):
        raise InstrumentError(
            f"{device}: sent {value:g} {unit}; what it measures is {span.least:g} to {span.most:g} {unit}",
            Fault.IMPLAUSIBLE,
        )
