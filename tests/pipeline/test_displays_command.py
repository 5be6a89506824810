"""`evenlight displays` tells what the presets are: whole devices, what is known and what is assumed."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from evenlight.data_schema.display import Actuator, pixels_per_degree_at
from evenlight.data_schema.power_model import PanelKind
from evenlight.method.preset_files import load_display, load_power_model, preset_names

PRESETS = preset_names("display")


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_a_whole_device(name: str) -> None:
    display = load_display(name)
    assert display.device
    assert display.assumed
    assert (display.panel is PanelKind.OLED) == (display.actuator is Actuator.PIXELS)
    if display.power_model:
        assert load_power_model(display.power_model).kind is display.panel
    if display.device == "headset":
        assert (display.size, display.viewing_distance, display.field_of_view) == (None, None, 90.0)
        return
    assert display.resolution is not None
    assert display.size is not None
    assert display.viewing_distance is not None
    made = pixels_per_degree_at(display.resolution, display.size, display.viewing_distance)
    assert made == pytest.approx(display.pixels_per_degree, rel=1e-3)  # sizes are to a tenth of a millimetre
    width, height = display.resolution
    assert display.size[0] / width == pytest.approx(display.size[1] / height, rel=1e-3)  # square pixels
    assert f"seen from {display.viewing_distance:g} m" in display.assumed


def test_all_are_listed_and_one_with_its_sources(command: Callable[..., Any]) -> None:
    listed = command("displays")
    assert (listed.code, listed.err) == (0, "")
    lines = listed.out.splitlines()
    assert max(map(len, lines)) <= 110
    rows = {name: next(line for line in lines if line.startswith(f"{name} ")) for name in PRESETS}
    assert re.split("  +", rows["phone-oled"])[1:] == [
        "phone", "2796 x 1290", "154 x 71", "0.35 m", "111", "1026, 0.0005", "pixels", "none",
    ]  # fmt: skip
    assert rows["varjo-xr3"].endswith("backlight  surace2025")
    assert command("displays", "--quiet").out.split() == PRESETS
    one = command("displays", "laptop-lcd").out
    assert "laptopmedia.com" in one
    assert "power model  none" in one
