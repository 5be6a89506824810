"""How carefully the light of a scene is worked out."""

from __future__ import annotations

from enum import Enum


class Quality(Enum):
    """How many rays are spent: over all samples, and per sample at the least and the most."""

    COARSE = (1_000_000, 6, 32)
    FINE = (12_000_000, 32, 256)
