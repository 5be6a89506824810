"""A calibration grows old, and a rig says when."""

import dataclasses

import pytest

from evenlight.data_schema.display import Display
from evenlight.experiments.calibration_age import too_old

NOW = "2026-11-21T12:00:00+00:00"
LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)


@pytest.mark.parametrize(
    "measured", ["2026-11-20", "2026-10-22T12:00:00+00:00", "2026-10-22T12:00Z", "2026-11-21T13:00:00+02:00"]
)
def test_one_within_the_limit_is_taken(measured):
    assert too_old(dataclasses.replace(LAB, measured=measured), 30.0, NOW) == ""


def test_one_beyond_it_is_not_and_the_message_says_how_old_it_is():
    said = too_old(dataclasses.replace(LAB, measured="2026-10-22T11:00:00+00:00"), 30.0, NOW)
    assert "30 days ago (2026-10-22)" in said


def test_one_that_says_no_date_is_not_taken_where_there_is_a_limit():
    assert "does not say when it was measured" in too_old(LAB, 30.0, NOW)
    assert too_old(LAB, None, NOW) == ""


@pytest.mark.parametrize("measured", ["yesterday", "21.11.2026", "2026-11", "2026-11-21 12:00"])
def test_a_date_is_written_in_one_way(measured):
    with pytest.raises(ValueError, match="measured"):
        dataclasses.replace(LAB, measured=measured)


def test_one_of_the_future_is_a_slip():
    said = too_old(dataclasses.replace(LAB, measured="2031-01-01"), 30.0, NOW)
    assert "in the future (2031-01-01)" in said
