"""What dimming by pixels makes of a video, wherever it is shown: the definition of `apply`, exports and page.

Decision (docs/decisions/dimming-in-files.md): the light of a pixel above the display's black is multiplied
by the factor, so a gamma-encoded value by b^(1/γ). A file does not know the black of the
display that will show it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.stimuli.dimmed.apply_options import DimmedVersion


def pixel_scale(factors: ArrayLike, gamma: float) -> Array:
    """Return what gamma-encoded pixel values are multiplied by, so that their light is by the factor.

    Parameters
    ----------
    factors : array_like, any shape
        Brightness factors b.
    gamma : float
        γ of the display.

    >>> pixel_scale(0.25, gamma=2.0).tolist()
    0.5
    """
    return np.asarray(factors, dtype=np.float64) ** (1 / gamma)


def version_factors(loaded: LoadedTrack, version: DimmedVersion) -> Array:
    """Return the factors of each frame (N,) of a version of a video."""
    factors = np.asarray(loaded.track.factors)
    return factors if version is DimmedVersion.OURS else np.full_like(factors, loaded.baseline)
