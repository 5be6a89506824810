"""Sequences of a few small frames, in place of rendered ones: workers find them here."""

from collections.abc import Iterator

import numpy as np

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes

FRAMES = 20


class Pattern:
    """Grain of a contrast that grows, on a ground that brightens and darkens: something to lose."""

    field_of_view = 90.0

    def __init__(self, name: str) -> None:
        self.name, self.n_frames = name, FRAMES

    def frames(self) -> Iterator[Frame]:
        rng = np.random.default_rng(len(self.name))
        grain = rng.normal(size=(36, 64, 1))
        for k in range(FRAMES):
            ground = 90 + 70 * np.sin(2 * np.pi * k / FRAMES)
            pixels = np.clip(ground + (4 + k / 2) * grain, 0, 255).astype(np.uint8)
            yield Frame(k / 2, 0.5, np.repeat(pixels, 3, axis=2))

    def sha256(self) -> str:
        return sha256_of_bytes(self.name.encode())


def pattern(name: str, size: object = None, frames_per_second: object = None) -> Pattern:
    return Pattern(name)
