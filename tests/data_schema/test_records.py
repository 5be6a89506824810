"""Records: their limits, and the way to a file and back."""

import dataclasses
import math
import pickle
import re
import typing
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping, type_hints
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.record_kinds import KINDS, RecordKind
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves

MAPPED = [kind for kind in KINDS if kind.record not in (LossCurves, BrightnessTrack)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAPPED, ids=lambda kind: kind.name)
@settings(max_examples=1, deadline=None, derandomize=True)
@given(data=st.data())
def test_a_number_just_beyond_a_declared_limit_is_refused_and_the_limit_is_not(
    kind: RecordKind, records_of: Callable[[type[Any]], st.SearchStrategy[Any]], data: st.DataObject
) -> None:
    """Of every number of every record that is a file, and so are numbers that are none."""
    sound = data.draw(records_of(kind.record))
    hints = type_hints(kind.record)
    for field in dataclasses.fields(sound):
        hint = hints[field.name]
        taken = {hint, *typing.get_args(hint)} if typing.get_origin(hint) is not tuple else set()
        if not taken & {int, float} or taken - {int, float, type(None)} - {hint}:
            continue
        above, least, most = (field.metadata.get(key) for key in ("above", "minimum", "maximum"))
        wrong = [(math.nan, "finite, got nan"), (math.inf, "finite, got inf")] if float in taken else []
        wrong += [(above, f"above {above:g}")] if above is not None else []
        wrong += [(least - abs(least or 1), f"at least {least:g}")] if least is not None else []
        wrong += [(most + abs(most or 1), f"at most {most:g}")] if most is not None else []
        for value, words in wrong:
            with pytest.raises(InputError, match=rf"^{field.name} must be {re.escape(words)}"):
                dataclasses.replace(sound, **{field.name: value if float in taken else int(value)})


def test_a_scalar_and_an_array_keep_the_same_limits() -> None:
    """A factor lies in (0, 1]: alone, in a tuple, and in an array."""
    for factors in ((0.5, 1.5), (1.5,)):
        with pytest.raises(ValueError, match=r"factors must be at most 1, got 1\.5"):
            RampDesign(factors=factors)
    with pytest.raises(ValueError, match=r"factors must be at most 1, got 1\.5"):
        track(factors=np.array([0.5, 1.5]))
    with pytest.raises(ValueError, match="factors must be above 0, got 0"):
        track(factors=np.array([0.5, 0.0]))


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_are_finite(number: float) -> None:
    with pytest.raises(ValueError, match=f"gamma must be finite, got {number:g}"):
        Display("x", 100.0, 0.1, number, 30.0)
    with pytest.raises(ValueError, match="relative_rates must be finite"):
        RampDesign(relative_rates=(0.01, number))
    with pytest.raises(ValueError, match=r"rate must be finite, got (nan|inf|-inf)"):
        track(rate=np.array([0.0, number]))


def limit(form: RateLimitForm, coefficients: tuple[float, ...], **changes: Any) -> RateLimit:
    return RateLimit("r", "d", "f", form, coefficients, (10.0, 100.0), **changes)


@pytest.mark.parametrize("form", [RateLimitForm.LN_RATE, RateLimitForm.LOG_LOG])
def test_the_logarithm_of_a_rate_is_within_50(form: RateLimitForm) -> None:
    """At z = -1 and 1 the polynomial c1 · P1 + c2 · P2 is c2 - c1 and c2 + c1."""
    assert limit(form, (0.0, 20.0, 29.0)).form is form
    for coefficients in ((0.0, 30.0, 21.0), (0.0, -30.0, 21.0), (-51.0,), (800.0,), (1e308, 1e308)):
        with pytest.raises(ValueError, match=r"coefficients give ln\(rate\) = "):
            limit(form, coefficients)
    with pytest.raises(ValueError, match=r"ln\(rate\) = 51 within"):
        limit(form, (0.0, 30.0, 21.0))


def test_a_rate_is_finite_and_no_flash() -> None:
    assert limit(RateLimitForm.RATE, (1e9,)).coefficients == (1e9,)
    for coefficients in ((1.1e9,), (-1e9, 0.0, 3e9), (1e308, 1e308), (-1e308, -1e308)):
        with pytest.raises(ValueError, match=r"coefficients give a rate of (2e\+09|1\.1e\+09|-?inf)"):
            limit(RateLimitForm.RATE, coefficients)


def test_a_polynomial_that_is_infinite_both_ways_is_refused() -> None:
    """inf - inf is no number: neither too large nor small enough."""
    for form in RateLimitForm:
        with pytest.raises(ValueError, match="coefficients give"):
            limit(form, (1e308, 1e308, -1e308, -1e308, 1e308, 1e308))


@pytest.mark.parametrize(
    ("luminance", "lower", "words"),
    [
        ((100.0, 10.0), (1.0, 1.0), "band_luminance must rise"),
        ((10.0, 50.0, 50.0, 100.0), (1.0,) * 4, "band_luminance must rise"),
        ((10.1, 100.0), (1.0, 1.0), "must cover luminance_range, 10 to 100, got 10.1 to 100"),
        ((10.0, 99.0), (1.0, 1.0), "must cover luminance_range, 10 to 100, got 10 to 99"),
        ((10.0,), (1.0,), "must cover luminance_range"),
        (
            (10.0, 50.0, 100.0),
            (1.0, 2.5, 1.0),
            r"need band_lower <= band_upper, got 2.5 and 2 at 50",
        ),
    ],
)
def test_a_band_can_be_looked_up_over_the_whole_range(
    luminance: tuple[float, ...], lower: tuple[float, ...], words: str
) -> None:
    upper = (2.0,) * len(luminance)
    with pytest.raises(ValueError, match=words):
        limit(RateLimitForm.RATE, (1.5,), band_luminance=luminance, band_lower=lower, band_upper=upper)


def test_a_band_may_reach_beyond_the_range_and_be_infinitely_narrow() -> None:
    band = {"band_luminance": (5.0, 200.0), "band_lower": (1.5, 1.5), "band_upper": (1.5, 1.5)}
    assert limit(RateLimitForm.RATE, (1.5,), **band).band_luminance == (5.0, 200.0)


def test_black_is_darker_than_white() -> None:
    with pytest.raises(ValueError, match=r"need black_level < peak_luminance / 2, got 100 and 100 cd/m\^2"):
        Display("x", 100.0, 100.0, 2.2, 30.0)


@pytest.mark.parametrize(
    ("kind", "words"),
    [(PanelKind.LCD, "an lcd power model needs"), (PanelKind.OLED, "an oled power model needs")],
)
def test_a_power_model_needs_what_its_panel_takes_power_for(kind: PanelKind, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PowerModel("x", kind, base_power=1.0)


def test_a_choice_may_be_given_by_its_value() -> None:
    assert PowerModel("mine", "lcd", 1.0, 0.002, 300.0).kind is PanelKind.LCD  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "nonsense"}, "kind: expected one of 'lcd', 'oled', got 'nonsense'"),
        ({"kind": None}, "kind: expected one of 'lcd', 'oled', got null"),
        ({"name": 3}, "name: expected text, got 3"),
        ({"base_power": "1"}, "base_power: expected a number, got '1'"),
        ({"base_power": True}, "base_power: expected a number, got true"),
        ({"base_power": None}, "base_power: expected a number, got null"),
        ({"base_power": 10**400}, "base_power: expected a number below 1.8e308"),
        ({"provenance": {}}, "provenance: expected a Provenance or null, got a table"),
        ({"peak_luminance": 0.0}, "an lcd power model needs"),
    ],
)
def test_a_record_takes_only_what_its_fields_are(changes: dict[str, Any], words: str) -> None:
    """Types, limits and the rules between fields are refused alike, with what would be right."""
    values = {"name": "x", "kind": PanelKind.LCD, "base_power": 1.0, "power_per_luminance": 0.002}
    with pytest.raises(InputError, match=f"^{re.escape(words)}"):
        PowerModel(**(values | {"peak_luminance": 300.0} | changes))


@pytest.mark.parametrize("factors", [[0.5, 1], np.array([0.5, 1.0]), np.array([0.5, 1.0], np.float32)])
def test_numbers_may_be_lists_and_arrays(factors: Any) -> None:
    """They become what a file would hold: tuples of Python's own numbers."""
    made = RampDesign(factors=factors, repetitions=np.int64(3))
    assert (made.factors, made.repetitions) == ((0.5, 1.0), 3)
    assert {type(number) for number in made.factors} == {float}
    assert type(made.repetitions) is int


def test_no_ramp_ends_below_black() -> None:
    """0.2 of the luminance per second for 5 s is all of it."""
    with pytest.raises(ValueError, match=r"the fastest must stay below 0\.2"):
        RampDesign(relative_rates=(0.2,), ramp_durations=(5.0,))
    assert RampDesign(relative_rates=(0.19,), ramp_durations=(5.0,)).relative_rates == (0.19,)


@pytest.mark.parametrize(("rate", "is_catch"), [(0.0, False), (1.0, True)])
def test_a_catch_trial_is_one_without_change(rate: float, is_catch: bool) -> None:
    with pytest.raises(ValueError, match="a catch trial has rate 0 and only a catch trial has"):
        RampTrial("01", "01", 0, "white", 0.5, 50.0, 40.0, rate, 5.0, is_catch, Response.NO, None, True)


@pytest.mark.parametrize("name", ["", "a b", "sub-01", "01\n", "ü"])
def test_a_participant_has_a_name_of_letters_and_digits(name: str) -> None:
    """BIDS: labels hold letters and digits only, for the hyphen and the underscore divide them."""
    with pytest.raises(ValueError, match=r"participant_id must match \^\[0-9A-Za-z\]\+\$"):
        RampTrial(name, "01", 0, "white", 0.5, 50.0, 45.0, 1.0, 5.0, False, Response.NO, None, True)


def test_an_estimate_lies_in_its_interval() -> None:
    with pytest.raises(ValueError, match="need ci_low <= threshold <= ci_high, got 2, 1, 3"):
        Threshold(
            "01", "white", 0.5, 50.0, 1.0, 2.0, 3.0, 0.2, 1.0, 0.1, 0.1, None, 48, 0, ThresholdFlag.NONE
        )


def test_a_rate_limit_below_zero_everywhere_is_refused_and_one_of_zero_is_not() -> None:
    with pytest.raises(ValueError, match="rate below 0 at all of luminance_range, at most -1"):
        RateLimit("r", "d", "", RateLimitForm.RATE, (-2.0, 1.0), (1.0, 100.0))
    RateLimit("r", "d", "", RateLimitForm.RATE, (0.0,), (1.0, 100.0))


@pytest.mark.parametrize("order", [(math.nan, 0.01), (0.01, math.nan)])
def test_a_nan_is_found_wherever_it_stands(order: tuple[float, float]) -> None:
    """NaN compares false with everything, so a smallest and a largest number can hide it."""
    with pytest.raises(ValueError, match="must be finite, got nan"):
        RampDesign(relative_rates=order)


def test_a_limit_names_quantity_unit_and_value() -> None:
    with pytest.raises(ValueError, match=r"^peak_luminance must be at least 1e-06 cd/m\^2, got -1"):
        Display("x", -1.0, 0.0, 2.2, 30.0)


def test_a_power_model_is_one_whose_power_can_be_written_down() -> None:
    with pytest.raises(ValueError, match="power_per_luminance must be at most 1e"):
        PowerModel("x", PanelKind.LCD, 1.0, power_per_luminance=1e308, peak_luminance=1e308)
    with pytest.raises(ValueError, match="blue_power must be at most 1e"):
        PowerModel("x", PanelKind.OLED, 1.0, red_power=1.0, blue_power=1e308)


def test_records_cannot_be_changed() -> None:
    display = Display("x", 100.0, 0.1, 2.2, 30.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        display.gamma = 2.4  # that it cannot be is the claim


def test_a_record_copies_arrays_that_others_may_write_to_and_one_made_of_it_shares_them() -> None:
    track = example_track(np.linspace(0.4, 0.6, 5))
    taken = replace(track, factors=(mine := track.factors.copy()))
    mine[0] = 0.1
    assert taken.factors[0] == track.factors[0]
    window = mine[:]
    window.flags.writeable = False  # `mine` can still be written to
    assert replace(track, factors=window).factors is not window
    assert replace(track, times=track.times).factors is track.factors


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"power_per_luminance": 1e4, "peak_luminance": 1e4}, r"must take 1e-06 to 1e\+06 W, got 1e\+08 W"),
        ({"power_per_luminance": 1e-300}, r"must take 1e-06 to 1e\+06 W, got 5e-298 W"),
    ],
)
def test_a_power_model_is_one_of_a_panel(changes: dict[str, float], words: str) -> None:
    lcd = PowerModel("p", PanelKind.LCD, 0.0, 0.002, 500.0)
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(lcd, **changes)


def test_a_window_has_pixels_that_a_screen_can_have() -> None:
    with pytest.raises(ValueError, match="window_size must be at most 32768 pixels"):
        Rig("r", "varjo-xr3", 0.6, 60.0, window_size=(10**9, 720))


def test_the_columns_of_a_track_are_equally_long() -> None:
    with pytest.raises(ValueError, match="must be equally long"):
        track(power=np.zeros(3))


def track(**changes: Any) -> BrightnessTrack:
    """A track of two frames, with what a test wants to be otherwise."""
    made = example_track([0.5, 0.5], mean_luminance=20.0, rate_limit=1.0, power=1.0)
    return replace(made, **changes)


def test_records_of_many_numbers_print_in_one_line() -> None:
    """The default would print every array in whole."""
    assert repr(track()) == "<BrightnessTrack 'v': 2 frames from 0 to 0.04 s, factor 0.5 to 0.5>"
    curves = LossCurves(
        "bikes",
        Display("d", 100.0, 0.1, 2.2, 30.0),
        times=np.arange(250) / 25,
        durations=np.full(250, 0.04),
        factors=np.array([0.2, 1.0]),
        loss=np.tile([0.375, 0.0], (250, 1)),
        visible_contrast=np.full(250, 0.5),
        mean_luminance=np.full(250, 20.0),
        channel_means=np.full((250, 3), 0.5),
        provenance=Provenance(),
    )
    assert repr(curves) == (
        "<LossCurves 'bikes': 250 frames from 0 to 9.96 s, factors 0.2 to 1, loss 0 to 0.375>"
    )
    log = FrameLog(3, 1, 1, tuple(k / 100 for k in range(500)), (40.0,) * 499 + (20.0,))
    assert repr(log) == "<FrameLog 'trial 3': 500 frames from 0 to 4.99 s, intended_luminance 20 to 40>"
    empty = dataclasses.replace(log, flip_times=(), intended_luminance=())
    assert repr(empty) == "<FrameLog 'trial 3': 0 frames, intended_luminance none>"
    assert repr(limit(RateLimitForm.LN_RATE, (1.0, 0.5))).startswith("<RateLimit ")
    assert repr(curves.display) == "<Display 'd': 0.1 to 100 cd/m^2, gamma 2.2, 30 pixels per degree>"
    lcd = PowerModel("p", PanelKind.LCD, 0.25, 0.002, 750.0)
    assert repr(lcd) == "<PowerModel 'p': lcd, 0.25 W and 0.002 W m^2/cd up to 750 cd/m^2>"
    oled = PowerModel("p", PanelKind.OLED, 0.25, red_power=1.0, green_power=1.2, blue_power=2.0)
    assert repr(oled) == "<PowerModel 'p': oled, 0.25 W and 1, 1.2, 2 W for R, G, B>"
    frame = Frame(0.04, 0.02, np.zeros((9, 16, 3), np.uint8))
    assert repr(frame) == "<Frame at 0.04 s for 0.02 s: 16 x 9 pixels, uint8>"


def test_who_writes_a_record_is_told_the_argument_and_who_writes_a_file_the_key() -> None:
    """So too where two fields contradict each other, and where a worker of a cluster sends the error."""
    usual = limit(RateLimitForm.LN_RATE, (1.0,))
    for changes, argument, key in (
        ({"luminance_range": (50.0, 5.0)}, "luminance_range must rise", "luminance_range_cd_m2 must rise"),
        ({"luminance_range": (-1.0, 5.0)}, "luminance_range must be at", "luminance_range_cd_m2 must be at"),
        ({"luminance_range": "wide"}, "luminance_range: expected a list", "luminance_range_cd_m2: expected"),
    ):
        with pytest.raises(InputError, match=f"^{argument}") as refused:
            dataclasses.replace(usual, **changes)
        assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)
        in_file = mapping_from_record(usual) | {f"{name}_cd_m2": value for name, value in changes.items()}
        with pytest.raises(InputError, match=f"^x.json: {key}"):
            record_from_mapping(RateLimit, in_file, "x.json")
