"""Passes of a film on a device that plays it itself: its versions in turn, and the power of each pass.

A battery's gauge lags behind by seconds, so the beginning of each pass belongs to what was shown before, and
does not count. The order is drawn anew for each measurement: no cycle of the device keeps step with it.
"""

from __future__ import annotations

import contextlib
import math
import os
import random
import secrets
import shlex
import shutil
import signal
import statistics
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.data_schema.recordings.played_power import DevicePass
from evenlight.data_schema.storage.append_log import AppendedRows
from evenlight.data_schema.storage.whole_files import make_folder
from evenlight.hardware.measuring import Bench, ShowLine, bench_for
from evenlight.hardware.operating_system import HAS_UNIX
from evenlight.hardware.power_average import averaged, sampled
from evenlight.hardware.protocols import Fault, InstrumentError, PowerMeter
from evenlight.hardware.rig import open_power_meter

SAMPLES, PASSES = "power.csv", "passes.csv"
VERSIONS = ("full", "dimmed")
SIMULATED_FACTORS = {"full": 1.0, "dimmed": 0.6}  # backlight of a simulated device
FEWEST_PASSES = 4  # two powers, a drift, and how far passes differ
FILM = "{film}"
IN_STEP = 0.3  # correlation that an order may have with a straight drift, and with a bent one
FEWEST_SAMPLES = 10  # that count in a pass
WILD = 3.0  # times the median of a pass, or that part of it: no film changes a whole device's power so far
GRACE = 1.0  # [s] in which a player ends that is asked to


@dataclass(frozen=True, slots=True)
class PassRequest:
    """What is to be measured."""

    instrument: str  # as `measure list` has it
    films: dict[str, str]  # the film of each version, "full" and "dimmed": a name, or what `play` takes
    rounds: int  # of one pass of each
    seconds: float  # of a pass [s]
    settle: float  # of it that do not count [s]
    rate: float  # of the samples [Hz]
    play: str  # command that plays {film}; empty where a person starts it
    seed: int = field(default_factory=lambda: secrets.randbits(32))  # of the order of the passes

    def __post_init__(self) -> None:
        counted = max(0.0, self.seconds - self.settle) * self.rate
        if not FEWEST_SAMPLES <= counted < math.inf:
            raise InputError(
                f"a pass needs {FEWEST_SAMPLES} samples that count; {self.seconds:g} s, less "
                f"{self.settle:g} s to settle, have {counted:g} at {self.rate:g} Hz"
            )
        if self.play and FILM not in self.play:
            raise InputError(f"--play {self.play!r}: say with {FILM} where the film goes")
        try:
            program = shlex.split(self.play)[:1]
        except ValueError as error:
            raise InputError(f"--play {self.play!r}: {error}") from None
        if program and shutil.which(program[0]) is None:
            raise InputError(f"--play {self.play!r}: there is no program {program[0]!r}")

    def order(self) -> list[str]:
        """Return the versions in the order in which they are played: at random, but not as a device drifts.

        Orders that go with a drift, straight or bent, are drawn again; where passes are few, what is left of
        them may go with it a little more.

        >>> PassRequest("simulated", {}, 3, 20.0, 5.0, 1.0, "", seed=1).order()
        ['full', 'dimmed', 'dimmed', 'full', 'full', 'dimmed']
        """
        order, draw, most = list(VERSIONS) * self.rounds, random.Random(self.seed), IN_STEP
        draw.shuffle(order)
        while self.rounds > 1 and max(_in_step(order, power) for power in (1, 2)) > most:
            draw.shuffle(order)
            most *= 1.02
        return order


def _in_step(order: Sequence[str], power: int) -> float:
    """Return the correlation of an order with a power of time, from its middle."""
    middle = (len(order) - 1) / 2
    times = [(k - middle) ** power for k in range(len(order))]
    return abs(statistics.correlation([float(version == VERSIONS[0]) for version in order], times))


def measure_passes(
    request: PassRequest, folder: Path, ask: Callable[[str], str], show: ShowLine
) -> tuple[list[DevicePass], dict[str, str]]:
    """Measure all passes, and return them with what the instrument says of itself.

    Ctrl-C ends it early, where enough was measured.

    Parameters
    ----------
    request, folder : PassRequest, Path
        What is measured, and a new folder for samples and passes, which are on the disk as they come.
    ask, show : callable
        Shows a question, and returns what was typed; shows a line.

    Raises
    ------
    InputError
        If a film cannot be started, or the folder holds something.
    InstrumentError
        If the meter fails; what was measured before is in the folder.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"--out {folder}: holds something already; give a new folder")
    bench, order, passes = bench_for(request.instrument), request.order(), list[DevicePass]()
    with ExitStack() as stack:
        meter = stack.enter_context(open_power_meter(request.instrument, bench.clock, bench.simulation))
        tables: tuple[AppendedRows, AppendedRows] | None = None
        minutes = len(order) * request.seconds / 60
        show(f"{len(order)} passes of {request.seconds:g} s: {minutes:.3g} min, and the time to start them")
        try:
            for index, version in enumerate(order):
                words = f"pass {index + 1} of {len(order)}, {version}"
                with _started(request, version, bench, f"{words}: start", ask):
                    tables = tables or _tables(folder, stack)
                    measured, said = _measured(meter, request, bench, tables[0], (index, version))
                for line in said:
                    show(f"{words}: {line}")
                passes.append(measured)
                tables[1].append(passes[-1:])
                show(f"{words}: {passes[-1].mean_power:.4g} W")
        except BaseException as error:
            if tables and not passes:
                shutil.rmtree(folder)
            if isinstance(error, InstrumentError) and passes:
                words = f"{error}; the {len(passes)} passes before it are in {folder / PASSES}"
                raise InstrumentError(words, error.fault, error.code) from None
            if not isinstance(error, KeyboardInterrupt) or len(passes) < FEWEST_PASSES:
                raise
        return passes, meter.apparatus()


def _tables(folder: Path, stack: ExitStack) -> tuple[AppendedRows, AppendedRows]:
    """Return the tables of samples and passes; nothing is made before there is something to measure."""
    make_folder(folder)
    samples = stack.enter_context(AppendedRows(folder / SAMPLES, PowerSample))
    return samples, stack.enter_context(AppendedRows(folder / PASSES, DevicePass))


@contextmanager
def _started(
    request: PassRequest, version: str, bench: Bench, words: str, ask: Callable[[str], str]
) -> Iterator[None]:
    """Start a version, and end it if it is a program of this computer."""
    film = request.films[version]
    if bench.simulation is not None:
        bench.simulation.panel.set_backlight(SIMULATED_FACTORS[version])
        yield
    elif not request.play:
        try:
            ask(f"{words} {film} from its beginning, and press Enter when it runs: ")
        except EOFError:
            raise InputError("no one pressed Enter; give --play, or a terminal") from None
        yield
    else:
        command = [part.replace(FILM, film) for part in shlex.split(request.play)]
        try:
            player = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
            )
        except OSError as error:
            raise InputError(f"--play: {command[0]} cannot be run ({error.strerror})") from None
        try:
            yield
            if player.poll():  # one that has only sent word, and ended well, gave 0
                raise InputError(f"--play: {shlex.join(command)} ended with the code {player.returncode}")
        finally:
            _end(player)


def _end(player: subprocess.Popen[bytes]) -> None:
    """End a player, and all that it has started; on Windows the player alone."""
    if not HAS_UNIX:
        player.kill()
        return
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(player.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            player.wait(GRACE)


def _measured(
    meter: PowerMeter, request: PassRequest, bench: Bench, rows: AppendedRows, which: tuple[int, str]
) -> tuple[DevicePass, list[str]]:
    """Return the power of a pass that runs, and a line for each sample that is left out."""
    begun, samples = bench.clock(), list[PowerSample]()
    rate = meter.start(request.rate)
    for batch in sampled(meter, request.seconds, rate, bench.clock, bench.wait):
        rows.append(batch, to_disk=False)
        samples += batch
    ended, counts_from = bench.clock(), begun + request.settle
    counted = [sample for sample in samples if sample.received >= counts_from]
    counted = [replace(sample, sequence=sample.sequence - counted[0].sequence) for sample in counted]
    middle = statistics.median(sample.power for sample in counted) if counted else 0.0
    wild = [one for one in counted if not middle / WILD <= one.power <= WILD * middle] if middle > 0 else []
    said = [
        f"the sample of {one.power:.4g} W, {one.device_time - begun:.1f} s after its begin, is left out: the "
        f"pass has a median of {middle:.4g} W"
        for one in wild
    ]
    counted = [one for one in counted if one not in wild]
    seconds = request.seconds - request.settle
    mean = averaged(counted, begun=counts_from, ended=ended, seconds=seconds, sample_rate=rate)
    if mean.power <= 0:
        raise InstrumentError(
            f"{request.instrument}: {mean.power:g} W over a pass, as if nothing ran; is it the right meter?",
            Fault.IMPLAUSIBLE,
        )
    n_lost = mean.n_lost - len(wild)
    measured = DevicePass(
        *which, counts_from, seconds, mean.power, mean.n_samples, max(n_lost, 0), _hold(samples), len(wild)
    )
    return measured, said


def _hold(samples: Sequence[PowerSample]) -> float:
    """Return the longest time for which a meter gave one and the same value [s].

    >>> _hold([PowerSample(k, float(k), float(k), power) for k, power in enumerate((2.0, 2.0, 2.0, 3.0))])
    3.0
    """
    changes = [next(group).device_time for _, group in groupby(samples, key=lambda sample: sample.power)]
    return max(
        (later - earlier for earlier, later in pairwise([*changes, samples[-1].device_time])), default=0.0
    )
