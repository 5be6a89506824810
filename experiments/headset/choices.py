"""The answers to a question, side by side or around, of which a stick marks one and a trigger takes it.

None is marked at first, so that none is suggested.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.experiments.headset.controllers import STICK_LEFT, STICK_RIGHT, TRIGGER
from evenlight.experiments.sessions.pages import Pages
from evenlight.stimuli.page_image import centred_image
from evenlight.stimuli.rings.landolt import GAPS_IN_DIAMETER, covered

PUSHED = 0.6  # share of the way that a stick must be pushed to mark a direction
SPELT = ("yes", "no", "first", "second")  # answers that pages have words for
# Of the panel's height [shares]: its lower part, in which the answers stand; a row's or ring's field; the
# circle of rings; the border of the field that is marked.
ROW, AROUND, FIELD, CIRCLE, BORDER = 0.35, 0.62, 0.13, 0.23, 0.006
RING = 0.6  # of its field, the diameter of a ring


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers to a question."""

    keys: tuple[str, ...]  # the rig's keys that stand for them, in order
    words: tuple[str, ...]  # what they are called; empty for the directions of a ring's gap

    @property
    def around(self) -> bool:
        """Whether they are the eight directions of a gap."""
        return not self.words


def answers_of(asked: Sequence[str], keys: Keys, pages: Pages) -> Answers:
    """Return the answers that some keys of a rig stand for.

    Parameters
    ----------
    asked : sequence of str
        The keys.
    keys : Keys
        The rig's.
    pages : Pages
        What answers are called.
    """
    if tuple(asked) == keys.orientations:
        return Answers(keys.orientations, ())
    words = {key: pages.text(f"meaning_{role}", keys) for role in SPELT for key in [getattr(keys, role)]}
    if set(asked) <= set(keys.ratings):
        words = {key: str(rating) for rating, key in enumerate(keys.ratings, start=1)}
    return Answers(tuple(asked), tuple(words.get(key, pages.key_name(key)) for key in asked))


class Choice:
    """Which answer is marked.

    Parameters
    ----------
    answers : Answers
        Of what.

    >>> choice = Choice(Answers(("1", "2", "3"), ("1", "2", "3")))
    >>> choice.taken("trigger", (0.0, 0.0)), choice.taken("stick_right", (1.0, 0.0)), choice.marked
    (None, None, 2)
    >>> choice.taken("stick_left", (-1.0, 0.0)), choice.taken("trigger", (0.0, 0.0))
    (None, '2')
    """

    def __init__(self, answers: Answers) -> None:
        self.answers = answers
        self.marked: int | None = None

    def look(self, stick: tuple[float, float]) -> None:
        """Mark the direction in which a stick is pushed, right and up, where answers stand around."""
        if self.answers.around and math.hypot(*stick) >= PUSHED:
            self.marked = round(math.degrees(math.atan2(stick[1], stick[0])) / 45) % len(ORIENTATIONS)

    def taken(self, pressed: str, stick: tuple[float, float]) -> str | None:
        """Take a press, and return the key of the answer that it gives, if it gives one."""
        self.look(stick)
        if pressed in self.answers.keys:
            return pressed
        if pressed in (STICK_LEFT, STICK_RIGHT) and not self.answers.around:
            self._move(1 if pressed == STICK_RIGHT else -1)
        if pressed == TRIGGER and self.marked is not None:
            return self.answers.keys[self.marked]
        return None

    def _move(self, step: int) -> None:
        """Move the mark; the first time from the middle of the row, which is no answer or a skipped one."""
        last = len(self.answers.keys) - 1
        start = last / 2 if self.marked is None else self.marked
        place = math.floor(start) + 1 if step > 0 else math.ceil(start) - 1
        self.marked = min(max(place, 0), last)


def choice_image(
    question: str, answers: Answers, marked: int | None, size: tuple[int, int], font: Path | None = None
) -> NDArray[np.uint8]:
    """Return a question with its answers under it, as coverage, (height, width).

    Parameters
    ----------
    question : str
        Its paragraphs.
    answers : Answers
        The answers.
    marked : int or None
        Which of them has a frame around it.
    size : (int, int)
        Width and height of the panel [pixels].
    font : Path, optional
        A lab's own.

    Raises
    ------
    InputError
        If the question does not fit.
    """
    width, height = size
    lower = round(height * (AROUND if answers.around else ROW))
    image = np.zeros((height, width), np.uint8)
    above = (width, height - lower)
    image[: height - lower] = centred_image(question, above, font=font, page_height=height)
    for index, (left, top, wide, high) in enumerate(_fields(answers, size, height - lower / 2)):
        field = image[top : top + high, left : left + wide]
        if answers.around:
            field[:] = _ring(ORIENTATIONS[index], high, wide)
        else:
            field[:] = centred_image(answers.words[index], (wide, high), 1.0, font, page_height=height)
        if index == marked:
            border = max(round(height * BORDER), 1)
            inside = field[border:-border, border:-border].copy()
            field[:] = 255
            field[border:-border, border:-border] = inside
    return image


def _fields(answers: Answers, size: tuple[int, int], middle: float) -> list[tuple[int, int, int, int]]:
    """Return left edge, top, width and height of each answer's field [pixels], around a height [pixels]."""
    width, height = size
    high = round(height * FIELD)
    if answers.around:
        turns = np.radians(ORIENTATIONS)
        places = np.stack([np.cos(turns), -np.sin(turns)], axis=1) * height * CIRCLE
        corners = np.rint(places + np.array([width / 2, middle]) - high / 2).astype(int).tolist()
        return [(left, top, high, high) for left, top in corners]
    pitch = width / len(answers.keys)
    wide = round(min(0.9 * pitch, 0.3 * width))
    top = round(middle - high / 2)
    return [(round((k + 0.5) * pitch - wide / 2), top, wide, high) for k in range(len(answers.keys))]


def _ring(orientation: int, high: int, wide: int) -> NDArray[np.uint8]:
    """Return the coverage of a ring with its gap in a direction [deg], in the middle of a field."""
    gap = RING * high / GAPS_IN_DIAMETER  # [pixels]
    rows, columns = np.mgrid[:high, :wide]
    points = np.stack([columns - (wide - 1) / 2, (high - 1) / 2 - rows], axis=-1) / gap
    return np.where(covered(points, orientation), np.uint8(255), np.uint8(0))
