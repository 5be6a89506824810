"""How visible a ring is in a scene, by the method's own contrast model (Eqs. 2 and 3)."""

from __future__ import annotations

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast_loss import csf_contrasts
from evenlight.method.luminance import dimmed_luminance
from evenlight.method.masking import MASKING_EXPONENT, TRANSDUCER_EXPONENT, neighbourhood_mean
from evenlight.stimuli.landolt import Ring, covered
from evenlight.stimuli.viewing_geometry import focal_length_of

SUBSAMPLES = 4  # along each side of a pixel


def ring_visibility(
    alone: Array, in_scene: Array, factor: float, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> float:
    """Return how far above its threshold a ring is in a scene: 1 at threshold.

    The ring's own contrast C in units of threshold, band by band and pixel by pixel, is that of the ring
    alone on a uniform ground. Its perceived contrast is |C|^0.7 / (1 + M), as in Eq. 3, with M the mean over
    the neighbourhood of |C'|^0.2 of all that is there, C' being the contrast of the scene with the ring. So
    the texture that the ring lies on masks it, and on a uniform ground that is the C_t of Eq. 3 itself. The
    largest counts: the method calls a pixel visible where |C_t| exceeds 1.

    Parameters
    ----------
    alone : array, (height, width)
        I, luminance emitted at b = 1 of the ring on a uniform ground [cd/m^2].
    in_scene : array, same shape
        I of the scene with the ring [cd/m^2].
    factor : float
        Brightness factor b.
    display : Display
        Its pixels per degree, and the light that it reflects.
    model : ContrastModel
        Choices of the contrast model.

    >>> lab = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
    >>> ring_visibility(np.full((16, 16), 50.0), np.full((16, 16), 50.0), 0.5, lab)
    0.0
    """
    own, all_there = (
        csf_contrasts(dimmed_luminance(emitted, factor, display), display, model)
        for emitted in (alone, in_scene)
    )
    return max(
        float((np.abs(ring) ** TRANSDUCER_EXPONENT / (1 + _masking(scene, model))).max())
        for ring, scene in zip(own, all_there, strict=True)
    )


def _masking(contrast: Array, model: ContrastModel) -> Array:
    """Return what masks each pixel of a band."""
    return neighbourhood_mean(np.abs(contrast) ** MASKING_EXPONENT, model.masking)


def ring_alone(ring: Ring, background: float, side: int, display: Display) -> Array:
    """Return a ring in the middle of a uniform ground, drawn at its true size, (side, side) [cd/m^2].

    Parameters
    ----------
    ring : Ring
        The ring.
    background : float
        Luminance of the ground, emitted at b = 1 [cd/m^2].
    side : int
        Of the picture [pixels].
    display : Display
        What shows it, pixel for pixel.
    """
    fine = (np.arange(side * SUBSAMPLES) + 0.5) / SUBSAMPLES - side / 2
    gaps = fine / focal_length_of(display) / ring.gap_on_plane
    points = np.stack(np.meshgrid(gaps, -gaps), axis=-1)
    shape = (side, SUBSAMPLES, side, SUBSAMPLES)
    coverage = covered(points, ring.orientation).reshape(shape).mean(axis=(1, 3))
    return np.asarray(background * (1 + ring.contrast * coverage))
