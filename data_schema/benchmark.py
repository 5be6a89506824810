"""What a benchmark measured: time against error, how cost grows with size, claims held to it."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import check_limits, described, quantity


class Role(enum.Enum):
    """What an approach is among those measured."""

    REFERENCE = "reference"  # the definition, to which the errors are
    DEFAULT = "default"  # what the commands do when nothing else is asked
    VARIANT = "variant"  # ours with one thing changed: an approximation, another number of knots, the GPU
    PEER = "peer"  # another library or the paper's own solver, in the same run
    CITED = "cited"  # a published figure from another machine: never compared as a ratio


@dataclass(frozen=True, slots=True)
class BenchmarkPoint:
    """One approach to one task: how long it takes, and how far it errs. A row of `*_benchmark.csv`.

    Attributes
    ----------
    task : str
        What is done, e.g. "one frame of 1920 x 1080": points of one task may be compared.
    approach : str
        How, in a few words.
    role : Role
        What it is among the others.
    size : int
        Pixels, frames or trials, as `size_of` says.
    size_of : str
        What `size` counts.
    repeats : int
        Timed runs, taken in turn with those of the other approaches; 0 for a cited figure.
    time, time_low, time_high : float
        Median wall time of a run and its quartiles [s].
    processor_time : float or None
        Median processor time of a run, over all threads [s]; at one core not above `time`.
    ratio : float or None
        Median over the repeats of its time to that of the default (of the reference where there is none) in
        the same turn; None for a cited figure.
    error : float or None
        How far it errs, as `error_of` says; None where no error was measured.
    error_of : str
        What the error is, e.g. "largest difference of contrast loss over all factors".
    peak_memory : float or None
        Largest memory of a process that does only this, less that of one that does nothing [MiB].
    note : str
        What should be known beside it.
    """

    task: str = described("what is done; points of one task may be compared")
    approach: str = described("how it is done")
    role: Role = described("reference, default, variant, peer or cited")
    size: int = quantity("1", "pixels, frames or trials, as size_of says", minimum=1)
    size_of: str = described("what size counts")
    repeats: int = quantity("1", "timed runs; 0 for a cited figure", minimum=0)
    time: float = quantity("s", "median wall time of a run", minimum=0.0)
    time_low: float = quantity("s", "lower quartile", minimum=0.0)
    time_high: float = quantity("s", "upper quartile", minimum=0.0)
    processor_time: float | None = quantity("s", "median processor time of a run, all threads", default=None)
    ratio: float | None = quantity("1", "median ratio of its time to the default's", default=None)
    error: float | None = quantity("1", "how far it errs, as error_of says", default=None)
    error_of: str = described("what the error is", default="")
    peak_memory: float | None = quantity(
        "1", "largest memory, less that of an idle process [MiB]", key="peak_memory_mib", default=None
    )
    note: str = described("what should be known beside it", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        if not self.time_low <= self.time <= self.time_high:
            raise ValueError(
                f"need time_low <= time <= time_high, "
                f"got {self.time_low:g}, {self.time:g}, {self.time_high:g}"
            )


@dataclass(frozen=True, slots=True)
class BenchmarkGrowth:
    """How time grows with size, time = c · size^exponent. A row of `*_growth.csv`.

    Attributes
    ----------
    task, approach : str
        As in the points it was fitted to.
    size_of : str
        What the size counts.
    smallest, largest : int
        Sizes between which it was fitted.
    sizes : int
        How many.
    exponent, exponent_low, exponent_high : float
        Slope of log time over log size by least squares, and its 95 % interval; no interval of two sizes.
    """

    task: str = described("what is done")
    approach: str = described("how it is done")
    size_of: str = described("what size counts")
    smallest: int = quantity("1", "smallest size", minimum=1)
    largest: int = quantity("1", "largest size", minimum=1)
    sizes: int = quantity("1", "how many sizes", minimum=2)
    exponent: float = quantity("1", "slope of log time over log size")
    exponent_low: float | None = quantity("1", "lower end of its 95 % interval", default=None)
    exponent_high: float | None = quantity("1", "upper end of it", default=None)

    def __post_init__(self) -> None:
        check_limits(self)


@dataclass(frozen=True, slots=True)
class BenchmarkClaim:
    """A target, and what was measured. A row of `*_claims.csv`.

    Attributes
    ----------
    claim : str
        What is to hold, in words, with its number.
    target : float
        The largest value with which it holds.
    measured : float or None
        What was measured; None where it could not be (`note` says why).
    unit : str
        Of both.
    met : bool or None
        Whether it holds; None where it was not measured.
    note : str
        How it was measured; where it is missed, why.
    """

    claim: str = described("what is to hold")
    target: float = quantity("1", "the largest value with which it holds")
    measured: float | None = quantity("1", "what was measured; empty where it could not be")
    unit: str = described("of both")
    met: bool | None = described("whether it holds; empty where it was not measured")
    note: str = described("how it was measured; where it is missed, why", default="")

    def __post_init__(self) -> None:
        check_limits(self)
        if self.measured is None:
            if self.met is not None or not self.note:
                raise ValueError(f"{self.claim!r} was not measured: it needs a note, and no verdict")
        elif self.met is not (self.measured <= self.target):
            raise ValueError(
                f"{self.claim!r}: {self.measured:g} against {self.target:g}, but met is {self.met}"
            )


@dataclass(frozen=True, slots=True)
class BenchmarkSummary:
    """The machine a benchmark ran on, and what came out. The file `benchmark.json`.

    Attributes
    ----------
    machine : dict of str to str
        Processor, cores, memory, system, graphics.
    quick : bool
        Whether it was a short run, whose figures are rough.
    leads : dict of str to str
        What came out, in a sentence or two, by subject.
    refused : dict of str to str
        What could not be measured here, and why.
    provenance : Provenance
        Software, versions, seed.
    """

    machine: dict[str, str] = described("processor, cores, memory, system, graphics")
    quick: bool = described("true for a short run, whose figures are rough")
    leads: dict[str, str] = described("what came out, by subject")
    refused: dict[str, str] = described("what could not be measured here, and why")
    provenance: Provenance = described("how the files were made")

    def __post_init__(self) -> None:
        check_limits(self)
