"""Backlights: steps, limits and lag; the file of Linux is set, read and left as it was found."""

import math
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.errors import InputError
from evenlight.hardware.drivers.sysfs_backlight import SysfsBacklight
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.panel import SimulatedBacklight


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    """A panel of 255 steps, as Linux shows it, at step 180."""
    folder = tmp_path / "intel_backlight"
    folder.mkdir()
    for name, step in (("max_brightness", 255), ("brightness", 180), ("actual_brightness", 180)):
        (folder / name).write_text(f"{step}\n")
    return folder


def test_the_nearest_step_is_set_and_told(panel: Path) -> None:
    with SysfsBacklight("intel_backlight", panel.parent) as backlight:
        assert backlight.set_factor(0.5) == 128 / 255  # 127.5 goes to the even step
        assert (panel / "brightness").read_text() == "128\n"
        assert backlight.set_factor(1 / 255) == backlight.smallest_factor() == backlight.step() == 1 / 255


def test_what_was_asked_for_is_read_and_not_what_the_driver_makes_of_it(panel: Path) -> None:
    """As amdgpu has it: 16 bits, from a curve, and 0 while the screen is blank."""
    with SysfsBacklight("intel_backlight", panel.parent) as backlight:
        for made in (34481, 127, 0):
            (panel / "actual_brightness").write_text(f"{made}\n")
            backlight.set_factor(0.5)
            assert backlight.read_factor() == 128 / 255


def test_whoever_looks_while_a_step_is_written_finds_a_whole_one(panel: Path, monkeypatch) -> None:
    """So a step is there, whoever is killed meanwhile: from 180 to 9, of fewer digits."""
    found = []

    def looking(call: Callable[..., int]) -> Callable[..., int]:
        def look(*given: object) -> int:
            found.append(backlight.read_factor() * 255)
            done = call(*given)
            found.append(backlight.read_factor() * 255)
            return done

        return look

    with SysfsBacklight("intel_backlight", panel.parent) as backlight, monkeypatch.context() as patched:
        for name in ("open", "write", "ftruncate"):
            patched.setattr(os, name, looking(getattr(os, name)))
        backlight.set_factor(9 / 255)
    assert found == pytest.approx([180, 180, 180, 9, 9, 9])


def test_the_panel_is_left_as_it_was_found_even_after_an_error(panel: Path) -> None:
    backlight = SysfsBacklight("intel_backlight", panel.parent)
    backlight.set_factor(0.2)
    with pytest.raises(InstrumentError), backlight:
        backlight.set_factor(1.2)
    assert (panel / "brightness").read_text() == "180\n"


def test_a_backlight_that_is_not_there_is_refused_with_those_that_are(panel: Path) -> None:
    with pytest.raises(
        InstrumentError, match="acpi_video0: no such backlight; there is intel_backlight on this"
    ):
        SysfsBacklight("acpi_video0", panel.parent)
    with pytest.raises(InstrumentError, match="there is none on this computer"):
        SysfsBacklight("acpi_video0", panel.parent / "nowhere")


def test_one_that_may_not_be_written_names_the_udev_rule(panel: Path, monkeypatch) -> None:
    opened = os.open

    def refuse(path: Path, flags: int) -> int:
        if flags & os.O_WRONLY:
            raise PermissionError(13, "Permission denied")
        return opened(path, flags)

    monkeypatch.setattr(os, "open", refuse)  # chmod would not stop root
    with pytest.raises(
        InstrumentError, match=r'brightness: may not be written.*SUBSYSTEM=="backlight"'
    ) as refused:
        SysfsBacklight("intel_backlight", panel.parent)
    assert "\n" not in str(refused.value)


def test_steps_that_are_not_linear_in_light_are_no_factors(panel: Path) -> None:
    (panel / "scale").write_text("non-linear\n")
    with pytest.raises(InputError, match="not linear in light"):
        SysfsBacklight("intel_backlight", panel.parent)
    SysfsBacklight("intel_backlight", panel.parent, curve_known=True).close()
    (panel / "scale").write_text("linear\n")
    SysfsBacklight("intel_backlight", panel.parent).close()


def test_a_panel_that_fails_meanwhile_is_an_instrument_error(panel: Path) -> None:
    backlight = SysfsBacklight("intel_backlight", panel.parent)
    (panel / "brightness").write_text("broken")
    with pytest.raises(InstrumentError, match="expected a whole number") as failed:
        backlight.read_factor()
    assert failed.value.fault is Fault.GARBLED
    (panel / "brightness").unlink()
    with pytest.raises(
        InstrumentError, match="cannot be set to 51: it is gone; was the panel unplug"
    ) as failed:
        backlight.set_factor(0.2)
    assert (failed.value.fault, failed.value.code) == (Fault.DISCONNECTED, "ENOENT")
    with pytest.raises(InstrumentError, match="cannot be read: it is gone") as failed:
        backlight.read_factor()
    assert failed.value.fault is Fault.DISCONNECTED


@pytest.mark.parametrize(("number", "words"), [(5, "cannot be set to 51 "), (13, "may not be written")])
def test_a_panel_that_refuses_meanwhile_is_an_instrument_error(
    panel: Path, monkeypatch, number: int, words: str
) -> None:
    backlight = SysfsBacklight("intel_backlight", panel.parent)

    def refuse(path: Path, flags: int) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InstrumentError, match=words):
        backlight.set_factor(0.2)


@pytest.mark.parametrize("highest", ["0", "-5"])
def test_a_panel_without_steps_is_no_backlight(panel: Path, highest: str) -> None:
    (panel / "max_brightness").write_text(f"{highest}\n")
    with pytest.raises(InstrumentError, match="intel_backlight: says that its brightness has no steps"):
        SysfsBacklight("intel_backlight", panel.parent)


def test_a_panel_that_is_gone_before_it_is_opened_is_an_instrument_error(panel: Path) -> None:
    (panel / "brightness").unlink()
    with pytest.raises(InstrumentError, match="brightness: cannot be read: it is gone"):
        SysfsBacklight("intel_backlight", panel.parent)


def test_a_setting_that_the_driver_does_not_take_fails_loudly(panel: Path, monkeypatch) -> None:
    """The kernel of some panels keeps them above a lowest step."""
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, data: write(file, b"40\n" if int(data) < 40 else data))
    with (
        SysfsBacklight("intel_backlight", panel.parent) as backlight,
        pytest.raises(InstrumentError, match="was set to step 26, and took 40"),
    ):
        backlight.set_factor(0.1)


def test_a_closed_backlight_is_set_no_more(panel: Path) -> None:
    for backlight in (SysfsBacklight("intel_backlight", panel.parent), SimulatedBacklight(lambda: 0.0)):
        backlight.close()
        backlight.close()
        with pytest.raises(InstrumentError, match="is closed"):
            backlight.set_factor(0.5)
    assert (panel / "brightness").read_text() == "180\n"


@pytest.mark.parametrize("factor", [0.0, -0.5, 1.01, float("nan"), 0.0001])
def test_a_factor_that_the_device_has_not_is_refused_and_not_clipped(panel: Path, factor: float) -> None:
    simulated = SimulatedBacklight(lambda: 0.0, steps=100)
    for backlight in (SysfsBacklight("intel_backlight", panel.parent), simulated):
        with pytest.raises(InstrumentError, match="has factors from"):
            backlight.set_factor(factor)


@given(st.floats(0.01, 1.0), st.floats(0.0, 0.1))
def test_the_simulated_backlight_follows_with_a_first_order_lag(factor: float, delay: float) -> None:
    """From 1 to b: b + (1 - b) exp(-t / tau), by hand."""
    time = [0.0]
    backlight = SimulatedBacklight(lambda: time[0], steps=100, time_constant=0.02)
    achieved = backlight.set_factor(factor)
    assert achieved == pytest.approx(factor, abs=0.5 / 100 + 1e-12)
    time[0] = delay
    assert backlight.read_factor() == pytest.approx(achieved + (1 - achieved) * math.exp(-delay / 0.02))


def test_a_change_on_the_way_sets_out_from_where_the_light_is() -> None:
    time = [0.0]
    backlight = SimulatedBacklight(lambda: time[0], steps=1000, time_constant=0.02)
    backlight.set_factor(0.5)
    time[0] = 0.02
    before = backlight.read_factor()
    backlight.set_factor(0.9)
    assert backlight.read_factor() == before
