"""Writes docs/data-dictionary.md, for people, from the JSON Schemas of the records.

`python -m evenlight.data_schema.json_schema` writes both; a test holds that they are up to date.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evenlight.data_schema.json_schema import schemas, type_of
from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves

Schema = dict[str, Any]
PAGE = Path(__file__).with_name("data-dictionary.md")
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
| `study.toml` | of `evenlight new study`: authors, licence, ethics ([study](#study)) |
| `preregistration*.md` | of `evenlight plan --preregister`, with which `fit` and `analyze` compare |
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
            words = _limit_words(type_of(float, field.metadata, {}))
            unit = _unit(field.metadata["unit"])
            yield f"`{field.name}`", f"numbers, {shape}", unit, words, "", field.metadata["doc"]
    for name, kind, words in (
        (
            "contents",
            "whole numbers, N",
            "which curve each frame has at any factor; these four may be missing",
        ),
        (
            "starts",
            "whole numbers, C + 1",
            "where the points of each curve begin, and where the last one's end",
        ),
        ("factors", "numbers, M", "of the points between which the curves are linear: brightness factors b"),
        ("loss", "numbers, M", "of the points: contrast loss 𝓛_c"),
    ):
        yield f"`bend_{name}`", kind, "1", "", "", words


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


if __name__ == "__main__":
    PAGE.write_text(data_dictionary(schemas()), encoding="utf-8")
    print(f"the data dictionary in {PAGE}")
