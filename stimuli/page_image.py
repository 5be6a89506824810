"""Pages of text as images: instructions, consent, breaks, and the question after a ramp.

A text is a small part of markdown: `# ` begins the title, blank lines divide paragraphs, `- ` or `1. ` begins
an item of a list, and `**` encloses what is bold. Paragraphs that run from right to left begin at the right.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.stimuli.ramp import reachable_luminances
from evenlight.stimuli.typesetting import Line, Word, beginning, require_letters, runs_to_left, words_of

# Sizes are shares of the page's height, or multiples of the size of the text (em).
TEXT_SIZE = 1 / 24  # of the height
SMALLEST_SHARE = 0.6  # of that size: a page that needs less is refused
SMALLEST_PIXELS = 9  # of letters that are still read
MEASURE = 34.0  # em; some 65 letters, the most that the eye follows at ease
MARGIN = 0.08  # of width and of height
LINE_HEIGHT = 1.5  # em
PARAGRAPH_GAP, ITEM_GAP, TITLE_GAP = 0.7, 0.2, 0.8  # em
TITLE_SIZE, FOOTER_SIZE, QUESTION_SIZE = 1.6, 0.85, 1.25  # em
FOOTER_INK = 0.9  # of the text's coverage: it steps back
INDENT = 1.7  # em; of lists
OPTICAL_CENTRE = 0.42  # share of the free height that is above the text: the true middle looks too low
READABLE_RATIO = 7.0  # of the luminances of ground and text, at least: W3C, WCAG 2.1, criterion 1.4.6
DARK_TEXT = 25.0  # ratio of dark text where the display has it
BRIGHT_TEXT = 10.0  # of bright text: more would glare on a dark ground


class Block(NamedTuple):
    """A title, a paragraph or an item of a list."""

    words: tuple[Word, ...]
    title: bool = False
    mark: str = ""  # what stands before an item of a list; empty for none
    to_left: bool = False  # whether it runs from right to left
    scale: float = 1.0  # of its letters, in multiples of the text's
    gap: float = 0.0  # below it, besides that of all paragraphs [em]


def page_blocks(text: str) -> tuple[Block, ...]:
    r"""Return the blocks of a page.

    Raises
    ------
    InputError
        If it is empty, or a bold part has no end.

    >>> blocks = page_blocks("# Start\n\nSit.\n- Look **here**.")
    >>> [(block.title, block.mark, len(block.words)) for block in blocks]
    [(True, '', 1), (False, '', 1), (False, '•', 2)]
    """
    if not text.strip():
        raise InputError("a page is empty; expected a title or a paragraph")
    if text.count("**") % 2:
        raise InputError(f"the page {beginning(text)} has a ** that no second one ends")
    return tuple(_blocks(text))


def _blocks(text: str) -> Iterator[Block]:
    page_to_left = runs_to_left(text)
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        for part in re.split(r"\n(?=\s*(?:-|\d+\.|#+)\s)", paragraph):
            begun = re.match(r"\s*(?:(#+)|(-)|(\d+\.))\s+(.*)", part, re.DOTALL)
            # A key's name in Latin letters may be most of a paragraph; digits alone lie as on their keys.
            to_left = page_to_left and any(map(runs_to_left, part))
            if begun is None:
                yield Block(words_of(part), to_left=to_left)
            else:
                mark = "•" if begun[2] else begun[3] or ""
                yield Block(words_of(begun[4]), bool(begun[1]), mark, to_left)


def page_image(
    text: str, size: tuple[int, int], footer: str = "", font: Path | None = None
) -> NDArray[np.uint8]:
    """Return a page of text: a column in the middle, not justified; long texts are set smaller, to a limit.

    Parameters
    ----------
    text : str
        The page, in the markdown that this module reads.
    size : (int, int)
        Width and height of the page [pixels].
    footer : str, optional
        A line at its foot, e.g. which key goes on.
    font : Path, optional
        A font of the lab's own, for scripts that DejaVu Sans does not have.

    Returns
    -------
    array of uint8, (height, width)
        How much of each pixel the text covers, from 0 to 255, row 0 on top.

    Raises
    ------
    InputError
        If the text is empty, does not fit, or has letters that the font lacks.
    """
    foot = 2 * LINE_HEIGHT if footer else 0.0
    require_letters(text, font)
    blocks = [
        block._replace(words=_bold(block.words), scale=TITLE_SIZE, gap=TITLE_GAP) if block.title else block
        for block in page_blocks(text)
    ]
    em, lines, depth = _fitted(text, blocks, size, font, size[1], MEASURE, foot)
    widest = _widest(lines)
    top = size[1] * MARGIN + OPTICAL_CENTRE * (size[1] * (1 - 2 * MARGIN) - foot * em - depth)
    lines = [line._replace(x=widest - line.x - line.width) if line.to_left else line for line in lines]
    image = _drawn(lines, ((size[0] - widest) / 2, top), size)
    return np.maximum(image, _foot(footer, em, size, font)) if footer else image


def centred_image(
    text: str,
    size: tuple[int, int],
    scale: float = QUESTION_SIZE,
    font: Path | None = None,
    page_height: int | None = None,
) -> NDArray[np.uint8]:
    """Return a short text in the middle of a page: a question, or the number of an interval.

    Parameters
    ----------
    text : str
        Its paragraphs.
    size : (int, int)
        Width and height of the page [pixels].
    scale : float, optional
        Size of the first paragraph, in multiples of the text's.
    font : Path, optional
        A font of the lab's own.
    page_height : int, optional
        Of the page whose letters it has, where it is on a part of one [pixels].

    Returns
    -------
    array of uint8, (height, width)
        As from `page_image`, which also says what is refused.
    """
    require_letters(text, font)
    first, *others = page_blocks(text)
    blocks = [
        block._replace(scale=scale) if block.title else block
        for block in (first._replace(title=True, mark=""), *others)
    ]
    em, lines, depth = _fitted(text, blocks, size, font, page_height or size[1])
    while True:  # the narrowest column that needs no more lines: no word is alone
        narrower, _ = _set(blocks, em, 0.98 * _widest(lines), font)
        if len(narrower) > len(lines) or _widest(narrower) >= _widest(lines):
            break
        lines = narrower
    middle = [line._replace(x=(size[0] - line.width) / 2) for line in lines]
    return _drawn(middle, (0.0, (size[1] - depth) / 2), size)


def _bold(words: Sequence[Word]) -> tuple[Word, ...]:
    return tuple(tuple((piece, True) for piece, _ in word) for word in words)


def _fitted(
    text: str,
    blocks: Sequence[Block],
    size: tuple[int, int],
    font: Path | None,
    page_height: int,
    measure: float = math.inf,
    foot: float = 0.0,
) -> tuple[int, list[Line], float]:
    """Return the largest letters in which a text fits, its lines, and how deep they reach [pixels]."""
    width, height = (side * (1 - 2 * MARGIN) for side in size)
    preferred = max(SMALLEST_PIXELS, round(page_height * TEXT_SIZE))
    for em in range(preferred, max(SMALLEST_PIXELS, round(preferred * SMALLEST_SHARE)) - 1, -1):
        column = min(measure * em, width)
        lines, depth = _set(blocks, em, column, font)
        if depth <= height - foot * em and _widest(lines) <= column:
            return em, lines, depth
    raise _too_long(text, size)


def _too_long(text: str, size: tuple[int, int]) -> InputError:
    return InputError(
        f"the page {beginning(text)} does not fit on {size[0]} x {size[1]} pixels in letters that can be "
        "read; shorten it, or make two pages of it"
    )


def _set(blocks: Sequence[Block], em: int, column: float, font: Path | None) -> tuple[list[Line], float]:
    lines: list[Line] = []
    depth = 0.0
    for index, block in enumerate(blocks):
        size = round(em * block.scale)
        in_list = bool(block.mark and index and blocks[index - 1].mark)
        if index:
            depth += em * (ITEM_GAP if in_list else PARAGRAPH_GAP)
            depth += em * blocks[index - 1].gap
        leading = size * (LINE_HEIGHT if not block.title else 1.25)
        indent = INDENT * em if block.mark else 0.0
        line = Line((), size, font, block.to_left, indent)
        for number, row in enumerate(_wrapped(block.words, line, column - indent)):
            depth += leading
            baseline = depth - (leading - size) / 2 - 0.2 * size  # letters reach 0.2 em below their baseline
            if block.mark and number == 0:
                lines.append(line._replace(x=0.0, y=baseline, words=words_of(block.mark)))
            lines.append(line._replace(y=baseline, words=row))
    return lines, depth


def _wrapped(words: Sequence[Word], line: Line, column: float) -> Iterator[tuple[Word, ...]]:
    row: list[Word] = []
    for word in words:
        if row and line._replace(words=(*row, word)).width > column:
            yield tuple(row)
            row = []
        row.append(word)
    yield tuple(row)


def _widest(lines: Sequence[Line]) -> float:
    return max(line.x + line.width for line in lines)


def _drawn(lines: Sequence[Line], origin: tuple[float, float], size: tuple[int, int]) -> NDArray[np.uint8]:
    from PIL import Image, ImageDraw

    image = Image.new("L", size, 0)
    draw = ImageDraw.Draw(image)
    for line in lines:
        line.draw(draw, (origin[0] + line.x, round(origin[1] + line.y)))
    return np.asarray(image, dtype=np.uint8)


def _foot(footer: str, em: int, size: tuple[int, int], font: Path | None) -> NDArray[np.uint8]:
    require_letters(footer, font)
    line = Line(words_of(footer), round(FOOTER_SIZE * em), font, runs_to_left(footer))
    if line.width > size[0] * (1 - 2 * MARGIN):
        raise _too_long(footer, size)
    image = _drawn([line], ((size[0] - line.width) / 2, size[1] * (1 - MARGIN)), size)
    return np.asarray(np.rint(image * FOOTER_INK), dtype=np.uint8)


def ink_on(ground: float, display: Display) -> float:
    """Return the luminance of text on a ground [cd/m^2]: darker, or brighter where the ground is near black.

    Parameters
    ----------
    ground : float
        L of the ground, reflected light included [cd/m^2].
    display : Display
        The display, whose black and white are the limits.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)
    >>> ink_on(50.0, lab), ink_on(0.25, lab)
    (2.0, 2.5)
    """
    darkest, brightest = reachable_luminances(1.0, display, Actuator.PIXELS)
    darker, brighter = max(darkest, ground / DARK_TEXT), min(brightest, ground * BRIGHT_TEXT)
    readable = ground >= READABLE_RATIO * darker
    return darker if readable or ground / darker >= brighter / ground else brighter
