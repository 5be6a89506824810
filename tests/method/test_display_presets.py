"""Each number of a display preset has a source or is said to be assumed, and its angle is its geometry's."""

import dataclasses
import math
import re

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.quantities import file_key
from evenlight.method.preset_files import PRESETS, load_display, preset_names

PRESET = pytest.mark.parametrize("name", preset_names("display"))
# A word that says who measured, published or set a number, or that nobody did.
SOURCED = re.compile(r"assumed|measured|maker's specification|standard|published|target", re.IGNORECASE)


def preset_text(name: str) -> str:
    """The file of a preset."""
    return (PRESETS / f"{name}.display.toml").read_text(encoding="utf-8")


def test_there_are_presets_for_what_people_have() -> None:
    wanted = {"laptop-lcd", "desktop-lcd", "phone-oled", "quest-3", "vision-pro", "varjo-xr3"}
    assert wanted == set(preset_names("display"))


@PRESET
def test_every_number_has_a_source_or_is_assumed(name: str) -> None:
    numbers = [file_key(f) for f in dataclasses.fields(Display) if "unit" in f.metadata]
    for key in numbers:
        line = re.search(rf"(?m)^{key} = [0-9.]+ +# (.+)$", preset_text(name))
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
