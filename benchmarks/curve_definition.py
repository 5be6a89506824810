"""Loss curves as the paper defines them: dim, rebuild, compare."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import loss_of, visible_contrast
from evenlight.method.contrast.luminance import dimmed_luminance


def loss_curves_by_definition(
    emitted: Array, factors: ArrayLike, display: Display, model: ContrastModel = DEFAULT_MODEL
) -> Array:
    """Return the contrast loss of one frame at each factor: dim, rebuild, compare (Eqs. 1 to 5), in float64.

    Parameters
    ----------
    emitted : array, (height, width)
        I, luminance that the display emits at b = 1 [cd/m^2].
    factors : array_like, (K,)
        Brightness factors b.
    display : Display
        The display that shows it.
    model : ContrastModel
        Choices of the contrast model.

    Returns
    -------
    array, (K,)
        𝓛_c, in [0, 1].
    """
    reference = visible_contrast(dimmed_luminance(emitted, 1.0, display), display, model)
    dimmed = (dimmed_luminance(emitted, b, display) for b in np.asarray(factors, dtype=np.float64))
    return np.array([loss_of(visible_contrast(D, display, model), reference, model.loss) for D in dimmed])
