"""An emulated power board: what the firmware of docs/power-board.md answers, with a simulated panel."""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.hardware.drivers import board_protocol as protocol
from evenlight.hardware.simulated.panel import Simulation
from evenlight.hardware.simulated.power_meter import PowerMeterPhysics, SensorSample, SimulatedPowerSensor

LARGEST_CURRENT_AT_ZERO = 0.01  # [A]
BUS_VOLTAGE = 5.0  # [V]


@dataclass(frozen=True, slots=True)
class BoardBuild:
    """How an emulated board is made, and what is wrong with it."""

    chip: str = "INA226"  # the sensor
    highest_rate: float = 1000.0  # what it states [Hz]
    native_usb: bool = True  # whether it states that no baud rate limits it
    pwm_steps: int = 4095  # of the backlight; 0 for a board without PWM
    protocol_version: str = protocol.VERSION  # what it states
    sensor_answers: bool = True  # whether the sensor is there
    supply_is_low: bool = False  # whether its own supply is


class _RefusalError(Exception):
    """The number and the words of an error that the board answers with."""


class PowerBoardEmulator:
    """A power board with a simulated panel on it, whose backlight it dims.

    Parameters
    ----------
    simulation : Simulation
        The panel, randomness and time.
    physics : PowerMeterPhysics, optional
        What is true of its sensor and its clock.
    build : BoardBuild, optional
        How it is made.
    """

    def __init__(
        self,
        simulation: Simulation,
        physics: PowerMeterPhysics | None = None,
        build: BoardBuild | None = None,
    ) -> None:
        self._simulation, self._build = simulation, build or BoardBuild()
        self._physics = physics or PowerMeterPhysics()
        self._sensor = SimulatedPowerSensor(simulation, self._physics)
        self._came, self._sampling = b"", False
        self._step = self._build.pwm_steps
        self.n_lost = self.n_duplicated = self.n_corrupted = 0

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, any part of a command, and return what is answered at once."""
        *commands, self._came = (self._came + data).split(b"\n")
        return b"".join(self._answer(command) for command in commands)

    def stream(self) -> bytes:
        """Return the samples taken since the last call."""
        if not self._sampling:
            return b""
        if not self._build.sensor_answers:
            self._sampling = False
            return protocol.with_checksum("E 6 sensor_lost")
        return b"".join(self._lines(sample) for sample in self._sensor.due())

    def _answer(self, command: bytes) -> bytes:
        """Return the reply to a command, after the samples that were taken before it."""
        before = self.stream()
        body = protocol.checked_body(command.decode("ascii", errors="replace"))
        if body is None:
            return before + protocol.with_checksum("ERR 0 1 checksum")
        number, _, asked = body.partition(" ")
        name, _, argument = asked.partition(" ")
        try:
            reply = f"OK {number} {name} {self._obey(name, argument)}".rstrip()
        except _RefusalError as refusal:
            reply = f"ERR {number} {refusal}"
        return before + protocol.with_checksum(reply)

    def _obey(self, name: str, argument: str) -> str:
        """Return what a command is answered with."""
        match name:
            case "ID?":
                return self._identity()
            case "START":
                return self._start(argument)
            case "STOP":
                self._sampling = False
                return ""
            case "CLOCK?":
                return str(round(self._sensor.device_time(self._simulation.clock()) * 1e6))
            case "ZERO":
                return self._zero()
            case "B" | "B?":
                return self._backlight(argument)
        raise _RefusalError("2 unknown_command")

    def _identity(self) -> str:
        """Return what the board says of itself."""
        build = self._build
        return (
            f"{protocol.FAMILY} protocol={build.protocol_version} chip={build.chip} serial=EMULATED "
            f"firmware=1.0 max_rate_hz={build.highest_rate:g} line={'usb' if build.native_usb else 'uart'} "
            f"max_power_uw={round(self._physics.highest_power * 1e6)} pwm_steps={build.pwm_steps}"
        )

    def _start(self, argument: str) -> str:
        """Begin to sample, and return the time between samples [µs]."""
        if self._sampling:
            raise _RefusalError("5 sampling")
        rate = _number(argument)
        if not protocol.SLOWEST <= rate <= self._build.highest_rate:
            raise _RefusalError("4 out_of_range")
        period = round(1e6 / rate)
        self._sensor.begin(1e6 / period)
        self._sampling = True
        return str(period)

    def _zero(self) -> str:
        """Take the current for zero, and return it [µA]."""
        if self._sampling:
            raise _RefusalError("5 sampling")
        current = self._simulation.panel.power() / BUS_VOLTAGE
        if current > LARGEST_CURRENT_AT_ZERO:
            raise _RefusalError("8 not_zero")
        return str(round(current * 1e6))

    def _backlight(self, argument: str) -> str:
        """Set the backlight where a step is given, and return its step."""
        if self._build.pwm_steps == 0:
            raise _RefusalError("7 no_pwm")
        if argument:
            step = _number(argument)
            if not 0 <= step <= self._build.pwm_steps:
                raise _RefusalError("4 out_of_range")
            self._step = int(step)
            self._simulation.panel.set_backlight(self._step / self._build.pwm_steps)
        return str(self._step)

    def _lines(self, sample: SensorSample) -> bytes:
        """Return the line of a sample: none where it is lost, two where it comes twice."""
        flags = protocol.Flag(0)
        flags |= protocol.Flag.SYNC if sample.sync else protocol.Flag(0)
        flags |= protocol.Flag.SHUNT_OVERLOAD if sample.overload else protocol.Flag(0)
        flags |= protocol.Flag.LOW_SUPPLY if self._build.supply_is_low else protocol.Flag(0)
        highest = self._physics.highest_power  # the sensor's register saturates: flag, not power, tells it
        line = protocol.with_checksum(
            f"P {sample.sequence % (1 << protocol.SEQUENCE_BITS)} "
            f"{round(sample.device_time * 1e6) % (1 << protocol.TIME_BITS)} "
            f"{round(min(sample.power, highest) * 1e6)} {int(flags):X}"
        )
        return self._over_the_line(line)

    def _over_the_line(self, line: bytes) -> bytes:
        """Return what a disturbed line makes of a line."""
        physics, rng = self._physics, self._simulation.rng
        chance = float(rng.random())
        if chance < physics.lost_share:
            self.n_lost += 1
            return b""
        chance -= physics.lost_share
        if chance < physics.duplicated_share:
            self.n_duplicated += 1
            return line * 2
        if chance - physics.duplicated_share < physics.corrupted_share:
            self.n_corrupted += 1
            place = int(rng.integers(len(line) - 1))  # not the line feed
            return line[:place] + bytes([line[place] ^ 1 << int(rng.integers(7))]) + line[place + 1 :]
        return line


def _number(argument: str) -> float:
    """Return the number that a command brings."""
    try:
        return float(argument)
    except ValueError:
        raise _RefusalError("3 number_missing") from None
