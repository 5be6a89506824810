"""JSON and TOML files of records, and in which line of them a key stands."""

from __future__ import annotations

import io
import json
import re
import tomllib
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, cast

from evenlight.data_schema.arguments import path as given_path
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.mapping import Place, mapping_from_record, record_from_mapping, words_of
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.input_sizes import MOST_BYTES
from evenlight.data_schema.storage.whole_files import require_free, write_whole

Record = TypeVar("Record")
DEEPEST = 50  # levels of lists and tables in each other; records have five
_BYTE_ORDER_MARKS = {
    b"\xff\xfe\0\0": "utf-32",
    b"\0\0\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
    b"\xef\xbb\xbf": "utf-8",
}
_CONTROL = re.compile("[\0-\x08\x0e-\x19\x1b-\x1f]")  # no text has them; Windows may end one with \x1a
_JSON_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')
_TOML_TABLE = re.compile(r"\s*\[+\s*([^\]]+?)\s*\]")
_TOML_KEY = re.compile(r"\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=")


def read_text(path: Path, what: str) -> str:
    """Return a file's text, or raise an `InputError` that names the file and what was expected in it.

    A byte order mark, as editors of other systems leave it, is taken off.
    """
    try:
        with io.TextIOWrapper(open_input(path, what, MOST_BYTES), encoding="utf-8-sig") as stream:
            return stream.read()
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text; expected {what}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); expected {what}") from error
    except MemoryError:
        raise InputError(f"{path}: does not fit into the memory; expected {what}") from None


def read_bytes(path: Path, what: str) -> bytes:
    """Return a file's bytes, or raise an `InputError` that names the file and what was expected in it."""
    try:
        with open_input(path, what, MOST_BYTES) as stream:
            return stream.read()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); expected {what}") from error
    except MemoryError:
        raise InputError(f"{path}: does not fit into the memory; expected {what}") from None


def decoded_text(content: bytes, encoding: str = "") -> tuple[str, str] | None:
    r"""Return another program's text, with lines that end in newlines, and its encoding; None if it is none.

    Without an encoding that is given, a byte order mark tells it, or the zeros that UTF-16 puts beside every
    Latin letter. What is not UTF-8 else is Windows' cp1252, or Latin-1 if cp1252 has not all of its bytes.

    >>> decoded_text("Küche\r\n".encode("cp1252"))
    ('Küche\n', 'cp1252')
    """
    marks = [name for mark, name in _BYTE_ORDER_MARKS.items() if content.startswith(mark)]
    zeros = [content[first:2000:2].count(0) for first in (0, 1)]
    if max(zeros) > len(content[:2000]) / 8 and min(zeros) == 0:
        marks += ["utf-16-be" if zeros[0] else "utf-16-le"]
    for name in [encoding] if encoding else [*marks[:1], "utf-8", "cp1252", "latin-1"]:
        try:
            text = content.decode(name)
        except (UnicodeError, LookupError):
            continue
        if name == "utf-8" or not _CONTROL.search(text):
            return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n"), name
    return None


def read_json(path: Path, what: str) -> Any:
    """Return the content of a JSON file."""
    return parse_json(read_text(path, what), str(path), what)


def parse_json(text: str, where: str, what: str) -> Any:
    """Return the content of a JSON text, checked strictly.

    NaN and Infinity, which Python's parser takes though JSON has none, are refused, and so is a key that is
    there twice, of which it would take the last.

    Raises
    ------
    InputError
        If the text is not JSON; it says in which line.
    """
    try:
        return _not_too_deep(json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{where}: not valid JSON{_at(error.lineno, text)} ({error.msg}); expected {what}"
        ) from None
    except _NotANumberError as error:
        line = _at(line_of_token(text, str(error)), text)
        raise InputError(
            f"{where}: not valid JSON{line} ({error} is no number of JSON); expected {what}"
        ) from None
    except RecursionError:
        raise InputError(f"{where}: not usable JSON (nested too deep); expected {what}") from None
    except ValueError as error:
        raise InputError(f"{where}: not valid JSON ({error}); expected {what}") from None


def _not_too_deep(content: Any) -> Any:
    """Return a content, or raise `RecursionError` before whatever walks through it would."""
    level = [content] if isinstance(content, dict | list) else []
    for _ in range(DEEPEST):
        if not level:
            return content
        inner = (each for one in level for each in (one.values() if isinstance(one, dict) else one))
        level = [each for each in inner if isinstance(each, dict | list)]
    raise RecursionError


class _NotANumberError(ValueError):
    """NaN, Infinity or -Infinity in JSON."""


def _refuse_constant(name: str) -> Any:
    raise _NotANumberError(name)


def _at(line: int | None, text: str) -> str:
    """Return where in a text a problem is; nothing where the text is a single line."""
    return f" at line {line}" if line and text.count("\n") > 1 else ""


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key {next(key for key in keys if keys.count(key) > 1)!r} is there twice")
    return content


def read_json_lines(path: Path, what: str) -> tuple[list[tuple[int, Any]], int | None]:
    """Return the number and the content of each line that holds anything; last, the line that is torn.

    An interruption tears the last line only; None if it is whole.

    Raises
    ------
    InputError
        If the file cannot be read, or another line is not JSON.
    """
    contents: list[tuple[int, Any]] = []
    numbered = enumerate(read_text(path, what).split("\n"), start=1)
    lines = [(number, line) for number, line in numbered if line.strip()]
    for number, line in lines:
        try:
            contents.append((number, parse_json(line, f"{path}, line {number}", what)))
        except InputError:
            if number == lines[-1][0] and _is_torn(line):
                return contents, number
            raise
    return contents, None


def _is_torn(line: str) -> bool:
    """Return whether a line is no JSON at all: one that is, and cannot be used, was not torn."""
    try:
        json.loads(line)
    except json.JSONDecodeError:
        return True
    except (ValueError, RecursionError):
        return False
    return False


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file, whole, with numbers in full precision; NaN is refused, as JSON has none."""
    write_whole(path, json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def read_json_record(cls: type[Record], path: Path) -> Record:
    """Return the record that a JSON file holds."""
    return record_from_mapping(cls, read_json(path, f"a {words_of(cls)} in JSON"), str(path))


def write_json_record(path: Path, record: Any) -> None:
    """Write a record as a JSON file."""
    write_json(path, mapping_from_record(record))


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Return the content of a TOML file."""
    text = read_text(path, what)
    try:
        content = _not_too_deep(tomllib.loads(text))
    except RecursionError:
        raise InputError(f"{path}: not usable TOML (nested too deep); expected {what}") from None
    except ValueError as error:  # a number of thousands of digits is one, and no TOMLDecodeError
        raise InputError(f"{path}: not valid TOML: {error}; expected {what}") from None
    if not text.strip():
        raise InputError(f"{path}: is empty; expected {what}")
    return cast("dict[str, Any]", content)


def read_toml_record(cls: type[Record], path: Path) -> Record:
    """Return the record that a TOML file holds."""
    return record_from_mapping(cls, read_toml(path, f"a {words_of(cls)} in TOML"), str(path))


def write_toml_record(path: Path, record: Any, notes: Sequence[str] = ()) -> None:
    """Write a record as a TOML file; TOML has no null, so None is left out. Notes are comments at its end."""
    import tomli_w

    content = tomli_w.dumps(_without_none(mapping_from_record(record)))
    write_whole(path, content + "".join(f"# {note}\n" for note in notes))


def save_record(self: Any, file: str | PathLike[str], *, force: bool = False) -> None:
    """Write it to a file, which `load` and the options of commands read.

    Parameters
    ----------
    file : str or path
        Ending in .toml; that of a rate limit in .json.
    force : bool, optional
        Whether to replace the file if it exists.

    Raises
    ------
    InputError
        If the file exists or cannot be written, or its name ends otherwise.
    """
    to, ending = given_path("file", file), getattr(self, "SAVED_AS", ".toml")
    if to.suffix != ending:
        raise ArgumentError("file", f"must end in {ending}, got {file}")
    require_free(to, force=force)
    (write_json_record if ending == ".json" else write_toml_record)(to, self)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    return value


def json_line_numbers(text: str) -> dict[Place, int]:
    r"""Return the line in which each key and list item of a JSON text begins; the text must be valid.

    >>> json_line_numbers('{"a": 1,\n "b": [2,\n 3]}')
    {('a',): 1, ('b',): 2, ('b', 0): 2, ('b', 1): 3}
    """
    lines: dict[Place, int] = {}
    place: list[str | int] = []  # of the value that comes next
    number, last = 1, 0
    tokens = [(match.start(), match[0]) for match in _JSON_TOKEN.finditer(text)]
    for position, (start, token) in enumerate(tokens):
        number, last = number + text.count("\n", last, start), start
        follows = tokens[position + 1][1] if position + 1 < len(tokens) else ""
        if place and isinstance(place[-1], int) and token not in ",]":
            lines.setdefault(tuple(place), number)
        if token.startswith('"') and follows == ":":
            place[-1] = json.loads(token)
            lines[tuple(place)] = number
        elif token in "{[":
            place.append("" if token == "{" else 0)
        elif token in "}]":
            place.pop()
        elif token == "," and isinstance(place[-1], int):
            place[-1] += 1
    return lines


def line_of_token(text: str, token: str) -> int | None:
    r"""Return the line of a bare word in a JSON text, such as NaN; None if it is not there outside texts.

    >>> line_of_token('["NaN",\n NaN]', "NaN")
    2
    """
    start = next((match.start() for match in _JSON_TOKEN.finditer(text) if match[0] == token), None)
    return None if start is None else text.count("\n", 0, start) + 1


def toml_line_numbers(text: str) -> dict[Place, int]:
    r"""Return the line of each key of a TOML text, of tables in brackets too.

    >>> toml_line_numbers('a = 1\n[t]\nb = 2')
    {('a',): 1, ('t',): 2, ('t', 'b'): 3}
    """
    lines: dict[Place, int] = {}
    table: Place = ()
    for number, line in enumerate(text.split("\n"), start=1):
        if match := _TOML_TABLE.match(line):
            table = tuple(part.strip().strip("\"'") for part in match[1].split("."))
            lines[table] = number
        elif match := _TOML_KEY.match(line):
            lines.setdefault((*table, match[1].strip("\"'")), number)
    return lines


def line_of(place: Place, lines: dict[Place, int]) -> int | None:
    """Return the line of a place, or of the nearest one around it that is known.

    >>> line_of(("display", "gamma"), {("display",): 7})
    7
    """
    return next((lines[place[:n]] for n in range(len(place), 0, -1) if place[:n] in lines), None)
