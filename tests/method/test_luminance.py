"""The display model, and presets that say where their numbers come from."""

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import DEFAULT_MODEL, PixelToLuminance, Visibility
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.quantities import file_key
from evenlight.method.contrast.luminance import (
    channel_means,
    dimmed_luminance,
    displayed_luminance,
    emitted_luminance,
)
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.preset_files import (
    PRESETS,
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
    preset_names,
)

LAB = Display("lab", peak_luminance=101.0, black_level=1.0, gamma=2.0, pixels_per_degree=60.0)

BRIGHT_ROOM = dataclasses.replace(LAB, reflected_luminance=5.0)


def test_equation_1_by_hand():
    """0.5² · (101 - 1) + 1 + 5 = 31."""
    assert displayed_luminance(0.5, BRIGHT_ROOM) == pytest.approx(31.0)


def test_a_gray_frame_emits_equation_1_less_its_reflections():
    gray = np.full((2, 3, 3), 51, np.uint8)  # 51/255 = 0.2; 0.04 · 100 + 1 = 5
    np.testing.assert_allclose(emitted_luminance(gray, BRIGHT_ROOM), 5.0, rtol=1e-12)


def test_linear_channels_are_weighed_by_default():
    """Green at half: 0.7152 · 0.5² · 100 + 1; weighing first gives (0.7152 · 0.5)² · 100 + 1."""
    green = np.array([[[0.0, 0.5, 0.0]]])
    assert emitted_luminance(green, LAB).item() == pytest.approx(18.88)
    luma_first = emitted_luminance(green, LAB, PixelToLuminance.LUMA_FIRST)
    assert luma_first.item() == pytest.approx(100 * 0.3576**2 + 1)


@given(st.floats(0, 1))
def test_both_orders_agree_on_gray(value):
    """The weights sum to 1, so a gray pixel has luma L' whichever comes first."""
    gray = np.full((1, 1, 3), value)
    orders = [emitted_luminance(gray, LAB, order) for order in PixelToLuminance]
    np.testing.assert_allclose(*orders, rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_integers_span_their_whole_range(dtype):
    ends = np.array([[[0] * 3, [np.iinfo(dtype).max] * 3]], dtype)
    np.testing.assert_allclose(emitted_luminance(ends, LAB), [[1.0, 101.0]])


def test_channel_means_are_of_linear_values():
    frame = np.array([[[0.0, 0.5, 1.0], [1.0, 0.5, 1.0]]])
    np.testing.assert_allclose(channel_means(frame, gamma=2.0), [0.5, 0.25, 1.0])


def test_dimming_scales_the_black_level_and_not_the_reflected_light():
    """Decision `dimming`: black at b = 0.2 is 0.2 · 1 + 5."""
    black = emitted_luminance(np.zeros((1, 1, 3), np.uint8), BRIGHT_ROOM)
    assert dimmed_luminance(black, 0.2, BRIGHT_ROOM).item() == pytest.approx(5.2)


@given(st.floats(0, 1))
def test_undimmed_is_equation_1(value):
    emitted = emitted_luminance(np.full((1, 1, 3), value), BRIGHT_ROOM)
    expected = displayed_luminance(value, BRIGHT_ROOM)
    np.testing.assert_allclose(dimmed_luminance(emitted, 1.0, BRIGHT_ROOM).item(), expected, rtol=1e-12)


# --- preset files


def test_the_display_is_that_of_the_authors_program() -> None:
    # vision.md 0.3: gamma 1.95, 0.2 to 104.4 cd/m^2, nothing reflected, at most 36.14 cpd.
    display = load_display("varjo-xr3")
    assert (display.gamma, display.black_level, display.peak_luminance) == (1.95, 0.2, 104.4)
    assert display.reflected_luminance == 0
    assert display.nyquist_frequency == pytest.approx(36.14)


def test_the_power_model_is_the_papers() -> None:
    model = load_power_model("surace2025")
    assert (model.power_per_luminance, model.base_power) == (0.001858, 0.2945)


def test_the_default_contrast_model_is_the_one_of_the_code() -> None:
    assert load_contrast_model("default") == DEFAULT_MODEL


def test_each_measure_is_a_contrast_model_of_its_name_and_relative_the_default() -> None:
    assert load_contrast_model("relative") == DEFAULT_MODEL
    assert set(preset_names("contrast_model")) == {*MEASURES, "default", "as-printed"}
    assert {name: load_contrast_model(name) for name in MEASURES} == MEASURES


def test_as_printed_counts_positive_contrast_alone() -> None:
    assert load_contrast_model("as-printed").visibility is Visibility.POSITIVE_ONLY


def test_the_rate_limit_belongs_to_the_display() -> None:
    assert load_rate_limit("surace2025").display_fingerprint == load_display("varjo-xr3").fingerprint


def test_a_name_that_is_none_is_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no such contrast model.*did you mean 'as-printed'\?.*default"):
        load_contrast_model("as_printed")


# --- display presets

PRESET = pytest.mark.parametrize("name", preset_names("display"))

# A word that says who measured, published or set a number, or that nobody did.
SOURCED = re.compile(r"assumed|measured|maker's specification|standard|published|target", re.IGNORECASE)


def preset_text(name: str) -> str:
    """The file of a preset."""
    return (PRESETS / f"{name}.display.toml").read_text(encoding="utf-8")


def test_there_are_presets_for_what_people_have() -> None:
    wanted = {"laptop-lcd", "desktop-lcd", "phone-oled", "quest-3", "vision-pro", "varjo-xr3"}
    assert wanted == set(preset_names("display"))


UNKNOWN = {"resolution_px", "size_mm", "viewing_distance_m", "field_of_view_deg"}  # of some displays


@PRESET
def test_every_number_has_a_source_or_is_assumed(name: str) -> None:
    numbers = [file_key(f) for f in dataclasses.fields(Display) if "unit" in f.metadata]
    for key in numbers:
        if re.search(rf"(?m)^{key} = ", preset_text(name)) is None:
            assert key in UNKNOWN, key
            continue
        line = re.search(rf"(?m)^{key} = [\[\]0-9., ]+ +# (.+)$", preset_text(name))
        assert line is not None, key
        assert SOURCED.search(line.group(1)), line.group()
    shown = load_display(name)
    assert shown.name == name
    assert not shown.measured  # nobody's own display: sessions with people refuse it
    assert ("assumed" in preset_text(name)) == ("assumed" in shown.source)


@PRESET
def test_pixels_per_degree_are_those_of_size_and_distance(name: str) -> None:
    """A pixel of p mm at d mm spans p / (2 d tan 0.5°) of a degree."""
    stated = re.search(
        r"Geometry: ([0-9.]+) in, (\d+) x (\d+) pixels .*seen from ([0-9.]+) m", preset_text(name)
    )
    if stated is None:
        assert re.search(r"pixels_per_degree = .*# (published|authors' published)", preset_text(name))
        return
    inches, across, down, metres = map(float, stated.groups())
    pitch = 25.4 * inches / math.hypot(across, down)
    expected = 2 * 1000 * metres * math.tan(math.radians(0.5)) / pitch
    assert load_display(name).pixels_per_degree == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize(
    ("name", "contrast"), [("laptop-lcd", 1700), ("desktop-lcd", 1000), ("phone-oled", 2e6)]
)
def test_black_is_the_peak_over_the_contrast_stated(name: str, contrast: float) -> None:
    shown = load_display(name)
    assert shown.black_level == pytest.approx(shown.peak_luminance / contrast, rel=0.03)  # to four decimals
