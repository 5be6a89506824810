"""Whose a data set is and by whose leave (`study.toml`), and what was planned before there were any data."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import Provenance, sha256_of_bytes
from evenlight.data_schema.quantities import count, described, file_key, record
from evenlight.data_schema.recordings.dataset_layout import STUDY
from evenlight.data_schema.recordings.session import Design
from evenlight.data_schema.result_request import Asked
from evenlight.data_schema.storage.text_files import parse_json, read_text, read_toml_record

WHAT = "a pre-registration of `evenlight plan --preregister`, as it was written"
BLOCK = re.compile(r"^```json\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@record
class Study:
    """Authors, licence and ethics of a data set, as its exports carry them."""

    authors: tuple[str, ...] = described(
        'authors of the data, in the order in which they are to be cited: ["A. Reed", "B. Meyer"]', default=()
    )
    licence: str = described(
        'licence of the data by its SPDX name (https://spdx.org/licenses): "CC0-1.0", "CC-BY-4.0"', default=""
    )
    ethics: tuple[str, ...] = described(
        'approvals: committee, number and date of each: ["Ethics board, Example University, 2026-17"]',
        default=(),
    )


@record
class Preregistration:
    """What was planned before any data were there."""

    task: str = described("experiment", pattern="^(ramp|rating|comparison|search)$")
    made: str = described("when it was written, UTC (ISO 8601)")
    participants: int = count("how many take part", minimum=1)
    design: Design = described("what is shown, and how")
    display: str = described("name of the display that was planned for; empty for any")
    options: dict[str, Asked] = described("options of the analysis by name; what is not set is missing")
    provenance: Provenance = described("software, seed of the plan, and the design's SHA-256")


def spdx_name(licence: str) -> str | None:
    """Return a licence as SPDX writes it, or None if SPDX has none of that name.

    >>> spdx_name("cc-by-4.0"), spdx_name("our licence")
    ('CC-BY-4.0', None)
    """
    from packaging.licenses import InvalidLicenseExpression, canonicalize_license_expression

    try:
        return canonicalize_license_expression(licence)
    except InvalidLicenseExpression:
        return None


def study_of(dataset: Path) -> Study:
    """Return what `study.toml` of a data set says; all is blank if there is none, as of earlier versions.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    path = dataset / STUDY
    return read_toml_record(Study, path) if path.exists() else Study()


def digest_of(content: dict[str, Any]) -> str:
    """Return the SHA-256 of what is kept as JSON, whatever the order of its keys."""
    return sha256_of_bytes(json.dumps(content, sort_keys=True).encode())


def read_preregistration(file: Path) -> Preregistration:
    """Return what a pre-registration promises; refuse one whose block is missing, damaged or changed."""
    blocks = BLOCK.findall(read_text(file, WHAT))
    content = parse_json(blocks[-1], str(file), WHAT) if blocks else None
    if not isinstance(content, dict) or content.pop("sha256", None) != digest_of(content):
        raise InputError(f"{file}: the block at its end is missing or was changed; expected {WHAT}")
    return record_from_mapping(Preregistration, content, str(file))


def blank_study() -> str:
    """Return a `study.toml` with a comment on every key, and nothing filled in."""
    fields = dataclasses.fields(Study)
    return "\n".join(f"# {f.metadata['doc']}\n{file_key(f)} = {json.dumps(f.default)}\n" for f in fields)
