"""The processor's energy counters under Linux (RAPL, powercap): power as energy over time.

They count the package, its cores or, as `psys`, the whole computer as far as its maker connected it; not
the panel. They go round at `max_energy_range_uj`; since 2020 (PLATYPUS, CVE-2020-8694) only root reads them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from evenlight.hardware.drivers.hwmon_power import SYS, read_number, read_text
from evenlight.hardware.drivers.power_sampling import PolledMeter
from evenlight.hardware.plausibility import require_power
from evenlight.hardware.protocols import Fault, InstrumentError

DOMAINS = "class/powercap"  # under /sys
DEFAULT = "package-0"
MMIO = "intel-rapl-mmio"  # the same package, seen another way
RATES = (0.05, 20.0)  # [Hz] the counter is renewed about every millisecond, so 20 Hz are good to 2 %
MOST_POWER = 2000.0  # [W] of any domain: how long a counter takes to go round at least
COUNTER, RANGE = "energy_uj", "max_energy_range_uj"


class RaplPowerMeter(PolledMeter):
    """A domain of RAPL; each sample is the mean since the one before, on the computer's clock.

    Parameters
    ----------
    url : str
        The domain's name ("package-0", "psys"), or its folder; empty for package-0.
    clock : callable, optional
        The computer's clock [s].
    timeout : float, optional
        Not needed: a file is there or not.
    root : Path, optional
        Where Linux shows its devices.

    Raises
    ------
    InstrumentError
        If there is no such domain, or it may not be read.
    """

    def __init__(
        self,
        url: str,
        clock: Callable[[], float] = time.monotonic,
        timeout: float | None = None,
        root: Path = SYS,
    ) -> None:
        self._folder = find_domain(url, root)
        super().__init__(str(self._folder), clock, RATES)
        self._range = read_number(self._folder / RANGE)  # [µJ]
        self._before = self._read_counter()

    def start(self, rate: float) -> float:
        """Begin to sample at a rate [Hz], and return it; the first sample is there a period later.

        Raises
        ------
        InstrumentError
            If the counter is not renewed that often.
        """
        achieved = super().start(rate)
        self._before = self._read_counter()
        self._sampling.is_due(self._clock())  # the first is due: it would be of no time
        return achieved

    def apparatus(self) -> dict[str, str]:
        """Return what it is."""
        name = read_text(self._folder / "name")
        return {
            "power_meter": f"RAPL, domain {name}: what the processor's counters see, not the panel",
            "power_meter_files": str(self._folder / COUNTER),
        }

    def _read_power(self) -> float:
        """Return the mean power since the counter was last read [W]."""
        (begun, energy), (ended, now) = self._before, self._read_counter()
        self._before = ended, now
        if (ended - begun) * MOST_POWER * 1e6 > self._range:
            raise InstrumentError(
                f"{self._name}: {ended - begun:.0f} s since it was last read, in which the counter may have "
                "gone round more than once",
                Fault.NO_REPLY,
            )
        spent = now - energy if now >= energy else now - energy + self._range
        if spent == 0 or ended <= begun:
            raise InstrumentError(
                f"{self._name}: the counter stands still; it counts nothing", Fault.NO_REPLY
            )
        power = spent * 1e-6 / (ended - begun)
        try:
            require_power("rapl", self._name, power)
        except InstrumentError:  # which of the two was wrong is not known: begin anew
            self._before = self._read_counter()
            raise
        return power

    def _read_counter(self) -> tuple[float, float]:
        """Return when the counter was read [s], and what it said [µJ]."""
        sent = self._clock()
        try:
            energy = read_number(self._folder / COUNTER)
        except InstrumentError as error:
            if error.code != "EACCES":
                raise
            path = self._folder / COUNTER
            raise InstrumentError(
                f"{path}: only root may read it since 2020; until the next start of the computer: sudo chmod "
                f"a+r {path}",
                Fault.NOT_FOUND,
                error.code,
            ) from None
        if not 0 <= energy <= self._range:
            raise InstrumentError(
                f"{self._name}: the counter says {energy:g} µJ; its range ends at {self._range:g}",
                Fault.IMPLAUSIBLE,
            )
        return (sent + self._clock()) / 2, energy

    def _why_no_faster(self) -> str:
        """Return what explains the highest rate."""
        return " (faster, the steps of its counter show)"


def find_domain(place: str, root: Path = SYS) -> Path:
    """Return the folder of a domain.

    Raises
    ------
    InstrumentError
        If there is no such one, or several packages have one of the name.
    """
    if "/" in place and Path(place).is_dir():
        return Path(place)
    wanted, found = place or DEFAULT, domains(root)
    chosen = [folder for folder in found if wanted in (folder.name, read_text(folder / "name"))]
    chosen = [folder for folder in chosen if not folder.name.startswith(MMIO)] or chosen
    if len(chosen) == 1:
        return chosen[0]
    names = ", ".join(f"{read_text(folder / 'name')} ({folder.name})" for folder in chosen or found)
    if chosen:
        raise InstrumentError(f"rapl:{wanted}: there are several: {names}; give what stands in parentheses")
    raise InstrumentError(
        f"rapl:{wanted}: no such domain of RAPL under {root / DOMAINS}; there is "
        f"{names or 'none: a processor without it, or a virtual machine'}",
        Fault.NOT_FOUND,
    )


def domains(root: Path = SYS) -> list[Path]:
    """Return the folders of all domains that count energy."""
    return [path.parent for path in sorted((root / DOMAINS).glob(f"intel-rapl*/{COUNTER}"))]
