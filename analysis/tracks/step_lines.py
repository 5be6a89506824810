"""Lines over time of values that hold until the next frame appears."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from evenlight.data_schema.arrays import Array

FEW_FRAMES = 40  # up to so many, each frame gets a dot


def step_line(axes: Axes, edges: Array, values: Array, **style: Any) -> None:
    """Draw values that hold from each edge to the next; where they are few, with a dot at their beginning."""
    dots: dict[str, Any] = {"marker": "o", "markevery": slice(0, len(values))}
    axes.plot(
        edges,
        np.append(values, values[-1]),
        drawstyle="steps-post",
        **{**(dots if len(values) <= FEW_FRAMES else {}), **style},
    )
