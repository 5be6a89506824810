"""Promises of a device that works: readings, settings, refusals, and how it is closed."""

from __future__ import annotations

import math
import time
from functools import partial

from evenlight.hardware.conformance.subject import (
    SETTLED,
    TOLERANCE,
    Bench,
    Subject,
    promised,
    refusal,
)
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import Fault

SHARES = (1.0, 0.5)  # what the panel shows
OFF_GRID = (0.7133, 0.3217)  # factors that lie on no step of a usual size,
PARTS = (0.3, 0.7)  # of a step: whatever 0.5 is, one of them has the nearest step above it
RATE = 20.0  # [Hz]
SAMPLED = 0.3  # [s]
AT_ONCE = 0.5  # [s] in which `samples` returns
WRONG_RATES = (0.0, -1.0, 1e9, math.nan, math.inf)  # [Hz]
WRONG_FACTORS = (0.0, -0.1, 1.001, 2.0, math.nan, math.inf)  # and half of the smallest


def luminance_is_a_reading(subject: Subject) -> None:
    """Require readings with unit, status and rising times, which can be, and are of the light now."""
    with subject.bench() as bench, bench.checked as meter:
        ended = -math.inf
        for share in SHARES:
            true = bench.show(share, subject.kind)
            reading = meter.read_luminance()
            promised(reading.begun >= ended, "a reading begins before the one before it has ended")
            _require_near(reading.value, true, "cd/m^2")
            ended = reading.ended


def power_is_sampled(subject: Subject) -> None:
    """Require samples in order, which can be, and are of the power now; none is waited for."""
    with subject.bench() as bench, bench.checked as meter:
        for share in SHARES:  # and it can be started again
            true = bench.show(share, subject.kind)
            rate = meter.start(RATE)
            samples = list(meter.samples())
            for _ in range(round(max(SAMPLED, 4 / rate) / SETTLED)):
                time.sleep(SETTLED)
                asked = time.monotonic()
                samples += meter.samples()
                promised(time.monotonic() - asked < AT_ONCE, "samples() waits: return what came, at once")
            samples += meter.stop()
            promised(samples, f"no sample in {max(SAMPLED, 4 / rate):g} s at {rate:g} Hz")
            _require_near(samples[-1].power, true, "W")


def _require_near(value: float, true: float | None, unit: str) -> None:
    """Refuse a value that is not that of the panel."""
    if true is not None:
        near = abs(value - true) <= TOLERANCE * true
        promised(near, f"gave {value:.5g} {unit} where the panel has {true:.5g} {unit}")


def factor_is_the_nearest_step(subject: Subject) -> None:
    """Require that the nearest step is set, returned and reported, and that the light follows."""
    with subject.bench() as bench, bench.checked as backlight:
        smallest, step = backlight.smallest_factor(), backlight.step()
        promised(0 < smallest < 1 and step > 0, "the smallest factor lies between 0 and 1, a step above 0")
        for factor in (*SHARES, *OFF_GRID, *(0.5 + part * step for part in PARTS)):
            if not smallest <= factor <= 1:
                continue
            achieved = backlight.set_factor(factor)
            off = abs(achieved - factor)
            promised(
                off <= step / 2 + 1e-9, f"set to {factor:.6g}, it is {achieved:.6g}, not the nearest step"
            )
            time.sleep(max(backlight.min_interval(), SETTLED))
            reported = backlight.read_factor()
            promised(abs(reported - achieved) <= step, f"set to {achieved:g}, it reports {reported:g}")
            _require_light(bench, achieved)


def _require_light(bench: Bench, factor: float) -> None:
    """Refuse a backlight whose panel is not lit by a factor."""
    if bench.simulation is not None:
        light = bench.simulation.panel.luminance() / 200.0
        promised(abs(light - factor) <= 0.01 * factor, f"set to {factor:g}, it shines with {light:.4g}")


def backlight_is_left_as_found(subject: Subject) -> None:
    """Require that closing puts the backlight back to how it was found."""
    with subject.bench() as bench:
        found = bench.device.read_factor()
        with bench.device as backlight:
            other = 0.5 if found > 0.75 else 1.0
            backlight.set_factor(other)
        time.sleep(SETTLED)
        if subject.emulated:
            _require_light(bench, found)
    if not subject.emulated and not bench.simulation:
        with subject.bench() as again, again.device as backlight:
            left = backlight.read_factor()
            promised(abs(left - found) <= backlight.step(), f"found at {found:g}, and left at {left:g}")


def says_what_it_is(subject: Subject) -> None:
    """Require words of what the meter is."""
    with subject.bench() as bench, bench.checked as meter:
        meter.apparatus()
        promised(bench.device.apparatus(), "apparatus() must return a dictionary of words, got none")


def closed_it_refuses(subject: Subject) -> None:
    """Require that it works in a context, is closed as often as one likes, and then refuses."""
    with subject.bench() as bench:
        with bench.device as device:
            promised(device is bench.device, "its context is not the device itself")
            subject.use(device)
        for _ in range(2):
            device.close()
        refusal(lambda: subject.use(device), "asked when closed", Fault.DISCONNECTED)


def wrong_values_are_refused(subject: Subject) -> None:
    """Require that no rate or factor is taken that the device has not."""
    with subject.bench() as bench, bench.device as device:
        wrong: tuple[float, ...] = WRONG_RATES
        if subject.kind is InstrumentKind.POWER:
            word, ask = "start", device.start
        else:
            word, ask = "set_factor", device.set_factor
            wrong = (*WRONG_FACTORS, device.smallest_factor() / 2)
        for value in wrong:
            refusal(partial(ask, value), f"{word}({value:g})", Fault.REFUSED)


def samples_need_a_start(subject: Subject) -> None:
    """Require an error of samples before `start`."""
    with subject.bench() as bench, bench.device as meter:
        refusal(meter.samples, "samples() before start()", *Fault)
