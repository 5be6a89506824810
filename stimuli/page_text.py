"""The text of a page: a small part of markdown, read into blocks of words.

`# ` begins the title, blank lines divide paragraphs, `- ` or `1. ` begins an item of a list, and `**`
encloses what is bold.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from evenlight.data_schema.errors import InputError

Word = tuple[tuple[str, bool], ...]  # its pieces, and whether each is bold
WIDE_GAP = "\u2003\u2003"  # two em spaces, at which no line ends


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
