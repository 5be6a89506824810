"""The battery of a headset or a phone, over adb: what the whole device takes, by its fuel gauge.

One shell on the device prints a line for each sample, with the device's own time. Each line holds its values
twice, so that a part of one is never taken for a reading. Written from the documents of Android and Linux,
and tried on a stand-in for adb, not on a device.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence

from evenlight.data_schema.recordings.instrument_logs import ClockPing, PowerSample
from evenlight.hardware.drivers.battery_power import RATES, drawn_power, gauge_units
from evenlight.hardware.drivers.power_sampling import SamplingMeter, require_sample_rate
from evenlight.hardware.operating_system import require_unix
from evenlight.hardware.protocols import Fault, InstrumentError

ANSWERS_WITHIN = 20.0  # [s] the first call of adb starts its server
SILENT = 5.0  # [s] and as many periods: a device that fell asleep prints no more
AT_ONCE = 65536  # bytes
LISTED = re.compile(r"^(\S+)\s+(\S+)", re.M)  # serial number and state
CURES = {
    "unauthorized": "put it on, or look at its screen, and allow USB debugging",
    "offline": "it does not answer: wake it, and connect it again",
    "no": "this user may not open it: install the udev rules (apt install android-sdk-platform-tools-common)",
}
WIRELESS = "; over a cable it charges: `adb tcpip 5555`, pull the cable, `adb connect ADDRESS:5555`"
# The first battery whose shell may read its current; `read` and `echo` are the shell's own, which is quick.
FIND = (
    "n=0; b=; for d in /sys/class/power_supply/*; do t=; read t <$d/type; "
    "[ $t = Battery ] && [ -r $d/current_now ] && b=$d && break; done 2>/dev/null; "
)
# Number, time, current, voltage, status, twice; before them how long they are.
LINE = (
    "{ u=; c=; v=; s=; read u x </proc/uptime; read c <$b/current_now; read v <$b/voltage_now; "
    'read s <$b/status; l="$n,$u,$c,$v,$s"; } 2>/dev/null; echo "${#l}|$l|$l" || exit; '
)
ONCE = f"{FIND}{LINE}getprop ro.product.model"
LOOP = f"{FIND}while :; do {LINE}n=$((n+1)); sleep PERIOD; done"
UPTIME = 'read u x </proc/uptime; echo "$u|$u"'


class AdbPowerMeter(SamplingMeter):
    """The battery of an Android device; its samples carry the device's time since it was started.

    Parameters
    ----------
    address : str
        The device's serial number or network address in the list of `adb devices`, empty for the only one;
        then, if adb is not on the path, "@" and where it is.
    clock : callable, optional
        The computer's clock [s].
    timeout : float, optional
        How long adb may take to answer [s].

    Raises
    ------
    InstrumentError
        If there is no adb, no such device, it is not allowed, it charges, or keeps its battery from adb.
    """

    def __init__(
        self, address: str, clock: Callable[[], float] = time.monotonic, timeout: float | None = None
    ) -> None:
        self._serial, _, program = address.partition("@")
        self._program, self._clock = program or "adb", clock
        self._timeout = ANSWERS_WITHIN if timeout is None else timeout
        self._name = f"adb:{self._serial}".rstrip(":")
        self._shell: subprocess.Popen[bytes] | None = None
        require_unix(self._name)
        self._serial = self._find_device()
        self._name = f"adb:{self._serial}"
        first, _, model = self._ask(ONCE).partition("\n")
        if (values := _values_in(first)) is None:
            raise InstrumentError(f"{self._name}: answered {first[:60]!r}", Fault.GARBLED)
        if not values["current_now"]:
            raise InstrumentError(
                f"{self._name}: its shell may not read current_now of a battery: the maker keeps it from adb",
                Fault.WRONG_INSTRUMENT,
            )
        self._units, self._model = gauge_units(values, "adb", self._name), model.strip()
        self._power_in(values)  # fails at once where it charges

    def start(self, rate: float) -> float:
        """Begin to sample at about a rate [Hz], and return it; each line takes the device a moment more.

        Raises
        ------
        InstrumentError
            If no gauge has a new value that often.
        """
        self._require_open()
        require_sample_rate(rate, *RATES, f"{self._name} (a battery's gauge is slow: give --rate-hz 1)")
        self._end_shell()
        command = [self._program, "-s", self._serial, "shell", LOOP.replace("PERIOD", f"{1 / rate:.3f}")]
        self._shell = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        os.set_blocking(_output_of(self._shell), False)
        self._came, self._said = b"", "adb ended"
        self._last, self._patience = self._clock(), SILENT + SILENT / rate
        return rate

    def samples(self) -> Sequence[PowerSample]:
        """Return the samples that came since the last call; a line that was damaged counts as lost.

        Raises
        ------
        InstrumentError
            DISCONNECTED where adb ended, NO_REPLY where nothing came for long, REFUSED where it charges now.
        """
        self._require_sampling(is_sampling=self._shell is not None)
        ended = self._shell is not None and self._shell.poll() is not None  # before its last lines are taken
        samples = self._taken()
        if samples:
            self._last = self._clock()
        elif ended:
            self._end_shell()
            raise InstrumentError(
                f"{self._name}: the connection broke ({self._said[:100]}); is it still in reach, and awake?",
                Fault.DISCONNECTED,
            )
        elif self._clock() - self._last > self._patience:
            raise InstrumentError(
                f"{self._name}: silent for {self._patience:.0f} s; did it fall asleep?", Fault.NO_REPLY
            )
        return samples

    def stop(self) -> Sequence[PowerSample]:
        """End the sampling, and return the samples that had not been taken."""
        if self._shell is None:
            return []
        try:
            return self._taken()
        finally:
            self._end_shell()

    def ping(self) -> ClockPing | None:
        """Return one comparison of the device's clock with the computer's: good to some 50 ms."""
        self._require_open()
        sent = self._clock()
        text = self._ask(UPTIME).strip()
        received = self._clock()
        match = re.fullmatch(r"(\d+\.\d+)\|\1", text)
        if match is None:
            raise InstrumentError(f"{self._name}: its time is {text[:30]!r}", Fault.GARBLED)
        return ClockPing(sent, float(match[1]), received)

    def apparatus(self) -> dict[str, str]:
        """Return what the device says of itself."""
        return {
            "power_meter": f"battery of {self._model or 'a device'} over adb: all that it takes",
            "power_meter_units": f"{self._units.in_words()}, by the size of the first reading",
        }

    def close(self) -> None:
        """End what runs on the device; more than once does nothing."""
        self._end_shell()
        super().close()

    def _find_device(self) -> str:
        """Return the serial number of the device, if adb may talk to it."""
        if shutil.which(self._program) is None:
            raise InstrumentError(
                f"{self._name}: no program {self._program!r}; install it with: apt install adb",
                Fault.NOT_FOUND,
            )
        _, _, listed = self._run(["devices"]).partition("List of devices attached")
        states = dict(LISTED.findall(listed))
        if self._serial not in states and not (self._serial == "" and len(states) == 1):
            names = ", ".join(f"adb:{serial} ({state})" for serial, state in states.items()) or "none"
            words = "several devices; name one" if states and not self._serial else "no such device"
            raise InstrumentError(
                f"{self._name}: {words}; `adb devices` lists {names}. Is USB debugging on, and has it been "
                "connected?",
                Fault.NOT_FOUND,
            )
        serial = self._serial or next(iter(states))
        if (state := states[serial]) != "device":
            cure = CURES.get(state, "start it as usual")
            raise InstrumentError(f"adb:{serial}: adb calls it {state!r}; {cure}", Fault.NOT_FOUND)
        return str(serial)

    def _ask(self, script: str) -> str:
        """Return what a script of the device's shell prints."""
        return self._run(["-s", self._serial, "shell", script])

    def _run(self, words: Sequence[str]) -> str:
        """Return what adb prints."""
        try:
            done = subprocess.run(
                [self._program, *words],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=self._timeout,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise InstrumentError(
                f"{self._name}: no answer within {self._timeout:g} s; is it in reach, and awake?",
                Fault.NO_REPLY,
            ) from None
        except OSError as error:
            raise InstrumentError(
                f"{self._name}: {self._program} cannot be run ({error.strerror})", Fault.NOT_FOUND
            ) from None
        if done.returncode:
            words_of = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
            raise InstrumentError(
                f"{self._name}: adb says {' '.join(words_of)[:120] or 'nothing'!r}; is it still connected?",
                Fault.DISCONNECTED,
            )
        return done.stdout.decode("utf-8", "replace")

    def _taken(self) -> list[PowerSample]:
        """Return the samples of the lines that are whole."""
        assert self._shell is not None
        try:
            while part := os.read(_output_of(self._shell), AT_ONCE):
                self._came += part
        except BlockingIOError:
            pass
        *lines, self._came = self._came.split(b"\n")
        received, samples = self._clock(), []
        for line in lines:
            if (values := _values_in(line.decode("utf-8", "replace"))) is None:
                self._said = line.decode("utf-8", "replace").strip()
                continue
            count, uptime = int(values["count"]), float(values["uptime"])
            samples.append(PowerSample(count, uptime, received, self._power_in(values)))
        return samples

    def _power_in(self, values: dict[str, str]) -> float:
        """Return the power of a line [W]."""
        try:
            return drawn_power(values, self._units, "adb", self._name)
        except InstrumentError as error:
            if error.fault is not Fault.REFUSED:
                raise
            raise InstrumentError(f"{error}{WIRELESS}", error.fault) from None

    def _end_shell(self) -> None:
        """End what runs on the device: its next line has no reader."""
        if self._shell is not None:
            self._shell.kill()
            self._shell.communicate()
            self._shell = None


def _output_of(shell: subprocess.Popen[bytes]) -> int:
    """Return the descriptor that a shell's lines are read from."""
    assert shell.stdout is not None
    return shell.stdout.fileno()


def _values_in(line: str) -> dict[str, str] | None:
    """Return the values of a line; None where they are not the same twice, and as long as it says.

    >>> _values_in("36|3,120.51,-500000,3900000,Discharging|3,120.51,-500000,3900000,Discharging")["uptime"]
    '120.51'
    >>> _values_in("36|3,120.51,-500000,3900000,Discharging|3,120.51,-50000,3900000,Discharging") is None
    True
    """
    length, _, values_twice = line.strip().partition("|")
    one, _, other = values_twice.partition("|")
    names = ("count", "uptime", "current_now", "voltage_now", "status")
    if one != other or length != str(len(one)) or one.count(",") != len(names) - 1:
        return None
    values = dict(zip(names, one.split(","), strict=True))
    is_number = re.fullmatch(r"\d{1,9}", values["count"]) and re.fullmatch(r"\d+\.\d+", values["uptime"])
    return values if is_number else None
