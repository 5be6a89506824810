"""The power that a film's dimmed version saves on the device that plays it: its passes, and the saving."""

from __future__ import annotations

from dataclasses import dataclass, field

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity


@dataclass(frozen=True, slots=True)
class DevicePass:
    """One time through a film on a device, a row of `passes.csv`; its samples are in `power.csv`."""

    pass_index: int = quantity("1", "which pass, from 0", minimum=0)
    version: str = described("which version of the film", pattern="^(full|dimmed)$")
    begun: float = quantity("s", "when it counts from: after the settling time, on the computer's clock")
    duration: float = quantity("s", "how long it counts", above=0.0)
    mean_power: float = quantity("W", "mean power of the device over that time, weighted by time", above=0.0)
    n_samples: int = quantity("1", "samples that came in that time", minimum=2)
    n_lost: int = quantity("1", "samples that did not come", minimum=0)
    longest_hold: float = quantity(
        "s", "the longest time for which the meter gave one and the same value", minimum=0.0
    )
    n_wild: int = quantity(
        "1", "samples left out: over 3 times the pass's median, or under a third of it", minimum=0, default=0
    )

    def __post_init__(self) -> None:
        check_limits(self)

    @property
    def used(self) -> bool:
        """Whether it counts: what does not is not recorded."""
        return True


@dataclass(frozen=True, slots=True)
class DeviceSaving:
    """The power that a dimmed version saves of the whole device, `saving.json`.

    Both versions are compared at one and the same time, freed from the device's straight drift; intervals are
    of 95 %, from Student's t over the passes.
    """

    simulated: bool = described("true if the device is simulated")
    instrument: str = described("what measured the power")
    full: str = described("the film at full brightness")
    dimmed: str = described("its dimmed version")
    settle: float = quantity("s", "time at the beginning of each pass that does not count", minimum=0.0)
    passes: tuple[DevicePass, ...] = described("each pass, in order")
    full_power: float = quantity("W", "mean power of the device with the film at full brightness", above=0.0)
    dimmed_power: float = quantity("W", "the same with its dimmed version", above=0.0)
    saving_percent: float = quantity("%", "1 - dimmed/full, freed from drift", key="saving_percent")
    ci_low: float = quantity("%", "lower end of its interval", key="saving_percent_ci_low")
    ci_high: float = quantity("%", "upper end of its interval", key="saving_percent_ci_high")
    degrees_of_freedom: int = quantity("1", "of the interval", minimum=1)
    detectable_percent: float = quantity(
        "%", "saving that such a measurement tells from none four times in five", minimum=0.0
    )
    drift_percent_h: float = quantity("%", "rise of the power of one and the same version, per hour")
    notes: tuple[str, ...] = described("what a reader should be warned of", default=())
    apparatus: dict[str, str] = field(
        default_factory=dict, metadata={"doc": "what the instrument says of itself"}
    )
    provenance: Provenance = described("how the file was made", default=Provenance())

    def __post_init__(self) -> None:
        check_limits(self)
