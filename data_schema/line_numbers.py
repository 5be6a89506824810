"""In which line of a file a key stands, for messages about its value."""

from __future__ import annotations

import json
import re

Place = tuple[str | int, ...]  # keys and list indices, from the outermost in

_JSON_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')
_TOML_TABLE = re.compile(r"\s*\[+\s*([^\]]+?)\s*\]")
_TOML_KEY = re.compile(r"\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=")


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
