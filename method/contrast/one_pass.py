"""Compiled loops of the one-pass loss curves: luminance, pyramid steps, and the count of critical factors.

Images are float32, rows contiguous. The steps are those of `contrast.luminance`, `contrast.pyramid` and
`contrast.masking` (Eq. 3, as `contrast.critical_factor` solves it), in the same order and with the same
differences from the centre pixel, so that an area of one luminance has contrast 0 exactly. A band is worked
through row by row, with the last five rows in memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from evenlight.method.contrast.critical_factor import MASKING_RANGE
from evenlight.method.contrast.csf import LOWEST_LUMINANCE
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.method.contrast.masking import MASKING_EXPONENT
from evenlight.method.contrast.pyramid import INNER_WEIGHT, OUTER_WEIGHT

Function = TypeVar("Function", bound=Callable[..., Any])

FLOAT_STEPS = 65535  # of the linearization table for floats, read with linear interpolation


class ContrastTables(NamedTuple):
    """What a row of luminance needs to become contrast; all logarithms are to base 2."""

    log_sensitivity: Any  # s at equal steps of log e
    log_darkest: Any  # e at the table's beginning
    log_span: Any  # from there to its end
    log_factor: Any  # b at which contrast is taken, and neighbours are compared
    log_common_adaptation: Any  # one L_a for the sensitivity of all pixels; nan: each has its own
    positive_only: Any  # whether negative contrast does not count


class FactorTables(NamedTuple):
    """What a row of contrast needs to become critical factors; all logarithms are to base 2."""

    log_threshold: Any  # T at equal steps of log m
    log_luminance: Any  # e at equal steps of log s
    log_faintest: Any  # s at that table's beginning
    log_span: Any  # from there to its end
    log_lowest_factor: Any  # where the histogram begins; it ends at b = 1
    counts: Any  # the histogram: below, equal steps of log b, above


def compiled(function: Function) -> Function:
    """Compile a loop, once per machine; products and sums may fuse, but never be reordered."""
    decorate = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"})
    return cast(Function, decorate(function))


def _power_series(function: Callable[[Any], Any], low: float, high: float, degree: int) -> tuple[Any, ...]:
    """Return the coefficients of a near-minimax polynomial, constant term first, as float32."""
    fitted = Chebyshev.interpolate(function, degree, domain=[low, high]).convert(kind=Polynomial)
    return tuple(np.float32(c) for c in fitted.coef)


_L = _power_series(lambda x: np.log2(1 + x) / np.where(x == 0, 1, x), 2**-0.5 - 1, 2**0.5 - 1, 7)
_E = _power_series(np.exp2, -0.5, 0.5, 5)
_R, _G, _B = (np.float32(w) for w in LUMINANCE_WEIGHTS)
_INNER, _OUTER = np.float32(INNER_WEIGHT), np.float32(OUTER_WEIGHT)
_TWICE_OUTER, _HALF = np.float32(2 * OUTER_WEIGHT), np.float32(2 * INNER_WEIGHT)
_BETA = np.float32(MASKING_EXPONENT)
_DARKEST = np.float32(LOWEST_LUMINANCE)
_FAINTEST = np.float32(1e-30)  # of r: its 0.2th power is 1e-6, as good as 0
_NEVER = np.float32(-200.0)  # log2 r of a pixel that is not to be counted
_MASKING_LOW = np.float32(MASKING_RANGE[0])
_PER_MASKING_SPAN = np.float32(1 / (MASKING_RANGE[1] - MASKING_RANGE[0]))
_ROOT_HALF_BITS = np.int32(0x3F3504F3)  # of the float32 nearest to sqrt(1/2)


@compiled
def log2(x: Any) -> Any:
    """Return log2 of a positive, normal float32; largest error 4e-7, and 2e-7 of the result."""
    bits = np.float32(x).view(np.int32)
    exponent = np.int32(np.int32(bits - _ROOT_HALF_BITS) >> np.int32(23))
    t = np.int32(bits - np.int32(exponent << np.int32(23))).view(np.float32) - np.float32(1)
    series = _L[4] + t * (_L[5] + t * (_L[6] + t * _L[7]))
    series = _L[0] + t * (_L[1] + t * (_L[2] + t * (_L[3] + t * series)))
    return np.float32(exponent) + t * series


@compiled
def exp2(x: Any) -> Any:
    """Return 2^x of a float32 within ±120; largest relative error 3e-7."""
    whole = np.floor(x + np.float32(0.5))
    t = x - whole
    series = _E[0] + t * (_E[1] + t * (_E[2] + t * (_E[3] + t * (_E[4] + t * _E[5]))))
    return series * np.int32(np.int32(np.int32(whole) + np.int32(127)) << np.int32(23)).view(np.float32)


@compiled
def interpolated(table: Any, x: Any) -> Any:
    """Return a table's value at x, linear between its equal steps over [0, 1], held outside."""
    position = min(max(x, np.float32(0)), np.float32(1)) * np.float32(table.size - 1)
    k = np.uint32(np.int32(min(position, np.float32(table.size - 2))))
    return table[k] + (position - np.float32(np.int32(k))) * (table[k + np.uint32(1)] - table[k])


@compiled
def convert_integers(pixel_values: Any, linear: Any, black: Any, span: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of an integer frame; return the sums of its linear channels.

    `linear[v]` is the linear value of the pixel value v; `span` is from `black` to the peak [cd/m^2].
    """
    red = green = blue = 0.0
    for i in range(luminance.shape[0]):
        for j in range(luminance.shape[1]):
            r = linear[pixel_values[i, j, 0]]
            g = linear[pixel_values[i, j, 1]]
            b = linear[pixel_values[i, j, 2]]
            red += r
            green += g
            blue += b
            luminance[i, j] = black + span * (_R * r + _G * g + _B * b)
    return red, green, blue


@compiled
def convert_floats(pixel_values: Any, linear: Any, black: Any, span: Any, luminance: Any) -> Any:
    """Fill `luminance` with I of a frame of floats in [0, 1]; otherwise as `convert_integers`."""
    red = green = blue = 0.0
    for i in range(luminance.shape[0]):
        for j in range(luminance.shape[1]):
            r = interpolated(linear, np.float32(pixel_values[i, j, 0]))
            g = interpolated(linear, np.float32(pixel_values[i, j, 1]))
            b = interpolated(linear, np.float32(pixel_values[i, j, 2]))
            red += r
            green += g
            blue += b
            luminance[i, j] = black + span * (_R * r + _G * g + _B * b)
    return red, green, blue


@compiled
def mirrored(index: Any, length: Any) -> Any:
    """Return where an index beyond an axis lies in its mirror, as `contrast.pyramid.mirrored`."""
    if length == 1:
        return 0
    folded = abs(index) % (2 * (length - 1))
    return min(folded, 2 * (length - 1) - folded)


@compiled
def reduced(fine: Any) -> Any:
    """Return the next coarser Gaussian level."""
    height, width = fine.shape
    coarse = np.empty(((height + 1) // 2, (width + 1) // 2), np.float32)
    row = np.empty(width + 4, np.float32)
    for i in range(coarse.shape[0]):
        a, b, c = fine[mirrored(2 * i - 2, height)], fine[mirrored(2 * i - 1, height)], fine[2 * i]
        d, e = fine[mirrored(2 * i + 1, height)], fine[mirrored(2 * i + 2, height)]
        for j in range(width):
            inner = (b[j] - c[j]) + (d[j] - c[j])
            row[j + 2] = c[j] + _INNER * inner + _OUTER * ((a[j] - c[j]) + (e[j] - c[j]))
        for j in (-2, -1, width, width + 1):
            row[j + 2] = row[mirrored(j, width) + 2]
        for j in range(coarse.shape[1]):
            middle = row[2 * j + 2]
            inner = (row[2 * j + 1] - middle) + (row[2 * j + 3] - middle)
            outer = (row[2 * j] - middle) + (row[2 * j + 4] - middle)
            coarse[i, j] = middle + _INNER * inner + _OUTER * outer
    return coarse


@compiled
def expand_row(coarse: Any, i: Any, height: Any, between: Any, row: Any) -> None:
    """Fill `row` with row i of a level expanded to `height` rows; `between` is scratch, two cells wider."""
    width, n = row.size, coarse.shape[1]
    a, c = coarse[mirrored(i - 1 - (i + 1) % 2, height) // 2], coarse[i // 2]
    e = coarse[mirrored(i + 1 + (i + 1) % 2, height) // 2]
    if i % 2 == 0:
        for k in range(n):
            between[k + 1] = c[k] + _TWICE_OUTER * ((a[k] - c[k]) + (e[k] - c[k]))
    else:
        for k in range(n):
            between[k + 1] = _HALF * (c[k] + e[k])
    between[0] = between[mirrored(-2, width) // 2 + 1]
    between[n + 1] = between[mirrored(2 * n, width) // 2 + 1]
    for k in range(width // 2):
        middle, after = between[k + 1], between[k + 2]
        row[2 * k] = middle + _TWICE_OUTER * ((between[k] - middle) + (after - middle))
        row[2 * k + 1] = _HALF * (middle + after)
    if width % 2 == 1:
        row[width - 1] = between[n] + _TWICE_OUTER * (
            (between[n - 1] - between[n]) + (between[n + 1] - between[n])
        )


@compiled
def expanded(coarse: Any, height: Any, width: Any) -> Any:
    """Return a level expanded to the next finer size."""
    fine = np.empty((height, width), np.float32)
    between = np.empty(coarse.shape[1] + 2, np.float32)
    for i in range(height):
        expand_row(coarse, i, height, between, fine[i])
    return fine


@compiled
def look_up(table: Any, x: Any, cells: Any) -> None:
    """Replace x by a table's values at x, linear between its equal steps over [0, 1], held outside.

    The reading of the table stands in a loop of its own, because it keeps a loop from being vectorized.
    """
    steps, last = np.float32(table.size - 1), np.float32(table.size - 2)
    for j in range(x.size):
        position = min(max(x[j], np.float32(0)), np.float32(1)) * steps
        cells[j] = np.int32(min(position, last))
        x[j] = position - np.float32(cells[j])
    for j in range(x.size):
        k = np.uint32(cells[j])
        x[j] = table[k] + x[j] * (table[k + np.uint32(1)] - table[k])


@compiled
def contrast_row(fine: Any, low: Any, seen: Any, to: ContrastTables, rows: Any) -> None:
    """Fill rows of log2 r, log2 L_a, log2 |C| at a factor, and |C|^0.2 by five columns."""
    log_ratio, log_adaptation, log_contrast, power_sum, power, cells = rows
    for j in range(fine.size):
        around = max(seen[j], _DARKEST)
        log_adaptation[j] = log2(around)
        log_ratio[j] = log2(max(abs(fine[j] - low[j]) / around, _FAINTEST))
    if not np.isnan(to.log_common_adaptation):
        log_adaptation[:] = to.log_common_adaptation
    for j in range(fine.size):
        log_contrast[j] = (log_adaptation[j] + to.log_factor - to.log_darkest) / to.log_span
    look_up(to.log_sensitivity, log_contrast, cells)
    for j in range(fine.size):
        log_contrast[j] += log_ratio[j]
        power[j + 2] = exp2(_BETA * log_contrast[j])
    for j in range(fine.size):
        power_sum[j] = power[j] + power[j + 1] + power[j + 2] + power[j + 3] + power[j + 4]
    if to.positive_only:
        for j in range(fine.size):
            if fine[j] <= low[j]:
                log_ratio[j] = _NEVER


@compiled
def count_row(log_ratio: Any, log_adaptation: Any, x: Any, to: FactorTables, cells: Any) -> None:
    """Add the critical factors of a row of pixels to the histogram; `x` brings log2 m, and is written to."""
    for j in range(x.size):
        x[j] = (x[j] - _MASKING_LOW) * _PER_MASKING_SPAN
    look_up(to.log_threshold, x, cells)
    for j in range(x.size):
        x[j] = (x[j] - log_ratio[j] - to.log_faintest) / to.log_span
    look_up(to.log_luminance, x, cells)
    last = np.float32(to.counts.size - 1)
    per_factor = (last - np.float32(1)) / -to.log_lowest_factor
    for j in range(x.size):
        cell = (x[j] - log_adaptation[j] - to.log_lowest_factor) * per_factor + np.float32(1)
        cells[j] = np.int32(min(max(cell, np.float32(0)), last))
    for j in range(x.size):
        to.counts[np.uint32(cells[j])] += 1


@compiled
def count_band(
    fine: Any, coarse: Any, adaptation: Any, tables: tuple[ContrastTables, FactorTables, bool]
) -> None:
    """Add the critical factors of a band's pixels to the histogram.

    Parameters
    ----------
    fine, coarse : array
        Gaussian levels l and l + 1 of emitted luminance.
    adaptation : array
        Level l + 2 expanded to the size of l + 1.
    tables : (ContrastTables, FactorTables, bool)
        The tables, and whether a pixel masks itself.
    """
    to_contrast, to_factor, masks_itself = tables
    height, width = fine.shape
    rows = np.zeros((4, 5, width), np.float32)  # of `contrast_row`: the last five of each kind
    power = np.zeros(width + 4, np.float32)
    low, seen, x = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    cells, between = np.empty(width, np.int32), np.empty(coarse.shape[1] + 2, np.float32)
    columns = np.minimum(np.arange(width) + 2, width - 1) - np.maximum(np.arange(width) - 2, 0) + 1
    for i in range(height + 2):
        new, ready = i % 5, (i - 2) % 5
        if i < height:
            expand_row(coarse, i, height, between, low)
            expand_row(adaptation, i, height, between, seen)
            filled = rows[0, new], rows[1, new], rows[2, new], rows[3, new], power, cells
            contrast_row(fine[i], low, seen, to_contrast, filled)
        else:
            rows[3, new] = 0
        if i >= 2:
            n_rows = min(i, height - 1) - max(i - 4, 0) + 1
            masking_row(rows[2, ready], rows[3], n_rows * columns, masks_itself, x)
            count_row(rows[0, ready], rows[1, ready], x, to_factor, cells)


@compiled
def masking_row(log_contrast: Any, sums: Any, counts: Any, masks_itself: Any, x: Any) -> None:
    """Fill `x` with log2 m: the mean of |C|^0.2 over the neighbourhood, over the pixel's own."""
    for j in range(x.size):
        total = sums[0, j] + sums[1, j] + sums[2, j] + sums[3, j] + sums[4, j]
        n = np.float32(counts[j])
        if not masks_itself:
            total -= exp2(_BETA * log_contrast[j])
            n = max(n - np.float32(1), np.float32(1))
        x[j] = log2(max(total / n, _FAINTEST)) - _BETA * log_contrast[j]
