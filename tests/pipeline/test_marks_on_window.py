"""What a photodiode and a recorder see of a session: read back from a real window, flip by flip."""

import os
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from warm_evenlight import said_by

WHITE, BLACK = [255], [0]


@pytest.fixture(scope="module")
def seen(virtual_screen: Callable[..., str]) -> dict[str, Any]:
    script = Path(__file__).with_name("marks_on_window.py")
    return said_by(script, [], os.environ | {"DISPLAY": virtual_screen()})


def corners(seen: dict[str, Any], begin: int, end: int) -> list[tuple[list[int], int]]:
    """What the corner had, and for how many flips."""
    flips = (flip["corner"] for flip in seen["flips"][begin:end])
    return [(colour, len(list(same))) for colour, same in groupby(flips)]


def test_the_corner_is_white_for_the_ramps_own_frames_and_black_before_and_after(
    seen: dict[str, Any],
) -> None:
    """At 60 Hz: 0.2 s of constant luminance are 12 frames, a ramp of 0.5 s 30, 0.1 s after it 6."""
    assert corners(seen, 0, seen["counts"]["ramp"]) == [(BLACK, 12), (WHITE, 30), (BLACK, 6)]


def test_the_ramp_beside_the_corner_has_its_own_luminance(seen: dict[str, Any]) -> None:
    """L = 99.8 (code/255)^2.2 + 0.2 + 0.5; dithering leaves the mean of 12288 codes within 0.05 cd/m^2."""
    for flip, intended in zip(seen["flips"], seen["intended"], strict=False):
        codes = np.array(flip["middle"])
        assert np.mean(99.8 * (codes / 255) ** 2.2 + 0.7) == pytest.approx(intended, abs=0.05)
        low, high = flip["beside"]
        assert low > 0
        assert high < 255
    assert len(seen["intended"]) == 48


def test_the_corner_is_black_on_questions_and_fields_and_white_for_all_of_a_video_and_a_search(
    seen: dict[str, Any],
) -> None:
    counts, lengths = seen["counts"], seen["lengths"]
    assert lengths["video"] == 30  # 0.5 s at 60 Hz
    assert corners(seen, counts["ramp"], counts["wait"]) == [(BLACK, counts["wait"] - counts["ramp"])]
    assert corners(seen, counts["wait"], counts["video"])[-1] == (WHITE, 30)
    assert corners(seen, counts["video"], counts["wait again"])[0][0] == BLACK
    assert corners(seen, counts["wait again"], counts["search"])[-1] == (WHITE, lengths["search"])
    assert corners(seen, counts["search"], len(seen["flips"]))[0][0] == BLACK


def test_a_trigger_follows_the_flip_that_first_shows_or_no_longer_shows_a_stimulus(
    seen: dict[str, Any],
) -> None:
    counts, lengths = seen["counts"], seen["lengths"]
    assert [tuple(each) for each in seen["triggers"]] == [
        (1, "ramp_onset", 13),  # after the first flip with a white corner
        (2, "ramp_offset", 43),
        (7, "question_onset", counts["ramp"] + 1),
        (8, "answer", counts["question"]),
        (3, "video_onset", counts["video"] - lengths["video"] + 1),
        (4, "video_offset", counts["video"] + 1),
        (5, "search_onset", counts["search"] - lengths["search"] + 1),
        (6, "search_offset", counts["search"] + 1),
    ]


@pytest.mark.real_time  # half of the triggers leave within 50 ms of their flips
def test_the_time_of_a_trigger_is_that_of_its_flip(seen: dict[str, Any]) -> None:
    times = {each["label"]: each["time"] for each in seen["sent"]}
    assert times["ramp_onset"] == pytest.approx(seen["onsets"]["ramp"] + 12 / 60, abs=1e-9)
    assert times["ramp_offset"] == pytest.approx(seen["onsets"]["ramp"] + 42 / 60, abs=1e-9)
    assert times["video_onset"] == pytest.approx(seen["onsets"]["video"], abs=1e-9)
    assert times["video_offset"] == pytest.approx(seen["onsets"]["video"] + 30 / 60, abs=1e-9)
    assert times["search_onset"] == pytest.approx(seen["onsets"]["search"], abs=1e-9)
    delays = [each["delay"] for each in seen["sent"]]
    assert min(delays) >= 0
    assert np.median(delays) < 0.05
