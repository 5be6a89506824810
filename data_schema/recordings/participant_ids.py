"""Which codes stand for participants, so that no name does: one rule for `run` and `import`."""

from __future__ import annotations

import re
import unicodedata

ID_RULE = "letters and digits, a digit among them, such as 01"
_ID = re.compile("(?=.*[0-9])[0-9A-Za-z]+")  # with a digit: a name has none
# Words that may stand beside a number: they say what is numbered, not who.
_LABELS = re.compile(
    "code|control|exp|grp|group|id|no|nr|obs|observer|part|participant|patient|person|pilot|pp|ppt|proband|sub"
    "|subj|subject|sujet|teilnehmer|test|user|vp|vpn|[a-z]",
    re.IGNORECASE,
)


def is_participant_id(text: str) -> bool:
    """Return whether a text is an id as `run` takes it.

    >>> is_participant_id("VP03"), is_participant_id("VP 03"), is_participant_id("Anna")
    (True, False, False)
    """
    return bool(_ID.fullmatch(text))


def participant_id_in(text: str) -> str | None:
    """Return the id that another program's text stands for; None if it is none, or may be a name.

    Unicode is normalized (NFKC), `sub-` and the end of a number such as `3.0` go. Other marks between
    letters and digits go only if every word beside them is one letter, up to three capitals, or says what
    is numbered. Letters never go.

    >>> [participant_id_in(text) for text in ("VP 03", "sub-03", "p1_a", "3.0", "Müller 3", "Ann-3", "Anna")]
    ['VP03', '03', 'p1a', '3', None, None, None]
    """
    text = unicodedata.normalize("NFKC", text).strip()
    whole = re.fullmatch(r"([0-9]+)\.0+", text)  # as tables with gaps write whole numbers
    text = whole[1] if whole else text.removeprefix("sub-")
    bare = re.sub("[^0-9A-Za-z]", "", text)
    words = re.findall("[A-Za-z]+", text)
    labels = all(_LABELS.fullmatch(word) or (len(word) <= 3 and word.isupper()) for word in words)
    fits = text.isascii() and is_participant_id(bare) and (bare == text or labels)
    return bare if fits else None


def participant_codes(number: int, prefix: str = "P") -> list[str]:
    """Return codes for so many participants.

    >>> participant_codes(2), participant_codes(1, "")
    (['P01', 'P02'], ['01'])
    """
    width = max(2, len(str(number)))
    return [f"{prefix}{n:0{width}}" for n in range(1, number + 1)]
