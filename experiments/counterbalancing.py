"""The order of the blocks: each follows each other one equally often over the participants."""

from __future__ import annotations


def williams_row(n: int, row: int) -> tuple[int, ...]:
    """Return the order of n conditions for one participant: a row of a Williams square.

    Over n participants (2n where n is odd) each condition stands equally often at each place, and follows
    each other condition equally often (Williams 1949, Aust. J. Sci. Res. A 2:149). So neither fatigue nor
    what a block leaves behind falls upon one condition.

    Parameters
    ----------
    n : int
        Conditions.
    row : int
        The participant's place in the data set, from 0; the rows repeat.

    >>> [williams_row(4, row) for row in range(4)]
    [(0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1)]
    """
    zigzag = [(k + 1) // 2 if k % 2 else -(k // 2) for k in range(n)]  # 0, 1, -1, 2, -2, ...
    shift = row % n
    order = tuple((place + shift) % n for place in zigzag)
    mirrored = n % 2 == 1 and row // n % 2 == 1  # an odd square needs its mirror image to be balanced
    return order[::-1] if mirrored else order
