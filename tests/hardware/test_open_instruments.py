"""The rig opens what it names: a board once for two devices, a curve beside its file, nothing by guess."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emulators.link import EmulatedLink
from emulators.ours import attach
from emulators.power_board import PowerBoardEmulator

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.sweep_fit import LuminanceLevel
from evenlight.data_schema.storage.tables import write_rows
from evenlight.hardware.backlight_curve import LinearizedBacklight
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.rig import (
    backlights_smallest_factor,
    open_backlight,
    open_luminance_meter,
    open_power_meter,
    open_swept_backlight,
)
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

RIG = """
name = "lab"
display = "varjo-xr3"
viewing_distance_m = 0.6
refresh_rate_hz = 120.0
backlight = "simulated"
backlight_curve = "sweep/brightness.csv"
"""


def seen(exponent: float = 1.0) -> Simulation:
    """A warm white panel in real time."""
    physics = PanelPhysics(warm_up_share=0.0, backlight_exponent=exponent)
    panel = SimulatedPanel(physics, time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(3), time.monotonic, time.sleep)


def with_backlight(name: str) -> Rig:
    return replace(load_rig("simulated")[0], backlight=name)


def works_alike(simulation: Simulation, board: str) -> None:
    """The meter of a board sees what its backlight does, in whatever order they are opened and closed."""
    rig = with_backlight(board)
    backlight = open_backlight(rig, time.monotonic, simulation)
    assert backlight is not None
    meter = open_power_meter(board, time.monotonic, simulation)
    meter.start(200.0)
    achieved = backlight.set_factor(0.25)  # while samples are streamed
    time.sleep(0.3)
    samples = [*meter.samples(), *meter.stop()]
    # 0.2945 + 0.001858 * 200 * b, as the panel's physics has it
    assert np.mean([one.power for one in samples[-10:]]) == pytest.approx(
        0.2945 + 0.3716 * achieved, rel=0.02
    )
    backlight.close()
    assert meter.start(100.0) > 0  # its link is still there
    meter.stop()
    meter.close()


def test_a_board_that_is_meter_and_backlight_is_opened_once() -> None:
    simulation = seen()
    with EmulatedLink(PowerBoardEmulator(simulation), pseudo_terminal=True) as link:
        for _ in range(2):  # and can be opened again when both are closed
            works_alike(simulation, f"board:{link.url}")


def test_an_emulated_board_is_shared_by_what_looks_at_the_same_panel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    attach(monkeypatch)
    simulation = seen()
    for _ in range(2):
        works_alike(simulation, "simulated:board")


def test_boards_on_two_panels_are_two_boards(monkeypatch: pytest.MonkeyPatch) -> None:
    attach(monkeypatch)
    one, other = seen(), seen()
    with open_power_meter("simulated:board", time.monotonic, one) as meter:
        backlight = open_backlight(with_backlight("simulated:board"), time.monotonic, other)
        assert backlight is not None
        with backlight:
            backlight.set_factor(0.2)
            meter.start(100.0)
            time.sleep(0.2)
            assert [*meter.samples(), *meter.stop()][-1].power == pytest.approx(0.6661, rel=0.02)


def test_a_simulated_backlight_dims_the_panel_that_it_is_given() -> None:
    simulation = seen()
    backlight = open_backlight(with_backlight("simulated"), time.monotonic, simulation)
    assert backlight is not None
    with backlight:
        achieved = backlight.set_factor(0.3)
        assert simulation.panel.luminance(time.monotonic() + 1) == pytest.approx(200 * achieved)


def lab(folder: Path) -> Path:
    """A rig whose backlight makes the square of its factor, with the table of the sweep that measured it."""
    (folder / "sweep").mkdir()
    rows = [LuminanceLevel(k / 10, k / 10, 200 * (k / 10) ** 2) for k in range(1, 11)]
    write_rows(folder / "sweep" / "brightness.csv", LuminanceLevel, rows)
    path = folder / "lab.rig.toml"
    path.write_text(RIG)
    return path


def test_with_its_curve_a_backlight_is_set_by_luminance_and_a_sweep_sees_it_without(tmp_path: Path) -> None:
    rig, _ = load_rig(str(lab(tmp_path)))
    simulation = seen(exponent=2.0)
    backlight = open_backlight(rig, time.monotonic, simulation)
    assert isinstance(backlight, LinearizedBacklight)
    with backlight:
        achieved = backlight.set_factor(0.25)
        assert achieved == pytest.approx(0.25, abs=1e-3)
        assert simulation.panel.luminance(time.monotonic() + 1) == pytest.approx(200 * achieved, rel=1e-3)
    assert backlights_smallest_factor(rig) == pytest.approx(0.01)
    swept = open_swept_backlight(rig, time.monotonic, simulation)
    assert swept is not None
    with swept:
        swept.set_factor(0.5)
        assert simulation.panel.luminance(time.monotonic() + 1) == pytest.approx(200 * 0.25, rel=2e-3)


def test_a_curve_is_sought_beside_the_rigs_file_wherever_that_is_read_from(tmp_path, monkeypatch) -> None:
    path = lab(tmp_path)
    monkeypatch.chdir(tmp_path.parent)
    rig, _ = load_rig(f"{tmp_path.name}/{path.name}")
    assert rig.backlight_curve == f"{tmp_path.name}/sweep/brightness.csv"
    backlight = open_backlight(rig, time.monotonic)
    assert backlight is not None
    backlight.close()
    (tmp_path / "sweep" / "brightness.csv").unlink()
    with pytest.raises(InputError, match=r"sweep/brightness\.csv: no such file"):
        open_backlight(rig, time.monotonic)


def test_a_bad_curve_leaves_no_backlight_open(tmp_path: Path) -> None:
    rig, _ = load_rig(str(lab(tmp_path)))
    (tmp_path / "sweep" / "brightness.csv").write_text("factor,achieved_factor,luminance_cd_m2\n1,1,200\n")
    with pytest.raises(InputError, match="need at least 3 levels"):
        open_backlight(rig, time.monotonic)


def test_a_table_in_place_of_a_meter_is_imported_and_not_opened() -> None:
    with pytest.raises(InputError, match=r"csv:l\.csv: is a table .* luminance-sweep` imports it"):
        open_luminance_meter("csv:l.csv", time.monotonic)


def test_none_is_no_instrument() -> None:
    with pytest.raises(InputError, match="there is no luminance meter 'none'"):
        open_luminance_meter("none", time.monotonic)


@pytest.mark.slow
def test_a_port_that_holds_no_board_is_closed_again() -> None:
    class Mute:
        def receive(self, data: bytes) -> bytes:
            return b""

        def stream(self) -> bytes:
            return b""

    with EmulatedLink(Mute(), pseudo_terminal=True) as link:
        with pytest.raises(InstrumentError) as failed:
            open_power_meter(f"board:{link.url}", time.monotonic)
        assert failed.value.fault is Fault.NO_REPLY
        SerialLink(link.url, LineSettings(), "somebody else").close()  # who finds the port free
