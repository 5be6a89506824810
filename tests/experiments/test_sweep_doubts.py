"""A sweep repeats at once a reading that contradicts those before it, and none of a good display."""

import dataclasses

import pytest
from rehearsed_sweeps import DISPLAY, LUMINANCE, POWER, RIG, Faulty, lines, request

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import EVENTS
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.sweep import LuminanceSweepDesign
from evenlight.experiments.stage import PausePressed
from evenlight.experiments.sweeps import sweep_devices
from evenlight.experiments.sweeps.run_sweep import run_sweep
from evenlight.hardware.protocols import Fault, InstrumentError

MANY = LuminanceSweepDesign(factors=(0.25, 0.5, 1.0), warm_up=0.0)
N_MANY = 1 + 3 * (17 + 3) + 2 * 3
DARK = InstrumentError("meter: too dark", Fault.UNDER_RANGE, "OK13")


class Wrong(Faulty):
    """A meter whose readings are other numbers at some calls, or fail."""

    def read_luminance(self):
        reading = super().read_luminance()
        return dataclasses.replace(reading, value=self._wrong.get(self._calls, reading.value))


@pytest.fixture
def misread(monkeypatch):
    """Let the luminance meter give another number at some calls, counted from 1."""
    opened = sweep_devices.open_luminance_meter

    def make(wrong, faults=None):
        def meter(*where):
            made = Wrong(opened(*where), faults or {})
            made._wrong = wrong
            return made

        monkeypatch.setattr(sweep_devices, "open_luminance_meter", meter)

    return make


def again(folder, **how):
    return [row for row in lines(folder, **how) if row["again_of"] is not None]


def doubts(folder, **how):
    return [event for event in lines(folder, EVENTS, **how) if event["kind"] == "reading_doubted"]


def test_a_reading_unlike_those_of_its_level_is_repeated_at_once_and_both_are_kept(tmp_path, misread):
    misread({45: 0.725})  # in the third repeat
    outcome = run_sweep(request(tmp_path, design=MANY))
    assert (outcome.status, outcome.done) == (SessionStatus.COMPLETE, N_MANY)
    (second,), first = again(tmp_path), lines(tmp_path)[44]
    assert (first["luminance_cd_m2"], second["again_of"], second["index"]) == (0.725, first["index"], N_MANY)
    assert second["pixel_value"] == first["pixel_value"]
    assert second["luminance_cd_m2"] > 1
    (event,) = doubts(tmp_path)
    assert event["trial_index"] == first["index"]
    assert "0.725 cd/m^2" in event["detail"]
    assert "read again" in event["detail"]


def test_a_first_reading_that_neighbouring_levels_leave_no_room_for_is_repeated(tmp_path, misread):
    misread({12: 1500.0})  # in the first repeat, of a display of 120 cd/m^2
    run_sweep(request(tmp_path, design=MANY))
    assert [row["again_of"] for row in again(tmp_path)] == [11]
    assert "neighbouring levels leave no room" in doubts(tmp_path)[0]["detail"]


def test_too_dark_for_the_meter_where_it_was_not_before_is_repeated(tmp_path, misread):
    misread({}, {N_MANY: DARK})  # white, at the end
    run_sweep(request(tmp_path, design=MANY))
    assert [row["again_of"] for row in again(tmp_path)] == [N_MANY - 1]


def test_a_meter_that_stays_wrong_is_asked_as_often_as_the_design_says(tmp_path, misread):
    misread({45: 0.7, 46: 0.8, 47: 0.9})
    outcome = run_sweep(request(tmp_path, design=MANY))
    assert outcome.done == N_MANY
    assert [row["index"] for row in again(tmp_path)] == [N_MANY, N_MANY + 1]  # retries of the design: 2


def test_a_power_sweep_repeats_a_reading_with_a_luminance_that_cannot_be(tmp_path, misread):
    misread({8: 1.5})
    outcome = run_sweep(request(tmp_path, "power-sweep"))
    assert outcome.done == outcome.planned
    assert [row["again_of"] for row in again(tmp_path, task="power-sweep")] == [7]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_neither_noise_nor_warming_up_is_doubted(tmp_path, seed):
    # Begun cold: the panel's luminance rises by 6 % while it is read.
    run_sweep(request(tmp_path, design=MANY, seed=seed))
    run_sweep(request(tmp_path, "power-sweep", design=dataclasses.replace(POWER, warm_up=0.0), seed=seed))
    assert again(tmp_path) == again(tmp_path, task="power-sweep") == []


def test_a_sweep_with_readings_repeated_is_valid_and_resumes(tmp_path, misread, command):
    misread({45: 0.725}, {50: PausePressed()})
    assert run_sweep(request(tmp_path, design=MANY)).done == 48  # of 49 readings, one is a repeated one
    misread({})
    outcome = run_sweep(request(tmp_path, design=MANY, resume=True))
    assert (outcome.status, outcome.done) == (SessionStatus.COMPLETE, N_MANY)
    assert sorted(row["index"] for row in lines(tmp_path)) == list(range(N_MANY + 1))
    done = command("validate", tmp_path / "lab")
    assert done.code == 0, done.out + done.err


def test_what_an_instrument_cannot_have_measured_is_asked_again_and_the_sweep_goes_on(tmp_path, misread):
    strange = InstrumentError("meter: sent 1e+12 cd/m^2", Fault.IMPLAUSIBLE)
    misread({}, {9: strange, 10: strange})
    assert run_sweep(request(tmp_path)).status is SessionStatus.COMPLETE
    failed = [event["detail"] for event in lines(tmp_path, EVENTS) if event["kind"] == "reading_failed"]
    assert len(failed) == 2
    assert all("implausible: meter: sent 1e+12 cd/m^2; tried again" in detail for detail in failed)


LS100, SERIAL = (
    {"model": "Konica Minolta LS-100, as named"},
    {"model": "CRS ColorCAL II", "serial number": "7"},
)


@pytest.fixture
def plugged(monkeypatch):
    """Run a sweep with an instrument at a port, until its fifth reading or on from there."""
    opened = sweep_devices.open_luminance_meter

    def run(folder, name, said, resume=True):
        def meter(*where):
            made = Faulty(opened(*where), {} if resume else {5: PausePressed()})
            made.apparatus = lambda: said
            return made

        monkeypatch.setattr(sweep_devices, "open_luminance_meter", meter)
        rig = dataclasses.replace(RIG, luminance_meter=name)
        return run_sweep(request(folder, rig=rig, resume=resume, design=None if resume else LUMINANCE))

    return run


@pytest.mark.parametrize(
    ("driver", "said", "told"),
    [("ls100", LS100, "it tells no serial number"), ("colorcal", SERIAL, "serial number 7")],
)
def test_a_sweep_resumes_with_its_instrument_at_another_port(tmp_path, plugged, driver, said, told):
    plugged(tmp_path, f"{driver}:/dev/ttyUSB0", said, resume=False)
    outcome = plugged(tmp_path, f"{driver}:/dev/ttyUSB1", said)
    assert outcome.status is SessionStatus.COMPLETE
    (event,) = (event for event in lines(tmp_path, EVENTS) if event["kind"] == "changed")
    assert told in event["detail"]
    assert f"is at {driver}:/dev/ttyUSB1, and was at {driver}:/dev/ttyUSB0" in event["detail"]


@pytest.mark.parametrize(
    ("name", "said", "words"),
    [
        ("colorcal:/dev/ttyUSB1", {**SERIAL, "serial number": "8"}, "began with the luminance meter '7'"),
        ("colorcal:/dev/ttyUSB0", {**SERIAL, "serial number": "8"}, "is '8'"),
        ("colorcal:/dev/ttyUSB1", {"model": "CRS ColorCAL II"}, "'without serial number'"),
        ("ls100:/dev/ttyUSB0", LS100, "--rig: luminance_meter = 'ls100:/dev/ttyUSB0' is not as it was"),
        ("simulated", LS100, "--rig: luminance_meter = 'simulated' is not as it was"),
    ],
)
def test_another_instrument_is_refused_by_name_and_the_sweep_left_as_it_was(
    tmp_path, plugged, name, said, words
):
    plugged(tmp_path, "colorcal:/dev/ttyUSB0", SERIAL, resume=False)
    before = lines(tmp_path, EVENTS)
    with pytest.raises(InputError, match=words):
        plugged(tmp_path, name, said)
    assert lines(tmp_path, EVENTS) == before


def test_an_instrument_without_port_and_serial_number_is_not_taken_for_another(tmp_path, plugged):
    said = {"model": "made at home"}
    plugged(tmp_path, "exec:one", said, resume=False)
    with pytest.raises(InputError, match="nothing tells that exec:two is the same"):
        plugged(tmp_path, "exec:two", said)


def test_the_board_at_another_port_is_the_same_by_its_serial_number(tmp_path, monkeypatch):
    opened = sweep_devices.open_power_meter

    def meter(*where):
        made = opened(*where)
        made.apparatus = lambda: {"power_meter": "evenlight power board", "power_meter_serial": "A1"}
        return made

    monkeypatch.setattr(sweep_devices, "open_power_meter", meter)
    write = sweep_devices.SweepScreen.show
    count = iter(range(100))

    def paused(screen, level):
        if next(count) == 5:
            raise PausePressed
        return write(screen, level)

    monkeypatch.setattr(sweep_devices.SweepScreen, "show", paused)
    for port, resume in (("board:/dev/ttyACM0", False), ("board:/dev/ttyACM1", True)):
        rig = dataclasses.replace(RIG, power_meter=port, backlight=port, luminance_meter="none")
        outcome = run_sweep(request(tmp_path, "power-sweep", rig=rig, display=DISPLAY, resume=resume))
    assert outcome.status is SessionStatus.COMPLETE
    (event,) = (event for event in lines(tmp_path, EVENTS, "power-sweep") if event["kind"] == "changed")
    assert "is at board:/dev/ttyACM1, and was at board:/dev/ttyACM0" in event["detail"]
