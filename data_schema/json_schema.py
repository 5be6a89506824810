"""JSON Schemas (draft 2020-12), and the data dictionary for people, generated from the records.

`python -m evenlight.data_schema.json_schema` writes `data_schema/schemas/*.json` and
`docs/data-dictionary.md`; a test holds that both are up to date.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from evenlight.data_schema.mapping import plain_value, type_hints
from evenlight.data_schema.provenance import SCHEMA_VERSION
from evenlight.data_schema.quantities import file_key
from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves

DIALECT = "https://json-schema.org/draft/2020-12/schema"
FOLDER = Path(__file__).resolve().parent / "schemas"
DICTIONARY = Path(__file__).resolve().parents[1] / "docs" / "data-dictionary.md"
_PLAIN = {int: "integer", float: "number", str: "string", bool: "boolean"}
_LIMITS = {"above": "exclusiveMinimum", "minimum": "minimum", "maximum": "maximum"}
Schema = dict[str, Any]
_INTRODUCTION = """\
# Data dictionary

Every file that Evenlight's parts hand to each other, with its keys or columns, their units and limits.
This page and the JSON Schemas in `data_schema/schemas/` are generated from the records of `data_schema/`;
`python -m evenlight.data_schema.json_schema` writes both. `evenlight validate PATH` checks files against
them.

A unit is part of the key in files (`_cd_m2` is cd/m², `_cd_m2_s` is cd/m²/s, `_w` is W, `_s` is s). A key
without a default must be there; an unknown key is refused. Numbers are finite: NaN and Infinity are refused.
"""
_DATA_SET = """\
## Layout of a data set

BIDS-like: the present validator of BIDS finds no error in it; the classic one wants `n/a` in empty cells, as
exports have it. Written by `evenlight run`, `evenlight simulate` and `evenlight import`.

| file | what it holds |
|---|---|
| `dataset_description.json`, `README` | what the data set is, version of BIDS, provenance |
| `participants.tsv`, `participants.json` | one row per participant (`sub-01`), and what the columns mean |
| `sub-XX/ses-YY/manifest.json` | the [session manifest](#session-manifest), written before the first trial; \
of an imported session null for what its file does not tell |
| `sub-XX/ses-YY/trials.jsonl` | one trial per line, written as it is answered: \
[ramp](#ramp-trial), [rating](#rating-trial), \
[comparison](#comparison-trial) or [search trial](#search-trial) |
| `sub-XX/ses-YY/frames.jsonl` | a line per interval, of `run` only: \
[frame](#frame-log), [clip](#clip-log) or \
[view log](#view-log) |
| `sub-XX/ses-YY/headset.jsonl` | a line per interval, of sessions in a headset only: \
[headset log](#headset-log) |
| `sub-XX/ses-YY/events.jsonl` | what happened, as lines ([session event](#session-event)); of `run` only |
| `sub-XX/ses-YY/beh/*_beh.tsv`, `*_beh.json` | the trials as a table; `n/a` for null. In exports `sub-01` \
in place of `01`, and `n/a` in empty cells, too |
| `sweeps/TASK_SESSION/sweep.json` | what a [sweep](#sweep-manifest) of a display measured, and with what |
| `sweeps/TASK_SESSION/readings.jsonl` | one reading per line, written as it is made: \
[luminance](#luminance-reading) or [power reading](#power-reading) |
| `sweeps/TASK_SESSION/events.jsonl` | what happened, as lines ([session event](#session-event)) |
| `simulated_truth.json` | only of `evenlight simulate`: what is true of the participants, and of a viewing \
experiment the effects that their population has (`assumed`) |

Between the files: `participant_id` and `session_id` of manifest and trials are those of the folders; each
`trial_index` is there once; a session of status `complete` or `imported` has `n_trials` usable trials
(neither practice nor flagged), but for those that stayed flagged; the table in `beh/` holds the same trials;
`participants.tsv` lists every `sub-*` folder, and may list participants who have no session yet; each `index`
of a sweep's readings is there once, and a sweep of status `complete` has `n_readings` of them, not counting
those that repeated one at once (`again_of`).
`.bidsignore` names the files that are not part of BIDS.
"""


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
        file_key(field): {**_type_of(float, field.metadata, {}), **_annotations(field)}
        for field in dataclasses.fields(BrightnessTrack)
        if field.metadata.get("shape")
    }
    return _closed(BrightnessTrack, {"frame": frame, **columns}, ["frame", *columns])


def _property(field: dataclasses.Field[Any], kind: Any, parts: dict[str, Schema]) -> Schema:
    schema = {**_type_of(kind, field.metadata, parts), **_annotations(field)}
    if field.default is not dataclasses.MISSING:
        schema["default"] = plain_value(field.default)
    elif field.default_factory is not dataclasses.MISSING:
        schema["default"] = plain_value(field.default_factory())
    return schema


def _annotations(field: dataclasses.Field[Any]) -> Schema:
    unit = {"unit": field.metadata["unit"]} if "unit" in field.metadata else {}
    return {**unit, "description": field.metadata["doc"]}


def _type_of(kind: Any, meta: Mapping[str, Any], parts: dict[str, Schema]) -> Schema:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return _one_of([_type_of(part, meta, parts) for part in arguments])
    if kind is type(None):
        return {"type": "null"}
    if origin is tuple:
        return _list_of(arguments, meta, parts)
    if origin is dict:
        return {"type": "object", "additionalProperties": _type_of(arguments[1], {}, parts)}
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
    items = {"type": "array", "items": _type_of(arguments[0], meta, parts)}
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


def data_dictionary(made: dict[str, Schema]) -> str:
    """Return the data dictionary in Markdown.

    Parameters
    ----------
    made : dict
        The schemas by name, from `schemas`.
    """
    known = {kind.record.__name__: kind.words for kind in KINDS}
    parts: dict[str, Schema] = {}
    sections = [_INTRODUCTION, _DATA_SET]
    for kind in KINDS:
        rows = _array_rows() if kind.record is LossCurves else _rows(made[kind.name], known)
        sections.append(_section(kind, rows))
        parts |= made.get(kind.name, {}).get("$defs", {})
    for name in sorted(set(parts) - set(known)):
        heading = f"## {name}\n\n{parts[name]['description']} A part of the records above.\n"
        sections.append(heading + "\n" + _table(_rows(parts[name], known)))
    return "\n".join(sections)


def _section(kind: RecordKind, rows: Iterator[tuple[str, ...]]) -> str:
    names = ", ".join(f"`{name}`" for name in kind.file_names)
    form = {
        FileFormat.TOML: "TOML",
        FileFormat.JSON: "JSON",
        FileFormat.JSON_LINES: "JSON, one record per line",
        FileFormat.CSV: "CSV, one record per row",
        FileFormat.NPZ: "NumPy npz; the `header` is JSON in text",
    }[kind.file_format]
    doc = (kind.record.__doc__ or "").partition("\n")[0]
    schema = "" if kind.record is LossCurves else f" Schema: `data_schema/schemas/{kind.name}.json`."
    return (
        f"## {kind.words.capitalize()}\n\n{doc}\n\n"
        f"Files: {names} ({form}). From: {kind.origin}.{schema}\n\n{_table(rows)}"
    )


def _table(rows: Iterator[tuple[str, ...]]) -> str:
    lines = ["| key | type | unit | limits | default | meaning |", "|---|---|---|---|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _rows(schema: Schema, known: dict[str, str]) -> Iterator[tuple[str, ...]]:
    for key, value in schema["properties"].items():
        default = "" if key in schema["required"] else json.dumps(value.get("default"), ensure_ascii=False)
        yield (
            f"`{key}`",
            _type_words(value, known),
            _unit(value.get("unit", "")),
            _limit_words(value),
            default,
            value["description"].replace("|", "\\|"),
        )


def _array_rows() -> Iterator[tuple[str, ...]]:
    yield "`header`", "text", "", "", "", "JSON: video, display, provenance"
    for field in dataclasses.fields(LossCurves):
        if field.name in ARRAY_SHAPES:
            shape = " × ".join(ARRAY_SHAPES[field.name])
            words = _limit_words(_type_of(float, field.metadata, {}))
            unit = _unit(field.metadata["unit"])
            yield f"`{field.name}`", f"numbers, {shape}", unit, words, "", field.metadata["doc"]


def _type_words(value: Schema, known: dict[str, str]) -> str:
    if "anyOf" in value:
        return " or ".join(_type_words(choice, known) for choice in value["anyOf"])
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        words = known.get(name, name)
        return f"[{words}](#{words.lower().replace(' ', '-')})"
    if "enum" in value:
        return "one of " + ", ".join(f'`"{choice}"`' for choice in value["enum"])
    if isinstance(value["type"], list):
        return " or ".join(_type_words({**value, "type": name}, known) for name in value["type"])
    if value["type"] == "array":
        return f"list of {_type_words(value['items'], known)}s"
    if value["type"] == "object":
        return f"table of names and {_type_words(value['additionalProperties'], known)}"
    names = {"integer": "whole number", "string": "text", "boolean": "true or false"}
    return names.get(value["type"], str(value["type"]))


def _limit_words(value: Schema) -> str:
    for choice in (value.get("items", {}), *value.get("anyOf", ())):
        value = {**choice, **value}
    words = {"exclusiveMinimum": "above", "minimum": "at least", "maximum": "at most"}
    limits = [f"{word} {value[key]:g}" for key, word in words.items() if key in value]
    if "pattern" in value:
        limits.append(f"matches `{value['pattern']}`".replace("|", "\\|"))
    if "maxItems" in value:
        limits.append(f"{value['maxItems']} of them")
    elif "minItems" in value:
        limits.append(f"{value['minItems']} or more of them")
    return ", ".join(limits)


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit.replace("^2", "²")


def main() -> None:
    """Write the schemas and the data dictionary."""
    from evenlight.data_schema.storage.whole_files import write_whole

    made = schemas()
    for name, schema in made.items():
        write_whole(FOLDER / f"{name}.json", schema_text(schema))
    for path in FOLDER.glob("*.json"):
        if path.stem not in made:
            path.unlink()
    write_whole(DICTIONARY, data_dictionary(made))
    print(f"{len(made)} schemas in {FOLDER}, the data dictionary in {DICTIONARY}")


if __name__ == "__main__":
    main()
