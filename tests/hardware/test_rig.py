"""The rig file: presets, paths, and one clear line for whatever is wrong with it."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import keys_of
from evenlight.data_schema.recordings.rig import Eye, Rig
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.rig import open_backlight
from evenlight.hardware.rig_files import RIGS, load_rig
from evenlight.hardware.rig_windows import require_refresh_rate
from evenlight.hardware.simulated.panel import SimulatedBacklight

RIG = """
name = "lab"
display = "lab.display.toml"
viewing_distance_m = 0.6
refresh_rate_hz = 120.0
"""
HEADSET = RIG + 'screen = "openxr"\n'


def written(folder: Path, text: str) -> str:
    path = folder / "lab.rig.toml"
    path.write_text(text)
    return str(path)


def test_a_rigs_display_file_lies_beside_it_wherever_it_is_read_from(tmp_path: Path) -> None:
    rig, display = load_rig(written(tmp_path, RIG))
    assert display == str(tmp_path / "lab.display.toml")
    assert rig.display == "lab.display.toml"  # the record keeps what the file says, and no path of a computer
    assert rig.refresh_rate == 120.0


def test_a_rigs_display_may_be_a_preset(tmp_path: Path) -> None:
    assert load_rig(written(tmp_path, RIG.replace("lab.display.toml", "varjo-xr3")))[1] == "varjo-xr3"


def test_the_example_of_a_desk_shows_every_key_at_its_default_but_for_the_age_limit() -> None:
    rig, display = load_rig("desk")
    assert display == str(RIGS / "desk.display.toml")
    assert not Path(display).exists()  # a rig of another lab's monitor would be a trap
    plain = Rig("desk", "desk.display.toml", 0.6, 60.0)
    assert rig == replace(plain, calibration_age_limit=30.0)
    shown = (RIGS / "desk.rig.toml").read_text()
    for key in keys_of(Rig)[0]:
        assert re.search(rf"^(# )?{key} =|^\[{key}\]", shown, re.MULTILINE) or key == "window_size_px"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (RIG + "refresh = 60\n", "refresh"),
        (RIG.replace('display = "lab.display.toml"\n', ""), "display"),
        (RIG.replace("lab.display.toml", ""), "display must name a calibrated display"),
        (RIG.replace("120.0", '"fast"'), "refresh_rate_hz"),
        (RIG.replace("120.0", "-1.0"), "refresh_rate_hz"),
        (RIG + "bits = 9\n", "bits must be 8 or 10, got 9"),
        (RIG + 'dither = "blue"\n', "dither"),
        (RIG + 'actuator = "backlight"\n', "backlight must name one"),
        (RIG + '[keys]\nyes = "n"\n', "must differ"),
        (
            RIG + 'triggers = ["serial:/dev/x?baud=fast"]\n',
            r"serial:PORT\?baud=57600, .* got 'serial:/dev/x\?baud=f",
        ),
        (
            RIG + 'triggers = ["rts:/dev/x?baud=9600"]\n',
            r"rts:PORT\?pulse_ms=10 .* got 'rts:/dev/x\?baud=9600'",
        ),
        (RIG + 'triggers = ["parallel:0x378"]\n', "triggers must be simulated, serial:PORT, "),
        (RIG + 'screen = "vr"\n', r"screen must match \^\(simulated:\)\?openxr\$, got 'vr'"),
        (RIG + "screen = 1.5\n", "screen: expected a whole number, got 1.5"),
        (RIG + "screen = true\n", "screen: expected a whole number, got true"),
        (RIG + "[screen]\n", "screen: expected a whole number, got a table"),
        (RIG + "screen = -1\n", "screen must be at least 0, got -1"),
        (HEADSET + "bits = 10\n", "a headset's runtime takes 8 bits of each colour, got bits = 10"),
        (HEADSET + 'backlight = "simulated"\n', "a headset's backlight is its own, and is not set"),
        (HEADSET + "[photodiode_patch]\n", "a headset has no corner for a photodiode"),
        ("name = lab", "not valid TOML"),
        ("", "is empty; expected a rig"),
    ],
)
def test_a_bad_rig_is_refused_in_one_line_that_names_file_and_key(tmp_path: Path, text, says) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=says) as refused:
        load_rig(path)
    assert str(refused.value).startswith(path)
    assert "\n" not in str(refused.value)


def test_a_rig_is_on_a_screen_by_its_number_or_in_a_headset(tmp_path: Path) -> None:
    rig = load_rig(written(tmp_path, RIG + "screen = 2\n"))[0]
    assert (rig.screen, rig.in_headset) == (2, False)
    rig = load_rig(written(tmp_path, HEADSET + 'eye = "right"\n'))[0]
    assert (rig.screen, rig.in_headset, rig.eye) == ("openxr", True, Eye.RIGHT)


def test_a_rig_that_is_not_there_is_refused_with_a_guess() -> None:
    with pytest.raises(InputError, match="simulatd: no such rig; did you mean 'simulated'"):
        load_rig("simulatd")
    with pytest.raises(InputError, match="is a folder"):
        load_rig(str(RIGS))


def test_a_refresh_rate_more_than_2_percent_off_is_refused() -> None:
    rig = load_rig("simulated")[0]
    for measured in (58.9, 60.0, 61.1):
        require_refresh_rate(rig, measured)
    for measured in (50.0, 58.7, 61.3, 120.0):
        with pytest.raises(InputError, match=rf"refresh rate of 60 Hz, and the window shows {measured:.1f}"):
            require_refresh_rate(rig, measured)


def clock() -> float:
    return 0.0


def test_a_rig_without_backlight_opens_none_and_one_with_opens_the_one_it_names(tmp_path: Path) -> None:
    rig, _ = load_rig(written(tmp_path, RIG))
    assert open_backlight(rig, clock) is None
    rig, _ = load_rig(written(tmp_path, RIG + 'backlight = "simulated"\n'))
    assert isinstance(open_backlight(rig, clock), SimulatedBacklight)
    rig, _ = load_rig(written(tmp_path, RIG + 'backlight = "sysfs:no_panel_of_this_name"\n'))
    with pytest.raises(InstrumentError, match="no_panel_of_this_name: no such backlight"):
        open_backlight(rig, clock)
