"""Records light over time: of a steady screen, or of a patch that turns from white to black and back.

The patch is the corner that a photodiode looks at, on middle grey. It stays white for two seconds, in which
the PWM shows, and then changes at intervals that vary, so that they keep step with nothing.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.dataset_layout import CLOCK_PINGS
from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.data_schema.recordings.light import (
    FEWEST_SAMPLES,
    LIGHT_ARRIVALS,
    LIGHT_LOG,
    LIGHT_SAMPLES,
    PATCH_FLIPS,
    LightArrival,
    LightLog,
    PatchFlip,
)
from evenlight.data_schema.recordings.rig import PhotodiodePatch, Rig
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.experiments.calibration_age import utc_now
from evenlight.experiments.showing import draw_patch
from evenlight.hardware.driver_table import RECORDED
from evenlight.hardware.light_file import recorded_light
from evenlight.hardware.measuring import bench_for
from evenlight.hardware.protocols import (
    LightBlock,
    LightSampler,
    LightStream,
    ResponseDevice,
    Window,
)
from evenlight.hardware.rig import is_simulated, open_light_sampler
from evenlight.hardware.rig_windows import open_keyboard, open_window
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.hardware.simulated.panel import PanelPhysics, SimulatedPanel, Simulation

LEAD = 2.0  # [s] of white, before the first change
VARIED = 0.2  # share by which intervals differ from what was asked for, at most
DARKNESS = 0.5  # [s] of a covered photodiode
LOOK_EVERY = 0.02  # [s] at the sampler
PINGS_AT_ONCE = 20
MOST_SAMPLES = 5_000_000  # that memory holds easily
GREY = 0.5
SEED = 1  # of intervals, and of simulated noise


@dataclass(frozen=True, slots=True)
class LightRequest:
    """What was asked for."""

    instrument: str  # the sampler
    rate: float | None  # of its samples [Hz]; None for its own
    seconds: float  # of a steady screen
    ask: Callable[[str], object] | None  # asks to cover the photodiode; None where darkness is not measured
    rig: Rig | None  # on whose window the patch is shown; None for a steady screen
    edges: int  # how often the patch changes
    interval: float  # from one change to the next [s]
    simulated: bool  # whether no window is opened, and time goes with the frames


@dataclass(slots=True)
class RecordedLight:
    """What came."""

    stream: LightStream
    blocks: list[LightBlock]
    apparatus: dict[str, str]
    flips: list[PatchFlip] = field(default_factory=list)
    pings: list[ClockPing] = field(default_factory=list)
    dark: float | None = None


def record_light(request: LightRequest, folder: Path) -> None:
    """Record light, and write what came into a folder.

    Raises
    ------
    InputError
        If something asked for cannot be.
    InstrumentError
        If the sampler fails.
    """
    kind, _, path = request.instrument.partition(":")
    if kind == RECORDED:
        if request.rig is not None:
            raise InputError(
                f"--rig shows frames to a sampler; {request.instrument} is a recording made elsewhere"
            )
        if request.ask is not None:
            raise InputError(
                f"--dark asks to cover a photodiode; {request.instrument} is a recording made elsewhere"
            )
        stream, block = recorded_light(Path(path))
        recorded = RecordedLight(stream, [block], {})
    elif request.rig is None:
        recorded = _record_steady(request)
    else:
        recorded = _record_patch(request, request.rig)
    if sum(len(block.times) for block in recorded.blocks) < FEWEST_SAMPLES:
        raise InputError(
            f"{request.instrument}: fewer than {FEWEST_SAMPLES} samples came; give more --seconds"
        )
    _write(recorded, request, folder)


def _record_steady(request: LightRequest) -> RecordedLight:
    """Return the light of a screen that someone else keeps steady."""
    bench = bench_for(request.instrument)
    panel = bench.simulation.panel if bench.simulation else None
    with open_light_sampler(request.instrument, bench.clock, bench.simulation) as sampler:

        def sampled(seconds: float) -> tuple[LightStream, list[LightBlock]]:
            stream, end = _started(sampler, request, seconds), bench.clock() + seconds
            blocks: list[LightBlock] = []
            while not blocks or bench.clock() < end:
                bench.wait(LOOK_EVERY)
                came = sampler.samples()
                if came and not blocks:  # a sound card takes its time to begin
                    end = bench.clock() + seconds
                blocks += came
            return stream, blocks

        dark = None
        if request.ask is not None:
            request.ask("cover the photodiode, then press Enter: ")
            if panel is not None:
                panel.show(0.0)
            covered = [block.values for block in sampled(DARKNESS)[1]]
            dark = float(np.median(np.concatenate(covered))) if covered else None
            request.ask("uncover it, aim it at a white screen, then press Enter: ")
        if panel is not None:
            panel.show(1.0)
            bench.wait(DARKNESS)
        stream, blocks = sampled(request.seconds)
        return RecordedLight(stream, blocks, sampler.apparatus(), dark=dark)


def _started(sampler: LightSampler, request: LightRequest, seconds: float) -> LightStream:
    """Start a sampler, and return what comes; refuse more than memory holds."""
    stream = sampler.start(request.rate)
    if seconds * stream.rate > MOST_SAMPLES:
        raise InputError(
            f"{seconds:g} s at {stream.rate:g} Hz are {seconds * stream.rate:.3g} samples; at most "
            f"{MOST_SAMPLES:,} are kept: record for a shorter time, or at a lower rate"
        )
    return stream


def _record_patch(request: LightRequest, rig: Rig) -> RecordedLight:
    """Return the light of a patch that changes, with its flips."""
    if rig.in_headset:
        raise InputError(f"the rig {rig.name!r} is in a headset, and the patch is a corner of a screen")
    with _opened_patch(request, rig) as (patch, simulation):
        name = "simulated" if request.simulated else request.instrument
        with open_light_sampler(name, patch.now, simulation) as sampler:
            stream = _started(sampler, request, LEAD + request.edges * request.interval)
            recorded = RecordedLight(stream, [], sampler.apparatus() | patch.apparatus())
            recorded.pings += _pings(sampler)
            for refreshes, lit in _turns(request, rig.refresh_rate):
                for refresh in range(refreshes):
                    flip = patch.show(lit=lit)
                    if refresh == 0:
                        recorded.flips.append(PatchFlip(flip, lit))
                    recorded.blocks += sampler.samples()
            recorded.pings += _pings(sampler)
            return recorded


def _turns(request: LightRequest, refresh_rate: float) -> Iterator[tuple[int, bool]]:
    """Yield for how many refreshes the patch is white or black, by turns."""
    rng = np.random.default_rng(SEED)
    shares = rng.uniform(1 - VARIED, 1 + VARIED, request.edges)
    seconds = [LEAD, *(request.interval * shares)]
    for length, lit in zip(seconds, itertools.cycle((True, False)), strict=False):
        yield max(math.ceil(length * refresh_rate), 2), lit


def _pings(sampler: LightSampler) -> list[ClockPing]:
    """Return some comparisons of the clocks; none of a sampler that answers none."""
    return [ping for _ in range(PINGS_AT_ONCE) if (ping := sampler.ping()) is not None]


@contextmanager
def _opened_patch(request: LightRequest, rig: Rig) -> Iterator[tuple[_Patch, Simulation | None]]:
    """Yield what shows the patch, and what a simulated photodiode looks at."""
    with ExitStack() as stack:
        clock = RefreshClock(rig.refresh_rate)
        window = keyboard = None
        if not request.simulated:
            window = open_window(rig)
            stack.callback(window.close)
            keyboard = open_keyboard(window)
            stack.callback(keyboard.close)
        now = window.now if window else clock.now
        simulation = None
        if request.simulated or is_simulated(request.instrument):
            panel = SimulatedPanel(PanelPhysics(warm_up_share=0.0), now)
            simulation = Simulation(panel, np.random.default_rng(SEED), now, time.sleep)
        yield _Patch(rig, clock, window, keyboard, simulation.panel if simulation else None), simulation


class _Patch:
    """The corner of a window, a simulated panel, or both."""

    def __init__(
        self,
        rig: Rig,
        clock: RefreshClock,
        window: Window | None,
        keyboard: ResponseDevice | None,
        panel: SimulatedPanel | None,
    ) -> None:
        self._rig, self._clock, self._window = rig, clock, window
        self._keyboard, self._panel = keyboard, panel
        self.now = window.now if window else clock.now

    def show(self, *, lit: bool) -> float:
        """Show it for one refresh, and return when [s]; the pause key raises KeyboardInterrupt."""
        if self._window is None:
            flip = self._clock.advance()
        else:
            framebuffer, size = self._window.framebuffer(), self._window.size()
            framebuffer.clear(GREY, GREY, GREY, 1.0)
            draw_patch(framebuffer, size, patch_of(self._rig), lit=lit)
            flip = self._window.flip()
        if self._panel is not None:
            self._panel.show(float(lit))
        if self._keyboard and any(key.name == self._rig.keys.pause for key in self._keyboard.pressed()):
            raise KeyboardInterrupt
        return flip

    def apparatus(self) -> dict[str, str]:
        """Return what it is shown on."""
        return self._window.apparatus() if self._window else {}


def patch_of(rig: Rig) -> PhotodiodePatch:
    """Return the corner that the photodiode looks at: the rig's, or the upper left one."""
    return rig.photodiode_patch or PhotodiodePatch()


def _write(recorded: RecordedLight, request: LightRequest, folder: Path) -> None:
    """Write what came."""
    rig, stream = request.rig, recorded.stream
    patch = patch_of(rig) if rig else None
    simulated = request.simulated or is_simulated(request.instrument)
    log = LightLog(
        simulated=simulated,
        instrument=request.instrument,
        sample_rate=stream.rate,
        full_scale=stream.full_scale,
        dc_coupled=stream.dc_coupled,
        dark=recorded.dark,
        refresh_rate=rig.refresh_rate if rig else None,
        place=f"{patch.corner.value.replace('_', ' ')}, {patch.size} pixels" if patch else "",
        apparatus=recorded.apparatus,
        provenance=provenance_now(),
        started="" if simulated or request.instrument.startswith(RECORDED) else utc_now(),
    )
    write_json_record(folder / LIGHT_LOG, log)
    parts = (zip(block.times.tolist(), block.values.tolist(), strict=True) for block in recorded.blocks)
    lines = (f"{time:.7f},{value:.7g}\n" for time, value in itertools.chain.from_iterable(parts))
    write_whole(folder / LIGHT_SAMPLES, "".join(("time_s,value\n", *lines)))
    if rig is not None:
        ends = [LightArrival(float(b.times[-1]), b.received) for b in recorded.blocks if len(b.times)]
        write_rows(folder / LIGHT_ARRIVALS, LightArrival, ends)
        write_rows(folder / CLOCK_PINGS, ClockPing, recorded.pings)
        write_rows(folder / PATCH_FLIPS, PatchFlip, recorded.flips)
