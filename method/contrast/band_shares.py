"""The share of visible pixels of a band at all brightness factors, of a histogram.

Of critical factors, where each pixel has one: its running sum; otherwise what `contrast_histogram` gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import (
    ContrastModel,
    LossForm,
    MaskingNeighbourhood,
    SensitivityModel,
    Visibility,
)
from evenlight.method.contrast.contrast_histogram import CellTables, Response, SeenContrast, count_cells
from evenlight.method.contrast.critical_factor import BandTable
from evenlight.method.contrast.csf import LOWEST_LUMINANCE
from evenlight.method.contrast.one_pass import (
    ContrastTables,
    FactorTables,
    Masking,
    compiled,
    count_band,
    expanded,
)

# In a band of few pixels each one shows in the loss. Such a band is cheap: it is counted several times, with
# neighbours compared at several factors (see `critical_factor`), and each count serves the factors nearby.
FEW_PIXELS = 16384
REFERENCES = 8
_CELLS = 4096  # of the histogram of critical factors, at least; equal steps of log b


class BandShares:
    """The counting of visible pixels in the bands of a frame, for one model and one set of knots.

    Parameters
    ----------
    model : ContrastModel
        Choices of the contrast model.
    factors : array, (K,)
        Knots b, rising to 1.
    bands : sequence of BandTable
        Their sensitivities, finest first.

    Attributes
    ----------
    log_factors : array, (F,)
        log2 of the factors at which is counted: all ends of cells where pixels have critical factors in all
        bands, else the knots.
    """

    def __init__(self, model: ContrastModel, factors: Array, bands: Sequence[BandTable]) -> None:
        self._model, self._bands = model, bands
        # A multiple, so that knots in equal ratios lie between cells, and no pixel is counted in part.
        self._n_cells = -(-_CELLS // (len(factors) - 1)) * (len(factors) - 1)
        whole = model.visibility is not Visibility.SOFT and model.loss is not LossForm.SUPRATHRESHOLD
        self._log_knots = self.log_factors = np.log2(factors)
        if whole and all(band.rises for band in bands):
            self.log_factors = np.linspace(self.log_factors[0], 0.0, self._n_cells + 1)
        self._seen = [
            None if whole and band.rises else SeenContrast(band, model, self.log_factors) for band in bands
        ]

    def of(self, fine: Any, coarse: Any, coarser: Any, number: int) -> Array:
        """Return what the pixels of a band count at each factor, (F,); 0 where nothing can be seen.

        Parameters
        ----------
        fine, coarse, coarser : array
            Gaussian levels l, l + 1 and l + 2 of emitted luminance, for band l.
        number : int
            Of the band, l.
        """
        band, seen = self._bands[number], self._seen[number]
        if not band.can_be_seen:
            return np.zeros(len(self.log_factors))
        around = expanded(coarser, *coarse.shape)
        levels, to_contrast = (fine, coarse, around), contrast_tables(band, self._model, (fine, around))
        masks_itself = self._model.masking is MaskingNeighbourhood.WITH_CENTRE
        masking = masks_itself, np.float32(self._model.masking_strength)
        few = fine.size <= FEW_PIXELS
        if seen is None:
            way = 1 - self.log_factors / self.log_factors[0]  # of log b from the lowest factor to 1
            visible, tables = np.empty(len(way)), (to_contrast, self._factor_tables(band), masking)
            _count_at_references(levels, tables, REFERENCES if few else 1, way * self._n_cells, visible)
        else:
            visible = self._by_contrast(seen.responses(few), levels, (to_contrast, masking))
        return np.asarray(visible / fine.size)

    def at_knots(self, counted: Array, number: int) -> Array:
        """Return what a band's pixels count at each knot, (K,), from the same at each factor, (F,)."""
        at_knots: Array = np.interp(self._log_knots, self.log_factors, counted)
        # Where two counts meet, a pixel may seem to vanish again as b grows.
        return np.asarray(np.maximum.accumulate(at_knots)) if self._bands[number].rises else at_knots

    def _by_contrast(
        self, responses: list[Response], levels: tuple[Any, Any, Any], tables: tuple[ContrastTables, Masking]
    ) -> Array:
        to_contrast, masking = tables
        visible = np.empty(len(self.log_factors))
        for response in responses:
            at = to_contrast._replace(log_factor=response.log_reference)
            cells = CellTables.of(response, self._model)
            count_cells(*levels, (at, cells, masking))
            visible[response.served] = response.seen(cells.counts)
        return visible

    def _factor_tables(self, band: BandTable) -> FactorTables:
        return FactorTables(
            log_luminance=band.log_luminance,
            log_faintest=np.float32(band.log_sensitivity_range[0]),
            log_span=np.float32(np.ptp(band.log_sensitivity_range)),
            steepest=np.float32(band.steepest),
            log_lowest_factor=np.float32(self.log_factors[0]),
            counts=np.zeros(0, np.int64),
        )


def contrast_tables(
    band: BandTable, model: ContrastModel, levels: tuple[Any, Any], factor: float = 1.0
) -> ContrastTables:
    """Return what the compiled loops need to make contrast of a band's luminance.

    Parameters
    ----------
    band : BandTable
        Its sensitivity.
    model : ContrastModel
        Choices of the contrast model.
    levels : (array, array)
        Gaussian level l of emitted luminance, and level l + 2 expanded to the size of l + 1, for band l.
    factor : float
        Brightness factor b at which contrast is taken.
    """
    return ContrastTables(
        log_sensitivity=band.log_sensitivity,
        log_sensitivity_series=band.log_sensitivity_series,
        series_error=np.float32(band.series_error),
        log_darkest=np.float32(band.log_luminance_range[0]),
        log_span=np.float32(np.ptp(band.log_luminance_range)),
        log_factor=np.float32(math.log2(factor)),
        log_common_adaptation=np.float32(_log_common_adaptation(model, *levels)),
        positive_only=model.visibility is Visibility.POSITIVE_ONLY,
    )


def _log_common_adaptation(model: ContrastModel, fine: Any, around: Any) -> float:
    """Return log2 of a band's mean L_a if sensitivity is taken there, nan if at each pixel's own."""
    if model.sensitivity is not SensitivityModel.AUTHORS:
        return math.nan
    mean = float(expanded(around, *fine.shape).mean(dtype=np.float64))
    return math.log2(max(mean, LOWEST_LUMINANCE))


@compiled
def _count_at_references(
    levels: tuple[Any, Any, Any],
    tables: tuple[ContrastTables, FactorTables, Masking],
    references: Any,
    cells: Any,
    visible: Any,
) -> None:
    """Count a band at several reference factors, and fill in how many pixels are visible at each knot.

    The references are in the middles of equal steps of log b; a knot takes the count of the step it lies in.
    `cells` is where the knots lie among the cells of the histogram, rising from 0 to their number.
    """
    fine, coarse, around = levels
    to_contrast, f, masking = tables
    n_cells = int(cells[-1])
    counts, knot = np.zeros((references, n_cells + 2), np.int32), 0
    to_factor = FactorTables(
        f.log_luminance, f.log_faintest, f.log_span, f.steepest, f.log_lowest_factor, counts
    )
    count_band(fine, coarse, around, (to_contrast, to_factor, masking))
    for k in range(references):
        below, cell = counts[k, 0], 0
        while knot < cells.size and (k == references - 1 or cells[knot] * references < (k + 1) * n_cells):
            whole = min(int(cells[knot]), n_cells - 1)
            while cell < whole:
                cell += 1
                below += counts[k, cell]
            visible[knot] = below + (cells[knot] - whole) * counts[k, whole + 1]
            knot += 1
