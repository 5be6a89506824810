"""What a public function or record cannot take is refused with an `InputError` that names the argument."""

import dataclasses
import enum
import inspect
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

import evenlight
from evenlight import choices
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.tracks.control_request import LoopRequest
from evenlight.analysis.tracks.track_request import TrackRequest

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
        "Reading": (evenlight.Reading, {"value": 1.0, "unit": "W", "begun": 0.0, "ended": 1.0}),
        "LineSettings": (evenlight.LineSettings, {}),
        "SerialLink": (
            evenlight.SerialLink,
            {"url": "loop://", "settings": evenlight.LineSettings(), "device": "a meter"},
        ),
        "Driver": (evenlight.Driver, {"place": int}),
        "PowerSample": (
            evenlight.PowerSample,
            dict.fromkeys(("device_time", "received", "power"), 1.0) | {"sequence": 1},
        ),
        "ClockPing": (evenlight.ClockPing, {"sent": 0.0, "device_time": 0.5, "received": 1.0}),
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


def test_odd_settings_of_a_line_are_refused() -> None:
    odd = {"data_bits": 9, "parity": "X", "stop_bits": 3, "baud_rate": 0, "timeout": 0.0, "terminator": b""}
    for name, value in odd.items():
        with pytest.raises(evenlight.InputError, match=f"^{name} must"):
            evenlight.LineSettings(**{name: value})
    with pytest.raises(evenlight.InputError, match=r"^url must be a text, got 3"):
        evenlight.SerialLink(3, 4, 5)  # type: ignore[arg-type]


def test_no_luminance_is_below_0() -> None:
    with pytest.raises(evenlight.InputError, match=r"luminance must be at least 0 cd/m\^2, got -2"):
        LIMIT([1.0, -2.0])
    assert LIMIT(0.0) == 0


def enums_in(kind: Any) -> Iterator[type[enum.Enum]]:
    """Yield the enums of a type, those of the members of a union too."""
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        yield kind
    for part in get_args(kind):
        yield from enums_in(part)


def test_every_choice_of_an_argument_has_a_public_name() -> None:
    """Of functions and records that are public, and of the requests whose fields are keywords."""
    taking = [getattr(evenlight, name) for name in evenlight.__all__]
    taking += [TrackRequest, LoopRequest, RateLimitOptions]
    found: set[type[enum.Enum]] = set()
    for one in taking:
        if inspect.isfunction(one) or dataclasses.is_dataclass(one):
            with suppress(NameError):  # what is imported for types alone
                found.update(part for kind in get_type_hints(one).values() for part in enums_in(kind))
    public = {getattr(place, name) for place in (evenlight, choices) for name in place.__all__}
    assert {one.__name__ for one in found - public} == set()
    assert {"BandKind", "Device", "Direction", "LimitCurve", "Procedure"} <= {one.__name__ for one in found}
