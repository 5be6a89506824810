"""What our drivers promise where an instrument or its line fails: errors in words, and nothing made up."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from emulators.link import ExtraReply, FaultPlan, LinkFault
from emulators.ours import OURS, LinkKind, open_at

from evenlight.hardware.conformance.devices import SETTLED, use
from evenlight.hardware.conformance.subject import (
    TOLERANCE,
    WARM_WHITE,
    Bench,
    BrokenPromiseError,
    Subject,
    promised,
    refusal,
)
from evenlight.hardware.guarded_devices import GUARDS
from evenlight.hardware.installed_drivers import InstrumentKind
from evenlight.hardware.protocols import TRANSIENT, Fault, InstrumentError
from evenlight.hardware.simulated.panel import SimulatedPanel, Simulation

TIMEOUT = 0.3  # [s] that a reply may take,
LATE = 0.5  # and that of a late one
SHARES = (1.0, 0.3, 0.8, 0.4)  # what the panel shows, so that an old reading is told from a new one
RATE = 20.0  # [Hz]
LONGEST_LAG = 4.0  # [s] after which samples are those of the power now
# The last two are of a setting that was not taken, and of a program that ended for it.
FEWEST_TRIES = 8  # however slow the machine is
PASSING = (*TRANSIENT, Fault.REFUSED, Fault.DISCONNECTED)
ALWAYS = 1_000_000  # replies
DEAD = (Fault.DISCONNECTED, Fault.BUSY, Fault.WRONG_INSTRUMENT, *TRANSIENT)
ABSENT = (Fault.NOT_FOUND, Fault.NO_REPLY, Fault.DISCONNECTED)
LUMINANCE, POWER, BACKLIGHT = InstrumentKind
Breakable = Callable[[], AbstractContextManager[tuple[Any, Callable[[], object]]]]
WORDS: dict[LinkFault | ExtraReply, str] = {
    LinkFault.NO_REPLY: "does not come",
    LinkFault.LATE_REPLY: "comes late",
    LinkFault.PARTIAL_LINE: "breaks off",
    LinkFault.GARBAGE: "is garbage",
    ExtraReply.DOUBLED: "comes twice",
    ExtraReply.MERGED: "runs into another",
    ExtraReply.STRAY_LINE: "is followed by an old one",
}


@dataclass(frozen=True, slots=True)
class LinkedBench(Bench):
    """A device that is open on a link."""

    link: Any = None

    def show(self, share: float) -> float:
        """Change the panel, and return its luminance [cd/m^2] or power [W]."""
        panel = self.panel
        assert panel is not None
        if self.subject.kind is InstrumentKind.LUMINANCE:
            panel.show(share)
            return panel.luminance()
        panel.set_backlight(share)
        time.sleep(SETTLED)
        return panel.power()


@dataclass(frozen=True, slots=True)
class FaultySubject(Subject):
    """A driver of ours on its emulated instrument, whose line may be made to fail."""

    patience: float | None = None  # [s] that a reply may take where none is said

    @property
    def has_line(self) -> bool:
        """Whether that is at the end of a line, which can be made to fail."""
        return OURS[self.kind, self.named.name].link is not LinkKind.OWN

    @contextmanager
    def bench(self, plan: FaultPlan | None = None, timeout: float | None = None) -> Iterator[LinkedBench]:
        """Yield the driver, open; whoever asks closes it.

        Parameters
        ----------
        plan : FaultPlan, optional
            What goes wrong on the line.
        timeout : float, optional
            How long a reply may take [s].
        """
        simulation = warm_white_panel()
        timeout = self.patience if timeout is None else timeout
        with OURS[self.kind, self.named.name].linked(simulation, plan) as link:
            # Unguarded: what is wrong when it is opened is seen as it is.
            device = open_at(self.kind, self.named.name, link.url, time.monotonic, timeout)
            guarded = GUARDS[self.kind](self.named, lambda: device)
            yield LinkedBench(self, guarded, simulation.panel, link=link)

    def use_absent(self) -> object:
        """Open the driver where its emulated instrument was and is no more, and ask it once."""
        with self.bench() as bench:
            bench.device.close()
        with open_at(self.kind, self.named.name, bench.link.url, time.monotonic) as device:
            return use(LinkedBench(self, GUARDS[self.kind](self.named, lambda: device), None))


def warm_white_panel() -> Simulation:
    """Return a panel in real time; its luminance is 200 cd/m^2, and its power 0.2945 + 0.3716 W."""
    panel = SimulatedPanel(WARM_WHITE, time.monotonic)
    panel.show(1.0)
    return Simulation(panel, np.random.default_rng(5), time.monotonic, time.sleep)


def absent_is_named(subject: FaultySubject) -> None:
    """Require an error of an instrument that is not there."""
    error = refusal(subject.use_absent, "opened and asked where nothing is", *ABSENT)
    promised(len(str(error)) > 20, f"says no more than {str(error)!r}")


def dead_line_is_told(subject: FaultySubject) -> None:
    """Require an error where a line is dead from a reply on: while the device is opened, or used."""
    for fault in (LinkFault.DISCONNECT, LinkFault.NO_REPLY, LinkFault.GARBAGE, LinkFault.PARTIAL_LINE):
        for first in (1, 3):
            plan = FaultPlan(fault, first, count=ALWAYS)
            what = f"the line is dead ({fault.value}) from reply {first} on"
            refusal(partial(_use_on_and_on, subject, plan), what, *DEAD)


def _use_on_and_on(subject: FaultySubject, plan: FaultPlan) -> None:
    """Open a device and ask it on and on: a break is noticed at once, or by a question soon after."""
    with subject.bench(plan, TIMEOUT) as bench, bench.device as device:
        if subject.kind is InstrumentKind.POWER:
            device.start(RATE)
        question = {LUMINANCE: "read_luminance", POWER: "samples", BACKLIGHT: "read_factor"}[subject.kind]
        for _ in range(300):
            time.sleep(0.02)
            getattr(device, question)()


def nothing_is_made_up(fault: LinkFault | ExtraReply) -> Callable[[FaultySubject], None]:
    """Return the check that a reply gone wrong makes an error or a true value, and the next a true one."""

    def check(subject: FaultySubject) -> None:
        with subject.bench() as bench, bench.device:
            opened = bench.link.replies()
        for first in dict.fromkeys((1, opened + 1, opened + 2)):
            plan = FaultPlan(fault, first, delay=LATE)
            with _session(subject, plan) as session:
                if session is not None:
                    _watch_until_it_measures(session, f"reply {first} {WORDS[fault]}", fault)

    return check


def _watch_until_it_measures(bench: LinkedBench, what: str, fault: LinkFault | ExtraReply) -> None:
    """Refuse what is not true, until all of some shares, which begin with another each time, came true.

    After what comes besides a reply an error each time will do, for it is no loss of a reply.
    """
    end, shares = time.monotonic() + LONGEST_LAG, SHARES
    for tried in count(1):
        try:
            return _watch[bench.subject.kind](bench, shares, what)
        except InstrumentError as error:
            require_told(error)
            if isinstance(fault, ExtraReply) and tried == len(SHARES):
                return None
            if not isinstance(fault, ExtraReply):
                promised(error.fault in PASSING, f"{what}: the fault is {error.fault.value}: {error}")
                lasts = tried > FEWEST_TRIES and time.monotonic() > end
                promised(not lasts, f"{what}, and it never measures again: {error}")
            shares = (*shares[1:], shares[0])
    return None


@contextmanager
def _session(subject: FaultySubject, plan: FaultPlan) -> Iterator[LinkedBench | None]:
    """Yield a device on a line that goes wrong; None if it cannot be opened for that."""
    with ExitStack() as stack:
        try:
            bench = stack.enter_context(subject.bench(plan, TIMEOUT))
        except InstrumentError as error:
            require_told(error)
            yield None
            return
        try:
            yield bench
        finally:
            with contextlib.suppress(InstrumentError):  # of a backlight that cannot be put back
                bench.device.close()


def _watch_luminance(bench: LinkedBench, shares: Sequence[float], what: str) -> None:
    """Refuse a reading of another luminance than that shown."""
    for share in shares:
        true, value = bench.show(share), bench.checked.read_luminance().value
        promised(abs(value - true) <= TOLERANCE * true, f"{what}: gave {value:.5g} for {true:.5g} cd/m^2")


def _watch_power(bench: LinkedBench, shares: Sequence[float], what: str) -> None:
    """Refuse a power that the panel never had, and at the end one that it has no more."""
    true = [bench.show(share) for share in shares[:2]]
    low, high = min(true) * (1 - TOLERANCE), max(true) * (1 + TOLERANCE)
    bench.checked.start(RATE)
    for share in shares[:2]:
        last, end = bench.show(share), time.monotonic() + LONGEST_LAG
        seen = 0.0
        while abs(seen - last) > TOLERANCE * last:
            promised(time.monotonic() < end, f"{what}: gives {seen:.5g} W on and on for {last:.5g} W")
            time.sleep(SETTLED)
            for sample in bench.checked.samples():
                seen = sample.power
                promised(low <= seen <= high, f"{what}: gave {seen:.5g} W, which never was")


def _watch_backlight(bench: LinkedBench, shares: Sequence[float], what: str) -> None:
    """Refuse a setting that the panel does not have."""
    assert bench.panel is not None
    for share in shares:
        achieved, reported = bench.checked.set_factor(share), bench.checked.read_factor()
        time.sleep(SETTLED)
        light = bench.panel.luminance() / 200.0
        promised(abs(light - achieved) <= 0.01, f"{what}: said {achieved:.4g}, and shines with {light:.4g}")
        same = abs(reported - achieved) <= bench.checked.step()
        promised(same, f"{what}: set {achieved:g}, reports {reported:g}")


_watch: dict[InstrumentKind, Callable[[LinkedBench, Sequence[float], str], None]] = {
    LUMINANCE: _watch_luminance,
    POWER: _watch_power,
    BACKLIGHT: _watch_backlight,
}


def not_restored_is_told(subject: FaultySubject) -> None:
    """Require that a backlight which cannot be put back is told of, and hides no other exception."""

    @contextmanager
    def breakable() -> Iterator[tuple[Any, Callable[[], object]]]:
        with subject.bench(timeout=TIMEOUT) as bench:
            yield bench.device, bench.link.unplug

    require_told_not_restored(breakable)


def require_told_not_restored(breakable: Breakable) -> None:
    """Refuse a backlight that is silent of not being left as found, or hides why.

    Parameters
    ----------
    breakable : callable
        Makes a context of an open backlight, and what makes it impossible to put back.
    """
    with breakable() as (device, break_it):
        device.set_factor(0.5)
        break_it()
        refusal(device.close, "closed when it cannot be put back", *Fault)
        device.close()  # once was enough
        refusal(lambda: device.set_factor(0.5), "asked when closed", Fault.DISCONNECTED)
    for leave in (contextlib.closing, lambda device: device):
        with breakable() as (device, break_it):
            try:
                with leave(device):
                    device.set_factor(0.5)
                    break_it()
                    raise _SomethingElseError
            except _SomethingElseError as error:
                noted = "could not be left as it was found" in " ".join(getattr(error, "__notes__", ()))
                promised(noted, "the exception under way has no note of it")
            except InstrumentError as error:
                raise BrokenPromiseError(f"hides the exception that was under way behind {error}") from error


def require_told(error: InstrumentError) -> None:
    """Refuse an error that says nothing, or more than one line."""
    words = str(error)
    promised(words.strip() and "\n" not in words, f"an error must be one line of words, got {words!r}")


class _SomethingElseError(Exception):
    """What was under way."""
