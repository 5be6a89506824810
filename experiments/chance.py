"""Chance and orders that do not depend on what came before: each use has a generator of its own, by a key.

A running stream of random numbers would be at another place after a crash, a repeated trial or a pause. Here
the number that, say, the jitter of trial 17 needs is a function of the seed and of "jitter, 17" alone.
"""

from __future__ import annotations

import enum

import numpy as np


class Purpose(enum.IntEnum):
    """What a random number is for; the numbers are part of the key and must not change."""

    ORDER = 1
    CATCH_LEVELS = 2
    CATCH_PLACES = 3
    INTERVALS = 4
    JITTER = 5
    PRACTICE = 6
    ANSWERS = 7
    NOISE = 8
    ANSWERING_TIMES = 9
    PERSON = 10
    GAPS = 11
    ORIENTATIONS = 12
    EXCERPTS = 13
    RATER = 20
    COMPARER = 21
    SEARCHER = 22
    RATINGS = 23
    COMPARISONS = 24
    SEARCHES = 25
    VIEWER = 26  # of a task from elsewhere
    VIEWERS_ANSWERS = 27


def generator_for(seed: int, order_index: int, purpose: Purpose, *key: int) -> np.random.Generator:
    """Return the generator of one use, always at its start.

    Parameters
    ----------
    seed : int
        Of the session.
    order_index : int
        The participant's place in the data set.
    purpose : Purpose
        What for.
    *key : int
        Which one of that kind.

    >>> first = generator_for(1, 0, Purpose.JITTER, 17).random()
    >>> first == generator_for(1, 0, Purpose.JITTER, 17).random()
    True
    >>> first == generator_for(1, 0, Purpose.JITTER, 18).random()
    False
    """
    return np.random.default_rng([seed, order_index, int(purpose), *key])


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
