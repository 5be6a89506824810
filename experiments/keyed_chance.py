"""Chance that does not depend on what came before: each use has a generator of its own, named by a key.

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
