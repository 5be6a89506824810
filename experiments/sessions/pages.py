"""The pages of a session: consent, instructions, questions, breaks, as text files that a lab can edit.

A page is a text file of a language's folder; a lab's own folder may hold its own version of some of them.
`{yes}` and the like stand for what changes: keys, numbers of trials.
"""

from __future__ import annotations

import string
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import unknown_key
from evenlight.data_schema.provenance import sha256_of_bytes, sha256_of_file
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.data_schema.storage.text_files import read_text
from evenlight.stimuli.typesetting import require_font

SHIPPED = Path(__file__).parents[1] / "pages"
SUFFIX = ".txt"
KEY_NAMES = "keys.toml"
# In a headset: other pages, what controllers are called there, and what our pages say otherwise.
HEADSET, ROLES, PHRASES = "headset", "roles.toml", "phrases.toml"

# What stands for keys, by their names in `Keys`, and what stands for something else.
KEY_PLACEHOLDERS = (
    "yes", "no", "first", "second", "proceed", "pause",
    "ratings", "found", "turn_left", "turn_right", "turn_up", "turn_down",
)  # fmt: skip
GAP_PLACEHOLDERS = tuple(f"gap_{orientation}" for orientation in ORIENTATIONS)
VALUE_PLACEHOLDERS = (
    "minutes", "trials", "done", "trials_between_breaks", "truth", "direction", "seconds",
    "look", "key", "meaning", "pressed",
    "right", "wanted", "practised", "flagged", "answered", "slow", "dropped", "frames",
)  # fmt: skip
PLACEHOLDERS = KEY_PLACEHOLDERS + GAP_PLACEHOLDERS + VALUE_PLACEHOLDERS


@dataclass(frozen=True, slots=True)
class Pages:
    """The texts of a session in one language."""

    texts: Mapping[str, str]  # by the name of the page, placeholders in them
    # what keys are called in this language, by PsychoPy's names; others are called as they are printed
    key_names: Mapping[str, str]
    font: Path | None = None  # a lab's own font, for scripts that DejaVu Sans does not have
    # in a headset: what is pressed on controllers, by the placeholders of keys; empty on a screen
    roles: Mapping[str, str] = field(default_factory=dict)

    def text(self, name: str, keys: Keys, **values: object) -> str:
        """Return a page with its placeholders filled.

        Parameters
        ----------
        name : str
            Of the page.
        keys : Keys
            The rig's.
        **values
            What the other placeholders stand for; those not given stay empty.
        """
        called = {role: self._called(getattr(keys, role)) for role in KEY_PLACEHOLDERS}
        # The keys of the numeric pad lie as the gaps do, and are called by their digits alone.
        gaps = (self.key_name(key.removeprefix("num_")) for key in keys.orientations)
        called |= dict(zip(GAP_PLACEHOLDERS, gaps, strict=True))
        empty = dict.fromkeys(VALUE_PLACEHOLDERS, "")
        return self.texts[name].format_map({**empty, **called, **self.roles, **values}).strip()

    def longest(self, keys: Keys) -> tuple[list[str], list[str]]:
        """Return all pages and all questions as they may be filled at their longest, to see that they fit."""
        values = dict.fromkeys(VALUE_PLACEHOLDERS, "1000")
        for value in ("direction", "truth", "meaning", "look", "slow"):
            parts = [name for name in self.texts if name.startswith(f"{value}_")]
            values[value] = max((self.text(name, keys, **values) for name in parts), key=len)
        filled = {name: self.text(name, keys, **values) for name in self.texts}
        questions = [text for name, text in filled.items() if name.startswith("question")]
        return [text for name, text in filled.items() if not name.startswith("question")], questions

    def name_for(self, name: str, task: str) -> str:
        """Return the name of a page as a task has it: its own, or the one of all tasks.

        >>> Pages({"consent": "", "consent_search": ""}, {}).name_for("consent", "search")
        'consent_search'
        """
        own = f"{name}_{task}"
        return own if own in self.texts else name

    def _called(self, key: str | tuple[str, ...]) -> str:
        names = (key,) if isinstance(key, str) else key
        return ", ".join(self.key_name(name) for name in names)

    def key_name(self, key: str) -> str:
        """Return what a key is called.

        >>> Pages({}, {"space": "the space bar"}).key_name("y")
        'Y'
        """
        return self.key_names.get(key, key.upper() if len(key) == len(key.upper()) == 1 else key)

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each page, and of a lab's own font, for the manifest."""
        of_font = {"font": sha256_of_file(self.font)} if self.font is not None else {}
        return of_font | {name: sha256_of_bytes(text.encode()) for name, text in sorted(self.texts.items())}


def languages() -> tuple[str, ...]:
    """Return the languages that come with Evenlight."""
    return tuple(sorted(path.name for path in SHIPPED.iterdir() if path.is_dir()))


def load_pages(
    language: str,
    own: Path | None = None,
    of_task: Mapping[str, Mapping[str, str]] | None = None,
    font: Path | None = None,
    *,
    in_headset: bool = False,
) -> Pages:
    """Return the pages of a language, some of them replaced by a lab's own.

    Parameters
    ----------
    language : str
        Such as "en".
    own : Path, optional
        Folder with a lab's own pages; one that has all of them may be in any language.
    of_task : mapping, optional
        By language: the pages of a task that brings its own, by their names; in English where there are none
        in this language.
    font : Path, optional
        A lab's own font.
    in_headset : bool, optional
        Whether controllers are pressed: some pages are others then.

    Raises
    ------
    InputError
        If there is no such language, folder, page or font, or a page has an unknown placeholder.
    """
    names = [path.stem for path in sorted((SHIPPED / "en").glob(f"*{SUFFIX}"))]
    files = {name: SHIPPED / language / f"{name}{SUFFIX}" for name in names}
    special = SHIPPED / language / HEADSET
    if in_headset:
        files |= {path.stem: path for path in sorted(special.glob(f"*{SUFFIX}"))}
    brought = dict((of_task or {}).get(language) or (of_task or {}).get("en", {}))
    replaced = {} if own is None else _own_files(own, [*names, *brought])
    files |= replaced
    brought = {name: text for name, text in brought.items() if name not in replaced}
    missing = [name for name, path in files.items() if not path.is_file()]
    if missing:
        wanted = f"; give the others with --pages: {', '.join(missing[:4])}" if own is not None else ""
        raise InputError(
            f"there are no pages in the language {language!r}, only in {', '.join(languages())}{wanted}"
        )
    texts = {name: read_text(path, "a page of a session") for name, path in files.items()}
    if in_headset:
        otherwise = _names_in(special / PHRASES)
        texts |= {name: _said_otherwise(texts[name], otherwise) for name in files.keys() - replaced.keys()}
    texts |= brought
    for name, text in texts.items():
        _check_placeholders(text, files.get(name, f"the page {name}"))
    if font is not None:
        require_font(font)
    roles = _names_in(SHIPPED / "en" / HEADSET / ROLES) | _names_in(special / ROLES) if in_headset else {}
    return Pages(texts, _key_names(language, own), font, roles)


def _said_otherwise(text: str, phrases: Mapping[str, str]) -> str:
    """Return a page with some of its phrases replaced, one after the other."""
    for phrase, other in phrases.items():
        text = text.replace(phrase, other)
    return text


def _own_files(own: Path, names: list[str]) -> dict[str, Path]:
    if not own.is_dir():
        raise InputError(f"{own}: no such folder; expected pages such as {names[0]}{SUFFIX}")
    found = {path.stem: path for path in sorted(own.glob(f"*{SUFFIX}"))}
    for name, path in found.items():
        if name not in names:
            raise InputError(f"{path}: no page of a session; {unknown_key(name, names).split('; ')[1]}")
    if not found:
        raise InputError(f"{own}: holds no page; expected files such as {names[0]}{SUFFIX}")
    return found


def _check_placeholders(text: str, path: Path | str) -> None:
    """Refuse a page with a placeholder that stands for nothing."""
    try:
        used = [name for _, name, _, _ in string.Formatter().parse(text) if name is not None]
    except ValueError as error:
        raise InputError(f"{path}: a brace is not closed ({error}); write {{{{ for a brace") from None
    for name in used:
        if name not in PLACEHOLDERS:
            raise InputError(f"{path}: {unknown_key(name, PLACEHOLDERS).replace('key', 'placeholder', 1)}")
    if not text.strip():
        raise InputError(f"{path}: the page is empty")


def _key_names(language: str, own: Path | None) -> dict[str, str]:
    """Return what keys are called: as the lab says, or as the language does, or as in English."""
    folders = [SHIPPED / "en", SHIPPED / language, *([own] if own is not None else [])]
    names: dict[str, str] = {}
    for folder in folders:
        names |= _names_in(folder / KEY_NAMES)
    return names


def _names_in(path: Path) -> dict[str, str]:
    """Return the names that a file has, by what they name; none where there is no such file."""
    if not path.is_file():
        return {}
    try:
        content = tomllib.loads(read_text(path, "names of keys"))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}; expected names of keys") from None
    return {key: str(value) for key, value in content.items()}
