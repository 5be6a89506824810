"""What is printed of words that strangers chose: names, answers, values, messages of other programs."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

# What a terminal obeys, and what turns the order of what is read around; but for line ends and tabs.
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def printable(text: str) -> str:
    r"""Return a text in which characters that a terminal would obey stand as escapes.

    >>> print(printable("a\x1b]0;b\x07.mp4"))
    a\x1b]0;b\x07.mp4
    """
    return _OBEYED.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def in_one_line(text: str) -> str:
    r"""Return a printable text on one line, whatever lines its values have.

    >>> in_one_line("no video 'a\nb'")
    "no video 'a b'"
    """
    return printable(" ".join(text.splitlines()))


def first_few(names: Sequence[str], most: int = 8, between: str = ", ") -> str:
    """Return names with commas, or other marks, between them, the first few of many.

    >>> first_few(["01", "02", "03", "04"], most=2)
    '01, 02 and 2 others'
    """
    shown = between.join(names[:most])
    return f"{shown} and {len(names) - most} others" if len(names) > most else shown


class PrintedStream:
    """A stream whose text is printable.

    Parameters
    ----------
    stream : text stream
        To which it goes.
    """

    def __init__(self, stream: Any) -> None:
        self.rich_proxied_file = stream  # so Rich calls it: what draws bars needs escapes

    def write(self, text: str) -> int:
        """Write a text; return its length."""
        self.rich_proxied_file.write(printable(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def terminal_of(stream: Any) -> Any:
    """Return the stream below a printable one, for those who draw with escapes of their own."""
    return getattr(stream, "rich_proxied_file", stream)


@contextmanager
def printed_streams() -> Iterator[None]:
    """Make all that is printed meanwhile printable."""
    before = sys.stdout, sys.stderr
    ours = tuple(stream and PrintedStream(stream) for stream in before)
    sys.stdout, sys.stderr = ours
    try:
        yield
    finally:  # unless there is nobody who reads it
        sys.stdout, sys.stderr = (
            stream if now is own else now
            for stream, own, now in zip(before, ours, (sys.stdout, sys.stderr), strict=True)
        )
