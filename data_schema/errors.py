"""The one error that a user can cause, and that the command shows as a single line."""


class InputError(ValueError):
    """Input that cannot be used: the message names the file or option, the value, and what would be right.

    Every other exception that reaches the command is a defect of Evenlight, not of its input.
    """
