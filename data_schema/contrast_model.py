"""The choices of the contrast model, where the paper is silent or contradicts itself."""

from __future__ import annotations

import enum

from evenlight.data_schema.quantities import count, described, quantity, record

LOWEST_FREQUENCY = 0.5  # [cpd] FovVideoVDP's lowest band, Mantiuk et al. (2021)
FIELD_SIZE = 60.0  # X0 [deg]; ITU-R BT.2246 and the authors' script
EPSILON = 1e-6  # ε [cd/m^2]; "a small value" in the paper: the luminance below which the eye sees nothing


class PixelToLuminance(enum.Enum):
    """How three gamma-encoded channels become one luminance."""

    LINEAR_FIRST = "linear_first"  # linearize each channel, then weigh: what a display emits
    LUMA_FIRST = "luma_first"  # weigh the encoded channels, then linearize: as the authors' script


class BandFrequency(enum.Enum):
    """Which frequency f a band of the pyramid stands for."""

    NYQUIST = "nyquist"  # upper end: Nyquist, halved per level, as Tursun et al. (2019)
    CENTROID = "centroid"  # energy centroid of the band's filter
    AUTHORS = "authors"  # a quarter of Nyquist, halved per level: as the authors' script


class SensitivityModel(enum.Enum):
    """Which contrast sensitivity function."""

    BARTEN = "barten"  # full form, pupil from luminance and field size
    SIMPLIFIED = "simplified"  # closed form of the 2003 paper
    AUTHORS = "authors"  # full form with a fixed pupil, at the mean luminance of the level
    CASTLE = "castle"  # castleCSF's achromatic form, fitted to many data sets (Ashraf et al. 2024)


class MaskingNeighbourhood(enum.Enum):
    """Which pixels mask a pixel."""

    WITH_CENTRE = "with_centre"  # all 25, as printed
    WITHOUT_CENTRE = "without_centre"  # the 24 others, as Tursun et al. (2019)


class Visibility(enum.Enum):
    """Which perceived contrasts count as visible."""

    BOTH_POLARITIES = "both_polarities"  # |C_t| > 1: dark detail is seen as well as bright detail
    POSITIVE_ONLY = "positive_only"  # C_t > 1, as printed
    SOFT = "soft"  # as likely as it is to be detected, both polarities


class LossForm(enum.Enum):
    """What of the visible contrast is counted as lost."""

    RELATIVE = "relative"  # the share of visible contrast that vanishes (Eq. 5)
    ABSOLUTE = "absolute"  # the share of all pixels whose contrast vanishes
    SUPRATHRESHOLD = "suprathreshold"  # the share of perceived contrast above threshold that is lost


@record
class ContrastModel:
    """All choices of the contrast model; the defaults are those of docs/decisions."""

    pixel_to_luminance: PixelToLuminance = described(
        "how three gamma-encoded channels become one luminance", default=PixelToLuminance.LINEAR_FIRST
    )
    band_frequency: BandFrequency = described(
        "which frequency f a band of the pyramid stands for", default=BandFrequency.NYQUIST
    )
    lowest_frequency: float = quantity(
        "cpd", "lowest frequency of a band", above=0.0, maximum=1e3, default=LOWEST_FREQUENCY
    )
    band_count: int | None = count(
        "number of bands, in place of those above lowest_frequency", minimum=1, default=None
    )
    sensitivity: SensitivityModel = described(
        "which contrast sensitivity function S_CSF", default=SensitivityModel.BARTEN
    )
    field_size: float = quantity(
        "deg", "X0, side of the field of view", minimum=1e-3, maximum=360.0, default=FIELD_SIZE
    )
    masking: MaskingNeighbourhood = described(
        "which pixels mask a pixel", default=MaskingNeighbourhood.WITH_CENTRE
    )
    masking_strength: float = quantity(
        "1",
        "what the masking of Eq. 3 is multiplied by; 0: none",
        minimum=0.0,
        maximum=4.0,
        default=1.0,
        later=True,
    )
    threshold: float = quantity(
        "1",
        "contrast that a lone pattern needs to be visible, in multiples of what S_CSF says",
        minimum=1e-3,
        maximum=1e3,
        default=1.0,
        later=True,
    )
    visibility: Visibility = described(
        "which perceived contrasts C_t count as visible", default=Visibility.BOTH_POLARITIES
    )
    loss: LossForm = described(
        "what of the visible contrast is counted as lost", default=LossForm.RELATIVE, later=True
    )
    epsilon: float = quantity(
        "cd/m^2",
        "ε of Eq. 2: small beside what is seen, and not lost in 32 bits",
        minimum=1e-12,
        maximum=1.0,
        default=EPSILON,
    )


DEFAULT_MODEL = ContrastModel()
