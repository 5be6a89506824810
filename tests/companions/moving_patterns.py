"""Sequences of a few small frames, in place of rendered ones, and who rates them: workers find both here."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from made_ratings import Raters, drawn_ratings

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.recordings.assumed_effect import RATED, AssumedEffect
from evenlight.data_schema.recordings.ramp import Trial
from evenlight.data_schema.tracks.brightness_track import read_track

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


def rated_often(
    task: str, stimuli: Path, people: tuple[int, int], display: str, sets: int
) -> tuple[tuple[AssumedEffect, ...], tuple[tuple[Trial, ...], ...]]:
    """Return an effect that a track has, and ratings with seeds that follow each other."""
    viewers, seed = people
    effect = float(read_track(stimuli / "library" / "track.csv").factors.std())
    seeds = range(seed, seed + sets)
    rated = (drawn_ratings(Raters(effect), viewers, np.random.default_rng(own)) for own in seeds)
    return (AssumedEffect(RATED, "library", effect, "rating points"),), tuple(map(tuple, rated))
