"""`request.toml`: what a folder of results was asked for; and `--request`, which asks it again.

A command is wrapped: its options are what is asked, so that no option has to be named here.
"""

from __future__ import annotations

import copy
import enum
import functools
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from inspect import Parameter, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import GONE, RIGHT_NAMES

NOT_ASKED = ("request", "quiet")  # of no influence on a result


def recorded(name: str, command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command that leaves `request.toml` in the folder of its results, and takes `--request`.

    Parameters
    ----------
    name : str
        What it is called.
    command : callable
        Has an option `out`, the folder.
    """

    @functools.wraps(command)
    def noted(context: typer.Context | None = None, request: Path | None = None, **given: Any) -> None:
        inputs = _inputs(name, given)  # as they are before the work
        try:
            command(**given)
        except InputError as error:
            if context is None or request is None:
                raise
            raise InputError(_told_of_file(str(error), request, context)) from None
        except typer.Exit:  # with results, though not all that was asked
            write_request(given["out"], name, given, inputs)
            raise
        write_request(given["out"], name, given, inputs)

    declared = signature(command, eval_str=True)
    kinds = {name: _kind_in_file(one) for name, one in declared.parameters.items()}

    def ask_again(context: typer.Context, value: Path | None) -> Path | None:
        if value is not None and not context.resilient_parsing:
            context.default_map = _asked_in(_file_of(value), context, kinds)
        return value

    option = typer.Option(
        metavar="FILE|DIR",
        rich_help_panel="Output",
        is_eager=True,
        callback=ask_again,
        help="request.toml of an earlier result, to make it again; what is given beside it overrides it. The "
        "file has options for experts, too (docs/requests.md).",
    )
    own = {
        "context": Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context),
        "request": Parameter(
            "request", Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[Path | None, option]
        ),
    }
    asked = [
        one.replace(kind=Parameter.KEYWORD_ONLY, annotation=_with_its_opposite(one))
        for one in declared.parameters.values()
    ]
    noted.__signature__ = declared.replace(parameters=[*asked, *own.values()])  # type: ignore[attr-defined] # Typer reads it
    return noted


def _with_its_opposite(declared: Parameter) -> Any:
    """Return what an option is declared as; a flag with what undoes it, where a request has it on."""
    kind, *options = get_args(declared.annotation) or (declared.annotation,)
    if kind is not bool or declared.default is not False or declared.name in NOT_ASKED:
        return declared.annotation
    option: Any = copy.copy(options[0])
    flag = f"--{declared.name.replace('_', '-')}"
    opposite = flag.replace("--no-", "--") if flag.startswith("--no-") else f"--no-{flag[2:]}"
    option.default, option.param_decls = f"{flag}/{opposite}", ()  # Typer has its first name as the default
    return Annotated[bool, option]


def _kind_in_file(declared: Parameter) -> Any:
    """Return the type of an option as a file has it."""
    kind = (get_args(declared.annotation) or [declared.annotation])[0]
    parts = get_args(kind) if get_origin(kind) is UnionType else (kind,)
    if list[str] in parts:
        return tuple[str, ...]
    return str if Path in parts else next((part for part in parts if part is not NoneType), kind)


def _asked_in(file: Path, context: typer.Context, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file asks, which stands for what the command line leaves out."""
    from evenlight.data_schema.provenance import sha256_of_file
    from evenlight.data_schema.result_request import ResultRequest
    from evenlight.data_schema.storage.text_files import read_toml_record

    request = read_toml_record(ResultRequest, file)
    if request.command != context.info_name:
        raise InputError(f"{file}: is of `evenlight {request.command}`; give it to that command")
    options = {key: one for key, one in _options_by_key(context).items() if key not in NOT_ASKED}
    for key in request.asked:
        if key not in options:
            raise InputError(f"{file}: asked: {_unknown(key, options)}")
    given = {
        options[key].name: _value_of(told, options[key], kinds[options[key].name], f"{file}: asked: {key}")
        for key, told in request.asked.items()
    }
    for of, sha256 in request.provenance.inputs.items():
        with suppress(InputError):
            if Path(of).exists() and sha256_of_file(Path(of)) != sha256:
                print(f"evenlight: note: {of} is not as it was when {file} was written", file=sys.stderr)
    return given


def _file_of(named: Path) -> Path:
    from evenlight.data_schema.result_request import REQUEST

    if named.is_dir() and not (named / REQUEST).exists():
        raise InputError(
            f"{named}: holds no {REQUEST}: an earlier version made it, or Python; give its options themselves"
        )
    return named / REQUEST if named.is_dir() else named


def _options_by_key(context: typer.Context) -> dict[str, Any]:
    return {one.name.strip("_"): one for one in context.command.params if one.name}


def _unknown(key: str, options: Mapping[str, Any]) -> str:
    """Return what is said of a key that there is not: the right one, as far as it can be told."""
    from evenlight.data_schema.mapping import unknown_key

    if why := GONE.get(key):
        return f"{key}: {why}"
    flag = f"--{key.replace('_', '-')}"  # as on the command line: `with` is the key `others`
    meant = [name for name, one in options.items() if flag in one.opts]
    right = RIGHT_NAMES.get(key) or next(iter(meant), None)
    return f"unknown key {key!r}; it is called {right!r}" if right else unknown_key(key, options)


def _value_of(told: Any, option: Any, kind: Any, where: str) -> Any:
    """Return the value of a key as its option takes it; refuse one of another kind, or out of its range."""
    from evenlight.data_schema.arguments import number
    from evenlight.data_schema.quantities import require_computable, typed

    require_computable(where, told)
    value = typed(kind, told, where)
    if isinstance(value, enum.Enum | tuple):
        return list(value) if isinstance(value, tuple) else value.value
    if getattr(option, "min", None) is not None:
        number(where, value, option.min, option.max)
    return value


def _told_of_file(words: str, request: Path, context: typer.Context) -> str:
    """Return what is wrong with what was asked: options that a file gives by their keys in it."""
    file, given = _file_of(request), context.default_map or {}
    options = {key: one for key, one in _options_by_key(context).items() if _is_of_file(one, context)}
    keys = {flag: key for key, one in options.items() for flag in (*one.opts, *one.secondary_opts)}
    if words.startswith(tuple(keys)):
        told = re.sub(r"--[a-z][a-z-]*", lambda found: keys.get(found[0], found[0]), words)
        return f"{file}: asked: {told}"
    values = [value for one in options.values() for value in _listed(given[one.name])]
    if any(isinstance(value, str) and repr(value) in words for value in values):
        return f"{words} (asked in {file}; names in it are from the folder where its command ran)"
    return words


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _is_of_file(option: Any, context: typer.Context) -> bool:
    return getattr(context.get_parameter_source(option.name), "name", "") == "DEFAULT_MAP"


def write_request(folder: Path, name: str, given: Mapping[str, Any], inputs: Mapping[str, str]) -> None:
    """Write what was asked of a command into a folder of its results.

    Parameters
    ----------
    folder : path
        The folder.
    name : str
        The command.
    given : mapping
        Options and arguments by name.
    inputs : mapping
        SHA-256 of what was named, by name.
    """
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.data_schema.result_request import REQUEST, ResultRequest
    from evenlight.data_schema.storage.text_files import write_toml_record

    told = {key.strip("_"): _plain(value) for key, value in given.items() if key not in NOT_ASKED}
    asked = {key: value for key, value in told.items() if value not in (None, ())}
    origin = provenance_now(
        seed=given.get("seed"), inputs={_plain(file): sha256 for file, sha256 in inputs.items()}
    )
    write_toml_record(folder / REQUEST, ResultRequest(name, origin, asked))


def _inputs(name: str, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of what is named, a folder that results are to lie in excepted."""
    from evenlight.data_schema.provenance import sha256_of_file

    named = [
        Path(one)
        for key, value in given.items()
        for one in _listed(value)
        if key not in (*NOT_ASKED, "out") and isinstance(one, str | Path)
    ]
    inputs, out = {}, Path(given["out"]).resolve()
    for path in named:
        with suppress(InputError, OSError):  # it is no name of a file, or the command says what is wrong
            folder = path.is_dir() and name != "catalogue" and not out.is_relative_to(path.resolve())
            if path.is_file() or folder:
                inputs[str(path)] = sha256_of_file(path)
    return inputs


def _plain(value: Any) -> Any:
    """Return the value of an option as TOML has it; a URL without what may be secret in it."""
    from evenlight.stimuli.video.video_locations import shown_name

    if isinstance(value, list | tuple):
        return tuple(_plain(one) for one in value)
    if isinstance(value, enum.Enum):
        return value.value
    return shown_name(str(value)) if isinstance(value, str | Path) else value
