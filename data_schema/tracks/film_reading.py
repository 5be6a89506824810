"""How the file of a film was read: which of its streams, by whose clock, and what damage cost."""

from __future__ import annotations

import enum

from evenlight.data_schema.quantities import count, described, quantity, record


class Damaged(enum.Enum):
    """What becomes of pictures that a film's damage costs."""

    REFUSE = "refuse"  # the film is refused
    HOLD = "hold"  # the last whole picture is shown in the place of each
    SKIP = "skip"  # they are left out: the last whole picture stays until the next one


@record
class FilmReading:
    """How the file of a film was read."""

    stream: int | None = count(
        "stream of the file that was asked for, as FFmpeg counts them; null for the one that players take",
        default=None,
    )
    picture_start: float = quantity(
        "s",
        "from the file's first stamp, of sound too, to the first frame",
        key="picture_start_s",
        default=0.0,
    )
    file_start: float = quantity(
        "s", "the file's first stamp; most players count from it", key="file_start_s", default=0.0
    )
    file_duration: float | None = quantity(
        "s",
        "how long the file is by its header, sound included; null if that does not say",
        minimum=0.0,
        key="file_duration_s",
        default=None,
    )
    damaged: Damaged = described(
        "what became of pictures that damage cost: the one before was held, or they were left out (skip)",
        default=Damaged.REFUSE,
    )
    frames_held: int = count("frames that show the picture before them, because of damage", default=0)
    frames_skipped: int = count(
        "pictures that are left out, because of damage, or since time stamps after them fall back", default=0
    )
    fall_back: float = quantity(
        "s", "how far the time stamps fall back at most", minimum=0.0, key="fall_back_s", default=0.0
    )

    @property
    def notes(self) -> tuple[str, ...]:
        """What was not taken as it is in the file, in lines."""
        held = f"{self.frames_held} frames show the picture before" if self.frames_held else ""
        skipped = f"{self.frames_skipped} pictures are left out" if self.frames_skipped else ""
        told = ", ".join(filter(None, (held, skipped)))
        why = f"time stamps fall back by up to {self.fall_back:.3f} s" if self.fall_back else "damaged"
        return (f"{told}: {why}",) if told else ()
