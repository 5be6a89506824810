"""Pages of text as images: instructions, consent, breaks, and the question after a ramp.

A text is a small part of markdown: `# ` begins the title, blank lines divide paragraphs, `- ` or `1. ` begins
an item of a list, and `**` encloses what is bold. The fonts are the DejaVu Sans that come with matplotlib, so
that a page looks alike on every machine.
"""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.stimuli.ramp import reachable_luminances

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

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
Word = tuple[tuple[str, bool], ...]  # its pieces, and whether each is bold
WIDE_GAP = "\u2003\u2003"  # two em spaces, at which no line ends
READABLE_RATIO = 7.0  # of the luminances of ground and text, at least: W3C, WCAG 2.1, criterion 1.4.6
DARK_TEXT = 25.0  # ratio of dark text where the display has it
BRIGHT_TEXT = 10.0  # of bright text: more would glare on a dark ground


@dataclass(frozen=True, slots=True)
class Block:
    """A title, a paragraph or an item of a list.

    Attributes
    ----------
    words : tuple of Word
        Its words.
    title : bool
        Whether it is the title.
    mark : str
        What stands before an item of a list; empty for none.
    """

    words: tuple[Word, ...]
    title: bool = False
    mark: str = ""


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


def beginning(text: str) -> str:
    r"""Return the first words of a text, for a message.

    >>> beginning("# Welcome\n\nThank you")
    "'# Welcome'"
    """
    return repr(text.strip().splitlines()[0][:40])


def _blocks(text: str) -> Iterator[Block]:
    """Yield the blocks of a text."""
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        for part in re.split(r"\n(?=\s*(?:-|\d+\.|#+)\s)", paragraph):
            begun = re.match(r"\s*(?:(#+)|(-)|(\d+\.))\s+(.*)", part, re.DOTALL)
            if begun is None:
                yield Block(words_of(part))
            else:
                yield Block(words_of(begun[4]), bool(begun[1]), "•" if begun[2] else begun[3] or "")


def words_of(text: str) -> tuple[Word, ...]:
    """Return the words of a text; a space that must not break stays within its word, three are a wide gap.

    >>> words_of("press **any key**, now")
    ((('press', False),), (('any', True),), (('key', True), (',', False)), (('now', False),))
    """
    words: list[list[tuple[str, bool]]] = [[]]
    bold = False
    gaps = re.sub(r"(?<=\S) {3,}(?=\S)", WIDE_GAP, text)
    for piece in re.split(r"(\*\*|[ \t\r\n]+)", gaps):
        if piece == "**":
            bold = not bold
        elif piece.strip(" \t\r\n"):
            words[-1].append((piece, bold))
        elif piece:
            words.append([])
    return tuple(tuple(word) for word in words if word)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of type.

    Attributes
    ----------
    x, y : float
        Where its baseline begins, from the left and the top of the text [pixels].
    words : tuple of Word
        What it says.
    size : int
        Of its letters [pixels].
    """

    x: float
    y: float
    words: tuple[Word, ...]
    size: int


def page_image(text: str, size: tuple[int, int], footer: str = "") -> NDArray[np.uint8]:
    """Return a page of text: a column in the middle, set to the left; long texts are set smaller, to a limit.

    Parameters
    ----------
    text : str
        The page, in the markdown that this module reads.
    size : (int, int)
        Width and height of the page [pixels].
    footer : str, optional
        A line at its foot, e.g. which key goes on.

    Returns
    -------
    array of uint8, (height, width)
        How much of each pixel the text covers, from 0 to 255, row 0 on top.

    Raises
    ------
    InputError
        If the text is empty, does not fit, or has letters that the font lacks.
    """
    blocks = page_blocks(_checked(text))
    width, height = size[0] * (1 - 2 * MARGIN), size[1] * (1 - 2 * MARGIN)
    for em in _sizes(size[1]):
        column = min(MEASURE * em, width)
        lines, depth = _set(blocks, em, column, TITLE_SIZE)
        room = height - (2 * LINE_HEIGHT * em if footer else 0)
        if depth <= room and _widest(lines) <= column:
            left = (size[0] - _widest(lines)) / 2
            top = size[1] * MARGIN + OPTICAL_CENTRE * (room - depth)
            image = _drawn(lines, (left, top), size)
            return np.maximum(image, _foot(footer, em, size)) if footer else image
    raise _too_long(text, size)


def centred_image(text: str, size: tuple[int, int], scale: float = QUESTION_SIZE) -> NDArray[np.uint8]:
    """Return a short text in the middle of a page: a question, or the number of an interval.

    Parameters
    ----------
    text : str
        Its paragraphs.
    size : (int, int)
        Width and height of the page [pixels].
    scale : float, optional
        Size of the first paragraph, in multiples of the text's.

    Returns
    -------
    array of uint8, (height, width)
        As from `page_image`, which also says what is refused.
    """
    first, *others = page_blocks(_checked(text))
    blocks = (Block(first.words, title=True), *others)
    width, height = size[0] * (1 - 2 * MARGIN), size[1] * (1 - 2 * MARGIN)
    for em in _sizes(size[1]):
        lines, depth = _set(blocks, em, width, scale, bold_title=False)
        if depth <= height and _widest(lines) <= width:
            lines = _balanced(blocks, em, scale, lines)
            middle = [Line((size[0] - _width(line)) / 2, line.y, line.words, line.size) for line in lines]
            return _drawn(middle, (0.0, (size[1] - depth) / 2), size)
    raise _too_long(text, size)


def _balanced(blocks: Sequence[Block], em: int, scale: float, lines: list[Line]) -> list[Line]:
    """Return the lines of a question in the narrowest column that needs no more of them: no word is alone."""
    while True:
        narrower, _ = _set(blocks, em, 0.98 * _widest(lines), scale, bold_title=False)
        if len(narrower) > len(lines) or _widest(narrower) >= _widest(lines):
            return lines
        lines = narrower


def _checked(text: str) -> str:
    """Return a text, or refuse it if the font cannot set it."""
    for letter in text:
        lacking = not letter.isspace() and ord(letter) not in _letters()
        if lacking or unicodedata.bidirectional(letter) in ("R", "AL"):
            reason = "which DejaVu Sans lacks" if lacking else "of a script set from right to left"
            raise InputError(
                f"the page {beginning(text)} has {letter!r} (U+{ord(letter):04X}), {reason}; pages are set "
                "from left to right in DejaVu Sans"
            )
    return text


def _too_long(text: str, size: tuple[int, int]) -> InputError:
    """Return the error of a text that does not fit."""
    return InputError(
        f"the page {beginning(text)} does not fit on {size[0]} x {size[1]} pixels in letters that can be "
        "read; shorten it, or make two pages of it"
    )


def _sizes(height: int) -> Iterator[int]:
    """Yield sizes of letters to try, from the preferred one to the smallest [pixels]."""
    preferred = max(SMALLEST_PIXELS, round(height * TEXT_SIZE))
    yield from range(preferred, max(SMALLEST_PIXELS, round(preferred * SMALLEST_SHARE)) - 1, -1)


def _set(
    blocks: Sequence[Block], em: int, column: float, title_size: float, bold_title: bool = True
) -> tuple[list[Line], float]:
    """Return the lines of a text in a column [pixels], and how deep they reach [pixels]."""
    lines: list[Line] = []
    depth = 0.0
    for index, block in enumerate(blocks):
        size = round(em * (title_size if block.title else 1))
        in_list = bool(block.mark and index and blocks[index - 1].mark)
        if index:
            depth += em * (ITEM_GAP if in_list else PARAGRAPH_GAP)
            depth += em * TITLE_GAP * (blocks[index - 1].title and bold_title)
        indent = INDENT * em if block.mark else 0.0
        words = _emboldened(block.words) if block.title and bold_title else block.words
        leading = size * (LINE_HEIGHT if not block.title else 1.25)
        for number, row in enumerate(_wrapped(words, size, column - indent)):
            depth += leading
            baseline = depth - (leading - size) / 2 - 0.2 * size  # letters reach 0.2 em below their baseline
            if block.mark and number == 0:
                lines.append(Line(0.0, baseline, words_of(block.mark), size))
            lines.append(Line(indent, baseline, row, size))
    return lines, depth


def _emboldened(words: tuple[Word, ...]) -> tuple[Word, ...]:
    """Return words with every piece bold."""
    return tuple(tuple((piece, True) for piece, _ in word) for word in words)


def _wrapped(words: Sequence[Word], size: int, column: float) -> Iterator[tuple[Word, ...]]:
    """Yield lines of words, each as long as the column [pixels] allows."""
    row: list[Word] = []
    for word in words:
        if row and _width(Line(0.0, 0.0, (*row, word), size)) > column:
            yield tuple(row)
            row = []
        row.append(word)
    yield tuple(row)


def _width(line: Line) -> float:
    """Return the width of a line [pixels]."""
    space = _font(line.size, False).getlength(" ")
    pieces = sum(_font(line.size, bold).getlength(piece) for word in line.words for piece, bold in word)
    return float(pieces + space * (len(line.words) - 1))


def _widest(lines: Sequence[Line]) -> float:
    """Return how far the lines reach to the right [pixels]."""
    return max(line.x + _width(line) for line in lines)


def _drawn(lines: Sequence[Line], origin: tuple[float, float], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return lines as an image, the text's upper left corner at `origin`."""
    from PIL import Image, ImageDraw

    image = Image.new("L", size, 0)
    draw = ImageDraw.Draw(image)
    for line in lines:
        x, y = origin[0] + line.x, round(origin[1] + line.y)
        for word in line.words:
            for piece, bold in word:
                font = _font(line.size, bold)
                draw.text((x, y), piece, fill=255, font=font, anchor="ls")
                x += font.getlength(piece)
            x += _font(line.size, False).getlength(" ")
    return np.asarray(image, dtype=np.uint8)


def _foot(footer: str, em: int, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the line at the foot of a page, in the middle and less strong than the text."""
    line = Line(0.0, 0.0, words_of(_checked(footer)), round(FOOTER_SIZE * em))
    if _width(line) > size[0] * (1 - 2 * MARGIN):
        raise _too_long(footer, size)
    image = _drawn([line], ((size[0] - _width(line)) / 2, size[1] * (1 - MARGIN)), size)
    return np.asarray(np.rint(image * FOOTER_INK), dtype=np.uint8)


@functools.lru_cache(maxsize=64)
def _font(size: int, bold: bool) -> FreeTypeFont:
    """Return DejaVu Sans in a size [pixels]."""
    from PIL import ImageFont

    # The basic layout is part of every Pillow; the other depends on a library that may be missing.
    return ImageFont.truetype(_font_file(bold), size, layout_engine=ImageFont.Layout.BASIC)


@functools.cache
def _letters() -> frozenset[int]:
    """Return the code points that both fonts have."""
    from matplotlib.ft2font import FT2Font

    return frozenset.intersection(*(frozenset(FT2Font(_font_file(b)).get_charmap()) for b in (False, True)))


def _font_file(bold: bool) -> str:
    """Return the path of a font."""
    import matplotlib

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name)


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
