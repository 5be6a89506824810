"""Which columns of a design can be fitted, and which of them can differ between participants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array


@dataclass(frozen=True, slots=True)
class Columns:
    """Which columns of a design can be fitted.

    Attributes
    ----------
    fitted : tuple of int
        A largest set without a column that is a combination of earlier ones.
    told_apart : tuple of bool
        Of each column: whether no combination of the others gives it, so that its effect means something.
    """

    fitted: tuple[int, ...]
    told_apart: tuple[bool, ...]


def require_effects(design: NDArray[np.float64], names: tuple[str, ...], slope_column: int | None) -> None:
    """Raise `ValueError` if a design (n, k) of fixed effects is not finite, or has no such slope column."""
    if not np.isfinite(design).all():
        raise ValueError("the design must be finite, got nan or infinity")
    if slope_column is not None and not 0 <= slope_column < len(names):
        raise ValueError(f"slope_column must be one of {len(names)} columns, got {slope_column}")


def estimable_columns(design: NDArray[np.float64], intercept: bool) -> Columns:
    """Return which columns of a design (n, k) can be fitted beside an intercept, or without one.

    >>> estimable_columns(np.array([[0.0, 1.0, 5.0], [1.0, 0.0, 5.0]]), intercept=True)
    Columns(fitted=(0,), told_apart=(False, False, False))
    """
    scale = np.maximum(np.abs(design).max(axis=0, initial=0.0), 1e-300)
    scaled: Array = design / scale
    if intercept:
        scaled = np.column_stack([np.ones(design.shape[0]), scaled])
    first = int(intercept)
    corner = np.asarray(np.linalg.qr(scaled, mode="r"))  # of the same rank, column by column, but small

    def rank(columns: list[int]) -> int:
        return int(np.linalg.matrix_rank(corner[:, columns], tol=1e-8)) if columns else 0

    kept = list(range(first))
    for j in range(first, scaled.shape[1]):
        if rank([*kept, j]) > len(kept):
            kept.append(j)
    every = list(range(scaled.shape[1]))
    apart = [rank([i for i in every if i != j]) < len(kept) for j in every]
    return Columns(tuple(j - first for j in kept[first:]), tuple(apart[first:]))


def in_row_space(weights: Array, design: NDArray[np.float64]) -> bool:
    """Return whether the combination w β of a design's effects is determined: w is a mixture of its rows.

    >>> in_row_space(np.array([1.0, -1.0]), np.array([[1.0, 1.0], [2.0, 2.0]]))
    False
    """
    scale = np.maximum(np.abs(design).max(axis=0), 1e-300)
    rows, wanted = np.asarray(np.linalg.qr(design / scale, mode="r")), weights / scale
    rest = wanted - rows.T @ np.linalg.lstsq(rows.T, wanted, rcond=None)[0]
    return bool(np.abs(rest).max() <= 1e-8 * np.abs(wanted).max())


def slope_of(
    wanted: int | None, design: NDArray[np.float64], groups: NDArray[np.int64], columns: Columns
) -> int | None:
    """Return the column with a participant effect, if the data can tell of one.

    None with one participant, or where everybody has one value of the column only.
    """
    if wanted is None or wanted not in columns.fitted or groups.max() == 0:
        return None
    low, high = np.full(groups.max() + 1, np.inf), np.full(groups.max() + 1, -np.inf)
    np.minimum.at(low, groups, design[:, wanted])
    np.maximum.at(high, groups, design[:, wanted])
    return wanted if (low < high).any() else None


def loadings_of(design: NDArray[np.float64], groups: NDArray[np.int64], slope: int | None) -> Array:
    """Return what the participant effects are multiplied with, (n, q).

    q = 0 with one participant, or with one observation of each: then no effect can be told from chance.

    >>> loadings_of(np.zeros((3, 0)), np.array([0, 0, 1]), None).tolist()
    [[1.0], [1.0], [1.0]]
    """
    ones = np.ones((groups.size, 1))
    if groups.max() == 0 or np.bincount(groups).max() == 1:
        return ones[:, :0]
    return ones if slope is None else np.column_stack([ones, design[:, slope]])


def start_of_loadings(n_effects: int, usual: tuple[float, float]) -> list[float]:
    """Return where a search begins for the rows of Λ: no correlation, and the usual standard deviations.

    Parameters
    ----------
    n_effects : int
        q: 0, 1 for an intercept, 2 for a slope too.
    usual : (float, float)
        Standard deviations of intercept and slope between participants.

    >>> start_of_loadings(2, (0.4, 0.3))
    [0.4, 0.0, 0.3]
    """
    return {0: [], 1: [usual[0]], 2: [usual[0], 0.0, usual[1]]}[n_effects]
