"""Replies that go wrong on their way, at random, and what comes of asking for them all the same."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evenlight.hardware.protocols import InstrumentError

Arrivals = list[tuple[float, bytes]]  # how long after what came before [s], and which bytes


@dataclass
class Tally:
    """What came of some exchanges."""

    exchanges: int = 0
    right: int = 0
    errors: Counter[str] = field(default_factory=Counter)
    made_up: list[str] = field(default_factory=list)

    def fail(self, error: InstrumentError) -> None:
        """Count an exchange that ended with an error."""
        self.exchanges += 1
        self.errors[error.fault.value] += 1

    def count(self, read: Callable[[], Any], is_true: Callable[[Any], bool]) -> bool:
        """Count one exchange, a reading, none yet (None), or an error; whether there was a reading."""
        try:
            reading = read()
        except InstrumentError as error:
            self.fail(error)
            return False
        if reading is not None:
            self.exchanges += 1
            self.right += is_true(reading)
            if not is_true(reading):
                self.made_up.append(repr(reading))
        return reading is not None


@dataclass
class Spoiler:
    """Makes of a reply what arrives of it, by one of some kinds."""

    rng: np.random.Generator
    kinds: tuple[str, ...]
    stray: Callable[[], bytes]  # what nobody asked for
    late: tuple[float, float]  # the shortest and the longest delay [s]
    after: tuple[float, ...]  # pauses between the reply and what comes besides, the longest last [s]
    struck: Counter[str] = field(default_factory=Counter)

    def spoil(self, reply: bytes) -> Arrivals:
        """Return what arrives of a reply that goes wrong."""
        rng, place = self.rng, int(self.rng.integers(len(reply)))
        kind = str(rng.choice(self.kinds))
        self.struck[kind] += 1
        match kind:
            case "lost bytes":
                gone = set(rng.integers(0, len(reply), size=int(rng.integers(1, 4))).tolist())
                return [(0.0, bytes(byte for i, byte in enumerate(reply) if i not in gone))]
            case "cut":
                return [(0.0, reply[:place])]
            case "without its end":  # the next one runs into it
                return [(0.0, reply.rstrip(b"\r\n"))]
            case "merged":
                second = self.stray() if rng.random() < 0.5 else reply
                whole = reply.rstrip(b"\r\n>") if rng.random() < 0.5 else reply[: max(place, 3)]
                return [(0.0, whole + second)]
            case "doubled":
                return [(0.0, reply), (float(rng.choice(self.after)), reply)]
            case "late":
                return [(float(rng.uniform(*self.late)), reply)]
            case "stray before":
                return [(0.0, self.stray()), (float(rng.choice(self.after[:-1])), reply)]
            case "stray after":
                return [(0.0, reply), (float(rng.choice(self.after)), self.stray())]
            case "unasked":
                return [(0.0, reply), (float(rng.uniform(0.0, 1.0)), self.stray())]
            case "garbage":  # of four bytes or more: noise in place of a digit may be another digit
                place = int(rng.integers(max(len(reply) - 3, 1)))
                end = place + int(rng.integers(4, 40))
                return [(0.0, reply[:place] + rng.bytes(len(reply[place:end])) + reply[end:])]
            case "flipped bit":
                flipped = bytes([reply[place] ^ 1 << int(rng.integers(8))])
                return [(0.0, reply[:place] + flipped + reply[place + 1 :])]
            case "silence":
                return []
        raise ValueError(f"no such kind: {kind}")


class NowAndThen:
    """Spoils a share of the replies of an instrument, each line by itself."""

    def __init__(self, spoiler: Spoiler, *, lines: bool = True) -> None:
        self._spoiler, self._lines, self.share = spoiler, lines, 0.0
        self.apart, self._whole = 0, 0  # replies that are whole after one that was not, and are so yet

    def __call__(self, sent: bytes) -> Arrivals:
        """Return what arrives of what was sent."""
        replies = sent.splitlines(keepends=True) if self._lines else [sent]
        return [part for reply in replies for part in self._arrivals(reply)]

    def _arrivals(self, reply: bytes) -> Arrivals:
        self._whole -= 1
        if self._spoiler.rng.random() >= self.share or self._whole >= 0:
            return [(0.0, reply)]
        self._whole = self.apart
        return self._spoiler.spoil(reply)
