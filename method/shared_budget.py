"""Several clips as one: their frames share a budget, and no step is seen between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.optimize import Problem


def joined_curves(clips: Sequence[LossCurves]) -> LossCurves:
    """Return the loss curves of clips shown one after the other.

    Raises
    ------
    InputError
        If they were made for different displays or factors.
    """
    first = clips[0]
    for other in clips[1:]:
        if other.display != first.display or not np.array_equal(other.factors, first.factors):
            raise InputError(
                f"{other.video} and {first.video} cannot share a budget: their loss curves are for different "
                f"displays, pixels per degree or factors"
            )
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(clip, name) for clip in clips])
        for name, shape in ARRAY_SHAPES.items()
        if shape[0] == "N"
    }
    start, times = 0.0, []
    for clip in clips:
        times.append(clip.times - clip.times[0] + start)
        start = float(times[-1][-1] + clip.durations[-1])
    arrays["times"] = np.concatenate(times)
    return replace(first, video=" + ".join(clip.video for clip in clips), **arrays)


def joints(clips: Sequence[LossCurves]) -> list[int]:
    """Return the first frame of every clip but the first."""
    return [int(end) for end in np.cumsum([clip.n_frames for clip in clips])[:-1]]


def clip_of(problem: Problem, clip: LossCurves, first: int) -> Problem:
    """Return the part of a problem that is about one clip, for its track: its budget is not its own.

    Parameters
    ----------
    problem : Problem
        Of all clips.
    clip : LossCurves
        The clip's own.
    first : int
        Its first frame among all.
    """
    frames = slice(first, first + clip.n_frames)
    allowances, weights = problem.allowances, problem.budget_weights[frames]
    if not weights.sum() > 0:  # black throughout, on a panel that then uses nothing
        weights = clip.durations
    return replace(
        problem,
        curves=clip,
        budget_weights=weights / weights.sum(),
        luminance=problem.luminance[frames],
        importance=None if problem.importance is None else problem.importance[frames],
        allowances=None if allowances is None else allowances[first : first + clip.n_frames - 1],
    )
