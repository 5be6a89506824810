"""Promises of all devices, and of backlights: settings, refusals, and how they are closed."""

from __future__ import annotations

import math
from functools import partial

from evenlight.hardware.conformance.subject import Bench, promised, refusal
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import Fault

SETTLED = 0.05  # [s] ten times the lag of the simulated panel's light
FACTORS = (1.0, 0.5, 0.7133, 0.3217)  # the last lie on no step of a usual size,
PARTS = (0.3, 0.7)  # of a step: whatever 0.5 is, one of them has the nearest step above it
WRONG_RATES = (0.0, -1.0, 1e9, math.nan, math.inf)  # [Hz]
WRONG_FACTORS = (0.0, -0.1, 1.001, 2.0, math.nan, math.inf)  # and half of the smallest


def samples_need_a_start(bench: Bench) -> None:
    """Have no samples before it is started."""
    refusal(bench.device.samples, "samples() before start()", *Fault)


def wrong_rates_are_refused(bench: Bench) -> None:
    """Refuse rates that it does not have."""
    for rate in WRONG_RATES:
        refusal(partial(bench.device.start, rate), f"start({rate:g})", Fault.REFUSED)


def wrong_factors_are_refused(bench: Bench) -> None:
    """Refuse factors that it does not have."""
    for factor in (*WRONG_FACTORS, bench.device.smallest_factor() / 2):
        refusal(partial(bench.device.set_factor, factor), f"set_factor({factor:g})", Fault.REFUSED)


def factor_is_the_nearest_step(bench: Bench) -> None:
    """Set the nearest step, report it, and let the light follow."""
    backlight = bench.checked
    smallest, step = backlight.smallest_factor(), backlight.step()
    promised(0 < smallest < 1 and step > 0, "the smallest factor lies between 0 and 1, a step above 0")
    for factor in (*FACTORS, *(0.5 + part * step for part in PARTS)):
        if smallest <= factor <= 1:
            achieved = backlight.set_factor(factor)
            nearest = abs(achieved - factor) <= step / 2 + 1e-9
            promised(nearest, f"set to {factor:.6g}, it is {achieved:.6g}, not the nearest step")
            bench.wait(max(backlight.min_interval(), SETTLED))
            reported = backlight.read_factor()
            promised(abs(reported - achieved) <= step, f"set to {achieved:g}, it reports {reported:g}")
            _require_light(bench, achieved)


def backlight_is_left_as_found(bench: Bench) -> None:
    """Leave the backlight as it was found."""
    found = bench.device.read_factor()
    with bench.device as backlight:
        backlight.set_factor(0.5 if found > 0.75 else 1.0)
    bench.wait(SETTLED)
    _require_light(bench, found)
    if not bench.subject.simulated:
        with bench.subject.bench() as again:
            left, step = again.device.read_factor(), again.device.step()
            promised(abs(left - found) <= step, f"found at {found:g}, and left at {left:g}")


def _require_light(bench: Bench, factor: float) -> None:
    if panel := bench.exact:
        light = panel.luminance() / panel.physics.peak_luminance
        promised(abs(light - factor) <= 0.01 * factor, f"set to {factor:g}, it shines with {light:.4g}")


def meter_says_what_it_is(bench: Bench) -> None:
    """Say what it is."""
    bench.checked.apparatus()
    promised(bench.device.apparatus(), "apparatus() must return a dictionary of words, got none")
    has = (hasattr(bench.device, "zero"), hasattr(bench.device, "before_zero"))
    promised(has[0] == has[1], "zero and before_zero come together")


def closed_it_refuses(bench: Bench) -> None:
    """Be closed as often as one likes, and then refuse."""
    with bench.device as device:
        promised(device is bench.device, "its context is not the device itself")
        use(bench)
    for _ in range(2):
        device.close()
    refusal(partial(use, bench), "asked when closed", Fault.DISCONNECTED)


def use(bench: Bench) -> object:
    """Ask a device once what its kind is for."""
    if bench.subject.kind is InstrumentKind.LUMINANCE:
        return bench.device.read_luminance()
    power = bench.subject.kind is InstrumentKind.POWER
    return bench.device.start(20.0) if power else bench.device.set_factor(0.5)
