"""The time integral of |static - dynamic response|, which tests compare with closed forms."""

import numpy as np

from evenlight.method.adaptation import adapting


def response_differences(luminance, durations):
    """Return it for each frame, (N, ...) [s]; the cones have adapted to the first frame when it appears."""
    shown = np.asarray(durations, dtype=np.float64)
    return np.stack([np.tensordot(weights, parts, axes=1) for parts, weights in adapting(luminance, shown)])
