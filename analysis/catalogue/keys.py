"""By what a later run knows that a result is still right: hashes of inputs, options and software."""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import json
from typing import Any

from evenlight.analysis.tracks.asked_track import AskedTrack
from evenlight.cluster import software
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record, sha256_of_record
from evenlight.method.optimizer.request import Request

OF_CURVES = ("min_factor", "field_of_view", "actuator", "fps", "tolerance")
# Options that tell nothing of a result: files, whose content counts, and what is only kept or allowed.
NOT_OF_RESULT = (
    "display", "power_model", "rate_limit", "curves", "weights", "allowances", "no_cache", "other_display_ok",
    "accept_wide_band",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, slots=True)
class ResultKeys:
    """What a result and its loss curves depend on, each as a SHA-256."""

    result: str
    curves: str


def keys_of(asked: AskedTrack, posed: tuple[Display, Request], video_sha256: str) -> ResultKeys:
    """Return the keys of what is asked of a video.

    Parameters
    ----------
    asked, posed : AskedTrack, (Display, Request)
        What is asked, and what `asked.posed()` has read.
    video_sha256 : str
        Of the video.
    """
    display, request = posed
    made_of: dict[str, Any] = {
        "video": video_sha256,
        "display": sha256_of_record(display),
        "contrast_model": sha256_of_record(asked.model()[0]),
        "software": software(),
        "options": {name: _plain(getattr(asked, name)) for name in OF_CURVES},
    }
    curves = _sha256(made_of)
    options = {field.name for field in dataclasses.fields(asked)} - set(NOT_OF_RESULT)
    made_of["options"] = {name: _plain(getattr(asked, name)) for name in options}
    made_of["power_model"] = sha256_of_record(request.power_model)
    made_of["rate_limit"] = sha256_of_record(request.rate_limit)
    made_of["sections"] = [mapping_from_record(one) for one in (*request.weights, *request.allowances)]
    return ResultKeys(_sha256(made_of), curves)


def _plain(value: Any) -> Any:
    """Return an option as JSON has it."""
    return value.value if isinstance(value, enum.Enum) else value


def _sha256(content: dict[str, Any]) -> str:
    """Return the SHA-256 of what something is made of."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
