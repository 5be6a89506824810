"""Hypothesis strategies that make any record from the limits its fields declare."""

import dataclasses
import enum
import functools
import json
import types
import typing
from collections.abc import Callable
from itertools import islice
from typing import Any

import pytest
from hypothesis import strategies as st

from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import type_hints
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.headset import HeadsetLog
from evenlight.data_schema.recordings.instrument_logs import ClockPing, MeterReading
from evenlight.data_schema.recordings.played_power import LEFT_OUT, FrameEnergy, PassPower, VersionPower
from evenlight.data_schema.recordings.ramp import (
    Direction,
    FrameLog,
    Procedure,
    RampDesign,
    RampTrial,
    Response,
)
from evenlight.data_schema.recordings.rating_scale import RatingScale
from evenlight.data_schema.recordings.rig import Actuator, Keys, Rig
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial, ViewLog
from evenlight.data_schema.recordings.session import TASKS, SessionManifest
from evenlight.data_schema.recordings.sweep import (
    DESIGN_OF_SWEEP,
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    ReadingStatus,
    SweepManifest,
)
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, PowerFit
from evenlight.data_schema.recordings.viewing import ClipLog, ComparisonDesign, ComparisonTrial, RatingDesign
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.tracks.brightness_track import ExportedTrack, VideoSection
from evenlight.data_schema.tracks.optimization_summary import MinimizedOutcome, OptimizationSummary

Values = dict[str, Any]


@functools.cache  # to make a strategy takes longer than to draw from it
def any_record(cls: type[Any]) -> st.SearchStrategy[Any]:
    """Records of a class: fields within their own limits, then made to keep the rules between fields."""
    kinds = type_hints(cls)
    fields = {f.name: field_values(kinds[f.name], f.metadata) for f in dataclasses.fields(cls)}
    repair = RULES.get(cls, lambda values: values)
    return st.fixed_dictionaries(fields).map(lambda values: cls(**repair(dict(values))))


def field_values(kind: Any, meta: Any) -> st.SearchStrategy[Any]:
    """Values of a type within the limits of its field."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is types.UnionType:
        possible = [field_values(part, meta) for part in arguments if part is not type(None)]
        return st.one_of([st.none(), *possible] if type(None) in arguments else possible)
    if origin is tuple:
        size = {"min_size": meta.get("min_items", 0), "max_size": 6}
        if arguments[-1] is not Ellipsis:
            size = {"min_size": len(arguments), "max_size": len(arguments)}
        return st.lists(field_values(arguments[0], meta), **size).map(tuple)
    if origin is dict:
        return st.dictionaries(st.text(max_size=8), st.text(max_size=8), max_size=3)
    if dataclasses.is_dataclass(kind):
        return any_record(kind)
    if issubclass(kind, enum.Enum):
        return st.sampled_from(list(kind))
    if kind is str:
        pattern = meta.get("pattern")
        return st.from_regex(pattern, fullmatch=True) if pattern else st.text(max_size=12)
    if kind is bool:
        return st.booleans()
    if kind is int:
        return st.integers(int(meta.get("minimum") or 0), int(meta.get("maximum") or 2**63 - 1))
    return numbers(meta)


def numbers(meta: Any) -> st.SearchStrategy[float]:
    """Floats within limits, at moderate size so that ratios and products of them are finite."""
    above, minimum, maximum = meta.get("above"), meta.get("minimum"), meta.get("maximum")
    low = above + 1e-6 if above is not None else minimum if minimum is not None else -1e6
    return st.floats(low, 1e6 if maximum is None else maximum, allow_subnormal=False)


def darker_black(values: Values) -> Values:
    return values | {"black_level": values["peak_luminance"] * 0.3}


def some_power(values: Values) -> Values:
    key = "power_per_luminance" if values["kind"] is PanelKind.LCD else "red_power"
    return values | {key: 1.5, "peak_luminance": 300.0, "green_power": 0.25, "blue_power": 0.5}


def consistent_limit(values: Values) -> Values:
    low, high = sorted(values["luminance_range"])
    n, m = len(values["band_luminance"]), len(values["point_luminance"])
    n = n if n >= 2 else 0
    # Legendre polynomials lie within -1 and 1, so the sum of the coefficients' sizes bounds the curve.
    scale = max(1.0, sum(abs(c) for c in values["coefficients"]) / 40)
    # The first is the mean of the curve: a rate that is below 0 everywhere is refused.
    mean, *others = (c / scale for c in values["coefficients"])
    display = values["display"]
    return values | {
        "display_fingerprint": values["display_fingerprint"] if display is None else display.fingerprint,
        "coefficients": (abs(mean), *others),
        "luminance_range": (low, 2 * high),
        "band_luminance": tuple(low + (2 * high - low) * k / (n - 1) for k in range(n)),
        "band_lower": (0.0,) * n,
        "band_upper": (1e30,) * n,
        "point_luminance": (low,) * m if n else (),
        "point_rate": (0.5,) * m if n else (),
    }


def threshold_in_interval(values: Values) -> Values:
    return values | {"ci_low": values["threshold"] * 0.5, "ci_high": values["threshold"] * 1.5}


def ends_above_black(values: Values) -> Values:
    """No ramp reaches zero, no list names anything twice or nothing, practice wants no more than it has."""
    lists = ("screens", "directions", "ramp_durations", "factors", "relative_rates")
    values = values | {name: tuple(dict.fromkeys(values[name])) for name in lists}
    values["screens"] = values["screens"] or ("white",)
    values["practice_correct"] = min(values["practice_correct"], values["practice_trials"])
    values["directions"] = values["directions"] or (Direction.DOWN,)
    longest = 1.0 if values["same_amounts"] else max(values["ramp_durations"]) / values["ramp_durations"][0]
    values["white_pixel_value"], values["gray_pixel_value"] = 1.0, values["gray_pixel_value"] / 2
    first = 0.5 / max(values["relative_rates"]) / longest
    scale = first / values["ramp_durations"][0]
    return values | {"ramp_durations": tuple(dict.fromkeys(d * scale for d in values["ramp_durations"]))}


def one_of_two_tasks(values: Values) -> Values:
    """A ramp in one of two intervals, or a question with yes and no, with a ramp that goes its way."""
    two = values["procedure"] is Procedure.TWO_INTERVAL
    rate = (values["rate"] or 1.0) if two else values["rate"]
    falls = values["direction"] is Direction.DOWN
    start = values["initial_luminance"]
    # At most half of the luminance either way, whatever was drawn as the rate.
    rate = min(rate, 0.5 * start / values["duration"]) if rate else 0.0
    change = rate * values["duration"]
    return values | {
        "rate": rate,
        "is_catch": rate == 0,
        "ramp_interval": (values["ramp_interval"] or 1) if two else None,
        "response": Response.FIRST if two else Response.YES,
        "final_luminance": start - change if falls else start + change,
    }


def as_long_as_its_times(values: Values) -> Values:
    n, flags = (
        len(values["display_times"]),
        {"visible": True, "focused": True, "tracked": True, "late_frames": 2},
    )
    lists = {key: flags.get(key, 0.5) for key, value in values.items() if isinstance(value, tuple)}
    return values | {key: values[key][:n] + (value,) * (n - len(values[key])) for key, value in lists.items()}


def a_trial_of_frames(values: Values) -> Values:
    """Lists of one length, times that do not fall."""
    times = tuple(sorted(values["flip_times"]))
    probes = values["probe_frames"][: len(times)]
    return values | {
        "flip_times": times,
        "intended_luminance": (1.0,) * len(times),
        "probe_frames": probes,
        "probe_luminance": (1.0,) * len(probes),
        "backlight_factors": (0.5,) * len(times) if values["backlight_factors"] else (),
    }


def keys_that_differ(values: Values) -> Values:
    letters = iter("abcdefghijklmnopqrstuvwxyz0123456789")
    several = {"ratings": 5, "orientations": 8}
    return {
        name: tuple(islice(letters, several[name])) if name in several else next(letters) for name in values
    }


def named_sequences(values: Values) -> Values:
    return values | {"sequences": tuple(dict.fromkeys(values["sequences"])) or ("library",)}


def a_search_design(values: Values) -> Values:
    values = named_sequences(values)
    return values | {
        "keypoints": (f"{values['sequences'][0]}/a desk",) if values["keypoints"] else (),
        "ring_contrast": values["ring_contrast"] or -0.5,
    }


def one_of_two_videos(values: Values) -> Values:
    """What was chosen is said by interval and response, or by the version where these are not both known."""
    if values["chosen"] is not None:
        return values | {"response": None}
    interval = values["ours_interval"] or 1
    return values | {
        "ours_interval": interval,
        "response": Response.FIRST if interval == 1 else Response.SECOND,
    }


def a_search(values: Values) -> Values:
    found = values["found"]
    return values | {
        "ring_orientation": 45,
        "reported_orientation": 90 if found else None,
        "search_time": values["time_limit"] / 2 if found else values["time_limit"],
    }


def a_clip(values: Values) -> Values:
    """Lists of one length, times and frames that do not fall."""
    n, probes = len(values["flip_times"]), len(values["probe_refreshes"])
    return values | {
        "flip_times": tuple(sorted(values["flip_times"])),
        "video_frames": tuple(range(n)),
        "factors": (0.5,) * n,
        "backlight_factors": (0.5,) * n if values["backlight_factors"] else (),
        "probe_luminance": (1.0,) * probes,
        "probe_intended": (2.0,) * probes,
    }


def a_view(values: Values) -> Values:
    n = len(values["flip_times"])
    return values | {
        "flip_times": tuple(sorted(values["flip_times"])),
        "azimuths": (-20.0,) * n,
        "altitudes": (5.0,) * n,
        "backlight_factors": (0.5,) * n if values["backlight_factors"] else (),
    }


def a_session_of_its_task(values: Values) -> Values:
    fitting = (t for t, of in TASKS.items() if isinstance(values["design"], of.design | None))
    return values | {"task": next(fitting)}


def with_a_reason(values: Values) -> Values:
    return values | {"flag": values["flag"] or ("" if values["value"] is not None else "too few answers")}


def usable_rig(values: Values) -> Values:
    values = values | {"display": values["display"] or "bench", "bits": 8, "backlight": "simulated"}
    if isinstance(values["screen"], str):  # a headset has no backlight, and no corner
        none = {"actuator": Actuator.PIXELS, "backlight": "none", "backlight_curve": ""}
        values |= none | {"photodiode_patch": None}
    return values


def levels_once(values: Values) -> Values:
    """No level twice; those measured again at the end are among those measured."""
    swept = {
        name: tuple(dict.fromkeys(values[name])) for name in ("pixel_values", "factors") if name in values
    }
    if "pixel_values" in swept:
        swept["pixel_values"] = tuple(dict.fromkeys((0.0, 0.5, *swept["pixel_values"], 1.0)))
        return values | swept | {"drift_pixel_values": swept["pixel_values"][:2]}
    swept["factors"] = (0.25, 0.5, 1.0)
    return values | swept | {"drift_factors": (1.0,)}


def a_reading_that_ends(values: Values) -> Values:
    status = "luminance_status" if "luminance_status" in values else "status"
    there = values["luminance"] is not None
    return values | {
        "ended": values["begun"] + 1.0,
        status: ReadingStatus.OK if there else ReadingStatus.UNDER_RANGE,
    }


def a_sweep_of_its_task(values: Values) -> Values:
    return values | {"task": next(t for t, d in DESIGN_OF_SWEEP.items() if isinstance(values["design"], d))}


def within_intervals(values: Values) -> Values:
    intervals = [name for name in values if f"{name}_interval" in values and values[name] is not None]
    return values | {f"{name}_interval": (values[name] - 1.0, values[name] + 1.0) for name in intervals}


def bounded_objective(values: Values) -> Values:
    return values | {"lower_bound": min(values["lower_bound"], values["objective"])}


def an_energy_unless_left_out(values: Values) -> Values:
    left_out = values["flag"] in LEFT_OUT
    return values | {"energy": None if left_out else 0.01, "power": None if left_out else 0.6}


def used_if_measured(values: Values) -> Values:
    return values | {"used": values["used"] and values["mean_power"] is not None}


def a_whole_interval(values: Values) -> Values:
    low = values["ci_low"]
    return values | {"ci_high": None if low is None else low + 0.1}


def from_lowest_to_highest(values: Values) -> Values:
    return {"lowest": -1.0, "highest": 3.0, "step": 0.5 if values["step"] > 1 else 0.0}


def frames_in_order(values: Values) -> Values:
    return values | {"times": tuple(0.04 * k for k in range(len(values["factors"])))}


RULES: dict[type[Any], Callable[[Values], Values]] = {
    Display: darker_black,
    PowerModel: some_power,
    RateLimit: consistent_limit,
    Threshold: threshold_in_interval,
    OptimizationSummary: bounded_objective,
    RampDesign: ends_above_black,
    RampTrial: one_of_two_tasks,
    FrameLog: a_trial_of_frames,
    HeadsetLog: as_long_as_its_times,
    Keys: keys_that_differ,
    Rig: usable_rig,
    Statistic: with_a_reason,
    RatingDesign: named_sequences,
    RatingScale: from_lowest_to_highest,
    ComparisonDesign: named_sequences,
    SearchDesign: a_search_design,
    ComparisonTrial: one_of_two_videos,
    SearchTrial: a_search,
    ClipLog: a_clip,
    ViewLog: a_view,
    SessionManifest: a_session_of_its_task,
    LuminanceSweepDesign: levels_once,
    PowerSweepDesign: levels_once,
    LuminanceReading: a_reading_that_ends,
    PowerReading: a_reading_that_ends,
    SweepManifest: a_sweep_of_its_task,
    DisplayFit: within_intervals,
    PowerFit: within_intervals,
    MeterReading: lambda values: values | {"ended": values["begun"] + 0.4},
    ClockPing: lambda values: values | {"received": values["sent"] + 0.5},
    FrameEnergy: an_energy_unless_left_out,
    PassPower: used_if_measured,
    VersionPower: a_whole_interval,
    VideoSection: lambda values: values | {"end": 2 * values["start"] + 1},
    MinimizedOutcome: lambda values: values | {"bound": min(values["bound"], values["value"])},
    ExportedTrack: frames_in_order,
    Provenance: lambda values: values | {"schema_version": 1},
}


@pytest.fixture(scope="session")
def records_of() -> Callable[[type[Any]], st.SearchStrategy[Any]]:
    return any_record


@pytest.fixture(scope="session")
def display() -> Display:
    return Display("bench", 104.4, 0.2, 1.95, 72.28, source="a meter")


@pytest.fixture(scope="session")
def manifest_of() -> Callable[..., SessionManifest]:
    """A complete ramp session, with what a test wants to be otherwise."""
    from evenlight.data_schema.recordings.session import SessionStatus

    def made(**changes: Any) -> SessionManifest:
        values: Values = {
            "participant_id": "01",
            "session_id": "01",
            "task": "ramp",
            "simulated": True,
            "status": SessionStatus.COMPLETE,
            "n_trials": 2,
            "display": Display("bench", 104.4, 0.2, 1.95, 72.28),
            "design": RampDesign(),
            "provenance": Provenance(),
        }
        return SessionManifest(**(values | changes))

    return made


@pytest.fixture
def importing(tmp_path, command):
    """Import a text as a file; returns the outcome, and the trials of each session."""

    def run(text: str, task: str, *options: str, name: str = "table.csv") -> tuple[Any, list[dict[str, Any]]]:
        (tmp_path / name).write_text(text)
        out = tmp_path / "lab"
        outcome = command("import", tmp_path / name, "--task", task, "--out", out, *options)
        if outcome.code:
            assert not out.exists(), "half-written"
            return outcome, []
        assert command("validate", out, "--quiet").out == ""
        files = sorted(out.glob("sub-*/ses-*/trials.jsonl"))
        return outcome, [json.loads(line) for file in files for line in file.read_text().splitlines()]

    return run
