"""Contrast loss of every frame at any brightness factor, as the points at which its curve bends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from evenlight.data_schema.arrays import Array, Integers


@dataclass(frozen=True, slots=True, eq=False)
class LossBends:
    """Points of the loss curves of N frames, each linear between its own; frames that are alike share theirs.

    Attributes
    ----------
    contents : array, (N,)
        Which of the C curves each frame has.
    starts : array, (C + 1,)
        Where the points of each curve begin, and where the last one's end.
    factors, loss : array, (M,)
        Of the points: brightness factors b, in each curve rising to 1, and contrast loss 𝓛_c.
    """

    contents: Integers
    starts: Integers
    factors: Array
    loss: Array

    def __post_init__(self) -> None:
        import numpy as np

        arrays = self.contents, self.starts, self.factors, self.loss
        if [array.ndim for array in arrays] != [1] * 4 or len(self.contents) < 1 or len(self.starts) < 2:
            raise ValueError("bends need rows of numbers for one frame and one curve at least")
        if self.contents.dtype.kind != "i" or self.starts.dtype.kind != "i":
            raise ValueError("frames and points of bends are counted in whole numbers")
        if (self.starts[0], self.starts[-1]) != (0, len(self.loss)) or len(self.factors) != len(self.loss):
            raise ValueError("the curves' bends must begin and end with all points")
        if (np.diff(self.starts) < 2).any() or (self.factors[self.starts[1:] - 1] != 1).any():
            raise ValueError("each curve needs bends at two factors or more, rising to 1")
        if not 0 <= self.contents.min() <= self.contents.max() < len(self.starts) - 1:
            raise ValueError("each frame must have one of the curves")
        rise = self.factors[1:] > self.factors[:-1]
        rise[self.starts[1:-1] - 1] = True  # from one curve to the next
        if not (rise.all() and self.factors.min() > 0):
            raise ValueError("factors of the bends must rise from above 0")
        if not 0 <= self.loss.min() <= self.loss.max() <= 1:
            raise ValueError("losses at the bends must lie in [0, 1]")

    def at(self, factors: Array) -> Array:
        """Return 𝓛_c of each frame at its factor, (N,); below a curve's lowest factor that at it."""
        import numpy as np

        # All curves on one axis, curve c from 2c to 2c + 1.
        places = 2.0 * np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts)) + self.factors
        wanted = 2.0 * self.contents + np.maximum(factors, self.factors[self.starts[self.contents]])
        found: Array = np.interp(wanted, places, self.loss)
        return found

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Return the bends of frames shown one after the other."""
        import numpy as np

        curves = np.cumsum([0, *(len(part.starts) - 1 for part in parts)])
        points = np.cumsum([0, *(len(part.factors) for part in parts)])
        arrays: dict[str, Any] = {
            "contents": [*map(np.add, (part.contents for part in parts), curves)],
            "starts": [*map(np.add, (part.starts[:-1] for part in parts), points), points[-1:]],
            "factors": [part.factors for part in parts],
            "loss": [part.loss for part in parts],
        }
        return cls(**{name: np.concatenate(values) for name, values in arrays.items()})
