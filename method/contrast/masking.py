"""Visual masking by neighbouring contrast (Eq. 3; Zeng, Daly & Lei 2000).

This is the definition, in float64. The same equation stands in three faster forms, which take their constants
from here: solved for the critical factor of each pixel (`contrast.critical_factor`, counted by
`contrast.one_pass`), at one factor (`contrast.one_factor`), and in compute shaders (`shaders/count.glsl`). A
change of the equation has to be made in all four: tests/method/test_masking_forms.py holds them together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.contrast_model import MaskingNeighbourhood

TRANSDUCER_EXPONENT = 0.7  # α, Zeng et al. (2000)
MASKING_EXPONENT = 0.2  # β, Zeng et al. (2000)
NEIGHBOURHOOD_SIDE = 5  # N(p) is 5 × 5 (paper, below Eq. 3)


def perceived_contrast(
    csf_contrast: NDArray[np.float64],
    neighbourhood: MaskingNeighbourhood = MaskingNeighbourhood.WITH_CENTRE,
) -> NDArray[np.float64]:
    """Return the perceived contrast C_t of a band: a transducer divided by what masks it (Eq. 3).

    Parameters
    ----------
    csf_contrast : array, (height, width)
        C, in units of threshold.
    neighbourhood : MaskingNeighbourhood
        Whether a pixel masks itself.

    Returns
    -------
    array, (height, width)
        C_t, of the sign of C.

    >>> perceived_contrast(np.ones((5, 5)))[2, 2].round(12).item()
    0.5
    """
    size = np.abs(csf_contrast)
    transduced = np.sign(csf_contrast) * size**TRANSDUCER_EXPONENT
    return np.asarray(transduced / (1 + neighbourhood_mean(size**MASKING_EXPONENT, neighbourhood)))


def neighbourhood_mean(
    values: NDArray[np.float64],
    neighbourhood: MaskingNeighbourhood = MaskingNeighbourhood.WITH_CENTRE,
) -> NDArray[np.float64]:
    """Return the mean over the 5 × 5 neighbourhood N(p) of each pixel.

    Decision (docs/decisions/masking-neighbourhood.md): all 25 pixels, the centre included; at the border
    of a frame N counts the pixels that exist.

    >>> neighbourhood_mean(np.array([[0.0, 3.0, 6.0]])).tolist()
    [[3.0, 3.0, 3.0]]
    """
    total = _window_sum(_window_sum(values).T).T
    count = _window_sum(_window_sum(np.ones_like(values)).T).T
    if neighbourhood is MaskingNeighbourhood.WITHOUT_CENTRE:
        # A level of a single pixel has no neighbours; the sum is then 0 as well.
        return np.asarray((total - values) / np.maximum(count - 1, 1))
    return np.asarray(total / count)


def _window_sum(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum over the five rows around each row, zeros outside."""
    reach, n = NEIGHBOURHOOD_SIDE // 2, len(values)
    padded = np.pad(values, ((reach, reach), (0, 0)))
    return np.asarray(sum(padded[k : k + n] for k in range(NEIGHBOURHOOD_SIDE)))
