"""The places of a scene by position."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from evenlight.stimuli.scenes.engine.scene import Scene


def place_at(scene: Scene, position: ArrayLike) -> str:
    """Return the name of the smallest place that contains a point, or nothing."""
    point = np.asarray(position)
    inside = [p for p in scene.places if (point >= p.low).all() and (point <= p.high).all()]
    return min(inside, key=lambda p: float(np.prod(np.subtract(p.high, p.low)))).name if inside else ""
