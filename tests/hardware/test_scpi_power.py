"""SCPI instruments: what they are asked, their overloads and errors, and answers that take their time."""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from emulators.link import EmulatedLink
from emulators.power_meters import SCPI_QUESTIONS, ScpiEmulator
from scripted_instrument import ScriptedInstrument

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.scpi_power import ScpiPowerMeter, VisaPowerMeter, number_in
from evenlight.hardware.power_average import average_power
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics

FULL = 0.2945 + 0.001858 * 200  # [W]
TIMEOUT = 30.0  # [s] where nothing is to be waited for
PATIENT = 60.0  # [s] where nothing is to be waited for


@pytest.fixture
def simulation() -> Simulation:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(), clock.now)
    return Simulation(panel, np.random.default_rng(2), clock.now, clock.wait)


@pytest.fixture
def emulator(simulation) -> ScpiEmulator:
    return ScpiEmulator(simulation)


@pytest.fixture
def meter(emulator, simulation) -> Iterator[ScpiPowerMeter]:
    with EmulatedLink(emulator) as link, ScpiPowerMeter(link.url, simulation.clock, TIMEOUT) as opened:
        yield opened


def averaged(meter: ScpiPowerMeter, simulation: Simulation) -> float:
    return average_power(meter, 0.5, 100.0, simulation.clock, simulation.wait).power


@pytest.mark.slow
@pytest.mark.parametrize(
    ("known", "options", "asked"),
    [
        (SCPI_QUESTIONS, "", "MEAS:POW?"),
        (("MEAS:VOLT?", "MEAS:CURR?"), "", "MEAS:VOLT? and MEAS:CURR?"),
        (("MEAS:CURR?",), "?voltage=5.0", "MEAS:CURR? times 5 V"),
        (SCPI_QUESTIONS, "?measure=power", "MEAS:POW?"),
        (SCPI_QUESTIONS, "?measure=current&voltage=5", "MEAS:CURR? times 5 V"),
    ],
)
def test_it_is_asked_for_what_it_measures(simulation, known, options, asked) -> None:
    with (
        EmulatedLink(ScpiEmulator(simulation, known=known)) as link,
        ScpiPowerMeter(link.url + options, simulation.clock, TIMEOUT) as meter,
    ):
        assert meter.apparatus()["power_meter_asked"] == asked
        # 50 samples of 2 mW noise: 0.28 mW for their mean, five times that is allowed
        assert averaged(meter, simulation) == pytest.approx(FULL, abs=0.0014)


@pytest.mark.slow
def test_an_instrument_that_measures_no_power_is_refused(simulation) -> None:
    with (
        EmulatedLink(ScpiEmulator(simulation, known=("MEAS:VOLT?",))) as link,
        pytest.raises(
            InstrumentError, match=r"does not measure power, nor voltage and current; name another"
        ) as told,
    ):
        ScpiPowerMeter(link.url, simulation.clock, TIMEOUT)
    assert told.value.fault is Fault.WRONG_INSTRUMENT


def test_an_overload_is_an_error_and_no_power(simulation) -> None:
    with (
        EmulatedLink(ScpiEmulator(simulation, PowerMeterPhysics(highest_power=0.5))) as link,
        ScpiPowerMeter(link.url, simulation.clock, TIMEOUT) as meter,
    ):
        with pytest.raises(InstrumentError, match=r"overload \(9.9E37\): the panel takes more") as told:
            averaged(meter, simulation)
        assert told.value.fault is Fault.OVER_RANGE
        simulation.panel.set_backlight(0.25)  # 0.387 W
        simulation.wait(1.0)
        assert averaged(meter, simulation) == pytest.approx(0.2945 + 0.3716 / 4, abs=0.0014)


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ("9.9E37", Fault.OVER_RANGE),
        ("-9.9e+37", Fault.OVER_RANGE),
        ("+9.90000000E+37", Fault.OVER_RANGE),
        ("9.91E37", Fault.REFUSED),
        ("nan", Fault.GARBLED),
        ("1e999", Fault.GARBLED),
        ("", Fault.GARBLED),
        ("INF", Fault.OVER_RANGE),
        ("0.672V", Fault.GARBLED),
        ("0.672M", Fault.GARBLED),
        ("0.6720.672", Fault.GARBLED),
        ("1_000", Fault.GARBLED),
        ("1.2,3.4", Fault.GARBLED),
    ],
)
def test_what_is_no_measurement_is_an_error(answer, fault) -> None:
    with pytest.raises(InstrumentError) as told:
        number_in(answer, "W", "the meter")
    assert told.value.fault is fault


def test_the_instruments_own_error_is_told_in_its_words(meter, emulator, simulation) -> None:
    meter.start(100.0)
    emulator.errors.append('-222,"Data out of range; current limit"')
    with pytest.raises(InstrumentError, match='had the error -222,"Data out of range; current') as told:
        meter.stop()
    assert (told.value.fault, told.value.code) == (Fault.REFUSED, "-222")
    assert averaged(meter, simulation) > 0  # it is cleared with the telling


def test_a_current_that_flows_backwards_is_no_power() -> None:
    clock = WaitingClock()
    panel = SimulatedPanel(PanelPhysics(base_power=-0.5, power_per_luminance=0.0), clock.now)
    simulation = Simulation(panel, np.random.default_rng(2), clock.now, clock.wait)
    with (
        EmulatedLink(ScpiEmulator(simulation)) as link,
        ScpiPowerMeter(link.url, clock.now, TIMEOUT) as meter,
        pytest.raises(InstrumentError, match="flows backwards; swap the leads"),
    ):
        meter.start(10.0)


class Slow:
    """A multimeter that takes 60 ms for an answer, as most of them do; or as long as a test holds it back."""

    def __init__(self, emulator: ScpiEmulator) -> None:
        self._emulator, self._answers = emulator, list[tuple[float, bytes]]()
        self.held_back = False

    def receive(self, data: bytes) -> bytes:
        if answer := self._emulator.receive(data):
            self._answers.append((time.monotonic() + 0.06, answer))
        return b""

    def stream(self) -> bytes:
        if self._answers and time.monotonic() >= self._answers[0][0] and not self.held_back:
            return self._answers.pop(0)[1]
        return b""

    def is_asked(self) -> bool:
        """Whether an answer is on its way."""
        return bool(self._answers)


def awaited(happened: Callable[[], object]) -> Iterator[None]:
    """Go round until something has happened: a hang ends it, a busy machine does not."""
    end = time.monotonic() + PATIENT
    while not happened():
        assert time.monotonic() < end
        yield
        time.sleep(0.002)


@pytest.mark.slow
def test_nobody_waits_for_a_slow_answer() -> None:
    panel = SimulatedPanel(PanelPhysics(), time.monotonic)
    simulation = Simulation(panel, np.random.default_rng(2), time.monotonic, time.sleep)
    slow, samples = Slow(ScpiEmulator(simulation)), list[PowerSample]()
    with EmulatedLink(slow) as link, ScpiPowerMeter(link.url, timeout=PATIENT) as meter:
        begun = time.monotonic()
        rate = meter.start(100.0)
        assert 1 / (time.monotonic() - begun) < rate < 1 / 0.06  # what it keeps up with
        for _ in range(4):
            slow.held_back = True  # whoever waited for the answer would wait for ever
            for _ in awaited(slow.is_asked):
                assert meter.samples() == []
            assert meter.samples() == []
            slow.held_back = False
            came: list[PowerSample] = []
            for _ in awaited(came.__len__):
                came += meter.samples()
            samples += came
        samples += meter.stop()
    times = [sample.device_time for sample in samples]
    assert times == sorted(times)
    for before, sample in itertools.pairwise(samples):  # the middle of question and answer
        took = 2 * (sample.received - sample.device_time)
        assert 0.06 <= took <= sample.received - before.received


NAME = b"RIGOL TECHNOLOGIES,DP832,DP8A1234,00.01.16"
NO_ERROR = b'0,"No error"'


def followed(question: bytes, answer: bytes) -> list[tuple[bytes, bytes]]:
    """A question, and that for the name after it."""
    return [(question + b"\n", answer + b"\r\n"), (b"*IDN?\n", NAME + b"\r\n")]


DIALOGUE = [
    *[(b"*IDN?\n", NAME + b"\r\n")] * 2,
    *followed(b"MEAS:POW?", b"0.671"),
    (b"*CLS\n", b""),
    *followed(b"SYST:ERR?", NO_ERROR),
    *(followed(b"MEAS:POW?", b"0.672") * 4),  # the form of its numbers
    *followed(b"MEAS:POW?", b"0.673"),  # how long it takes
    *followed(b"MEAS:POW?", b"0.500"),
    *followed(b"SYST:ERR?", NO_ERROR),
]


def test_the_dialogue_is_the_one_that_is_written_down() -> None:
    script = ScriptedInstrument(DIALOGUE)
    with EmulatedLink(script) as link:
        with ScpiPowerMeter(link.url, lambda: 3.0, TIMEOUT) as meter:
            assert meter.apparatus()["power_meter"] == NAME.decode()
            meter.start(10.0)
            samples = [*meter.samples(), *meter.stop()]
        script.finish()
    assert [sample.power for sample in samples] == [0.5]
    assert meter.apparatus()["power_meter_asked"] == "MEAS:POW?"


@pytest.mark.parametrize(
    "address",
    [
        "",
        "?voltage=5",
        *(
            f"host:5025?{said}"
            for said in (
                "volts=5",
                "voltage=-5",
                "channel=0",
                "channel=1.5",
                "channel=two",
                "measure=current",  # of an unknown voltage
                "measure=voltage",
                "measure=voltage&voltage=5",
                "measure=power&voltage=5",
            )
        ),
    ],
)
def test_an_address_that_says_nothing_of_use_is_refused(address) -> None:
    with pytest.raises(InputError, match="scpi:"):
        ScpiPowerMeter(address)


class Instrument:
    """One that answers some questions, and is silent to all others, as of its maker."""

    def __init__(self, **answers: str) -> None:
        self._came, self._selected, self.answers = b"", "1", answers

    def receive(self, data: bytes) -> bytes:
        *lines, self._came = (self._came + data).split(b"\n")
        answers = (self._answer(line.decode().upper()) for line in lines)
        return b"".join(f"{answer}\n".encode() for answer in answers if answer)

    def stream(self) -> bytes:
        return b""

    def _answer(self, line: str) -> str:
        if line.startswith("INST:NSEL ") and "INST:NSEL 2" in self.answers:
            self._selected = line[-1]
        there = {"*IDN?": "MAKER,MODEL,1,1", "INST:NSEL?": self._selected, **self.answers}
        return there.get(f"{line} of {self._selected}", there.get(line, ""))


# The load is on the second of two outputs.
SUPPLIES = {
    "keysight": ({"MEAS:POW?": "0.000012", "MEAS:POW? (@2)": "1.250000"}, "MEAS:POW? (@2)"),
    "rigol": ({"MEAS:POW?": "0.000", "MEAS:POW? CH2": "1.250"}, "MEAS:POW? CH2"),
    "siglent": (
        {"MEAS:VOLT?": "5.00", "MEAS:CURR?": "0.00", "MEAS:VOLT? CH2": "5.00", "MEAS:CURR? CH2": "0.25"},
        "MEAS:VOLT? CH2 and MEAS:CURR? CH2",
    ),
    "rohde": (
        {"INST:NSEL 2": "", "MEAS:POW? of 1": "0.000", "MEAS:POW? of 2": "1.250"},
        "INST:NSEL 2;MEAS:POW?",
    ),
    # which goes by what is selected, whatever a question says
    "careless": (
        {"INST:NSEL 2": ""}
        | {f"MEAS:POW?{which} of 1": "0.000" for which in ("", " (@2)", " CH2", " (@99)", " CH99")}
        | {f"MEAS:POW?{which} of 2": "1.250" for which in ("", " (@2)", " CH2", " (@99)", " CH99")},
        "INST:NSEL 2;MEAS:POW?",
    ),
}


@pytest.fixture
def probed_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evenlight.hardware.drivers.scpi_power.PROBE", 0.3)


@pytest.mark.real_time  # what an instrument does not know it does not answer, and that is waited for
@pytest.mark.usefixtures("probed_quickly")
@pytest.mark.parametrize("name", SUPPLIES)
def test_a_load_on_the_second_output_is_measured_where_the_address_names_it_and_told_where_not(name) -> None:
    answers, asked = SUPPLIES[name]
    with (
        EmulatedLink(Instrument(**answers)) as link,
        ScpiPowerMeter(f"{link.url}?channel=2", lambda: 3.0, TIMEOUT) as meter,
    ):
        assert meter.apparatus()["power_meter_asked"] == asked
        meter.start(10.0)
        assert [sample.power for sample in [*meter.samples(), *meter.stop()]] == [1.25]
    with EmulatedLink(Instrument(**answers)) as link, ScpiPowerMeter(link.url, timeout=TIMEOUT) as meter:
        with pytest.raises(InstrumentError, match=r"which no panel takes.*\?channel=2") as told:
            meter.start(10.0)
        assert told.value.fault is Fault.WRONG_INSTRUMENT


@pytest.mark.real_time  # what an instrument does not know it does not answer, and that is waited for
@pytest.mark.usefixtures("probed_quickly")
def test_a_channel_that_cannot_be_asked_is_told() -> None:
    """One that answers for whatever channel is asked, and for none that is selected."""
    answers = {f"MEAS:POW? {which}": "1.25" for which in ("(@2)", "CH2", "(@99)", "CH99")}
    with (
        EmulatedLink(Instrument(**answers)) as link,
        pytest.raises(InstrumentError, match=r"does not measure power.* of a channel 2") as told,
    ):
        ScpiPowerMeter(f"{link.url}?channel=2", timeout=TIMEOUT)
    assert told.value.fault is Fault.WRONG_INSTRUMENT


@pytest.mark.real_time  # what an instrument does not know it does not answer, and that is waited for
@pytest.mark.usefixtures("probed_quickly")
@pytest.mark.parametrize("volts", ["3.1E-06", "0.000E+00", "5.0E+00"])
def test_a_multimeter_that_is_asked_for_two_things_at_once_is_doubted(volts) -> None:
    """Its leads are in the jacks of the current, or in those of the voltage: one of the two is of nothing."""
    amperes = "2.5E-01" if volts != "5.0E+00" else "1.2E-09"
    with (
        EmulatedLink(Instrument(**{"MEAS:VOLT?": volts, "MEAS:CURR?": amperes})) as link,
        ScpiPowerMeter(link.url, timeout=TIMEOUT) as meter,
        pytest.raises(
            InstrumentError, match=r"measures .* V and .* A, which no panel takes.*measure=current"
        ),
    ):
        meter.start(10.0)
    with (
        EmulatedLink(Instrument(**{"MEAS:VOLT?": volts, "MEAS:CURR?": "2.5E-01"})) as link,
        ScpiPowerMeter(f"{link.url}?measure=current&voltage=5", lambda: 3.0, TIMEOUT) as meter,
    ):
        meter.start(10.0)
        assert [sample.power for sample in meter.samples()] == [1.25]


@pytest.mark.slow
@pytest.mark.parametrize("driver", [ScpiPowerMeter, VisaPowerMeter])
def test_a_serial_line_is_asked_as_a_socket_is(simulation, driver) -> None:
    with EmulatedLink(ScpiEmulator(simulation), pseudo_terminal=True) as link:
        place = link.url if driver is ScpiPowerMeter else f"ASRL{link.url}::INSTR"
        with driver(place, simulation.clock, TIMEOUT) as meter:
            assert averaged(meter, simulation) == pytest.approx(FULL, abs=0.0014)
            port = (
                meter._dialogue._resource
            )  # assumed: a frequent factory setting; the line feed is SCPI-99's
            assert (port.baud_rate, port.data_bits, port.parity.name) == (9600, 8, "none")
            assert (port.stop_bits.name, port.flow_control.name) == ("one", "none")
            with pytest.raises(InstrumentError, match="in use by another program") as told:
                driver(place, simulation.clock, TIMEOUT)
            assert told.value.fault is Fault.BUSY


@pytest.mark.parametrize("place", ["nonsense", "FOO0::1::INSTR"])
def test_what_is_no_address_of_visa_is_told_what_one_is(place: str) -> None:
    with pytest.raises(InputError, match=rf"^{place}: is neither an address of VISA, such as USB0::"):
        VisaPowerMeter(place, lambda: 0.0, TIMEOUT)


def test_without_pyvisa_it_says_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    with pytest.raises(InputError, match=r"pip install '\.\[instruments\]'"):
        ScpiPowerMeter("127.0.0.1:9")
