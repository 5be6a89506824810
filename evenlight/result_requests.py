"""`request.toml`: what a folder of results was asked for; and `--request`, which asks it again.

A command is wrapped: its options are what is asked, so that no option has to be named here.
"""

from __future__ import annotations

import enum
import functools
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from evenlight.data_schema.errors import InputError

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
    def noted(request: Path | None = None, **given: Any) -> None:
        inputs = _inputs(name, given)  # as they are before the work
        try:
            command(**given)
        except InputError as error:
            if request is None:
                raise
            raise InputError(f"{error} (asked in {request})") from None
        except typer.Exit:  # with results, though not all that was asked
            write_request(given["out"], name, given, inputs)
            raise
        write_request(given["out"], name, given, inputs)

    option = typer.Option(
        metavar="FILE|DIR",
        rich_help_panel="Output",
        is_eager=True,
        callback=_ask_again,
        help="request.toml of an earlier result, to make it again; what is given beside it overrides it. The "
        "file has options for experts, too (docs/requests.md).",
    )
    asked = Parameter(
        "request", Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[Path | None, option]
    )
    declared = signature(command, eval_str=True)
    own = [one.replace(kind=Parameter.KEYWORD_ONLY) for one in declared.parameters.values()]
    noted.__signature__ = declared.replace(parameters=[*own, asked])  # type: ignore[attr-defined] # Typer reads it
    return noted


def _ask_again(context: typer.Context, value: Path | None) -> Path | None:
    """Have what a file asks stand for what the command line leaves out."""
    if value is None or context.resilient_parsing:
        return value
    from evenlight.data_schema.mapping import unknown_key
    from evenlight.data_schema.provenance import sha256_of_file
    from evenlight.data_schema.result_request import REQUEST, ResultRequest
    from evenlight.data_schema.storage.text_files import read_toml_record

    file = value / REQUEST if value.is_dir() else value
    request = read_toml_record(ResultRequest, file)
    if request.command != context.info_name:
        raise InputError(f"{file}: is of `evenlight {request.command}`; give it to that command")
    names = {one.name.strip("_"): one.name for one in context.command.params if one.name}
    for key in request.asked:
        if key not in names or key in NOT_ASKED:
            raise InputError(f"{file}: asked: {unknown_key(key, set(names) - set(NOT_ASKED))}")
    given = {
        names[key]: list(told) if isinstance(told, tuple) else told for key, told in request.asked.items()
    }
    context.default_map = given
    for of, sha256 in request.provenance.inputs.items():
        with suppress(InputError):
            if Path(of).exists() and sha256_of_file(Path(of)) != sha256:
                print(f"evenlight: note: {of} is not as it was when {file} was written", file=sys.stderr)
    return value


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
        for one in (value if isinstance(value, list) else [value])
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
