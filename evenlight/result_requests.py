"""`request.toml`: what a folder of results was asked for; and `--request`, which asks it again.

A command is wrapped: its options are what is asked, so that no option has to be named here.
"""

from __future__ import annotations

import copy
import enum
import functools
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from inspect import Parameter, Signature, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin

import typer

from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.option_panels import GONE, RIGHT_NAMES, added

if TYPE_CHECKING:
    from evenlight.data_schema.result_request import ResultRequest

ANY_SIZE = "--large-ok"  # of all commands: how large files may be that they read (docs/security.md)
NOT_ASKED = ("request", "quiet", "force")  # of no influence on a result


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
        from evenlight.data_schema.storage.result_folders import Asked, asked_of_command
        from evenlight.stimuli.video.film_bytes import READ_FILMS
        from evenlight.stimuli.video.video_locations import local_name

        READ_FILMS.clear()
        file = None if request is None else _file_of(request)
        earlier = {} if file is None else _read(file).provenance.inputs
        before = _inputs_before(name, given)

        def write(folder: Path) -> None:
            inputs = {_plain(of): sha256 or _sha256_of_film(of) for of, sha256 in before.items()}
            write_request(folder, name, given, inputs, [] if context is None else context.command.params)
            for of, sha256 in earlier.items():
                if inputs.get(of, sha256) not in ("", sha256):
                    print(f"evenlight: note: {of} is not as it was when {file} was written", file=sys.stderr)

        inputs = tuple(Path(local_name(one)) for one in before)
        with asked_of_command(Asked(given["out"], inputs, write)):
            command(**given)

    declared = signature(command, eval_str=True)
    kinds = kinds_in_file(declared)

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
    asked = [one.replace(annotation=_with_its_opposite(one)) for one in declared.parameters.values()]
    asked.append(Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context))
    asked.append(added("request", Path, option))
    noted.__signature__ = declared.replace(parameters=asked)  # type: ignore[attr-defined] # Typer reads it
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


def kinds_in_file(declared: Signature) -> dict[str, Any]:
    """Return the types that the options of a command have in a file, by their names."""
    return {name: _kind_in_file(one) for name, one in declared.parameters.items()}


def _kind_in_file(declared: Parameter) -> Any:
    kind = (get_args(declared.annotation) or [declared.annotation])[0]
    parts = get_args(kind) if get_origin(kind) is UnionType else (kind,)
    if list[str] in parts:
        return tuple[str, ...]
    return str if Path in parts else next((part for part in parts if part is not NoneType), kind)


def _read(file: Path) -> ResultRequest:
    from evenlight.data_schema.result_request import ResultRequest
    from evenlight.data_schema.storage.text_files import read_toml_record

    return read_toml_record(ResultRequest, file)


def _asked_in(file: Path, context: typer.Context, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file asks, which stands for what the command line leaves out."""
    request, options = _read(file), _options_by_key(context.command)
    if request.command != context.info_name:
        raise InputError(f"{file}: is of `evenlight {request.command}`; give it to that command")
    for _, problem in problems_in(request, context.command, kinds):
        raise InputError(f"{file}: asked: {problem}")
    return {
        options[key].name: _value_of(key, told, options[key], kinds) for key, told in request.asked.items()
    }


def problems_in(request: ResultRequest, command: Any, kinds: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the keys of a request that its command has no option for, or no such value, and what is wrong.

    Parameters
    ----------
    request : ResultRequest
        The request.
    command : click.Command
        Its command.
    kinds : mapping of str to type
        From `kinds_in_file`.
    """
    options = _options_by_key(command)
    for key, told in request.asked.items():
        if key not in options:
            yield key, _unknown(key, options)
            continue
        try:
            _value_of(key, told, options[key], kinds)
        except InputError as error:
            yield key, str(error)


def _file_of(named: Path) -> Path:
    from evenlight.data_schema.result_request import REQUEST

    if named.is_dir() and not (named / REQUEST).exists():
        raise InputError(
            f"{named}: holds no {REQUEST}: an earlier version made it, or Python; give its options themselves"
        )
    return named / REQUEST if named.is_dir() else named


def _options_by_key(command: Any) -> dict[str, Any]:
    named = {one.name.strip("_"): one for one in command.params if one.name}
    return {key: one for key, one in named.items() if key not in NOT_ASKED}


def _unknown(key: str, options: Mapping[str, Any]) -> str:
    """Return what is said of a key that there is not: the right one, as far as it can be told."""
    from evenlight.data_schema.mapping import unknown_key

    if why := GONE.get(key):
        return f"{key}: {why}"
    flag = f"--{key.replace('_', '-')}"  # as on the command line: `with` is the key `others`
    meant = [name for name, one in options.items() if flag in one.opts]
    right = RIGHT_NAMES.get(key) or next(iter(meant), None)
    return f"unknown key {key!r}; it is called {right!r}" if right else unknown_key(key, options)


def _value_of(key: str, told: Any, option: Any, kinds: Mapping[str, Any]) -> Any:
    """Return the value of a key as its option takes it; refuse one of another kind, or out of its range."""
    from evenlight.data_schema.arguments import number
    from evenlight.data_schema.quantities import require_computable, typed

    require_computable(key, told)
    value = typed(kinds[option.name], told, key)
    if isinstance(value, enum.Enum | tuple):
        return list(value) if isinstance(value, tuple) else value.value
    if getattr(option, "min", None) is not None:
        number(key, value, option.min, option.max)
    return value


def told_as_given(error: InputError, context: typer.Context) -> str:
    """Return what is wrong with the arguments of a command, as who gave them knows them.

    What a message names in backticks is an option on the command line. What it is about is one, too, or a key
    of the file of `--request` if it stands there.
    """
    options = {one.name.strip("_"): one for one in context.command.params if one.name}
    file = context.params.get("request")
    about = options.get(error.argument) if isinstance(error, ArgumentError) else None
    of_file = about is not None and _is_of_file(about, context)

    def named(found: re.Match[str]) -> str:
        option = options.get(found[1])
        if option is None:
            return ANY_SIZE if found[1] == "large_ok" else found[0]
        return str(option.name) if of_file and _is_of_file(option, context) else _option_of(option)

    problem = error.problem if isinstance(error, ArgumentError) and about is not None else str(error)
    told = re.sub(r"`([a-z_]+)`", named, problem)
    if about is not None:
        told = f"{about.name if of_file else _option_of(about)} {told}"
    if file is None:
        return told
    asked = {one.name: one for one in options.values() if _is_of_file(one, context)}
    values = [value for name in asked for value in _listed((context.default_map or {})[name])]
    where, words = _file_of(file), str(error)
    if of_file:
        return f"{where}: asked: {told}"
    if any(isinstance(one, str) and _is_missing(one, words) for one in values):
        return f"{told} (asked in {where}; names in it are from the folder where its command ran)"
    beside = [name for name in re.findall("`([a-z_]+)`", words) if name in asked]
    return f"{told} ({', '.join(beside)}: as asked in {where})" if beside else told


def _is_missing(value: str, words: str) -> bool:
    return f"no video {value!r}" in words or f"{value}: no such" in words


def _option_of(option: Any) -> str:
    """Return an option as it is given; an argument by its name."""
    return next((flag for flag in option.opts if flag.startswith("--")), str(option.name))


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _is_of_file(option: Any, context: typer.Context) -> bool:
    return getattr(context.get_parameter_source(option.name), "name", "") == "DEFAULT_MAP"


def write_request(
    folder: Path, name: str, given: Mapping[str, Any], inputs: Mapping[str, str], options: Sequence[Any] = ()
) -> None:
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
    options : sequence
        Those of the command: what holds for one that was not given is told in a comment.
    """
    from evenlight.data_schema.provenance import provenance_now
    from evenlight.data_schema.result_request import REQUEST, ResultRequest
    from evenlight.data_schema.storage.text_files import write_toml_record

    told = {key.strip("_"): _plain(value) for key, value in given.items() if key not in NOT_ASKED}
    asked = {key: value for key, value in told.items() if value not in (None, ())}
    origin = provenance_now(
        seed=given.get("seed"), inputs={_plain(file): sha256 for file, sha256 in inputs.items() if sha256}
    )
    left = {one.name.strip("_"): _otherwise(one) for one in options if told.get(one.name.strip("_")) is None}
    notes = [f"{key}: not given; {what}" for key, what in left.items() if what and key not in NOT_ASKED]
    write_toml_record(folder / REQUEST, ResultRequest(name, origin, asked), notes)
    for url in (one for value in given.values() for one in _listed(value)):
        if isinstance(url, str) and _plain(url) != url:
            print(
                f"evenlight: note: {given.get('out', folder) / REQUEST} leaves out what may be secret of "
                f"{_plain(url)}: give the whole URL beside --request",
                file=sys.stderr,
            )


def _otherwise(option: Any) -> str:
    """Return what holds where an option is not given, as its help has it; nothing where nothing does."""
    if isinstance(option.show_default, str):
        return str(option.show_default)
    found = re.search(r"Otherwise ([^.]*(?:\.\S[^.]*)*)", getattr(option, "help", None) or "")
    return " ".join(found[1].split()) if found else ""


def _inputs_before(name: str, given: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of what is named, a folder that results are to lie in excepted.

    That of a film is empty: who reads it hashes it, and it is not read twice.
    """
    from evenlight.data_schema.provenance import sha256_of_file
    from evenlight.stimuli.video.video_locations import VIDEO_ENDINGS, is_url, local_name

    named = [
        str(one)
        for key, value in given.items()
        for one in _listed(value)
        if key not in (*NOT_ASKED, "out") and isinstance(one, str | Path)
    ]
    inputs, out = {}, Path(given["out"]).resolve()
    for one in named:
        path = Path(local_name(one))
        with suppress(InputError, OSError):  # it is no name of a file, or the command says what is wrong
            if is_url(local_name(one)) or (path.suffix.lower() in VIDEO_ENDINGS and path.is_file()):
                inputs[one] = ""
                continue
            folder = path.is_dir() and name != "catalogue" and not out.is_relative_to(path.resolve())
            if path.is_file() or folder:
                inputs[one] = sha256_of_file(path)
    return inputs


def _sha256_of_film(name: str) -> str:
    """Return the SHA-256 of a film that a command has read; nothing of one at a URL that it has not."""
    from evenlight.data_schema.provenance import sha256_of_file
    from evenlight.stimuli.video.film_bytes import READ_FILMS
    from evenlight.stimuli.video.video_locations import is_url, local_name

    name = local_name(name)
    if is_url(name):
        return READ_FILMS.get(name, "")
    with suppress(InputError):  # it went meanwhile
        return READ_FILMS.get(str(Path(name))) or sha256_of_file(Path(name))
    return ""


def _plain(value: Any) -> Any:
    """Return the value of an option as TOML has it; a URL without what may be secret in it."""
    from evenlight.stimuli.video.video_locations import shown_name

    if isinstance(value, list | tuple):
        return tuple(_plain(one) for one in value)
    if isinstance(value, enum.Enum):
        return value.value
    return shown_name(str(value)) if isinstance(value, str | Path) else value
