"""What is seen of a band at all brightness factors where a pixel's critical factor does not tell.

It does not where visibility is a matter of degree (soft, suprathreshold), nor where sensitivity falls with
luminance. Let ρ be a pixel's contrast over its threshold at a reference factor b₀. At another factor b, with
the approximation of `critical_factor`, it is ρ · s(b · L_a) / s(b₀ · L_a): it depends on two numbers of the
pixel, log ρ and log L_a. A histogram has cells of both, and each cell counts f(ρ) at each factor, with f the
step at 1, the probability of detection, or the share above threshold (weighed by contrast). Logarithms are to
base 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel, LossForm, Visibility
from evenlight.method.contrast.critical_factor import (
    FAINTEST_DETECTED,
    BandTable,
)
from evenlight.method.contrast.detection import detection_probability, share_above_threshold
from evenlight.method.contrast.one_pass import (
    BLOCK,
    ContrastTables,
    Masking,
    compiled,
    contrast_row,
    exp2,
    expand_row,
    threshold_row,
)

_WITHIN_CELL = 16  # points at which f is averaged over a cell
_CERTAIN = 1.25  # log2 ρ above which 1 - p < 1e-6
_ALL_SHOWN = 10.0  # log2 ρ above which the threshold takes less than 1e-3 of the contrast
_NEVER = np.float32(-150.0)  # log2 r below which `contrast_row` marks what is not to be counted


class Resolution(NamedTuple):
    """How finely a band is counted."""

    references: int  # factors at which neighbours are compared
    cells: int  # of ρ, in an octave
    lights: int  # cells of L_a, in an octave


# Of bands with many pixels, and of those where each one shows; steps show the cells, what is soft hides them.
SOFT, SOFT_FEW = Resolution(1, 32, 16), Resolution(2, 64, 16)
SHOWN, SHOWN_FEW = Resolution(1, 16, 16), Resolution(2, 32, 32)
STEP, STEP_FEW = Resolution(1, 256, 32), Resolution(1024, 512, 64)  # each knot its own reference


@dataclass(frozen=True, slots=True)
class Response:
    """What the cells of a histogram taken at one reference factor count at the knots that it serves."""

    log_reference: np.float32  # b at which the histogram is taken
    served: slice  # of the knots
    resolution: Resolution
    lowest: float  # log ρ at which the cells begin; below, nothing counts
    darkest: float  # log L_a at which they begin
    shape: tuple[int, int]  # cells of L_a, cells of ρ (the first below all, the last above)
    profile: Array  # f, averaged over cells that begin at equal steps of log ρ
    # (L_a, knots): where the cells of a luminance begin in the profile, and what light their contrast keeps
    position: Array
    kept: Array

    def seen(self, counts: Array) -> Array:
        """Return what all cells count at each knot that is served."""
        found = np.zeros(self.position.shape[1])
        _add_seen(counts.reshape(self.shape), self.profile, self.position, self.kept, found)
        return found


class SeenContrast:
    """What is seen of a band, for one model and one set of knots.

    Parameters
    ----------
    band : BandTable
        Its sensitivity.
    model : ContrastModel
        What counts as seen.
    log_factors : array, (K,)
        log2 of the knots b, rising to 0.
    """

    def __init__(self, band: BandTable, model: ContrastModel, log_factors: Array) -> None:
        self._band, self._log_factors, self._epsilon = band, log_factors, model.epsilon
        self._counted, self._responses = counted_as(model), dict[bool, list[Response]]()

    def responses(self, few: bool) -> list[Response]:
        """Return the response at each reference factor, for a band of few pixels or of many."""
        if few not in self._responses:
            resolution = self._counted.few if few else self._counted.many
            parts = np.array_split(np.arange(len(self._log_factors)), resolution.references)
            served = [slice(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]
            self._responses[few] = [self._response(knots, resolution) for knots in served]
        return self._responses[few]

    def _response(self, served: slice, resolution: Resolution) -> Response:
        (low, high), (_, cells, lights) = self._band.log_luminance_range, resolution
        log_reference = float(np.mean(self._log_factors[[served.start, served.stop - 1]]))
        n_lights = int(np.ceil((high - low + self._log_factors[0]) * lights)) + 1
        darkest = high - n_lights / lights
        log_L = darkest + (np.arange(n_lights) + 0.5)[:, None] / lights
        log_e = log_L + self._log_factors[served]
        shift = self._log_s(log_e) - self._log_s(log_L + log_reference)
        least, most = float(shift.min()), float(shift.max())
        lowest = self._counted.faintest - most
        n = int(np.ceil((self._counted.surest - least - lowest) * cells)) + 1
        begins = lowest + least + np.arange(n + int((most - least) * cells) + 3) / cells
        within = (np.arange(_WITHIN_CELL) + 0.5) / _WITHIN_CELL / cells
        e = np.exp2(log_e)
        kept = e / (e + self._band.reflected_luminance + self._epsilon)
        return Response(
            log_reference=np.float32(log_reference),
            served=served,
            resolution=resolution,
            lowest=lowest,
            darkest=darkest,
            shape=(n_lights, n + 1),
            profile=self._counted.of(np.exp2(begins[:, None] + within)).mean(axis=1),
            position=(shift - least) * cells,
            kept=kept if self._counted.weighs else np.ones_like(e),
        )

    def _log_s(self, log_e: Array) -> Array:
        table = self._band.log_sensitivity
        return np.interp(log_e, np.linspace(*self._band.log_luminance_range, len(table)), table)


@dataclass(frozen=True, slots=True)
class Counted:
    """What a contrast ρ counts, and how finely it is to be told."""

    of: Callable[[Array], NDArray[np.float64]]  # f(ρ)
    faintest: float  # log ρ from which on it counts at all
    surest: float  # log ρ from which on it counts as much as it can
    weighs: bool  # whether it is a share of the contrast itself
    many: Resolution
    few: Resolution


def counted_as(model: ContrastModel) -> Counted:
    """Return what contrast counts in a model."""
    if model.loss is LossForm.SUPRATHRESHOLD:
        return Counted(share_above_threshold, 0.0, _ALL_SHOWN, True, SHOWN, SHOWN_FEW)
    if model.visibility is Visibility.SOFT:
        return Counted(detection_probability, FAINTEST_DETECTED, _CERTAIN, False, SOFT, SOFT_FEW)
    return Counted(lambda rho: (rho > 1).astype(np.float64), 0.0, 0.0, False, STEP, STEP_FEW)


class CellTables(NamedTuple):
    """What a row of contrast needs to be counted in cells; all logarithms are to base 2."""

    lowest: Any  # log ρ and log L_a where the cells begin
    darkest: Any
    resolution: Resolution
    weighs: Any  # whether a pixel counts its contrast r, at most 1, rather than 1
    positive_only: Any  # whether negative contrast does not count
    lights: Any  # cells of L_a
    counts: Any  # (L_a times ρ,): the histogram

    @classmethod
    def of(cls, response: Response, model: ContrastModel) -> CellTables:
        """Return the tables of an empty histogram."""
        weighs = model.loss is LossForm.SUPRATHRESHOLD
        return cls(
            lowest=np.float32(response.lowest),
            darkest=np.float32(response.darkest),
            resolution=response.resolution,
            weighs=weighs,
            positive_only=model.visibility is Visibility.POSITIVE_ONLY,
            lights=response.shape[0],
            counts=np.zeros(response.shape[0] * response.shape[1], np.float64 if weighs else np.int32),
        )


@compiled
def count_cells(
    fine: Any, coarse: Any, adaptation: Any, tables: tuple[ContrastTables, CellTables, Masking]
) -> None:
    """Add a band's pixels to the histogram; levels and tables as of `one_pass.count_band`."""
    to_contrast, to_cells, masking = tables
    height, width = fine.shape
    whole = -(-width // BLOCK) * BLOCK  # rows are filled up without contrast
    rows = np.zeros(
        (4, 5, whole), np.float32
    )  # log r, log L_a, log |C|, sums of |C|^0.2: the last five of each
    power, image = np.zeros(whole + 4, np.float32), np.ones((4, whole), np.float32)
    here, low, seen, x = image[0], image[1], image[2], image[3]
    cells, between = np.empty(whole, np.int32), np.empty(coarse.shape[1] + 2, np.float32)
    columns = np.ones(whole, np.float32)
    for j in range(width):
        columns[j] = 1 / (min(j + 2, width - 1) - max(j - 2, 0) + 1)
    for i in range(height + 2):
        new, ready = i % 5, (i - 2) % 5
        if i < height:
            for j in range(width):
                here[j] = fine[i, j]
            expand_row(coarse, i, height, between, low[:width])
            expand_row(adaptation, i, height, between, seen[:width])
            filled = rows[0, new], rows[1, new], rows[2, new], rows[3, new], power, cells
            contrast_row(here, low, seen, to_contrast, filled)
        else:
            rows[3, new] = 0
        if i >= 2:
            per_row = np.float32(1 / (min(i, height - 1) - max(i - 4, 0) + 1))
            threshold_row(rows[2, ready], rows[3], columns, (per_row, masking, to_cells.lowest), x)
            _count_row(rows[0, ready], rows[1, ready], rows[2, ready], (x, cells), to_cells)


@compiled
def _count_row(log_ratio: Any, log_light: Any, log_contrast: Any, scratch: Any, to: CellTables) -> None:
    """Add a row of pixels to the histogram; `scratch` brings log2 T, and is written to."""
    x, cells = scratch
    n = to.counts.size // to.lights
    last, brightest = np.float32(n - 1), np.float32(to.lights - 1)
    for j in range(x.size):
        cell = (log_contrast[j] - x[j] - to.lowest) * np.float32(to.resolution.cells) + np.float32(1)
        light = (log_light[j] - to.darkest) * np.float32(to.resolution.lights)
        cells[j] = np.int32(min(max(light, np.float32(0)), brightest)) * np.int32(n)
        cells[j] += np.int32(min(max(cell, np.float32(0)), last))
    if to.positive_only:
        for j in range(x.size):
            if log_ratio[j] < _NEVER:
                cells[j] = 0
    if to.weighs:
        for j in range(x.size):
            x[j] = exp2(min(log_ratio[j], np.float32(0)))
        for j in range(x.size):
            to.counts[np.uint32(cells[j])] += x[j]
    else:
        for j in range(x.size):
            to.counts[np.uint32(cells[j])] += 1


@compiled
def _add_seen(counts: Any, profile: Any, position: Any, kept: Any, found: Any) -> None:
    """Add to `found` what the cells of each luminance count at each knot."""
    n, knots = counts.shape[1] - 1, found.size
    at = np.empty(profile.size - n + 1)
    for i in range(counts.shape[0]):
        if counts[i, 1:].sum() == 0:
            continue
        begin = int(position[i].min())
        end = int(position[i].max()) + 2
        at[begin:end] = 0
        for j in range(n):
            count = counts[i, j + 1]
            if count != 0:
                for m in range(begin, end):
                    at[m] += count * profile[j + m]
        for k in range(knots):
            m = int(position[i, k])
            part = position[i, k] - m
            found[k] += kept[i, k] * (at[m] + part * (at[m + 1] - at[m]))
