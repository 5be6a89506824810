"""The power that a display takes, as a function of brightness and, for OLED, of content."""

from __future__ import annotations

import enum

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import MOMENT, described, quantity, record
from evenlight.data_schema.storage.text_files import save_record

LARGEST = 1e6  # W, cd/m^2, W m^2/cd: beyond, a number is a typing error, and products of them overflow
LEAST_LIGHT = (
    1e-6  # [W] a full panel's light: a square centimetre of 100 cd/m^2 is 5e-5 W of light at 683 lm/W
)


class PanelKind(enum.Enum):
    """What makes the light."""

    LCD = "lcd"  # one global backlight: power depends on the brightness factor alone
    OLED = "oled"  # each pixel makes its own: power depends on content and factor


@record
class PowerModel:
    """Power of a display panel, linear in the luminance that it makes.

    LCD: P = base_power + power_per_luminance · b · peak_luminance (Section 5 of the paper).
    OLED: P = base_power + b · (red_power·R + green_power·G + blue_power·B), with R, G, B the means over the
    frame of the linear channels in [0, 1].
    """

    name: str = described("name of the power model")
    kind: PanelKind = described("what makes the light: a backlight, or each pixel")
    base_power: float = quantity("W", "power at zero luminance", minimum=0.0, maximum=LARGEST)
    power_per_luminance: float = quantity(
        "W m^2/cd", "LCD: slope of power over luminance", minimum=0.0, maximum=LARGEST, default=0.0
    )
    peak_luminance: float = quantity(
        "cd/m^2",
        "LCD: luminance of the power panel at b = 1; it need not be the display that is watched",
        minimum=0.0,
        maximum=LARGEST,
        default=0.0,
    )
    red_power: float = quantity(
        "W",
        "OLED: power of the red channel at full drive over the whole panel",
        minimum=0.0,
        maximum=LARGEST,
        default=0.0,
    )
    green_power: float = quantity(
        "W",
        "OLED: power of the green channel at full drive over the whole panel",
        minimum=0.0,
        maximum=LARGEST,
        default=0.0,
    )
    blue_power: float = quantity(
        "W",
        "OLED: power of the blue channel at full drive over the whole panel",
        minimum=0.0,
        maximum=LARGEST,
        default=0.0,
    )
    source: str = described("where the figures come from", default="")
    measured: str = described(
        "when it was measured, UTC (ISO 8601, the date at least); empty if unknown",
        default="",
        pattern=MOMENT,
    )
    provenance: Provenance | None = described("how the file was made", default=None)

    def __post_init__(self) -> None:
        if self.kind is PanelKind.LCD and not self.power_per_luminance * self.peak_luminance > 0:
            raise ValueError(
                "an lcd power model needs power_per_luminance_w_m2_cd and peak_luminance_cd_m2 above 0"
            )
        if self.kind is PanelKind.OLED and not self.red_power + self.green_power + self.blue_power > 0:
            raise ValueError("an oled power model needs a channel power above 0 W")
        full, by = self.light_power
        if not LEAST_LIGHT <= full <= LARGEST:
            raise ValueError(
                f"the light at full brightness ({by}) must take {LEAST_LIGHT:g} to {LARGEST:g} W, "
                f"got {full:.4g} W"
            )

    @property
    def light_power(self) -> tuple[float, str]:
        """What the light of a full white takes [W], and what that is computed from."""
        if self.kind is PanelKind.LCD:
            by = "power_per_luminance_w_m2_cd times peak_luminance_cd_m2"
            return self.power_per_luminance * self.peak_luminance, by
        return self.red_power + self.green_power + self.blue_power, "the sum of the channels"

    save = save_record

    def __repr__(self) -> str:
        slope = f"{self.power_per_luminance:.4g} W m^2/cd up to {self.peak_luminance:g} cd/m^2"
        if self.kind is PanelKind.OLED:
            slope = f"{self.red_power:.4g}, {self.green_power:.4g}, {self.blue_power:.4g} W for R, G, B"
        return f"<PowerModel {self.name!r}: {self.kind.value}, {self.base_power:.4g} W and {slope}>"
