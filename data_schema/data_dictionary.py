"""The data dictionary: every file, its keys and columns, their units and limits, as one page for people."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from typing import Any

from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves

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

BIDS-like: the validator of BIDS finds no error in it. Written by `evenlight run` and `evenlight simulate`.

| file | what it holds |
|---|---|
| `dataset_description.json`, `README` | what the data set is, version of BIDS, provenance |
| `participants.tsv`, `participants.json` | one row per participant (`sub-01`), and what the columns mean |
| `sub-XX/ses-YY/manifest.json` | the [session manifest](#session-manifest), written before the first trial |
| `sub-XX/ses-YY/trials.jsonl` | one trial per line, written as it is answered: \
[ramp](#ramp-trial), [rating](#rating-trial), \
[comparison](#comparison-trial) or [search trial](#search-trial) |
| `sub-XX/ses-YY/frames.jsonl` | a line per interval, of `run` only: \
[frame](#frame-log), [clip](#clip-log) or \
[view log](#view-log) |
| `sub-XX/ses-YY/events.jsonl` | what happened, as lines ([session event](#session-event)); of `run` only |
| `sub-XX/ses-YY/beh/*_beh.tsv`, `*_beh.json` | the trials as a table; `n/a` where there is no value |
| `sweeps/TASK_SESSION/sweep.json` | what a [sweep](#sweep-manifest) of a display measured, and with what |
| `sweeps/TASK_SESSION/readings.jsonl` | one reading per line, written as it is made: \
[luminance](#luminance-reading) or [power reading](#power-reading) |
| `sweeps/TASK_SESSION/events.jsonl` | what happened, as lines ([session event](#session-event)) |
| `simulated_truth.json` | only of `evenlight simulate`: what is true of the participants |

Between the files: `participant_id` and `session_id` of manifest and trials are those of the folders; each
`trial_index` is there once; a session of status `complete` has `n_trials` usable trials (neither practice nor
flagged), but for those that stayed flagged; the table in `beh/` holds the same trials; `participants.tsv`
lists every `sub-*` folder, and may list participants who have no session yet; each `index` of a sweep's
readings is there once, and a sweep of status `complete` has `n_readings` of them. `.bidsignore` names the
files that are not part of BIDS.
"""


def data_dictionary(schemas: dict[str, Schema]) -> str:
    """Return the data dictionary in Markdown.

    Parameters
    ----------
    schemas : dict
        The schemas by name, from `json_schema.schemas`.
    """
    known = {kind.record.__name__: kind.words for kind in KINDS}
    parts: dict[str, Schema] = {}
    sections = [_INTRODUCTION, _DATA_SET]
    for kind in KINDS:
        rows = _array_rows() if kind.record is LossCurves else _rows(schemas[kind.name], known)
        sections.append(_section(kind, rows))
        parts |= schemas.get(kind.name, {}).get("$defs", {})
    for name in sorted(set(parts) - set(known)):
        heading = f"## {name}\n\n{parts[name]['description']} A part of the records above.\n"
        sections.append(heading + "\n" + _table(_rows(parts[name], known)))
    return "\n".join(sections)


def _section(kind: RecordKind, rows: Iterator[tuple[str, ...]]) -> str:
    """Return the section of one kind of file."""
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
    """Return a table of keys."""
    lines = ["| key | type | unit | limits | default | meaning |", "|---|---|---|---|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _rows(schema: Schema, known: dict[str, str]) -> Iterator[tuple[str, ...]]:
    """Yield the row of each property of a schema."""
    for key, value in schema["properties"].items():
        default = "" if key in schema["required"] else _default(value.get("default"))
        yield (
            f"`{key}`",
            _type_words(value, known),
            _unit(value.get("unit", "")),
            _limit_words(value),
            default,
            value["description"].replace("|", "\\|"),
        )


def _array_rows() -> Iterator[tuple[str, ...]]:
    """Yield the row of each array of loss curves, N frames at K brightness factors."""
    yield "`header`", "text", "", "", "", "JSON: video, display, provenance, tolerance"
    for field in dataclasses.fields(LossCurves):
        if field.name in ARRAY_SHAPES:
            shape = " × ".join(ARRAY_SHAPES[field.name])
            limits = {"above": "exclusiveMinimum", "minimum": "minimum", "maximum": "maximum"}
            found = {word: field.metadata[key] for key, word in limits.items()}
            words = _limit_words({word: limit for word, limit in found.items() if limit is not None})
            unit = _unit(field.metadata["unit"])
            yield f"`{field.name}`", f"numbers, {shape}", unit, words, "", field.metadata["doc"]


def _type_words(value: Schema, known: dict[str, str]) -> str:
    """Return what a value may be, in words."""
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
    """Return the limits of a value, in words."""
    value = {**value.get("items", {}), **value}
    words = {"exclusiveMinimum": "above", "minimum": "at least", "maximum": "at most"}
    limits = [f"{word} {value[key]:g}" for key, word in words.items() if key in value]
    if "pattern" in value:
        limits.append(f"matches `{value['pattern']}`".replace("|", "\\|"))
    if "maxItems" in value:
        limits.append(f"{value['maxItems']} of them")
    elif "minItems" in value:
        limits.append(f"{value['minItems']} or more of them")
    return ", ".join(limits)


def _default(value: Any) -> str:
    """Return a default as it is written in JSON."""
    return json.dumps(value, ensure_ascii=False)


def _unit(unit: str) -> str:
    """Return a unit as it is printed; nothing for a pure number."""
    return "" if unit == "1" else unit.replace("^2", "²")
