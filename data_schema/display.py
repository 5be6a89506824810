"""The display: how pixel values become luminance, and how finely it resolves the visual field."""

from __future__ import annotations

import enum
import math

from evenlight.data_schema.notebook import display_html
from evenlight.data_schema.power_model import PanelKind
from evenlight.data_schema.provenance import Provenance, sha256_of_bytes
from evenlight.data_schema.quantities import MOMENT, described, quantity, record
from evenlight.data_schema.storage.text_files import save_record

# Beyond these a number is a typing error or in another unit, and the model would overflow or see nothing.
HIGHEST_LUMINANCE = 1e6  # [cd/m^2] far above any panel, far below the sun's disc
DIMMEST = 1e-6  # [cd/m^2] of white: the dark-adapted eye sees nothing below
# A linear display has 1, measured with errors; panels have 1.8 to 2.6, medical ones up to 3. Below 0.5 lies
# the exponent that encodes (1/2.2), taken for the one that decodes.
LOWEST_GAMMA, HIGHEST_GAMMA = 0.5, 5.0
LOWEST_CONTRAST = (
    2.0  # white over black; paper has 15, a projector's slide 100: the room's light is not black
)
COARSEST, FINEST = 1e-3, 1e4  # [1/deg] the eye resolves 60 cycles, which takes 120 pixels
# What is known of the device, beside its light.
OF_DEVICE = (
    "device", "panel", "actuator", "resolution", "size", "viewing_distance", "field_of_view", "power_model",
)  # fmt: skip
DEVICES = "^(monitor|laptop|phone|tablet|television|projector|headset)?$"


class Actuator(enum.Enum):
    """What makes the brightness."""

    PIXELS = "pixels"
    BACKLIGHT = "backlight"


@record
class Display:
    """A display, as measured with a luminance meter (parameters of the paper's Eq. 1)."""

    name: str = described("name of the display, for figures and messages")
    peak_luminance: float = quantity(
        "cd/m^2",
        "L_max, emitted at full pixel value and full brightness",
        minimum=DIMMEST,
        maximum=HIGHEST_LUMINANCE,
    )
    black_level: float = quantity(
        "cd/m^2", "L_black, emitted at pixel value 0 and full brightness", minimum=0.0
    )
    gamma: float = quantity(
        "1", "γ, exponent from pixel value to luminance", minimum=LOWEST_GAMMA, maximum=HIGHEST_GAMMA
    )
    pixels_per_degree: float = quantity(
        "1/deg",
        "pixels per degree of visual angle; half of it is the highest spatial frequency shown (cpd)",
        minimum=COARSEST,
        maximum=FINEST,
    )
    reflected_luminance: float = quantity(
        "cd/m^2",
        "L_refl, ambient light reflected from the surface; not dimmed with the display",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
        default=0.0,
    )
    source: str = described("where the figures come from", default="")
    measured: str = described(
        "when it was measured, UTC (ISO 8601, the date at least); empty if unknown",
        default="",
        pattern=MOMENT,
    )
    provenance: Provenance | None = described("how the file of a measured display was made", default=None)
    device: str = described(
        "kind of device: monitor, laptop, phone, tablet, television, projector or headset",
        default="",
        pattern=DEVICES,
        later=True,
    )
    panel: PanelKind | None = described("what makes the light", default=None, later=True)
    actuator: Actuator | None = described(
        "what dims it, where nothing else is asked: its backlight, or its pixels", default=None, later=True
    )
    resolution: tuple[int, int] | None = quantity(
        "pixels", "its pixels across and down", minimum=1, default=None, later=True
    )
    size: tuple[float, float] | None = quantity(
        "mm", "width and height of its picture, if it is flat", above=0.0, default=None, later=True
    )
    viewing_distance: float | None = quantity(
        "m",
        "distance from the eye at which it has its pixels per degree",
        above=0.0,
        default=None,
        later=True,
    )
    field_of_view: float | None = quantity(
        "deg",
        "of a headset: angle that its picture spans",
        above=0.0,
        maximum=180.0,
        default=None,
        later=True,
    )
    power_model: str = described(
        "its power model, a preset or a toml file; empty: none is known", default="", later=True
    )

    def __post_init__(self) -> None:
        if not self.black_level < self.peak_luminance / LOWEST_CONTRAST:
            raise ValueError(
                f"need black_level < peak_luminance / {LOWEST_CONTRAST:g}, got {self.black_level:.10g} and "
                f"{self.peak_luminance:.10g} cd/m^2 (light of the room is reflected_luminance, not black)"
            )

    def __repr__(self) -> str:
        light = f"{self.black_level:g} to {self.peak_luminance:g} cd/m^2, gamma {self.gamma:g}"
        return f"<Display {self.name!r}: {light}, {self.pixels_per_degree:.4g} pixels per degree>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: what is known of the device, and its light."""
        return display_html(self)

    save = save_record

    @property
    def nyquist_frequency(self) -> float:
        """Highest spatial frequency that the display shows [cpd]."""
        return self.pixels_per_degree / 2

    @property
    def assumed(self) -> str:
        """What its source assumes, as it names it at its end; empty: nothing."""
        return self.source.partition("assumed: ")[2]

    @property
    def calibration(self) -> str:
        """What was measured, and when, in words.

        >>> Display("desk", 248.0, 0.25, 2.2, pixels_per_degree=38.0, measured="2026-11-21").calibration
        '248 cd/m^2, gamma 2.2, measured 2026-11-21'
        """
        measured = f", measured {self.measured[:10]}" if self.measured else ""
        return f"{self.peak_luminance:g} cd/m^2, gamma {self.gamma:g}{measured}"

    @property
    def fingerprint(self) -> str:
        """Identity of the display's photometry, by which a rate limit knows the display it was fitted on.

        The resolution is not part of it: the same panel behind another lens keeps its rate limit.
        """
        photometry = ("peak_luminance", "black_level", "gamma", "reflected_luminance")
        values = ",".join(f"{getattr(self, key):.9g}" for key in photometry)
        return sha256_of_bytes(values.encode())[:16]


def pixels_per_degree_at(resolution: tuple[int, int], size: tuple[float, float], distance: float) -> float:
    """Return the pixels per degree of a flat picture [1/deg]: 2 d tan(0.5°) over the width of a pixel.

    Parameters
    ----------
    resolution, size, distance : (int, int), (float, float), float
        Pixels across and down; width and height [mm]; distance from the eye [m].

    >>> round(pixels_per_degree_at((2560, 1440), (526.9, 296.4), 0.6), 2)
    50.88
    """
    return 2 * 1000 * distance * math.tan(math.radians(0.5)) * resolution[0] / size[0]
