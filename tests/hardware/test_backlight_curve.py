"""Backlights by luminance: a measured curve is inverted, and nothing is guessed beyond it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.sweep_fit import LuminanceLevel
from evenlight.data_schema.storage.tables import write_rows
from evenlight.hardware.backlight_curve import BacklightCurve, LinearizedBacklight, read_backlight_curve
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.panel import SimulatedBacklight

TENTHS = tuple(k / 10 for k in range(1, 11))


def linearized(exponent: float, steps: int = 4095) -> tuple[LinearizedBacklight, SimulatedBacklight]:
    device = SimulatedBacklight(lambda: 0.0, steps=steps, time_constant=1e-9)
    return LinearizedBacklight(
        device, BacklightCurve(TENTHS, tuple(200 * f**exponent for f in TENTHS))
    ), device


@given(st.floats(0.05, 1.0), st.floats(0.5, 3.0))
def test_a_device_that_follows_a_power_law_is_set_to_the_share_asked_for(
    share: float, exponent: float
) -> None:
    """b = x^e: x = b^(1/e), by hand; half a step of x is e x^(e - 1) / 2 of b, and a little, for it bends."""
    backlight, device = linearized(exponent)
    if share < backlight.smallest_factor():
        return
    set_to: list[float] = []
    device._follow = set_to.append
    achieved = backlight.set_factor(share)
    wanted = share ** (1 / exponent)
    assert set_to[0] == pytest.approx(wanted, abs=0.5 / 4095 + 1e-9)
    assert achieved == pytest.approx(set_to[0] ** exponent, rel=1e-9)
    assert abs(achieved - share) <= backlight.step()


def test_a_curve_with_an_offset_is_met_between_its_levels() -> None:
    """L = 10 + 190 x: the law is known, and ten levels hold it to 0.25 % of the light, at the dim end too."""
    curve = BacklightCurve(TENTHS, tuple(10 + 190 * f for f in TENTHS))
    backlight = LinearizedBacklight(SimulatedBacklight(lambda: 0.0, steps=100_000), curve)
    for share in np.linspace(0.15, 1.0, 86):
        set_to: list[float] = []
        backlight._inner._follow = set_to.append
        backlight.set_factor(share)
        assert (10 + 190 * set_to[0]) / 200 == pytest.approx(share, rel=2.5e-3)


def test_the_step_told_is_the_widest_in_luminance() -> None:
    """Of x^2 in 100 steps, from 0.99 to 1: 1 - 0.99^2 = 0.0199."""
    backlight, _ = linearized(2.0, steps=100)
    assert backlight.step() == pytest.approx(1 - 0.99**2, rel=1e-6)


def test_below_the_lowest_level_that_was_measured_nothing_is_guessed() -> None:
    backlight, device = linearized(2.0)
    assert backlight.smallest_factor() == pytest.approx(0.1**2)
    with pytest.raises(
        InstrumentError, match=r"with its measured curve: has factors from 0\.01 to 1, got 0\.009"
    ):
        backlight.set_factor(0.009)
    device.set_factor(0.05)
    device._start = device._target  # without its lag
    with pytest.raises(InstrumentError, match=r"stands at its factor 0\.05\d*, below 0\.1"):
        backlight.read_factor()


def test_the_full_backlight_and_the_lowest_level_are_met_exactly() -> None:
    backlight, _ = linearized(1.7, steps=100)
    assert backlight.set_factor(1.0) == 1.0
    assert backlight.set_factor(backlight.smallest_factor()) == pytest.approx(0.1**1.7)


def table(path: Path, luminances: dict[float, float | None], share: bool = False) -> Path:
    full = luminances.get(1.0) or 1.0
    rows = [
        LuminanceLevel(f, f, light, share=light / full if share and light is not None else None)
        for f, light in luminances.items()
    ]
    write_rows(path, LuminanceLevel, rows)
    return path


def test_a_table_of_a_sweep_is_a_curve_whatever_the_order_of_its_rows(tmp_path: Path) -> None:
    path = table(tmp_path / "brightness.csv", {1.0: 200.0, 0.2: 20.0, 0.1: None, 0.6: 90.0})
    assert read_backlight_curve(path) == BacklightCurve((0.2, 0.6, 1.0), (20.0, 90.0, 200.0))


def test_where_reflected_light_is_taken_off_that_share_counts(tmp_path: Path) -> None:
    path = table(tmp_path / "brightness.csv", {0.2: 20.0, 0.6: 90.0, 1.0: 200.0}, share=True)
    assert read_backlight_curve(path).luminances == (0.1, 0.45, 1.0)


def test_a_table_of_three_columns_made_by_hand_will_do(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("factor,achieved_factor,luminance_cd_m2\n0.2,0.2,20\n0.6,0.6,90\n1,1,200\n")
    assert read_backlight_curve(path).luminances == (20.0, 90.0, 200.0)


@pytest.mark.parametrize(
    ("luminances", "says"),
    [
        (
            {0.2: 20.0, 0.6: 90.0, 0.8: 89.0, 1.0: 200.0},
            "must rise with the factor, got 90 at 0.6 and 89 at 0.8",
        ),
        ({0.2: 20.0, 0.4: 20.0, 1.0: 200.0}, "must rise with the factor"),
        ({0.2: 20.0, 0.6: 90.0, 0.9: 150.0}, "must end at factor 1, the full backlight, got 0.9"),
        ({0.5: 20.0, 1.0: 200.0}, "need at least 3 levels with a luminance each, got 2"),
        ({0.1: None, 0.2: None, 1.0: None}, "need at least 3 levels with a luminance each, got 0"),
    ],
)
def test_a_curve_that_cannot_be_inverted_is_refused_in_one_line(tmp_path, luminances, says) -> None:
    path = table(tmp_path / "brightness.csv", luminances)
    with pytest.raises(InputError, match=says) as refused:
        read_backlight_curve(path)
    assert str(refused.value).startswith(str(path))


def test_shares_that_rise_excuse_no_luminance_below_0(tmp_path: Path) -> None:
    path = table(tmp_path / "brightness.csv", {0.2: 20.0, 0.6: 90.0, 1.0: 200.0}, share=True)
    path.write_text(path.read_text().replace(",20.0,", ",-98.0,"))
    with pytest.raises(InputError, match=r"line 2: luminance_cd_m2 must be at least 0 .*, got -98"):
        read_backlight_curve(path)
    path.write_text(path.read_text().replace(",-98.0,", ",98.0,"))
    with pytest.raises(InputError, match=r"must rise with the factor, got 98 at 0.2 and 90 at 0.6"):
        read_backlight_curve(path)


def test_a_table_of_other_columns_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("factor,luminance\n1,200\n")
    with pytest.raises(InputError, match="luminance"):
        read_backlight_curve(path)
