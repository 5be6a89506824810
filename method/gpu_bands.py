"""How the bands of a frame lie in the buffers of `method/shaders/count.glsl`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.method.band_shares import FEW_PIXELS
from evenlight.method.critical_factor import BandTable, threshold_table
from evenlight.method.gpu_pyramid import SUM_WORDS

TILE = 28  # pixels across and down that a group counts

_RECORD = np.dtype(
    [(name, np.int32) for name in ("width", "height", "fine_at", "coarse_at", "coarser_at", "first_group")]
    + [(name, np.int32) for name in ("tiles_across", "tiles", "first_reference", "counts_at", "tables_at")]
    + [(name, np.float32) for name in ("log_darkest", "per_log_luminance")]
    + [(name, np.float32) for name in ("log_faintest", "per_log_sensitivity")]
)


@dataclass(frozen=True, slots=True)
class Request:
    """At how many factors pixels are counted.

    Attributes
    ----------
    lowest_factor : float
        Smallest brightness factor that will be asked for, above 0.
    knots : int
        At how many factors, the last of which is 1.
    references : int
        At how many factors neighbours are compared in bands of few pixels; in others, at one.
    equal_ratios : bool
        Whether the factors are in equal ratios.
    """

    lowest_factor: float
    knots: int
    references: int
    equal_ratios: bool


@dataclass(frozen=True, slots=True)
class BandPlace:
    """One band, and where its counts lie.

    Attributes
    ----------
    pixels : int
        Of the band.
    references : int
        At how many factors its neighbours are compared.
    counts_at : int
        Where its counts begin among the words of the results, one for each knot of each reference.
    groups : int
        How many groups count it.
    """

    pixels: int
    references: int
    counts_at: int
    groups: int


@dataclass(frozen=True, slots=True)
class BandLayout:
    """Where everything lies.

    Attributes
    ----------
    places : tuple of BandPlace
        The bands, finest first.
    records : bytes
        What the shader reads of each band, one after the other.
    tables : array of float32
        The thresholds, then the sensitivities and luminances of each band.
    steps : (int, int, int)
        Of the table of thresholds, and of a band's two tables.
    words : int
        Of the results: the sums, then the counts.
    """

    places: tuple[BandPlace, ...]
    records: bytes
    tables: NDArray[np.float32]
    steps: tuple[int, int, int]
    words: int

    @property
    def groups(self) -> int:
        """How many groups count all bands."""
        return sum(place.groups for place in self.places)


def band_layout(
    shapes: Sequence[tuple[int, int]], begins: Sequence[int], seen: Mapping[int, BandTable], request: Request
) -> BandLayout:
    """Return where the bands lie.

    Parameters
    ----------
    shapes : sequence of (height, width)
        Of the levels of the pyramid.
    begins : sequence of int
        Where each level begins in its buffer.
    seen : mapping of int to BandTable
        The bands in which contrast can be visible, by their level.
    request : Request
        What is counted.
    """
    tables: list[NDArray[np.float32]] = [threshold_table()]
    records, places, words, groups = np.zeros(len(seen), _RECORD), [], SUM_WORDS, 0
    for number, (level, table) in enumerate(seen.items()):
        height, width = shapes[level]
        few = height * width <= FEW_PIXELS
        references = request.references if few else 1
        across, down = -(-width // TILE), -(-height // TILE)
        split = groups, across, across * down
        starts = few, words, sum(part.size for part in tables)
        records[number] = width, height, *begins[level : level + 3], *split, *starts, *_ranges(table)
        places.append(BandPlace(height * width, references, words, across * down * references))
        tables += [table.log_sensitivity, table.log_luminance]
        words += references * request.knots
        groups += across * down * references
    thresholds, sensitivities, luminances = ([part.size for part in tables] + [2, 2])[
        :3
    ]  # 2: no band is seen
    steps = thresholds, sensitivities, luminances
    return BandLayout(tuple(places), records.tobytes(), np.concatenate(tables), steps, words)


def _ranges(table: BandTable) -> tuple[float, float, float, float]:
    """Return where each table of a band begins, and one over how far it reaches."""
    (dark, bright), (low, high) = table.log_luminance_range, table.log_sensitivity_range
    return dark, 1 / (bright - dark), low, 1 / (high - low)
