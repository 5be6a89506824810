"""JSON Schemas (draft 2020-12), generated from the records.

`python -m evenlight.data_schema.json_schema` writes `data_schema/schemas/*.json`, and of them
`docs/data-dictionary.md` (`docs/make_data_dictionary.py`); a test holds that both are up to date.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evenlight.data_schema.mapping import plain_value, type_hints
from evenlight.data_schema.provenance import SCHEMA_VERSION
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.record_kinds import KINDS, RecordKind
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.loss_curves import LossCurves

DIALECT = "https://json-schema.org/draft/2020-12/schema"
FOLDER = Path(__file__).resolve().parent / "schemas"
_PLAIN = {int: "integer", float: "number", str: "string", bool: "boolean"}
_LIMITS = {"above": "exclusiveMinimum", "minimum": "minimum", "maximum": "maximum"}
Schema = dict[str, Any]


def schemas() -> dict[str, Schema]:
    """Return the schemas by name: of every record that is JSON, TOML, or a row of a table.

    Loss curves are arrays (npz) and have none.
    """
    return {kind.name: schema_of(kind) for kind in KINDS if kind.record is not LossCurves}


def schema_of(kind: RecordKind) -> Schema:
    """Return the JSON Schema of a record; the unit of a quantity is in the annotation `unit`."""
    parts: dict[str, Schema] = {}
    own = _track_row() if kind.record is BrightnessTrack else _object(kind.record, parts)
    head = {
        "$schema": DIALECT,
        "$id": f"urn:evenlight:schema:{SCHEMA_VERSION}:{kind.name}",
        "title": kind.words.capitalize(),
    }
    return {**head, **own, **({"$defs": dict(sorted(parts.items()))} if parts else {})}


def _object(cls: type[Any], parts: dict[str, Schema]) -> Schema:
    """Return the schema of a record, and put those of its parts into `parts`."""
    properties, required = {}, []
    kinds = type_hints(cls)
    for field in dataclasses.fields(cls):
        properties[file_key(field)] = _property(field, kinds[field.name], parts)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            required.append(file_key(field))
    return _closed(cls, properties, required)


def _closed(cls: type[Any], properties: dict[str, Schema], required: list[str]) -> Schema:
    return {
        "description": (cls.__doc__ or "").partition("\n")[0],
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


def _track_row() -> Schema:
    frame = {"type": "integer", "minimum": 0, "unit": "1", "description": "number of the frame, from 0"}
    columns = {
        file_key(field): {**type_of(float, field.metadata, {}), **_annotations(field)}
        for field in dataclasses.fields(BrightnessTrack)
        if field.metadata.get("shape")
    }
    return _closed(BrightnessTrack, {"frame": frame, **columns}, ["frame", *columns])


def _property(field: dataclasses.Field[Any], kind: Any, parts: dict[str, Schema]) -> Schema:
    schema = {**type_of(kind, field.metadata, parts), **_annotations(field)}
    if field.default is not dataclasses.MISSING:
        schema["default"] = plain_value(field.default)
    elif field.default_factory is not dataclasses.MISSING:
        schema["default"] = plain_value(field.default_factory())
    return schema


def _annotations(field: dataclasses.Field[Any]) -> Schema:
    unit = {"unit": field.metadata["unit"]} if "unit" in field.metadata else {}
    return {**unit, "description": field.metadata["doc"]}


def type_of(kind: Any, meta: Mapping[str, Any], parts: dict[str, Schema]) -> Schema:
    """Return the schema of a type with the limits of its field; records in it go to the parts, by name."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return _one_of([type_of(part, meta, parts) for part in arguments])
    if kind is type(None):
        return {"type": "null"}
    if origin is tuple:
        return _list_of(arguments, meta, parts)
    if origin is dict:
        return {"type": "object", "additionalProperties": type_of(arguments[1], {}, parts)}
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        parts[kind.__name__] = _object(kind, parts)
        return {"$ref": f"#/$defs/{kind.__name__}"}
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return {"type": "string", "enum": [member.value for member in kind]}
    if kind is str:
        return {"type": "string", **({"pattern": meta["pattern"]} if meta.get("pattern") else {})}
    limits = {_LIMITS[key]: meta[key] for key in _LIMITS if meta.get(key) is not None}
    return {"type": _PLAIN[kind], **limits}


def _list_of(arguments: tuple[Any, ...], meta: Mapping[str, Any], parts: dict[str, Schema]) -> Schema:
    items = {"type": "array", "items": type_of(arguments[0], meta, parts)}
    if arguments[-1] is not Ellipsis:
        return {**items, "minItems": len(arguments), "maxItems": len(arguments)}
    return {**items, "minItems": meta["min_items"]} if meta.get("min_items") else items


def _one_of(choices: list[Schema]) -> Schema:
    """Return the schema of a value that may be one of several; briefly, where all but one is null."""
    others = [choice for choice in choices if choice != {"type": "null"}]
    if len(others) == 1 and "type" in others[0] and "enum" not in others[0]:
        return {**others[0], "type": [others[0]["type"], "null"]}
    return {"anyOf": choices}


def schema_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the schemas and, in a checkout, the data dictionary."""
    import runpy

    from evenlight.data_schema.storage.whole_files import write_whole

    made = schemas()
    for name, schema in made.items():
        write_whole(FOLDER / f"{name}.json", schema_text(schema))
    for path in FOLDER.glob("*.json"):
        if path.stem not in made:
            path.unlink()
    print(f"{len(made)} schemas in {FOLDER}")
    runpy.run_path(str(FOLDER.parents[1] / "docs" / "make_data_dictionary.py"), run_name="__main__")


if __name__ == "__main__":
    main()
