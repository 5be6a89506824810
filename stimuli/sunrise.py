"""A time-lapse of a sunrise over a lake, reversed at half of its duration, as in the paper's section 4."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.sequence_format import SequenceFormat
from evenlight.stimuli.sunrise_scene import SunriseScene

VERSION = 1  # to be raised when the pictures change
SEED = 2
NIGHT, MORNING = -12.0, 22.0  # altitude of the sun in the first and last frame, and in the middle [degrees]


@dataclass(frozen=True, slots=True)
class Sunrise:
    """Night, sunrise over mountains and a lake, morning, and all of it backwards.

    Frame k and the k-th frame from the end are the same picture. Pixel values are 10 bits, encoded for a
    display with gamma 2.2.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate.
    """

    format: SequenceFormat = field(default_factory=lambda: SequenceFormat(duration=40.0))

    @property
    def name(self) -> str:
        """Short name for titles."""
        return "sunrise"

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return self.format.n_frames

    def sha256(self) -> str:
        """Return the SHA-256 of the sequence's definition."""
        return sha256_of_bytes(f"sunrise {VERSION} {SEED} {self.format!r}".encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order."""
        scene = SunriseScene(self.format.width, self.format.height, SEED)
        last = self.n_frames - 1
        for k, (time, duration) in enumerate(self.format.times()):
            phase = min(k, last - k) / (last / 2)
            yield Frame(time, duration, scene.picture(NIGHT + phase * (MORNING - NIGHT)))
