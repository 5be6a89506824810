"""Which codes stand for participants, so that no name does: one rule for `run` and `import`."""

from __future__ import annotations

import re
import string
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.tables import csv_text

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


def numbered_codes(number: int, prefix: str = "") -> list[str]:
    """Return codes that count.

    >>> numbered_codes(2, "P"), numbered_codes(1)
    (['P01', 'P02'], ['01'])
    """
    width = max(2, len(str(number)))
    return [f"{prefix}{n:0{width}}" for n in range(1, number + 1)]


def ids_for(texts: list[str]) -> dict[str, str]:
    """Return ids for other programs' texts: those that they stand for or, if one is none, codes for all.

    >>> ids_for(["VP 1", "VP 2"]), ids_for(["VP 1", "Anna"])
    ({'VP 1': 'VP1', 'VP 2': 'VP2'}, {'VP 1': 'P01', 'Anna': 'P02'})
    >>> ids_for(["P02", "Anna", "B1"])
    {'P02': 'C01', 'Anna': 'C02', 'B1': 'C03'}
    """
    found = [participant_id_in(text) for text in texts]
    ids = [each for each in found if each]
    if len(ids) < len(texts):  # codes begin with P, or else as none of the texts does
        plain = (unicodedata.normalize("NFKC", text) for text in texts)
        firsts = {re.sub(r"^sub-|[\W_]", "", text)[:1].upper() for text in plain}
        free = (letter for letter in "P" + string.ascii_uppercase if letter not in firsts)
        ids = numbered_codes(len(texts), next(free, "P" * max(map(len, texts)) + "P"))
    return dict(zip(texts, ids, strict=True))


def are_codes(ids: dict[str, str]) -> bool:
    """Return whether ids, by the texts that they are for, are codes that were given to them."""
    return any(participant_id_in(text) is None for text in ids)


@contextmanager
def written_key(path: Path | None, ids: dict[str, str]) -> Iterator[None]:
    """Write whose codes ids are, for its owner alone; it goes again if the block fails.

    Raises
    ------
    InputError
        If something is there: a key is never overwritten.
    """
    if path is None:
        yield
        return
    text = csv_text(("participant_id", "source_id"), ((code, text) for text, code in ids.items()))
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            path.chmod(0o600)
            file.write(text)
    except OSError as error:
        raise InputError(
            f"{path}: the key of the participants' codes cannot be written ({error.strerror}); a key that is "
            "there is never overwritten: move it, or give another folder as `out`"
        ) from None
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise
