"""What a benchmark measured: time against error, how cost grows with size, claims held to it."""

from __future__ import annotations

import enum

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import count, described, quantity, record


class Role(enum.Enum):
    """What an approach is among those measured."""

    REFERENCE = "reference"  # the definition, to which the errors are
    DEFAULT = "default"  # what the commands do when nothing else is asked
    VARIANT = "variant"  # ours with one thing changed: an approximation, another number of knots, the GPU
    PEER = "peer"  # another library or the paper's own solver, in the same run
    CITED = "cited"  # a published figure from another machine: never compared as a ratio


@record
class BenchmarkPoint:
    """One approach to one task: how long it takes, and how far it errs. A row of `*_benchmark.csv`."""

    task: str = described("what is done, e.g. one frame of 1920 x 1080; points of one task may be compared")
    approach: str = described("how it is done")
    role: Role = described("what it is among the others: reference, default, variant, peer or cited")
    size: int = count("pixels, frames or trials, as size_of says", minimum=1)
    size_of: str = described("what size counts")
    repeats: int = count("timed runs, in turn with the other approaches; 0 for a cited figure")
    time: float = quantity("s", "median wall time of a run", minimum=0.0)
    time_low: float = quantity("s", "lower quartile of the wall times", minimum=0.0)
    time_high: float = quantity("s", "upper quartile of the wall times", minimum=0.0)
    processor_time: float | None = quantity(
        "s", "median processor time of a run, over all threads", default=None
    )
    ratio: float | None = quantity(
        "1",
        "median ratio of its time to the default's in the same turn (the reference's without "
        "a default); empty for a cited figure",
        default=None,
    )
    error: float | None = quantity(
        "1", "how far it errs, as error_of says; empty if not measured", default=None
    )
    error_of: str = described(
        "what the error is, e.g. largest difference of contrast loss over all factors", default=""
    )
    peak_memory: float | None = quantity(
        "MiB",
        "largest memory of a process that does only this, less that of an idle one",
        key="peak_memory_mib",
        default=None,
    )
    note: str = described("what should be known beside it", default="")

    def __post_init__(self) -> None:
        if not self.time_low <= self.time <= self.time_high:
            raise ValueError(
                f"need time_low <= time <= time_high, "
                f"got {self.time_low:g}, {self.time:g}, {self.time_high:g}"
            )


@record
class BenchmarkGrowth:
    """How time grows with size, time = c · size^exponent. A row of `*_growth.csv`."""

    task: str = described("what is done")
    approach: str = described("how it is done")
    size_of: str = described("what size counts")
    smallest: int = count("smallest size of the fit", minimum=1)
    largest: int = count("largest size of the fit", minimum=1)
    sizes: int = count("number of sizes fitted", minimum=2)
    exponent: float = quantity("1", "slope of log time over log size, by least squares")
    exponent_low: float | None = quantity(
        "1", "lower end of its 95 % confidence interval; empty with two sizes", default=None
    )
    exponent_high: float | None = quantity(
        "1", "upper end of its 95 % confidence interval; empty with two sizes", default=None
    )


@record
class BenchmarkClaim:
    """A target, and what was measured. A row of `*_claims.csv`."""

    claim: str = described("what is to hold, in words, with its number")
    target: float = quantity("1", "largest value with which it holds")
    measured: float | None = quantity("1", "what was measured; empty if it could not be, and note says why")
    unit: str = described("unit of target and measured")
    met: bool | None = described("whether it holds; empty where it was not measured")
    note: str = described("how it was measured; where it is missed, why", default="")

    def __post_init__(self) -> None:
        if self.measured is None:
            if self.met is not None or not self.note:
                raise ValueError(f"{self.claim!r} was not measured: it needs a note, and no verdict")
        elif self.met is not (self.measured <= self.target):
            raise ValueError(
                f"{self.claim!r}: {self.measured:g} against {self.target:g}, but met is {self.met}"
            )


@record
class BenchmarkSummary:
    """The machine a benchmark ran on, and what came out. The file `benchmark.json`."""

    machine: dict[str, str] = described("processor, cores, memory, system, graphics")
    quick: bool = described("true for a short run, whose figures are rough")
    leads: dict[str, str] = described("what came out, by subject")
    refused: dict[str, str] = described("what could not be measured here, and why")
    provenance: Provenance = described("how the files were made")
