"""What to do where PsychoPy is missing."""

from __future__ import annotations

INSTALL = "install it with `make lab`, or in the checkout with `pip install '.[lab]'`"
NEWEST_PYTHON = (3, 12)  # that PsychoPy has packages for


def how_to_install(python: tuple[int, int]) -> str:
    """Return what to do where PsychoPy is missing.

    Parameters
    ----------
    python : tuple of int
        The version of Python, as (3, 12).
    """
    if python <= NEWEST_PYTHON:
        return INSTALL
    return (
        f"PsychoPy needs Python 3.11 or 3.12, and this is {python[0]}.{python[1]}: install one beside it, "
        "then run `make lab PYTHON=/path/to/python3.12`"
    )
