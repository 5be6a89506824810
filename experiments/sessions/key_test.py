"""The test of the keys, before practice and on resuming: a participant presses each key of the task once.

A key that is not there, or is not what it is called, is found out before it can be taken for an answer.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING

from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.session import EventKind
from evenlight.experiments.sessions.pages import Pages

if TYPE_CHECKING:
    from evenlight.experiments.sessions.conduct_session import SessionParts

ANY_KEY = ()  # to a page


def try_keys(parts: SessionParts, note: Callable[[EventKind, str], None], pause: Callable[[], None]) -> None:
    """Have each key of the task pressed once, and note which others were pressed instead.

    Parameters
    ----------
    parts : SessionParts
        Who and what takes part.
    note : callable
        Notes an event, with a detail.
    pause : callable
        Pauses the session, when the pause key is pressed.
    """
    answers, keys, pages = parts.task.key_answers(), parts.keys, parts.pages
    if not answers or pages.roles:  # in a headset the answers stand there in words
        return
    instead: dict[str, list[str]] = {}
    for key, answer in answers.items():
        said = {"key": pages.key_name(key), "meaning": _meaning(answer, pages, keys)}
        name, pressed, others = "key_test", "", instead.setdefault(key, [])
        while pressed != key:
            note(EventKind.PAGE_SHOWN, name)
            parts.participant.see_page((key, keys.pause))
            text = pages.text(name, keys, pressed=pages.key_name(pressed), **said)
            pressed = parts.stage.show_page(text, ANY_KEY).name
            if pressed == keys.pause:
                pause()
                name = "key_test"
            elif pressed != key:
                others.append(pressed)
                name = "key_test_other"
    note(EventKind.KEYS_TRIED, json.dumps(instead, ensure_ascii=False))


def _meaning(answer: object, pages: Pages, keys: Keys) -> str:
    """Return what an answer means, in the words of the pages where they have some."""
    value = getattr(answer, "value", answer)
    names = (f"meaning_{value}", f"direction_{value}")
    return next((pages.text(name, keys) for name in names if name in pages.texts), str(value))
