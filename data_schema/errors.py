"""The one error that a user can cause, and that the command shows as a single line."""

from collections.abc import Mapping


class InputError(ValueError):
    """Input that cannot be used: the message names the file or option, the value, and what would be right.

    Every other exception that reaches the command is a defect of Evenlight, not of its input.
    """


def shown(value: object) -> str:
    """Return a value as it is put into a message: as JSON names its kind, and not too long.

    >>> shown({"a": 1}), shown([1, 2]), shown(None)
    ('a table', 'a list', 'null')
    """
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
