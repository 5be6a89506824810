"""How names and numbers are written in words and in the cells of tables."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


def in_words(name: str) -> str:
    """Return the name of a sequence as it is written in a title.

    >>> in_words("living_room")
    'Living room'
    """
    return spaced(name).capitalize()


def spaced(name: str) -> str:
    """Return the name of a sequence as it is written within a sentence.

    >>> spaced("living_room")
    'living room'
    """
    return name.replace("_", " ")


def p_text(value: float | None) -> str | None:
    """Return a p value with two significant digits, or that it is smaller than 0.001.

    >>> p_text(0.2344), p_text(0.04904), p_text(0.0002), p_text(1.0), p_text(None)
    ('0.23', '0.049', '< 0.001', '1', None)
    """
    if value is None:
        return None
    return "< 0.001" if value < 0.001 else f"{value:.2g}"


def p_in_words(value: float) -> str:
    """Return a p value for a sentence.

    >>> p_in_words(0.2344), p_in_words(0.0002)
    ('p = 0.23', 'p < 0.001')
    """
    text = p_text(value) or ""
    return f"p {text}" if text.startswith("<") else f"p = {text}"


def sentence(words: str) -> str:
    """Return words that begin with a capital letter.

    >>> sentence("the limit is a line")
    'The limit is a line'
    """
    return words[:1].upper() + words[1:]


def listed(names: Sequence[str]) -> str:
    """Return names with commas and an "and".

    >>> listed(["library", "gym", "basement"])
    'library, gym and basement'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def first_few(names: Sequence[str], most: int = 8) -> str:
    """Return names with commas between them, the first few of many.

    >>> first_few(["01", "02", "03", "04"], most=2)
    '01, 02 and 2 others'
    """
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} others" if len(names) > most else shown


def percent(share: float) -> str:
    """Return a share in percent, for a sentence.

    >>> percent(0.9377)
    '93.8 %'
    """
    return f"{100 * share:.1f} %"


def detection_in_words(summary: OptimizationSummary) -> str:
    """Return sentences on how near to its limit a track changes, and how well that can be detected."""
    if summary.share_near_limit is None or summary.reversals_per_s is None:
        return "How long it is near the limit is not known (an older file)."
    words = (
        f"It spends {100 * summary.share_near_limit:.0f} % of the time above 0.9 of the rate limit, and "
        f"turns back {summary.reversals_per_s:.2f} times a second. "
    )
    if summary.detectability is None:
        return f"{words}How detectable that is can be said for a limit of `evenlight fit` only."
    if summary.windows_noticed is None:
        return (
            f"{words}For someone who watches a plain screen, d' = {summary.detectability:.2g} over all of it."
        )
    return (
        f"{words}Someone who watches a plain screen for changes would report one in "
        f"{summary.windows_noticed:.1f} of {summary.windows} windows, false alarms included "
        f"(d' = {summary.detectability:.2g} over all of it)."
    )
