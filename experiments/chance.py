"""Chance and orders that do not depend on what came before: each use has a generator of its own, by a key.

A running stream of random numbers would be at another place after a crash, a repeated trial or a pause. Here
the number that, say, the jitter of trial 17 needs is a function of the seed and of "jitter, 17" alone.
"""

from __future__ import annotations

import enum

import numpy as np
from numpy.typing import NDArray


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
    ROWS = 28  # of the orders of a study, whose key is its participants' places
    HALVES = 29
    RING_PLACES = 30


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


def drawn_row(n: int, order_index: int, seed: int, block: int = 1) -> int:
    """Return a participant's row of a Williams square of n conditions, whose rows come in an order drawn.

    Everybody's rows of a round differ. Two rounds have one draw; in the second, neighbours exchange theirs.

    Parameters
    ----------
    n, order_index : int
        Conditions, and the participant's place in the data set.
    seed : int
        Of the study's orders: the same for all participants.
    block : int
        Each block of a session has a draw of its own.
    """
    rounds, place = divmod(order_index, _rows(n))
    rows = generator_for(seed, rounds // 2, Purpose.ROWS, block).permutation(_rows(n))
    return int(rows[place ^ (rounds % 2)])


def drawn_halves(n: int, order_index: int, seed: int, blocks: int = 1) -> NDArray[np.bool_]:
    """Return in which of n conditions a participant sees one version first, in each block: (blocks, n).

    That is half of them, drawn; over the blocks half of the times, in an order drawn. A participant and the
    next, from 0 on, see the opposite; so do two with the same row of `drawn_row`.
    """
    rounds, place = divmod(order_index, _rows(n))
    chance = generator_for(seed, rounds // 2, Purpose.HALVES, place // 2)
    halves: list[NDArray[np.bool_]] = []
    for _ in range(-(-blocks // 2)):
        half = chance.permutation(n) % 2 == chance.integers(2)
        halves += [half, ~half]
    return chance.permutation(np.array(halves[:blocks])) ^ bool(place % 2)


def _rows(n: int) -> int:
    """Return after how many participants a Williams square repeats: an even number."""
    return n * (1 + n % 2)
