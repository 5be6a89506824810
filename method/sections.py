"""Weights and allowances of sections, frame by frame.

Decisions: docs/decisions/frame-weights.md, docs/decisions/rate-allowances.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.loss_curves import LossCurves
from evenlight.data_schema.section import AllowanceSection, WeightSection


def frame_weights(curves: LossCurves, sections: Sequence[WeightSection]) -> Array | None:
    """Return how much each frame counts, 1 on average; None where all count alike, (N,).

    Raises
    ------
    InputError
        If sections overlap or hold no frame, or if nothing is left that counts.
    """
    if not sections:
        return None
    weights = _by_section(curves, sections, [s.weight for s in sections], "--weights")
    if not weights.max() > 0:
        raise InputError("--weights gives every frame the weight 0: at least one must count")
    return np.asarray(weights / weights.mean())


def step_allowances(
    curves: LossCurves, sections: Sequence[AllowanceSection], joints: Sequence[int] = ()
) -> Array | None:
    """Return how many times the rate limit each step may reach; None where all may reach just that, (N-1,).

    Parameters
    ----------
    curves : LossCurves
        N frames.
    sections : sequence of AllowanceSection
        A step belongs to the moment at which the later one of its two frames appears.
    joints : sequence of int
        Frames that begin another clip: nobody sees the step to them, and it is free.

    Raises
    ------
    InputError
        If sections overlap or hold no frame.
    """
    if not sections and not joints:
        return None
    of_frames = _by_section(curves, sections, [s.allowance for s in sections], "--allowances")
    of_frames[list(joints)] = np.inf
    return of_frames[1:]


def _by_section(
    curves: LossCurves,
    sections: Sequence[WeightSection | AllowanceSection],
    values: Sequence[float],
    option: str,
) -> Array:
    """Return the value of the section that each frame belongs to; 1 outside all, (N,)."""
    of_frames, taken = np.ones(curves.n_frames), np.zeros(curves.n_frames, dtype=bool)
    for section, value in zip(sections, values, strict=True):
        inside = (curves.times >= section.start) & (curves.times < section.end)
        where = f"{option}: the section from {section.start:g} to {section.end:g} s"
        if not inside.any():
            last = float(curves.times[-1])
            raise InputError(f"{where} holds no frame: frames appear from {curves.times[0]:g} to {last:g} s")
        if (inside & taken).any():
            raise InputError(f"{where} overlaps another one; give each frame one section")
        of_frames[inside], taken = value, taken | inside
    return of_frames
