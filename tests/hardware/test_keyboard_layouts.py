"""Keys have the names of what is printed on them, under whatever layout; and the times of their presses."""

import ctypes
import json
import os
import shutil
import statistics
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest

import evenlight
from evenlight.data_schema.recordings.rig import Keys
from evenlight.hardware.presentation.key_names import characters_of_layout, printed_name

ROOT = Path(evenlight.__file__).parents[1]
MISSING = 77
A_FRAME = 1 / 60  # [s]

# What is printed where on the keyboards of these countries, in the order of the rows.
PRINTED = {
    "us": {"third row, 1st": "z", "first row, 6th": "y", "first row, 1st": "q", "digits, 1st": "1"},
    "de": {
        "third row, 1st": "y", "first row, 6th": "z", "first row, 1st": "q", "digits, 1st": "1",
        "second row, 10th": "ö", "second row, 11th": "ä", "first row, 11th": "ü", "third row, 10th": "minus",
    },
    "fr": {
        "first row, 1st": "a", "second row, 1st": "q", "first row, 2nd": "z", "third row, 1st": "w",
        "digits, 1st": "1", "digits, 2nd": "2",  # 1 and 2 are typed with shift, & and é without
        "second row, 10th": "m", "second row, 11th": "ù",
    },
    "ru": {"second row, 10th": "ж", "first row, 1st": "й", "digits, 1st": "1", "third row, 10th": "period"},
}  # fmt: skip
THE_SAME = {"space": "space", "escape": "escape", "left": "left", "numeric pad, 7": "num_7", "F1": "f1"}


@pytest.fixture(scope="module")
def heard(psychopy_is_here: None) -> dict[str, Any]:
    """What a window's keyboard heard, on a screen of its own: its layout is changed."""
    if shutil.which("setxkbmap") is None:
        pytest.skip("setxkbmap is missing: on Debian, apt-get install x11-xkb-utils")
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        screen = f":{server.stdout.readline().strip()}"
        done = subprocess.run(
            [sys.executable, str(Path(__file__).parent / "press_keys.py"), *PRINTED],
            cwd=ROOT, env=os.environ | {"DISPLAY": screen, "PYTHONPATH": str(ROOT)},
            capture_output=True, text=True, timeout=90, check=False,
        )  # fmt: skip
    finally:
        server.terminate()
        server.wait()
        server.stdout.close()
    if done.returncode == MISSING:
        pytest.skip(f"keys cannot be pressed: {done.stdout.strip()} (on Debian, apt-get install libxtst6)")
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.slow
@pytest.mark.parametrize("layout", PRINTED)
def test_a_key_has_the_name_of_what_is_printed_on_it(heard: dict[str, Any], layout: str) -> None:
    names = heard["heard"][layout]
    assert {place: names[place] for place in PRINTED[layout]} == {
        place: [name] for place, name in PRINTED[layout].items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("layout", PRINTED)
def test_keys_without_a_letter_are_the_same_everywhere(heard: dict[str, Any], layout: str) -> None:
    names = heard["heard"][layout]
    assert {place: names[place] for place in THE_SAME} == {place: [name] for place, name in THE_SAME.items()}


@pytest.mark.slow
def test_the_shift_key_does_not_change_a_name(heard: dict[str, Any]) -> None:
    """The last layout is the Russian one, whose sixth key of the first row is Н."""
    assert heard["shifted"] == ["н"]


@pytest.mark.slow
@pytest.mark.real_time  # the median press is heard within a frame
def test_a_press_has_the_time_when_the_key_went_down(heard: dict[str, Any]) -> None:
    """Not earlier than it was sent, and within a frame of the moment when the server had it; it is read three
    frames later. A busy machine wakes the driver late now and then: the median is asked for. The driver's
    clock and the window's are related by a pair of readings, microseconds apart: 0.1 ms is no difference.
    """
    assert len(heard["delays"]) > 60
    assert min(since_before for since_before, _ in heard["delays"]) > -1e-4
    assert statistics.median(since_after for _, since_after in heard["delays"]) < A_FRAME


@pytest.mark.slow
def test_the_record_says_how_keys_are_named(heard: dict[str, Any]) -> None:
    assert heard["apparatus"]["key_names"] == "as printed, under the layout in use"


def test_windows_is_asked_for_the_characters_of_its_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Codes are virtual keys: Z is 0x5A wherever it lies; in German 0xDE is Ä, and 0xDC a dead circumflex."""
    typed = {0x5A: ord("Z"), 0x31: ord("1"), 0xDE: ord("Ä"), 0xDC: ord("^") | 1 << 31, 0x25: 0}
    user32 = types.SimpleNamespace(MapVirtualKeyW=lambda code, _: typed[code])
    monkeypatch.setattr(ctypes, "windll", types.SimpleNamespace(user32=user32), raising=False)
    monkeypatch.setattr(sys, "platform", "win32")
    characters = characters_of_layout(object())
    assert characters is not None
    places = {0x5A: "z", 0x31: "1", 0xDE: "pound", 0xDC: "backslash", 0x25: "left"}
    names = [printed_name(place, characters(code)) for code, place in places.items()]
    assert names == ["z", "1", "ä", "dead key at backslash", "left"]


def test_the_digit_row_of_french_windows_is_named_by_its_digits() -> None:
    """The virtual key of the first key is 0x31, and without shift it types &."""
    assert printed_name("1", ("&", "1")) == "1"


def test_elsewhere_keys_keep_their_places_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert characters_of_layout(object()) is None


@pytest.mark.parametrize("key", ["ä", "é", "ж", "ß", "/", "num_7"])
def test_a_rig_may_have_keys_of_other_layouts(key: str) -> None:
    assert Keys(yes=key).yes == key


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("Y", "lower case: 'y', got 'Y'"), ("Ä", "lower case: 'ä', got 'Ä'"), (" ", "must match"),
        (",", "must match"), ("yes", "must match"),
    ],
)  # fmt: skip
def test_names_that_no_key_has_are_refused(key: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Keys(yes=key)
