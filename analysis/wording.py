"""How names and numbers are written in words and in the cells of tables."""

from __future__ import annotations

import re
from collections.abc import Sequence

from evenlight.data_schema.printed import first_few as first_few


def in_words(name: str) -> str:
    """Return the name of a sequence as it is written in a title; other capitals are kept.

    >>> in_words("living_room"), in_words("gym_HDR")
    ('Living room', 'Gym HDR')
    """
    return sentence(spaced(name))


def spaced(name: str) -> str:
    """Return the name of a sequence as it is written within a sentence.

    >>> spaced("living_room")
    'living room'
    """
    return name.replace("_", " ")


def of_track(name: str) -> str:
    """Return a version, or what a statistic of versions is called, as reports say it: `ours` is the track.

    >>> of_track("mean difference, ours less baseline")
    'mean difference, the track less baseline'
    """
    return re.sub(r"\bours\b", "the track", name)


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> counted(1, "search", "searches"), counted(2, "location")
    ('1 search', '2 locations')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def participants(number: int, simulated: bool = False) -> str:
    """Return how many people took part.

    >>> participants(17, simulated=True)
    '17 simulated participants'
    """
    return f"{number} {people_noun(number, simulated)}"


def people_noun(number: int, simulated: bool = False) -> str:
    """Return what so many people are, where the number stands apart.

    >>> people_noun(1), people_noun(17, simulated=True)
    ('participant', 'simulated participants')
    """
    return f"{'simulated ' * simulated}participant{'s' * (number != 1)}"


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


def percent(share: float, digits: int = 1) -> str:
    """Return a share in percent, for a sentence.

    >>> percent(0.9377), percent(0.9377, digits=0)
    ('93.8 %', '94 %')
    """
    return f"{100 * share:.{digits}f} %"
