"""The JSON Schemas and the data dictionary: up to date, valid, and at one with the records."""

import copy
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

import evenlight
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.json_schema import FOLDER, schema_text, schemas
from evenlight.data_schema.mapping import keys_of, mapping_from_record, problems_in, record_from_mapping
from evenlight.data_schema.record_kinds import KINDS, RecordKind
from evenlight.data_schema.recordings.ramp import RampTrial
from evenlight.data_schema.tracks.brightness_track import TRACK_COLUMNS, BrightnessTrack
from evenlight.data_schema.tracks.loss_curves import LossCurves

Strategies = Callable[[type[Any]], st.SearchStrategy[Any]]
MAPPED = [kind for kind in KINDS if kind.record not in (LossCurves, BrightnessTrack)]
SCHEMAS = schemas()
VALIDATORS = {name: Draft202012Validator(schema) for name, schema in SCHEMAS.items()}
REGENERATE = "run `python -m evenlight.data_schema.json_schema`"

kinds = pytest.mark.parametrize("kind", MAPPED, ids=lambda kind: kind.name)


def test_the_committed_schemas_are_those_of_the_records() -> None:
    committed = {path.stem: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.json")}
    assert committed == {name: schema_text(schema) for name, schema in schemas().items()}, REGENERATE


def test_the_data_dictionary_is_that_of_the_records() -> None:
    made = runpy.run_path(str(Path(evenlight.__file__).parents[1] / "docs" / "make_data_dictionary.py"))
    assert made["PAGE"].read_text(encoding="utf-8") == made["data_dictionary"](schemas()), REGENERATE


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_valid_itself(name: str) -> None:
    Draft202012Validator.check_schema(SCHEMAS[name])


@kinds
def test_a_schema_has_the_keys_of_its_record_and_no_other(kind: RecordKind) -> None:
    schema = SCHEMAS[kind.name]
    known, required = keys_of(kind.record)
    assert list(schema["properties"]) == list(known)
    assert schema["required"] == list(required)
    assert schema["additionalProperties"] is False


def test_a_row_of_a_track_has_the_columns_of_the_file() -> None:
    assert tuple(SCHEMAS["brightness_track"]["properties"]) == TRACK_COLUMNS
    assert ",".join(TRACK_COLUMNS) == (
        "frame,time_s,factor,contrast_loss,mean_luminance_cd_m2,rate_cd_m2_s,rate_limit_cd_m2_s,power_w"
    )


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_key_says_what_it_is_and_its_unit_is_that_of_its_name(name: str) -> None:
    suffixes = {"_cd_m2_s": "cd/m^2/s", "_cd_m2": "cd/m^2", "_w_m2_cd": "W m^2/cd", "_w": "W"}
    for key, value in SCHEMAS[name]["properties"].items():
        assert value["description"]
        suffix = next((s for s in suffixes if key.endswith(s)), None)
        if suffix:
            assert value["unit"] == suffixes[suffix]


def test_a_plan_says_its_durations_in_minutes_and_hours() -> None:
    row = SCHEMAS["ramp_plan_row"]["properties"]
    units = {key: row[key]["unit"] for key in ("minutes", "total_hours", "hours_needed")}
    assert units == {"minutes": "min", "total_hours": "h", "hours_needed": "h"}


def test_limits_units_and_choices_are_in_the_schema() -> None:
    """Display.peak_luminance >= 1e-6 cd/m^2; a factor in (0, 1]; one of four responses; a pattern."""
    peak = SCHEMAS["display"]["properties"]["peak_luminance_cd_m2"]
    assert (peak["type"], peak["minimum"], peak["unit"]) == ("number", 1e-6, "cd/m^2")
    trial = SCHEMAS["ramp_trial"]["properties"]
    assert (trial["factor"]["exclusiveMinimum"], trial["factor"]["maximum"]) == (0.0, 1.0)
    assert trial["response"]["enum"] == ["yes", "no", "first", "second"]
    assert trial["response_time_s"]["type"] == ["number", "null"]
    assert trial["participant_id"]["pattern"] == "^[0-9A-Za-z]+$"
    limit = SCHEMAS["rate_limit"]["properties"]
    assert (limit["luminance_range_cd_m2"]["minItems"], limit["luminance_range_cd_m2"]["maxItems"]) == (2, 2)
    assert limit["coefficients"]["minItems"] == 1


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.floats(-2.0, 2.0),
    st.text(max_size=3),
    st.lists(st.floats(-1.0, 2.0), max_size=3),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=1),
)


# To draw a record takes ten times as long as to change it: each is changed in four ways.
@pytest.mark.slow
@kinds
@settings(max_examples=8, deadline=None)
@given(data=st.data())
def test_a_schema_accepts_what_a_record_writes_and_what_it_refuses_cannot_be_made_into_a_record(
    kind: RecordKind, records_of: Strategies, data: st.DataObject
) -> None:
    """What is wrong with a single key, `evenlight validate` finds as the schema does."""
    written = mapping_from_record(data.draw(records_of(kind.record)))
    validator = VALIDATORS[kind.name]
    assert validator.is_valid(written)
    assert list(problems_in(kind.record, written)) == []
    for _ in range(4):
        content = changed(written, data)
        valid, problems = validator.is_valid(content), list(problems_in(kind.record, content))
        try:
            record_from_mapping(kind.record, content, "memory")
            refused = False
        except InputError:
            refused = True
        assert refused or valid
        assert refused or not problems
        assert problems or valid


def changed(content: dict[str, Any], data: st.DataObject) -> dict[str, Any]:
    """A mapping with one key, on some level, replaced, removed or added."""
    content = copy.deepcopy(content)
    target = content
    inner = [value for value in content.values() if isinstance(value, dict)]
    if inner and data.draw(st.booleans()):
        target = data.draw(st.sampled_from(inner))
    key = data.draw(st.sampled_from(sorted(target)) if target else st.just("new"))
    how = data.draw(st.sampled_from(["replace", "remove", "add"]))
    if how == "replace":
        target[key] = data.draw(JUNK)
    elif how == "remove":
        target.pop(key, None)
    else:
        target["never_heard_of"] = data.draw(JUNK)
    return content


def told(cls: type[Any], content: dict[str, Any]) -> list[Any]:
    """What is wrong with a content, in order of place."""
    return sorted(problems_in(cls, content))


def trial(**changes: Any) -> dict[str, Any]:
    content: dict[str, Any] = {
        "participant_id": "01",
        "session_id": "01",
        "trial_index": 0,
        "screen": "white",
        "factor": 0.5,
        "initial_luminance_cd_m2": 50.0,
        "final_luminance_cd_m2": 40.0,
        "rate_cd_m2_s": 2.0,
        "duration_s": 5.0,
        "is_catch": False,
        "response": "yes",
        "response_time_s": None,
        "simulated": True,
    }
    return content | changes


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"factor": 0}, "expected above 0, got 0"),
        ({"factor": 1.5}, "expected at most 1, got 1.5"),
        ({"rate_cd_m2_s": -1.0}, "expected at least 0 cd/m^2/s, got -1"),
        ({"factor": "a"}, "expected a number, got 'a'"),
        ({"trial_index": 1.5}, "expected a whole number, got 1.5"),
        ({"is_catch": 0}, "expected true or false, got 0"),
        ({"response": "maybe"}, "expected one of 'yes', 'no', 'first', 'second', got 'maybe'"),
        ({"response_time_s": "a"}, "expected a number or null, got 'a'"),
        ({"participant_id": "a b"}, "expected text that matches ^[0-9A-Za-z]+$, got 'a b'"),
    ],
)
def test_a_problem_is_told_in_words(changes: dict[str, Any], problem: str) -> None:
    (key,) = changes
    assert told(RampTrial, trial(**changes)) == [((key,), problem)]


def test_all_problems_are_told_not_only_the_first() -> None:
    content = trial(factor=2.0, response="no!", facto=1)
    del content["screen"]
    assert told(RampTrial, content) == [
        ((), "the key 'screen' is missing"),
        (("facto",), "unknown key 'facto'; did you mean 'factor'?"),
        (("factor",), "expected at most 1, got 2"),
        (("response",), "expected one of 'yes', 'no', 'first', 'second', got 'no!'"),
    ]


def test_a_problem_inside_what_may_be_null_is_told_where_it_is() -> None:
    """`provenance` of a display is a Provenance or null; what is wrong with the Provenance is told."""
    content = {
        "name": "d",
        "peak_luminance_cd_m2": 100.0,
        "black_level_cd_m2": 0.1,
        "gamma": 2.2,
        "pixels_per_degree": 30.0,
        "provenance": {"seed": "x"},
    }
    assert told(Display, content) == [(("provenance", "seed"), "expected a whole number or null, got 'x'")]
