"""`evenlight measure`: what the person at the bench sees, and what stays when something goes wrong."""

import re
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulators.link import EmulatedLink, FaultPlan, LinkFault
from emulators.luminance_meters import EmulatedColorCal, EmulatedLs100, EmulatedPr655
from emulators.ours import attach
from emulators.power_board import PowerBoardEmulator

from evenlight.data_schema.recordings.instrument_logs import MeterReading, PowerSample
from evenlight.data_schema.storage.tables import read_rows
from evenlight.hardware import measuring
from evenlight.hardware.drivers.serial_link import LineSettings, SerialLink
from evenlight.hardware.measure_command import driver_names
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics


@pytest.fixture(autouse=True)
def nothing_stays_open() -> Iterator[None]:
    def held() -> tuple[int, int]:
        return len(list(Path("/proc/self/fd").iterdir())), threading.active_count()

    before = held()
    yield
    end = time.monotonic() + 200
    while held() != before and time.monotonic() < end:  # a thread may be on its last way
        time.sleep(0.01)
    assert held() == before


def seen(peak: float = 200.0) -> Simulation:
    """A white panel."""
    panel = SimulatedPanel(PanelPhysics(peak_luminance=peak, warm_up_share=0.0), time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(3), time.monotonic, time.sleep)


def test_the_list_has_every_driver_and_opens_nothing(command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("something was opened")

    monkeypatch.setattr("serial.serial_for_url", refuse)
    monkeypatch.setattr(subprocess, "Popen", refuse)
    listed = command("measure", "list")
    assert listed.code == 0
    for name in driver_names():
        assert re.search(rf"^  {name} ", listed.out, re.MULTILINE)
    for title in ("Luminance meters", "Power meters", "Backlights", "Serial ports here", "Not installed"):
        assert f"{title}\n" in listed.out
    assert command("measure", "list", "--quiet").out.split() == driver_names()


def test_without_a_word_more_it_shows_its_help(command: Any) -> None:
    shown = command("measure")
    assert (shown.code, shown.err) == (0, "")
    assert "luminance" in shown.out


def test_readings_are_shown_kept_and_summed_up(command: Any, tmp_path: Path) -> None:
    """Simulated waiting takes no time: three readings that begin 10 s apart are there at once."""
    table = tmp_path / "luminance.csv"
    done = command(
        "measure", "luminance", "--rig", "simulated", "--count", 4, "--interval-s", 10, "--out", table
    )
    assert (done.code, done.err) == (0, "")
    rows = read_rows(MeterReading, table)
    assert [row.index for row in rows] == [1, 2, 3, 4]
    assert [row.begun for row in rows] == pytest.approx([0, 10, 20, 30])
    assert {row.meter for row in rows} == {"simulated"}
    values = [row.luminance for row in rows]
    assert values == pytest.approx([200.0] * 4, rel=0.05)
    *_, closing = done.out.splitlines()
    assert closing == (
        f"SIMULATED: {statistics.fmean(values):.5g} cd/m^2, 4 readings, standard deviation "
        f"{statistics.stdev(values):.3g} cd/m^2"
    )
    assert sum(f"{value:10.4g} cd/m^2" in done.out for value in set(values)) == len(set(values))
    assert command("validate", table).code == 0


def test_quiet_leaves_only_the_closing_line(command: Any) -> None:
    done = command("measure", "luminance", "--instrument", "simulated", "--count", 1, "--quiet")
    assert re.fullmatch(r"SIMULATED: [0-9.]+ cd/m\^2, 1 reading\n", done.out)
    done = command("measure", "power", "--instrument", "simulated", "--seconds", 1, "--quiet")
    assert done.out.count("\n") == 1


def test_a_driver_on_its_emulated_instrument_shows_chromaticity_too(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    attach(monkeypatch)
    done = command("measure", "luminance", "--instrument", "simulated:cs100a", "--count", 1)
    assert done.code == 0
    assert re.search(r"1 .* cd/m\^2  x 0\.\d{4}  y 0\.\d{4}  OK00", done.out)


def test_power_is_averaged_kept_and_its_samples_counted(command: Any, tmp_path: Path) -> None:
    """0.2945 + 0.001858 * 200 = 0.6661 W, of a warm white panel."""
    table = tmp_path / "simulated-power.csv"
    done = command(
        "measure", "power", "--instrument", "simulated", "--seconds", 3, "--rate-hz", 200, "--out", table
    )
    assert (done.code, done.err) == (0, "")
    rows = read_rows(PowerSample, table)
    assert len(rows) == pytest.approx(600, abs=2)
    *live, closing = done.out.splitlines()
    assert sum("mean so far" in line for line in live) >= 2
    said = re.search(r"SIMULATED: ([0-9.]+) W over", closing)
    assert said is not None
    mean = float(said[1])
    assert mean == pytest.approx(statistics.fmean(row.power for row in rows), rel=1e-3)
    assert mean == pytest.approx(0.2945 + 0.001858 * 200, rel=0.01)  # of the simulated panel, white
    assert command("validate", table).code == 0


def test_without_a_rate_a_meter_is_read_as_often_as_it_is_for(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A battery's gauge is slow."""
    attach(monkeypatch)
    ended = command("measure", "power", "--instrument", "simulated:battery", "--seconds", 3)
    assert ended.code == 0, ended.err
    assert "1 samples a second\n" in ended.out


def test_an_address_that_is_gone_is_told_what_takes_its_place(command: Any) -> None:
    ended = command("measure", "power", "--instrument", "rapl:psys")
    assert ended.code == 2
    assert "no power meter 'rapl' any more" in ended.err
    assert "battery:" in ended.err


def test_samples_that_are_lost_or_come_twice_are_told(command: Any, tmp_path: Path) -> None:
    physics = PowerMeterPhysics(lost_share=0.1, duplicated_share=0.05)
    table = tmp_path / "power.csv"
    with EmulatedLink(PowerBoardEmulator(seen(), physics), pseudo_terminal=True) as link:
        done = command(
            "measure", "power", "--instrument", f"board:{link.url}", "--seconds", 1, "--rate-hz", 200,
            "--out", table,
        )  # fmt: skip
    assert (done.code, done.err) == (0, "")
    numbers = [row.sequence for row in read_rows(PowerSample, table)]
    lost = numbers[-1] + 1 - len(set(numbers))  # a board counts from 0
    twice = len(numbers) - len(set(numbers))
    assert lost > 5
    assert twice > 1
    assert re.search(rf"; {lost} lost \([0-9.]+%\), {twice} came twice$", done.out.strip())
    assert "SIMULATED" not in done.out.splitlines()[-1]  # it was named as a real one


def refused(outcome: Any, code: int, *says: str) -> None:
    assert outcome.code == code, outcome.err
    assert outcome.err.count("\n") == 1
    assert outcome.err.startswith("evenlight: ")
    for words in says:
        assert words in outcome.err


def test_an_instrument_that_is_not_there_is_one_line_and_what_to_do(command: Any) -> None:
    for kind, name in [("luminance", "ls100:/dev/no_such_port"), ("power", "board:/dev/no_such_port")]:
        done = command("measure", kind, "--instrument", name)
        refused(done, 1, "/dev/no_such_port", "`evenlight measure list` shows the ports there are")


def test_a_port_that_another_program_holds_is_one_line_and_what_to_do(command: Any) -> None:
    with (
        EmulatedLink(EmulatedPr655(seen()), pseudo_terminal=True) as link,
        SerialLink(link.url, LineSettings(), "another program"),
    ):
        done = command("measure", "luminance", "--instrument", f"pr655:{link.url}")
    refused(done, 1, link.url, "in use by another program; end that first")


def test_another_instrument_at_the_port_is_one_line_that_says_so(command: Any) -> None:
    with EmulatedLink(EmulatedPr655(seen()), pseudo_terminal=True) as link:
        done = command("measure", "luminance", "--instrument", f"pr670:{link.url}")
    refused(done, 1, "PR-670", "PR-655")


def test_a_panel_too_bright_for_the_meter_is_an_error_in_its_own_words(command: Any) -> None:
    with EmulatedLink(EmulatedLs100(seen(peak=9e5))) as link:
        done = command("measure", "luminance", "--instrument", f"ls100:{link.url}")
    refused(done, 1, "LS-100", "ER10")
    assert done.out.count("cd/m^2") == 0


def test_what_was_read_before_the_cable_was_pulled_is_kept(command: Any, tmp_path: Path) -> None:
    """The driver's own exchanges at the beginning are replies, too: some of eight readings come through."""
    table = tmp_path / "luminance.csv"
    with EmulatedLink(EmulatedLs100(seen()), FaultPlan(LinkFault.DISCONNECT, first=6)) as link:
        name = f"ls100:{link.url}"
        done = command("measure", "luminance", "--instrument", name, "--count", 8, "--out", table)
    refused(done, 1, "LS-100")
    rows = read_rows(MeterReading, table)
    assert 1 <= len(rows) < 8
    assert rows[0].meter == name
    assert rows[0].utc.startswith("20")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("luminance",), "name an instrument with --instrument, as `evenlight measure list` has them"),
        (
            ("luminance", "--rig", "desk"),
            "the rig 'desk' names no luminance meter: set `luminance_meter` in it",
        ),
        (("power", "--rig", "desk"), "the rig 'desk' names no power meter"),
        (("luminance", "--rig", "dsk"), "no such rig; did you mean 'desk'"),
        (
            ("luminance", "--instrument", "ls10:COM3"),
            "no luminance meter 'ls10'; did you mean 'ls1",
        ),
        (("luminance", "--instrument", "ls100"), "where is it? Give ls100:ADDRESS"),
        (
            ("luminance", "--instrument", "simulated:ls100"),
            "brings no emulated instrument; `simulated` needs no",
        ),
        (("luminance", "--instrument", "simulated:ls10"), "no emulated luminance meter 'ls10'"),
        (("power", "--instrument", "ls100:COM3"), "no power meter 'ls100'"),
        (("power", "--instrument", "simulated", "--seconds", "0.01"), "an average needs at least 2 samples"),
        (("power", "--instrument", "simulated", "--rate-hz", "0"), "an average needs at least 2 samples"),
        (("power", "--instrument", "simulated", "--out", "power.csv"), "says so: simulated-power.csv"),
        (("luminance", "--instrument", "csv:readings.csv"), "`evenlight run luminance-sweep` imports it"),
        (
            ("zero", "--instrument", "ls100:COM3"),
            "ls100:COM3: has no zero that is set by command; these have: colorcal, board",
        ),
        (("zero", "--instrument", "bord:COM3"), "no luminance or power meter 'bord'; did you mean 'board'"),
        (("zero", "--instrument", "board"), "where is it? Give board:ADDRESS"),
        (("luminance", "--instrument", "simulated", "--out", "l.txt"), "give a file that ends in .csv"),
        (("luminance", "--instrument", "simulated", "--count", "0"), "Invalid value for '--count'"),
        (("luminance", "--instrument", "simulated", "--out", "nowhere/l.csv"), "there is no folder nowhere"),
    ],
)
def test_bad_input_is_one_line(
    command: Any, words: tuple[str, ...], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    refused(command("measure", *words), 2, says)
    assert list(tmp_path.iterdir()) == []


def test_what_a_meter_shows_can_be_typed_in(
    command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    typed = iter(["100 cd/m2", "a lot", "102"])
    monkeypatch.setattr("builtins.input", lambda question: next(typed))
    table = tmp_path / "luminance.csv"
    done = command("measure", "luminance", "--instrument", "manual", "--count", 2, "--out", table)
    assert [row.luminance for row in read_rows(MeterReading, table)] == [100.0, 102.0]
    # The mean of 100 and 102, and the root of (1 + 1) / (2 - 1).
    assert done.out.splitlines()[-1] == "101 cd/m^2, 2 readings, standard deviation 1.41 cd/m^2"


@pytest.mark.parametrize(
    ("driver", "words"), [("colorcal", "cover the sensor"), ("board", "unplug the panel")]
)
def test_a_zero_is_set_after_the_person_has_pressed_enter(
    command: Any, monkeypatch: pytest.MonkeyPatch, driver: str, words: str
) -> None:
    """The simulated instruments look at a panel that is off."""
    attach(monkeypatch)
    asked: list[str] = []

    def enter(question: str) -> str:
        asked.append(question)
        return ""

    monkeypatch.setattr("builtins.input", enter)
    done = command("measure", "zero", "--instrument", f"simulated:{driver}", "--quiet")
    assert (done.code, done.err) == (0, "")
    assert done.out == f"SIMULATED: zero set{'; it was 0 mA' if driver == 'board' else ''}\n"
    (question,) = asked
    assert words in question
    assert question.endswith("then press Enter: ")
    assert command("measure", "zero", "--instrument", f"simulated:{driver}", "--yes", "--quiet").code == 0
    assert len(asked) == 1


def test_a_zero_is_not_set_before_anybody_has_pressed_enter(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(error: type[BaseException]) -> Callable[[str], str]:
        def ask(question: str) -> str:
            raise error

        return ask

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("it was opened")

    monkeypatch.setattr("serial.serial_for_url", refuse)
    words = ("measure", "zero", "--instrument", "colorcal:/dev/ttyACM0")
    monkeypatch.setattr("builtins.input", gone(EOFError))
    refused(command(*words), 2, "no one has pressed Enter; where all is ready, give --yes")
    monkeypatch.setattr("builtins.input", gone(KeyboardInterrupt))
    refused(command(*words), 130, "interrupted")


def test_a_zero_is_refused_in_the_light_and_with_a_panel_that_takes_current(command: Any) -> None:
    with EmulatedLink(EmulatedColorCal(seen()), pseudo_terminal=True) as link:
        done = command("measure", "zero", "--instrument", f"colorcal:{link.url}", "--yes")
    refused(done, 1, "ColorCAL", "cover the sensor")
    with EmulatedLink(PowerBoardEmulator(seen()), pseudo_terminal=True) as link:
        done = command("measure", "zero", "--instrument", f"board:{link.url}", "--yes")
    refused(done, 1, "unplug the panel before zeroing")


def test_measured_data_are_never_overwritten(command: Any, tmp_path: Path) -> None:
    table = tmp_path / "luminance.csv"
    table.write_text("of yesterday\n")
    done = command("measure", "luminance", "--instrument", "simulated", "--out", table)
    refused(done, 2, "is there already, and measured data are never overwritten")
    assert table.read_text() == "of yesterday\n"


def test_an_interruption_closes_the_port_and_keeps_what_was_read(
    command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Ctrl-C while the third reading is waited for; what is left open, every test here looks for."""

    def interrupted(readings: list[int]) -> Callable[[float], None]:
        def wait(seconds: float) -> None:
            readings.append(1)
            if len(readings) == 2:
                raise KeyboardInterrupt

        return wait

    table, bench_for = tmp_path / "luminance.csv", measuring.bench_for
    attach(monkeypatch)
    wait = interrupted([])
    monkeypatch.setattr(
        measuring,
        "bench_for",
        lambda name: measuring.Bench(time.monotonic, wait, bench_for(name).simulation, timed=True),
    )
    done = command("measure", "luminance", "--instrument", "simulated:ls100", "--count", 5, "--out", table)
    refused(done, 130, "interrupted")
    assert len(read_rows(MeterReading, table)) == 2


def test_a_process_that_is_interrupted_has_its_samples_on_the_disk(tmp_path: Path) -> None:
    table = tmp_path / "power.csv"
    words = ["measure", "power", "--seconds", "60", "--out", str(table), "--instrument"]
    with (
        EmulatedLink(PowerBoardEmulator(seen()), pseudo_terminal=True) as link,
        subprocess.Popen(
            [sys.executable, "-c", "from evenlight.command import main; main()", *words, f"board:{link.url}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        ) as process,
    ):
        end = time.monotonic() + 200
        while not (table.exists() and table.read_text().count("\n") > 10):
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=200)
    assert process.returncode == 130
    assert err == f"evenlight: interrupted; what was read until then is in {table}\n"
    assert len(read_rows(PowerSample, table)) > 10
