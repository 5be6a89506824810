"""Visual masking by neighbouring contrast (Eq. 3; Zeng, Daly & Lei 2000).

This is the definition, in float64. The same equation stands in three faster forms, which take their constants
from here: solved for the critical factor of each pixel (`contrast.critical_factor`, counted by
`contrast.one_pass`), at one factor (`contrast.one_factor`), and in compute shaders (`shaders/count.glsl`). A
change of the equation has to be made in all four: tests/method/test_forms_of_loss.py holds them together.
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
    strength: float = 1.0,
) -> NDArray[np.float64]:
    """Return the perceived contrast C_t of a band: a transducer divided by what masks it (Eq. 3).

    Parameters
    ----------
    csf_contrast : array, (height, width)
        C, in units of threshold.
    neighbourhood : MaskingNeighbourhood
        Whether a pixel masks itself.
    strength : float
        What masking is multiplied by: 1 as printed, 0 for none.

    Returns
    -------
    array, (height, width)
        C_t, of the sign of C.

    >>> perceived_contrast(np.ones((5, 5)))[2, 2].round(12).item()
    0.5
    """
    size = np.abs(csf_contrast)
    transduced = np.sign(csf_contrast) * size**TRANSDUCER_EXPONENT
    mean = neighbourhood_mean(size**MASKING_EXPONENT, neighbourhood)
    return np.asarray(transduced / (1 + strength * mean))


def contrast_over_threshold(
    csf_contrast: NDArray[np.float64],
    neighbourhood: MaskingNeighbourhood = MaskingNeighbourhood.WITH_CENTRE,
    strength: float = 1.0,
) -> NDArray[np.float64]:
    """Return the contrast ρ of a band in units of what would be just visible in its place.

    Decision (docs/decisions/soft-visibility.md): a pattern becomes just visible, C_t = 1 in Eq. 3, where it
    is divided by ρ with its neighbourhood: (|C|/ρ)^α = 1 + M / ρ^β, with M the mean of |C|^β over N(p).

    Parameters
    ----------
    csf_contrast, neighbourhood, strength : array (height, width), MaskingNeighbourhood, float
        As of `perceived_contrast`.

    Returns
    -------
    array, (height, width)
        ρ, at least 0; 1 where |C_t| = 1.

    >>> contrast_over_threshold(np.full((5, 5), 2 * 3.211)).round(3)[2, 2].item()  # 3.211^0.7 = 1 + 3.211^0.2
    2.0
    """
    size = np.abs(csf_contrast)
    transduced = size**TRANSDUCER_EXPONENT
    masked = strength * neighbourhood_mean(size**MASKING_EXPONENT, neighbourhood)
    # With x = ρ^0.1 the equation is x^7 + M x^5 = |C|^0.7: rising and convex, so that Newton's steps from
    # above fall to its root. Far below threshold, among strong neighbours, they are cut short: ρ < 1e-3.
    x = transduced ** (1 / 7)
    for _ in range(30):
        excess, rise = x**7 + masked * x**5 - transduced, 7 * x**6 + 5 * masked * x**4
        x = x - np.divide(excess, rise, out=np.zeros_like(x), where=rise > 0)
    return np.asarray(np.maximum(x, 0.0) ** 10)


def neighbourhood_mean(
    values: NDArray[np.float64],
    neighbourhood: MaskingNeighbourhood = MaskingNeighbourhood.WITH_CENTRE,
) -> NDArray[np.float64]:
    """Return the mean over the 5 × 5 neighbourhood N(p) of each pixel.

    Decision (docs/decisions/visibility.md): all 25 pixels, the centre included; at the border
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
