"""What a JSON Schema has to say against a content: all of it, in words."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.json_schema import committed_schema
from evenlight.data_schema.line_numbers import Place
from evenlight.data_schema.mapping import shown, unknown_key

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator, ValidationError

_TYPES = {
    "integer": "a whole number",
    "number": "a number",
    "string": "text",
    "boolean": "true or false",
    "array": "a list",
    "object": "a table of names and values",
    "null": "null",
}
_LIMITS = {"exclusiveMinimum": "above", "minimum": "at least", "maximum": "at most"}
_LENGTHS = {"minItems": "at least", "maxItems": "at most"}


def schema_problems(content: Any, name: str) -> list[tuple[Place, str]]:
    """Return every place at which a content breaks a schema, and what would be right there.

    Parameters
    ----------
    content : object
        Plain values, as read from JSON or TOML.
    name : str
        Name of the schema.

    >>> schema_problems({"peak_luminance_cd_m2": -1.0}, "display")[-1]
    (('peak_luminance_cd_m2',), 'expected above 0 cd/m^2, got -1.0')
    """
    problems = [told for error in _validator(name).iter_errors(content) for told in _told(error)]
    return sorted(problems, key=lambda problem: [str(key) for key in problem[0]])


@cache
def _validator(name: str) -> Draft202012Validator:
    """Return the validator of a schema; jsonschema is imported only where something is validated."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(committed_schema(name))


def _told(error: ValidationError) -> Iterator[tuple[Place, str]]:
    """Yield what one error of jsonschema says: its place, and the problem in words."""
    place: Place = tuple(error.absolute_path)
    rule, limit = str(error.validator), error.validator_value
    got: Any = error.instance
    schema = error.schema if isinstance(error.schema, dict) else {}
    if rule == "anyOf":
        yield from _nearest_choice(error)
    elif rule == "required":
        # jsonschema reports each missing key apart, and names it in its message only.
        yield place, f"the key {error.message.split(' is a required')[0]} is missing"
    elif rule == "additionalProperties":
        known = list(schema["properties"])
        for key in got:
            if key not in known:
                yield (*place, key), unknown_key(key, known)
    elif rule in _LIMITS:
        unit = "" if schema.get("unit", "1") == "1" else f" {schema['unit']}"
        yield place, f"expected {_LIMITS[rule]} {limit:g}{unit}, got {shown(got)}"
    elif rule in _LENGTHS:
        yield place, f"expected a list of {_LENGTHS[rule]} {limit}, got {len(got)}"
    else:
        yield place, f"expected {_wanted(rule, limit)}, got {shown(got)}"


def _wanted(rule: str, limit: Any) -> str:
    """Return what a rule about the kind of a value wants."""
    if rule == "type":
        names = limit if isinstance(limit, list) else [limit]
        return " or ".join(_TYPES[name] for name in names)
    if rule == "enum":
        return "one of " + ", ".join(map(repr, limit))
    return f"text that matches {limit}" if rule == "pattern" else f"{rule} {limit!r}"


def _nearest_choice(error: ValidationError) -> Iterator[tuple[Place, str]]:
    """Yield what is wrong by the choice that comes nearest: the one broken deepest inside, not at the top."""
    choices: dict[int, list[ValidationError]] = {}
    for cause in error.context or []:
        choices.setdefault(int(cause.schema_path[0]), []).append(cause)
    inside = [
        causes
        for causes in choices.values()
        if not any(c.validator == "type" and not c.relative_path for c in causes)
    ]
    for cause in min(inside or choices.values(), key=len):
        yield from _told(cause)
