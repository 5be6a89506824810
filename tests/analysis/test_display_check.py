"""Whether a display's file still holds."""

import dataclasses

import pytest

from evenlight.analysis.sweeps.luminance_sweep import compared_with_file
from evenlight.data_schema.display import Display

KNOWN = Display("desk", 200.0, 0.2, 2.2, pixels_per_degree=40.0, measured="2026-10-01")


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"peak_luminance": 203.0},  # 1.5 %
        {"black_level": 0.215},
        {"gamma": 2.205},  # at L' = 0.5, 0.5^0.005 = 0.35 % darker
        {"reflected_luminance": 5.0},  # the room's, not the display's
    ],
)
def test_a_file_holds_while_no_luminance_is_further_than_tolerated(change):
    said = compared_with_file(KNOWN, dataclasses.replace(KNOWN, **change))
    assert "(2026-10-01) still holds" in said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"peak_luminance": 206.0}, "peak +3.0 %"),
        ({"black_level": 0.3}, "black +0.10 cd/m^2"),
        ({"gamma": 2.3}, "gamma +0.100"),  # 0.5^0.1 = 6.7 % darker
    ],
)
def test_it_no_longer_does_beyond(change, words):
    said = compared_with_file(KNOWN, dataclasses.replace(KNOWN, **change))
    assert "no longer holds" in said
    assert words in said
