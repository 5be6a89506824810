"""Keywords of public functions: the fields of a record of options, and the right name for an earlier one."""

from __future__ import annotations

import dataclasses
import enum
import functools
import re
import textwrap
from collections.abc import Callable
from inspect import Parameter, cleandoc, signature
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar, get_args, get_type_hints

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import GONE, METAVARS, RIGHT_NAMES

OF_COMMANDS = ("no_cache", "no_player")  # what Python has no use for
UNITS = {"DEGREES": "deg", "HZ": "Hz", "SECONDS": "s"}
P = ParamSpec("P")
Asked = ParamSpec("Asked")
First = TypeVar("First")
Made = TypeVar("Made")
Asking = Callable[[First, dict[str, Any]], Made]


def right_names(function: Callable[P, Made]) -> Callable[P, Made]:
    """Return a function that tells the right name for a keyword that is called otherwise elsewhere."""

    @functools.wraps(function)
    def named(*given: P.args, **keywords: P.kwargs) -> Made:
        for name in keywords:
            if right := RIGHT_NAMES.get(name):
                raise InputError(f"{name}: it is called {right}")
            if why := GONE.get(name):
                raise InputError(f"{name}: {why}")
        return function(*given, **keywords)

    return named


def takes_fields_of(
    record: Callable[Asked, Any],
) -> Callable[[Asking[First, Made]], Callable[Concatenate[First, Asked], Made]]:
    """Return what lets a function take the fields of a record as keywords, and document them.

    The function takes something and the keywords as a dict; `{fields}` in its docstring stands for them.
    """

    def taking(function: Asking[First, Made]) -> Callable[Concatenate[First, Asked], Made]:
        own = next(iter(signature(function).parameters.values()))
        keywords = [
            Parameter(
                one.name,
                Parameter.KEYWORD_ONLY if one.kw_only else Parameter.POSITIONAL_OR_KEYWORD,
                default=Parameter.empty if one.default is dataclasses.MISSING else _plain(one.default),
            )
            for one in _fields(record)
        ]
        declared = signature(function).replace(parameters=[own, *keywords])

        @functools.wraps(function)
        def flat(*given: Any, **asked: Any) -> Made:
            try:
                bound = declared.bind(*given, **asked).arguments
            except TypeError as error:
                raise TypeError(f"{function.__qualname__}() {error}") from None
            return function(bound.pop(own.name), bound)

        flat.__signature__ = declared  # type: ignore[attr-defined] # inspect looks for it
        flat.__doc__ = with_fields(function.__doc__, record)
        return right_names(flat)

    return taking


def with_fields(docstring: str | None, record: Callable[..., Any]) -> str:
    """Return a docstring with the fields of a record in place of `{fields}`."""
    hints = get_type_hints(record, include_extras=True)
    described = "\n".join(_described(one, *get_args(hints[one.name])[:2]) for one in _fields(record))
    return cleandoc(docstring or "").replace("{fields}", described)


def _fields(record: Callable[..., Any]) -> list[dataclasses.Field[Any]]:
    return [one for one in dataclasses.fields(record) if one.name not in OF_COMMANDS]  # type: ignore[arg-type] # a class


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, enum.Enum) else value


def _described(field: dataclasses.Field[Any], kind: Any, option: Any) -> str:
    """Return a field as numpy's docstrings have a parameter: its help speaks of keywords, not of options."""
    kinds = {
        bool: "bool",
        float: "float",
        int: "int",
        str: "str",
        Path: "path",
        list[str]: "sequence of videos",
    }
    one = next((part for part in get_args(kind) if part is not type(None)), kind)
    words = kinds.get(one, "")
    if isinstance(one, type) and issubclass(one, enum.Enum):
        words = "{" + ", ".join(f'"{member.value}"' for member in one) + "}"
    if METAVARS.get(field.name) == "NAME|FILE" or option.metavar == "NAME|FILE":
        words = "str, path or record"
    optional = ", optional" if field.default is None else ""
    help_ = option.help.replace("--with", "`others`")
    help_ = re.sub(r"--([a-z][a-z-]*)", lambda found: f"`{found[1].replace('-', '_')}`", help_)
    if field.default is None and isinstance(option.show_default, str):
        help_ += f" Default: {option.show_default}."
    if unit := UNITS.get(option.metavar or METAVARS.get(field.name, "")):
        help_ += f" [{unit}]"
    text = textwrap.fill(help_, 106, initial_indent="    ", subsequent_indent="    ")
    return f"{field.name} : {words}{optional}\n{text}"
