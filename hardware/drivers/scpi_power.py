"""Bench instruments that speak SCPI as power meters, through PyVISA: supplies, power analysers, multimeters.

Tested against an emulated instrument over sockets and serial lines of PyVISA-py, not on one.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Generator, Mapping, Sequence
from typing import ClassVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.drivers.power_sampling import PolledMeter, positive, split_words
from evenlight.hardware.drivers.scpi_dialogue import SHOWN, ScpiDialogue, finished
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, Instrument, InstrumentError

TIMEOUT = 5.0  # [s] a multimeter may average over a second or more
SLOWEST, FASTEST = 0.01, 1000.0  # [Hz]
PROBE = 1.8  # [s] in which an instrument answers a question that it knows
SCPI_PORT = 5025  # registered with IANA as scpi-raw
OPTIONS = {
    "channel": "output of a supply, element of an analyser",
    "measure": "power, or current of a multimeter",
    "voltage": "of the supply [V], with measure=current",
}
UNITS = {"POW": "W", "VOLT": "V", "CURR": "A"}
FUNCTIONS = {"": (("POW",), ("VOLT", "CURR")), "power": (("POW",),), "current": (("CURR",),)}
# How a channel is said: Keysight; Rigol and Siglent; SCPI-99's INSTrument, of which R&S's supplies are.
CHANNELS = ("MEAS:{}? (@{})", "MEAS:{}? CH{}", "INST:NSEL {1}\nMEAS:{0}?")
NO_CHANNEL = 99
LEAST_VOLTAGE, LEAST_POWER = 0.5, 1e-3  # [V] and [W] of any panel's supply
ADVICE = (
    "name another output with ?channel=2; a multimeter measures one thing at a time: give "
    "?measure=current&voltage=5.0, with the voltage of the supply"
)
# The power analysers WT300 to WT5000 know no MEAS. What makes power the only one of the numbers that NUM:VAL?
# sends; the display keeps its own (IM WT310-17EN, the group NUMeric).
YOKOGAWA, FIRST_ITEM = "YOKOGAWA", "NUM:FORM ASC\nNUM:NUM 1\nNUM:ITEM1 P,{}"
MOST_ERRORS = 20  # that an instrument's list is read of
ERROR = re.compile(r'([+-]?\d+)(?:(?:\s*,\s*|\s+)"?(.*?)"?)?')
NUMBER = re.compile(r"([+-]?(?:\d+|(?=\.\d))(?:\.\d*)?(?:E[+-]?\d+)?)\s*([A-Z]*)", re.IGNORECASE | re.ASCII)
OVERFLOW = 9.9e37  # SCPI-99, 7.2.1: infinity, which stands for an overload; 9.91e37 is not a number
ROUNDING = 1e-4  # of it
INFINITE = ("INF", "+INF", "-INF")  # Yokogawa's overload
SUFFIXES = {"": 1.0, "M": 1e-3, "U": 1e-6, "N": 1e-9, "K": 1e3}  # IEEE 488.2: M is milli, in either case
ALIKE = 4  # answers in a row that show in which form an instrument writes its numbers
MOST_ASKED = 24  # times for one value, before its changing forms are an error
STEADY = 1.5  # ratio of two neighbouring values; a lost digit before the point makes at least 2


class ScpiPowerMeter(PolledMeter, Instrument):
    """A SCPI instrument at a socket or serial line; its samples carry the computer's time.

    It is asked for power, or for voltage and current of one output where it has no power. The next question
    goes out when `samples` is called and one is due; an answer that is not there at once is taken by a later
    call.

    The address is "HOST", "HOST:PORT" or a serial port; after it "?channel=2" for another output than that
    which the instrument takes by itself, "?measure=current&voltage=5.0" for a multimeter in a supply's line,
    with the voltage of that [V]. Parameters as of `Instrument`.
    """

    driver: ClassVar = "scpi"
    backend: ClassVar = "@py"
    _rates = (SLOWEST, FASTEST)

    def _open(self, address: str) -> None:
        place, said = split_words(address, self.driver, OPTIONS)
        self._function, self._voltage, self._channel = _stated(said, f"{self.driver}:{address}")
        resource = place if "::" in place or self.driver == "visa" else resource_name(place)
        self._name = f"the SCPI instrument at {place}"
        self._dialogue = ScpiDialogue(self._name, resource, self._timeout, self.backend)
        self._asking: Generator[None, None, PowerSample] | None = None
        try:
            self._is_yokogawa = self._dialogue.identity.upper().startswith(YOKOGAWA)
            self._questions = self._find_questions()
            self._dialogue.send("*CLS")  # forget the errors of the search
            errors = "STAT:ERR?" if self._is_yokogawa else "SYST:ERR?"
            self._errors = errors if ERROR.fullmatch(self._dialogue.answer_if_known(errors, PROBE)) else ""
        except BaseException:
            self._dialogue.close()
            raise
        self._forms = {question: NumberForm() for question in self._questions}

    def _begin(self, rate: float) -> float:
        """Begin to sample, no faster than it answers; refuse what is no panel's power."""
        self._asking = None
        finished(self._measure())  # which finds the form of its numbers
        begun = time.monotonic()
        finished(self._measure(doubting=True))
        return super()._begin(min(rate, 1 / (time.monotonic() - begun)))

    def _news(self) -> Sequence[PowerSample]:
        if self._asking is None:
            if not self._is_due(self._clock()):
                return []
            self._asking = self._measure()
        asking, self._asking = self._asking, None
        try:
            next(asking)
        except StopIteration as ended:
            return [ended.value]
        self._asking = asking
        return []

    def _rest(self) -> Sequence[PowerSample]:
        """Return the sample that was asked for last, unless the instrument had an error meanwhile."""
        asking, self._asking = self._asking, None
        left = [] if asking is None else [finished(asking)]
        last = ""
        for _ in range(MOST_ERRORS if self._errors else 0):
            answer = finished(self._dialogue.asked(self._errors))
            if (match := ERROR.fullmatch(answer)) is None:
                raise self._error(
                    f"{answer[:SHOWN]!r} is no error of SCPI; its errors cannot be read", Fault.GARBLED
                )
            if not int(match[1]):
                break
            last = answer
        if last:
            raise self._error(f"had the error {last}", Fault.REFUSED, last.partition(",")[0].strip())
        return left

    def apparatus(self) -> dict[str, str]:
        """Return what the instrument says of itself."""
        supply = "" if self._voltage is None else f" times {self._voltage:g} V"
        asked = " and ".join(self._questions).replace("\n", ";")
        return {"power_meter": self._dialogue.identity, "power_meter_asked": asked + supply}

    def close(self) -> None:
        """Let go of the instrument; more than once does nothing."""
        self._dialogue.close()
        super().close()

    def _find_questions(self) -> dict[str, str]:
        if self._is_yokogawa:
            element = f"P,{self._channel or 1}"
            self._dialogue.send(FIRST_ITEM.format(self._channel or 1))
            item = self._dialogue.answer_if_known("NUM:ITEM1?", PROBE).upper()
            if item.split(" ")[-1] in (element, element.removesuffix(",1")):
                return {"NUM:VAL?": "W"}
        for form in ("MEAS:{}?",) if self._channel is None else CHANNELS:
            for function in FUNCTIONS[self._function]:
                questions = {form.format(name, self._channel): UNITS[name] for name in function}
                known = all(map(self._understands, questions, questions.values()))
                if known and self._selects(form, function[0]):
                    return questions
        wanted = self._function or "power, nor voltage and current"
        wanted += "" if self._channel is None else f", of a channel {self._channel}"
        raise self._error(
            f"{self._dialogue.identity} does not measure {wanted}; {ADVICE}", Fault.WRONG_INSTRUMENT
        )

    def _selects(self, form: str, quantity: str) -> bool:
        """Return whether the instrument goes by the channel in a question, and does not answer for any."""
        if self._channel is None:
            return True
        if form == CHANNELS[-1]:
            selected = self._dialogue.answer_if_known(f"INST:NSEL {self._channel}\nINST:NSEL?", PROBE)
            return selected.strip().lstrip("+") == str(self._channel)
        return not self._understands(form.format(quantity, NO_CHANNEL), UNITS[quantity])

    def _understands(self, question: str, unit: str) -> bool:
        try:
            number_in(self._dialogue.answer_if_known(question, PROBE), unit, self._name)
        except InstrumentError as error:
            return error.fault is not Fault.GARBLED
        return True

    def _measure(self, *, doubting: bool = False) -> Generator[None, None, PowerSample]:
        """Return a sample; all of it is asked for anew where an answer may have lost a digit."""
        answer = ""
        for _ in range(MOST_ASKED):
            sent, values = self._clock(), dict[str, float]()
            for question, unit in self._questions.items():
                answer = yield from self._dialogue.asked(question)
                value = number_in(answer, unit, self._name)
                if not self._forms[question].is_whole(answer, value):
                    break
                values[unit] = value
            if len(values) < len(self._questions):
                continue
            power = math.prod(values.values()) * (self._voltage or 1.0)
            require_power(self.driver, self._name, power)
            self._require_forwards(power, "swap the leads")
            if doubting and (values.get("V", math.inf) < LEAST_VOLTAGE or abs(power) < LEAST_POWER):
                said = " and ".join(f"{value:g} {unit}" for unit, value in values.items())
                raise self._error(
                    f"measures {said}, which no panel takes; is it on? {ADVICE}", Fault.WRONG_INSTRUMENT
                )
            since = time.monotonic() - self._dialogue.came
            return self._sample(power, sent, max(self._clock() - since, sent))
        raise self._error(
            f"answers {answer[:SHOWN]!r}, and each time in another form; is the line bad?", Fault.GARBLED
        )


class VisaPowerMeter(ScpiPowerMeter):
    """A SCPI instrument at whatever PyVISA reaches, by PyVISA's name of it; as `ScpiPowerMeter`.

    Where that is no socket and no serial line, each answer is waited for.
    """

    driver, backend = "visa", ""


def _stated(said: Mapping[str, str], given: str) -> tuple[str, float | None, int | None]:
    """Return the function, voltage [V] and channel that an address states, if they make a power."""
    voltage = positive(said["voltage"], f"{given}: voltage") if "voltage" in said else None
    channel = said.get("channel")
    if channel is not None and not (
        channel.isdecimal() and channel.isascii() and 0 < int(channel) < NO_CHANNEL
    ):
        raise InputError(f"{given}: channel must be a whole number from 1, got {channel!r}")
    function = said.get("measure", "current" if voltage else "")
    if function not in FUNCTIONS or (function == "current") != (voltage is not None):
        raise InputError(
            f"{given}: makes no power; there is ?measure=power, and ?measure=current&voltage=5.0 with the "
            "voltage of the supply"
        )
    return function, voltage, None if channel is None else int(channel)


def resource_name(place: str) -> str:
    """Return PyVISA's name of a host, a host and port, a serial port, or a URL of pyserial.

    >>> resource_name("192.0.2.7"), resource_name("comet:5555")
    ('TCPIP::192.0.2.7::5025::SOCKET', 'TCPIP::comet::5555::SOCKET')
    >>> resource_name("/dev/ttyUSB0"), resource_name("COM3"), resource_name("rfc2217://comet:4001")
    ('ASRL/dev/ttyUSB0::INSTR', 'ASRL3::INSTR', 'ASRLrfc2217://comet:4001::INSTR')
    """
    place = place.removeprefix("socket://")
    if "/" in place or re.fullmatch(r"COM\d+", place, re.IGNORECASE):
        return f"ASRL{re.sub('^COM', '', place, flags=re.IGNORECASE)}::INSTR"
    host, _, port = place.partition(":")
    return f"TCPIP::{host}::{port or SCPI_PORT}::SOCKET"


def number_in(answer: str, unit: str, name: str) -> float:
    """Return the number of an answer in a unit, "W", "V" or "A".

    Raises
    ------
    InstrumentError
        If there is none, it is in another unit, or it stands for an overload.

    >>> number_in("500mW", "W", "the meter"), number_in("+1.25E+00", "W", "the meter")
    (0.5, 1.25)
    """
    match = NUMBER.fullmatch(answer)
    number, written = (float(match[1]), match[2].upper()) if match else (math.nan, "")
    scale = SUFFIXES.get(written.removesuffix(unit))
    if answer.upper() in INFINITE or abs(abs(number) / OVERFLOW - 1) <= ROUNDING:
        raise InstrumentError(
            f"{name}: overload ({answer}): the panel takes more than the range that is set",
            Fault.OVER_RANGE,
            answer,
        )
    if scale is None or not math.isfinite(number) or (written and not written.endswith(unit)):
        raise InstrumentError(
            f"{name}: answered {answer[:SHOWN]!r} where a number of {unit} belongs", Fault.GARBLED
        )
    if abs(number) > OVERFLOW:
        raise InstrumentError(f"{name}: has no value ({answer})", Fault.REFUSED, answer)
    return number * scale


class NumberForm:
    """The form in which an instrument writes its numbers, by which one that lost a digit is found.

    SCPI has no checksum. But an instrument writes its numbers equally long, or with equally many decimals;
    what lost a character has neither, or is at most half of what it was. Such an answer is asked for again,
    until four in a row show a new form: another range, or much more power.

    >>> form = NumberForm()
    >>> [form.is_whole(answer, float(answer)) for answer in ("12.5", "12.4", "12.5", "12.6", "2.6", "12.6")]
    [False, False, False, True, False, True]
    """

    def __init__(self) -> None:
        self._held: tuple[int, str, float] | None = None  # length, decimals, size of the last that was whole
        self._new: list[tuple[int, str, float]] = []  # that do not follow it, but each other

    def is_whole(self, answer: str, value: float) -> bool:
        """Return whether an answer is in the form, and so not shorter or longer than it was sent."""
        digits = answer.lstrip("+-")
        now = len(digits), re.sub(r"\d", "0", re.sub(r"^\d*", "", digits)), abs(value)
        if self._held is None or not _follows(now, self._held):
            self._new = [*self._new, now] if self._new and _follows(now, self._new[-1]) else [now]
            if len(self._new) < ALIKE:
                return False
        self._held, self._new = now, []
        return True


def _follows(one: tuple[int, str, float], other: tuple[int, str, float]) -> bool:
    """Return whether no digit was lost of one number, if none was of another before it."""
    smaller, larger = sorted((one[2], other[2]))
    return one[0] == other[0] or (one[1] == other[1] and larger <= STEADY * smaller)
