"""The one error that a user can cause, and that the command shows as a single line."""

from collections.abc import Mapping

from evenlight.data_schema.printed import in_one_line


class InputError(ValueError):
    """Input that cannot be used: the message names the file or argument, the value, and what would be right.

    Every other exception that reaches the command is a defect of Evenlight, not of its input.
    """

    def __init__(self, *words: object) -> None:
        super().__init__(*(in_one_line(one) if isinstance(one, str) else one for one in words))


class ArgumentError(InputError):
    """What is wrong with an argument: an option, on the command line; a key, in the file of a request."""

    def __init__(self, argument: str, problem: str) -> None:
        super().__init__(argument, problem)  # both, as workers of a cluster send it
        self.argument, self.problem = argument, problem

    def __str__(self) -> str:
        return f"{self.argument} {self.problem}"


class FieldError(InputError):
    """A field of a record that cannot be so: a program reads the argument's name, a file's reader the key."""

    def __init__(self, of_argument: str, of_key: str) -> None:
        super().__init__(of_argument, of_key)  # both, as workers of a cluster send it

    def __str__(self) -> str:
        return str(self.args[0])


def told_of_file(error: Exception) -> str:
    """Return what is wrong with a record that a file holds: its fields by the keys of the file."""
    return str(error.args[1] if isinstance(error, FieldError) else error)


def shown_kind(value: object) -> str:
    """Return what an object of Python is, where it is not the kind that is expected.

    >>> shown_kind(3), shown_kind("a")
    ('an int', 'a str')
    """
    name = type(value).__name__
    return f"{'an' if name.lower().startswith(('a', 'e', 'i', 'o', 'nd')) else 'a'} {name}"


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
