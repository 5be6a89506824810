"""Compiled loops of the one-pass loss curves: luminance, pyramid steps, and the count of critical factors.

Images are float32, rows contiguous. The steps are those of `contrast.luminance`, `contrast.pyramid` and
`contrast.masking` (Eq. 3, as `contrast.critical_factor` solves it), in the same order and with the same
differences from the centre pixel, so that an area of one luminance has contrast 0 exactly. A band is worked
through row by row, with the last five rows in memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from evenlight.method.compiled_loop import compiled_loop
from evenlight.method.contrast.critical_factor import SERIES_DEGREE, log_threshold
from evenlight.method.contrast.csf import LOWEST_LUMINANCE
from evenlight.method.contrast.masking import MASKING_EXPONENT
from evenlight.method.contrast.pyramid import INNER_WEIGHT, OUTER_WEIGHT

Function = TypeVar("Function", bound=Callable[..., Any])


class ContrastTables(NamedTuple):
    """What a row of luminance needs to become contrast; all logarithms are to base 2."""

    log_sensitivity: Any  # s at equal steps of log e
    log_sensitivity_series: Any  # the same as a `power_series`, from -1/2 to 1/2 over these steps
    series_error: Any  # of it, at most
    log_darkest: Any  # e at the table's beginning
    log_span: Any  # from there to its end
    log_factor: Any  # b at which contrast is taken, and neighbours are compared
    log_common_adaptation: Any  # one L_a for the sensitivity of all pixels; nan: each has its own
    positive_only: Any  # whether negative contrast does not count


class FactorTables(NamedTuple):
    """What a row of contrast needs to become critical factors; all logarithms are to base 2."""

    log_luminance: Any  # e at equal steps of log s
    log_faintest: Any  # s at that table's beginning
    log_span: Any  # from there to its end
    steepest: Any  # d log s / d log e, at most
    log_lowest_factor: Any  # where the histogram begins; it ends at b = 1
    # (references, cells): a histogram for each of some equal steps of log b, with neighbours compared at its
    # middle; it holds for the factors of its step only. Its cells: below, equal steps of log b, above
    counts: Any


Masking = tuple[bool, Any]  # whether a pixel masks itself, and the strength of masking


def compiled(function: Function) -> Function:
    """Compile a loop; products and sums may fuse, but never be reordered."""
    return compiled_loop(nogil=True, error_model="numpy", fastmath={"contract", "nsz"})(function)


def _power_series(function: Callable[[Any], Any], low: float, high: float, degree: int) -> tuple[Any, ...]:
    """Return the coefficients of a near-minimax polynomial, constant term first, as float32."""
    fitted = Chebyshev.interpolate(function, degree, domain=[low, high]).convert(kind=Polynomial)
    return tuple(np.float32(c) for c in fitted.coef)


_L = _power_series(lambda x: np.log2(1 + x) / np.where(x == 0, 1, x), 2**-0.5 - 1, 2**0.5 - 1, 7)
_E = _power_series(np.exp2, -0.5, 0.5, 5)
_INNER, _OUTER = np.float32(INNER_WEIGHT), np.float32(OUTER_WEIGHT)
_TWICE_OUTER, _HALF = np.float32(2 * OUTER_WEIGHT), np.float32(2 * INNER_WEIGHT)
_BETA = np.float32(MASKING_EXPONENT)
_DARKEST = np.float32(LOWEST_LUMINANCE)
# |ΔL| [cd/m^2]: r is then below 1e-30, and its 0.2th power below 1e-6, as good as 0.
_FAINTEST_DIFFERENCE = np.float32(1e-36)
_NEVER = np.float32(-200.0)  # log2 r of a pixel that is not to be counted
# T(m) as a series of log2(1 + m), to 2e-6. Above m = 22, T is some 500: a pixel of that contrast would have
# neighbours whose mean |C|^0.2 is 75, and |C| 2^31, while r is below 2^8 and s, at the eye's best, near 2^10.
_LARGEST_LOG_MASKING = 4.5
_T = _power_series(
    lambda x: log_threshold(np.exp2((x + 0.5) * _LARGEST_LOG_MASKING) - 1), -0.5, 0.5, SERIES_DEGREE
)
_PER_LOG_MASKING, _MIDDLE = np.float32(1 / _LARGEST_LOG_MASKING), np.float32(0.5)
BLOCK = 64  # pixels: rows are made of whole blocks, as what is left over of a vectorized loop is slow
EXACT = np.float32(1e-4)  # error of log2 s with which the series serves for more than ratios of neighbours
_ROUNDING = np.float32(1e-4)  # of log2 s, and of what it is compared with: more than there can be
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
def power_series(c: Any, x: Any) -> Any:
    """Return a power series of degree 12 (`SERIES_DEGREE`) at x."""
    high = c[8] + x * (c[9] + x * (c[10] + x * (c[11] + x * c[12])))
    high = c[4] + x * (c[5] + x * (c[6] + x * (c[7] + x * high)))
    return c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * high)))


@compiled
def interpolated(table: Any, x: Any) -> Any:
    """Return a table's value at x, linear between its equal steps over [0, 1], held outside."""
    position = min(max(x, np.float32(0)), np.float32(1)) * np.float32(table.size - 1)
    k = np.uint32(np.int32(min(position, np.float32(table.size - 2))))
    return table[k] + (position - np.float32(np.int32(k))) * (table[k + np.uint32(1)] - table[k])


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
    ratio_row(fine, low, seen, to, (log_ratio, log_adaptation))
    by_series = to.series_error < EXACT
    filled = log_contrast, power_sum, power, cells
    power_row((log_ratio, log_adaptation), to.log_factor, to, by_series, filled)
    if to.positive_only:
        leave_out_negative(fine, low, log_ratio)


@compiled
def ratio_row(fine: Any, low: Any, seen: Any, to: ContrastTables, rows: Any) -> None:
    """Fill rows of log2 r and log2 L_a."""
    log_ratio, log_adaptation = rows
    for j in range(fine.size):
        log_adaptation[j] = log2(max(seen[j], _DARKEST))
        log_ratio[j] = log2(max(abs(fine[j] - low[j]), _FAINTEST_DIFFERENCE)) - log_adaptation[j]
    if not np.isnan(to.log_common_adaptation):
        for j in range(fine.size):
            log_adaptation[j] = to.log_common_adaptation


@compiled
def power_row(at: Any, log_factor: Any, to: ContrastTables, by_series: Any, rows: Any) -> None:
    """Fill rows of log2 |C| at a factor, and of |C|^0.2 by five columns; `at` are those of `ratio_row`."""
    log_ratio, log_adaptation = at
    log_contrast, power_sum, power, cells = rows
    shift, per_span = log_factor - to.log_darkest, np.float32(1) / to.log_span
    if by_series:
        shift -= _MIDDLE * to.log_span
        for j in range(log_ratio.size):
            position = min(max((log_adaptation[j] + shift) * per_span, -_MIDDLE), _MIDDLE)  # held outside
            log_contrast[j] = power_series(to.log_sensitivity_series, position)
    else:
        for j in range(log_ratio.size):
            log_contrast[j] = (log_adaptation[j] + shift) * per_span
        look_up(to.log_sensitivity, log_contrast, cells)
    for j in range(log_ratio.size):
        log_contrast[j] += log_ratio[j]
        power[j + 2] = exp2(_BETA * log_contrast[j])
    for j in range(log_ratio.size):
        power_sum[j] = power[j] + power[j + 1] + power[j + 2] + power[j + 3] + power[j + 4]


@compiled
def leave_out_negative(fine: Any, low: Any, log_ratio: Any) -> None:
    """Mark the pixels of a row whose contrast is negative as not to be counted."""
    for j in range(fine.size):
        if fine[j] <= low[j]:
            log_ratio[j] = _NEVER


@compiled
def threshold_row(
    log_contrast: Any, sums: Any, columns: Any, choices: tuple[Any, Masking, Any], x: Any
) -> None:
    """Fill `x` with log2 T(m), m the mean of |C|^0.2 over the neighbourhood, over the pixel's own.

    `columns` is one over the number of the neighbourhood's columns that lie in the picture. `choices` are one
    over the number of its rows, how pixels mask, and log2 of a contrast: T is infinite in blocks where none
    is higher. Rows are of whole blocks.
    """
    per_row, (masks_itself, strength), faintest = choices
    a, b, c, d, e = sums[0], sums[1], sums[2], sums[3], sums[4]
    for begin in range(0, x.size, BLOCK):
        some = numba.int32(0)
        for k in range(BLOCK):
            some |= numba.int32(log_contrast[np.uint64(begin + k)] > faintest)
        if some == 0:
            for k in range(BLOCK):
                x[np.uint64(begin + k)] = np.inf
            continue
        for k in range(BLOCK):
            j = np.uint64(begin + k)
            total = (a[j] + b[j] + c[j] + d[j] + e[j]) * exp2(-_BETA * log_contrast[j])
            x[j] = total * (per_row * columns[j])
        if not masks_itself:
            for k in range(BLOCK):
                j = np.uint64(begin + k)
                others = max(np.float32(1) / (per_row * columns[j]) - np.float32(1), np.float32(1))
                x[j] = max(x[j] / (per_row * columns[j]) - np.float32(1), np.float32(0)) / others
        for k in range(BLOCK):
            j = np.uint64(begin + k)
            x[j] = log2(np.float32(1) + strength * x[j]) * _PER_LOG_MASKING - _MIDDLE
        for k in range(BLOCK):
            j = np.uint64(begin + k)
            x[j] = power_series(_T, min(x[j], _MIDDLE))


@compiled
def count_row(
    rows: Any, x: Any, bounds: tuple[Any, Any], to: FactorTables, counts: Any, scratch: Any
) -> None:
    """Add the critical factors of a row of pixels to a histogram; `x` brings log2 T(m).

    T / |C| is what a pixel's sensitivity would have to rise by. It rises so far at all factors of the step if
    that is below the first of `bounds`, at none if above the second; only between them it is looked up where.
    """
    log_ratio, log_adaptation, log_contrast = rows
    flags, flags_by_eight, chosen, needed, cells = scratch
    least, most = bounds
    visible, n = numba.int32(0), np.int64(0)
    for begin in range(0, x.size, BLOCK):
        if x[np.uint64(begin)] == np.inf:  # nothing of the block is seen
            continue
        for k in range(BLOCK):
            j = np.uint64(begin + k)
            rise, matters = x[j] - log_contrast[j], log_ratio[j] > _NEVER
            visible += numba.int32(matters & (rise < least))
            flags[j] = matters & (rise >= least) & (rise < most)
        for k in range(begin // 8, (begin + BLOCK) // 8):
            if flags_by_eight[k] != 0:
                for pixel in range(8 * k, 8 * k + 8):
                    chosen[n] = pixel
                    n += np.int64(flags[pixel])
    counts[0] += visible
    for k in range(n):
        j = np.uint64(chosen[k])
        needed[k] = (x[j] - log_ratio[j] - to.log_faintest) / to.log_span
    look_up(to.log_luminance, needed[:n], cells)
    last = np.float32(counts.size - 1)
    per_factor = (last - np.float32(1)) / -to.log_lowest_factor
    for k in range(n):
        log_factor = needed[k] - log_adaptation[np.uint32(chosen[k])]
        cell = (log_factor - to.log_lowest_factor) * per_factor + np.float32(1)
        counts[np.uint32(min(max(cell, np.float32(0)), last))] += 1


@compiled
def count_band(
    fine: Any, coarse: Any, adaptation: Any, tables: tuple[ContrastTables, FactorTables, Masking]
) -> None:
    """Add the critical factors of a band's pixels to the histograms.

    Parameters
    ----------
    fine, coarse : array
        Gaussian levels l and l + 1 of emitted luminance.
    adaptation : array
        Level l + 2 expanded to the size of l + 1.
    tables : (ContrastTables, FactorTables, Masking)
        The tables, and how pixels mask.
    """
    to_contrast, to_factor, masking = tables
    height, width = fine.shape
    n, whole = to_factor.counts.shape[0], -(-width // BLOCK) * BLOCK  # rows are filled up without contrast
    shared, own = np.zeros((2, 5, whole), np.float32), np.zeros((n, 2, 5, whole), np.float32)
    power, image = np.zeros(whole + 4, np.float32), np.ones((4, whole), np.float32)
    here, low, seen, x = image[0], image[1], image[2], image[3]
    row_low, row_seen = low[:width], seen[:width]
    cells, between = np.empty(whole, np.int32), np.empty(coarse.shape[1] + 2, np.float32)
    flags, chosen = np.empty(whole, np.uint8), np.empty(whole, np.int32)
    scratch = flags, flags.view(np.int64), chosen, np.empty(whole, np.float32), cells
    columns = np.ones(whole, np.float32)
    for j in range(width):
        columns[j] = 1 / (min(j + 2, width - 1) - max(j - 2, 0) + 1)
    step = to_factor.log_lowest_factor / np.float32(n)
    most = np.float32(0.5) * -step * to_factor.steepest + to_contrast.series_error + _ROUNDING
    for i in range(height + 2):
        new, ready = i % 5, (i - 2) % 5
        if i < height:
            for j in range(width):
                here[j] = fine[i, j]
            expand_row(coarse, i, height, between, row_low)
            expand_row(adaptation, i, height, between, row_seen)
            ratio_row(here, low, seen, to_contrast, (shared[0, new], shared[1, new]))
        per_row = np.float32(1 / (min(i, height - 1) - max(i - 4, 0) + 1))
        for k in range(n):
            log_contrast, sums = own[k, 0], own[k, 1]
            if i < height:
                reference = step * np.float32(n - k - 0.5)
                filled = log_contrast[new], sums[new], power, cells
                power_row((shared[0, new], shared[1, new]), reference, to_contrast, True, filled)
            else:
                for j in range(width):
                    sums[new, j] = 0
            if i >= 2:
                threshold_row(log_contrast[ready], sums, columns, (per_row, masking, -most), x)
                row = shared[0, ready], shared[1, ready], log_contrast[ready]
                count_row(row, x, (-most, most), to_factor, to_factor.counts[k], scratch)
        if i < height and to_contrast.positive_only:
            leave_out_negative(here, low, shared[0, new])
