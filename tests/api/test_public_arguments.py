"""What a public function or record cannot take is refused with an `InputError` that names the argument."""

import dataclasses
import inspect
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import evenlight

WRONG = (object(), float("nan"), [], {}, b"x", np.zeros(3), 10**400)
VIDEO = np.random.default_rng(1).random((2, 16, 16, 3))
PICTURE = VIDEO[0]
LIMIT = evenlight.load_rate_limit("surace2025")
RAMPS = [
    {"participant_id": "1", "luminance_cd_m2": 10.0, "rate_cd_m2_s": 0.1 * k, "response": k > 5}
    for k in range(20)
]
RATINGS = [
    {
        "participant_id": str(person),
        "sequence": "gym",
        "version": version,
        "rating": 3,
        "place_in_pair": place,
    }
    for person in range(4)
    for place, version in ((1, "ours"), (2, "baseline"))
]


def fields_of(record: Any) -> dict[str, Any]:
    return {one.name: getattr(record, one.name) for one in dataclasses.fields(record)}


def asked() -> Iterator[tuple[str, str, Callable[..., Any]]]:
    """Yield each argument, and what calls its function with it alone being wrong."""
    functions: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
        "optimize": (evenlight.optimize, {"video": VIDEO, "budget": 0.5}),
        "loss_curves": (evenlight.loss_curves, {"video": VIDEO}),
        "frame_loss": (evenlight.frame_loss, {"pixel_values": PICTURE, "factors": 0.5}),
        "OnlineController": (evenlight.OnlineController, {"target_loss": 0.1}),
        "fit_ramps": (evenlight.fit_ramps, {"table": RAMPS}),
        "analyze": (evenlight.analyze, {"table": RATINGS}),
        "load": (evenlight.load, {"folder": "x"}),
        "Frame": (evenlight.Frame, {"time": 0.0, "duration": 1.0, "pixel_values": PICTURE}),
        "RateLimit": (evenlight.RateLimit, fields_of(LIMIT)),
        "RateLimit()": (LIMIT, {"luminance": 1.0}),
        "Display": (evenlight.Display, fields_of(LIMIT.display)),
        "PowerModel": (evenlight.PowerModel, fields_of(evenlight.load_power_model("surace2025"))),
        "LossCurves": (evenlight.LossCurves, fields_of(evenlight.loss_curves(VIDEO))),
    }
    for title, (function, usual) in functions.items():
        for name in inspect.signature(function).parameters:
            yield title, name, lambda wrong, of=function, at=name, rest=usual: of(**(rest | {at: wrong}))
    for of in ("load_display", "load_power_model", "load_rate_limit"):
        yield of, of.removeprefix("load_"), getattr(evenlight, of)
    yield "open_video", "video", evenlight.open_video
    yield "open_video", "fps", lambda wrong: evenlight.open_video("sunrise", wrong)
    yield "register_task", "TaskDeclaration", evenlight.register_task


@pytest.mark.parametrize(
    ("name", "call"), [pytest.param(name, call, id=f"{title}.{name}") for title, name, call in asked()]
)
def test_a_wrong_argument_is_named(name: str, call: Callable[..., Any]) -> None:
    """An object that is nothing at all is refused by its name; other oddities too, or taken as they are."""
    with pytest.raises(evenlight.InputError, match=name.replace("_", "[_ ]")) as refused:
        call(object())
    assert "\n" not in str(refused.value)
    for wrong in WRONG:
        with suppress(evenlight.InputError):  # anything else is a defect
            call(wrong)
