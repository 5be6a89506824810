"""Samples of Y', Cb, Cr whose R', G' or B' is above 1: cut off, as displays do, before they are dimmed.

Cameras and encoders write such samples in highlights and in saturated colours. Were they dimmed as they are,
they would be brighter than their share of what is seen at full brightness.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np

from evenlight.stimuli.dimmed.dimmed_samples import Codes, Codings

ROUNDING = 0.5  # codes of luma above white that may be the rounding of what was white
STRIP = 16  # rows of chroma whose largest and smallest samples may tell that nothing is above white


def cut_above_white(planes: list[Codes], codings: Codings, weights: tuple[float, float]) -> list[Codes]:
    """Return Y', Cb, Cr without what is above white; the weights are K_R and K_B of their matrix."""
    luma, blue, red = planes[0], planes[1].copy(), planes[2].copy()
    (height, width), (rows, columns) = luma.shape, blue.shape
    down, across = -(-height // rows), -(-width // columns)
    whole = np.pad(luma, ((0, rows * down - height), (0, columns * across - width)), mode="edge")
    parts = [whole[i::down, j::across] for i in range(down) for j in range(across)]
    for row in range(0, rows, STRIP):
        strip = slice(row, row + STRIP)
        _cut_off([part[strip] for part in parts], (blue[strip], red[strip]), codings, weights)
    return [whole[:height, :width], blue, red]


def _cut_off(
    parts: list[Codes], chroma: tuple[Codes, Codes], codings: Codings, weights: tuple[float, float]
) -> None:
    """Cut off, in place, what is above white in the parts of luma that have a sample of chroma in common."""
    of_luma, of_chroma, _ = codings
    white = of_luma.zero + of_luma.span + ROUNDING

    def added(*samples: Any) -> list[Any]:
        """Return R' - Y', G' - Y', B' - Y' of Cb, Cr (ITU-T H.273, 8.3), in codes of luma."""
        blue, red = ((c - np.float32(of_chroma.zero)) / of_chroma.span * of_luma.span for c in samples)
        r, b = 2 * (1 - weights[0]) * red, 2 * (1 - weights[1]) * blue
        return [r, (weights[0] * r + weights[1] * b) / (sum(weights) - 1), b]

    extremes = [added(*map(end, chroma)) for end in (np.min, np.max)]
    if max(part.max() for part in parts) + np.max(extremes) <= white:
        return
    above = reduce(np.maximum, parts) + reduce(np.maximum, added(*chroma)) > white
    luma = np.stack([part[above] for part in parts]) - np.float32(of_luma.zero)
    r, g, b = (np.minimum(luma + more, of_luma.span) for more in added(*(plane[above] for plane in chroma)))
    luma = weights[0] * r + (1 - sum(weights)) * g + weights[1] * b
    for part, values in zip(parts, luma, strict=True):
        part[above] = np.rint(values + of_luma.zero)
    for plane, channel, weight in zip(chroma, (b, r), reversed(weights), strict=True):
        mean = ((channel - luma) / (2 * (1 - weight))).mean(axis=0)
        plane[above] = np.rint(mean / of_luma.span * of_chroma.span + of_chroma.zero)
