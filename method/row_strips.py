"""Which rows of a picture stand for all of them, where to look at each takes too long."""

from __future__ import annotations

import math

STRIP = 4  # rows that are counted together
GOLDEN = (math.sqrt(5) - 1) / 2  # its multiples, without whole parts, fall evenly into [0, 1)


def counted_rows(height: int, one_in: int, turn: int) -> list[tuple[int, int]]:
    """Return the strips of rows that are counted: the first row of each, and the one after its last.

    One of each `one_in` strips that follow each other, by the golden ratio's multiples, so that no period of
    the picture is met by a period of the strips; at the next turn the next one.

    >>> counted_rows(16, 2, turn=0), counted_rows(16, 2, turn=1), counted_rows(16, 1, turn=0)
    ([(0, 4), (12, 16)], [(4, 8), (8, 12)], [(0, 16)])
    """
    if one_in == 1 or height < one_in * STRIP:
        return [(0, height)]
    strips = []
    for part in range(-(-height // (one_in * STRIP))):
        chosen = (int(part * GOLDEN % 1 * one_in) + turn) % one_in
        begin = (part * one_in + chosen) * STRIP
        if begin < height:
            strips.append((begin, min(begin + STRIP, height)))
    return strips
