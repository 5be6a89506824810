"""Taking what an instrument sees now for its zero: the sensor covered, or the panel unplugged."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from evenlight.data_schema.errors import InputError
from evenlight.hardware.driver_table import named_driver
from evenlight.hardware.measuring import Tell, bench_for, introduce
from evenlight.hardware.protocols import LuminanceMeter, PowerMeter, ZeroedMeter
from evenlight.hardware.rig import (
    LUMINANCE_METERS,
    POWER_METERS,
    is_simulated,
    open_luminance_meter,
    open_power_meter,
)
from evenlight.hardware.simulated_panel import PanelPhysics

METERS = {**LUMINANCE_METERS, **POWER_METERS}
OFF = PanelPhysics(peak_luminance=0.0, black_level=0.0, base_power=0.0, power_per_luminance=0.0)


def measure_zero(name: str, ask: Callable[[str], str] | None, tell: Tell) -> str:
    """Set the zero of an instrument, and return the closing line.

    Parameters
    ----------
    name : str
        The instrument.
    ask : callable or None
        Shows a question, and returns the line that was typed once all is ready; None where it is already.
    tell : callable
        Shows a line.

    Raises
    ------
    InputError
        If there is no such instrument, it has no zero to set, or nobody answers.
    InstrumentError
        If it is not there, or refuses.
    """
    before = _what_comes_before(name)
    if ask is not None:
        try:
            ask(f"{name}: {before}, then press Enter: ")
        except EOFError:
            raise InputError("nobody has pressed Enter; where all is ready, give --yes") from None
    with _opened(name) as meter:
        introduce(meter.apparatus(), tell)
        found = cast("ZeroedMeter", meter).zero()
    what = "" if found is None else f"; it was {found * 1e3:.3g} mA"
    return f"{'SIMULATED: ' if is_simulated(name) else ''}zero set{what}"


def _what_comes_before(name: str) -> str:
    """Return what has to be done before the zero of an instrument is set; refuse one that has none."""
    driver = named_driver(name, METERS, "luminance or power meter").driver.load()
    if not hasattr(driver, "zero"):
        having = ", ".join(each for each in METERS if hasattr(METERS[each].load(), "zero"))
        raise InputError(f"{name}: has no zero that is set by command; these have: {having}")
    return str(driver.before_zero)


def _opened(name: str) -> LuminanceMeter | PowerMeter:
    """Return a meter, open; a simulated one looks at a panel that is off."""
    bench = bench_for(name, OFF)
    if named_driver(name, METERS, "luminance or power meter").name in POWER_METERS:
        return open_power_meter(name, bench.clock, bench.simulation)
    return open_luminance_meter(name, bench.clock, bench.simulation)
