"""How far the curves of a video by default are from the definition: all savings together.

The tolerance, the one pass and the straight line between two knots each err by something; what a user gets is
their sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.frame_points import EVERY
from benchmarks.measured import claim, not_measured
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.benchmark import BenchmarkClaim
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.loss_curves import loss_curves_by_definition
from evenlight.method.contrast.luminance import emitted_luminance

TARGET_ERROR = 1e-3
BETWEEN_EVERY = 2  # interval of the knots within which it is, at the middle of its logarithms


@dataclass(frozen=True, slots=True)
class DefaultErrors:
    """Differences of the default's loss from the definition, of some frames of a video.

    Attributes
    ----------
    video : str
        Its name and size.
    at_knots : array, (frames, knots compared)
        Absolute differences at knots.
    between : array, (frames, factors compared)
        The same between knots, where loss is interpolated linearly.
    whole_between : array, (frames, factors compared)
        The same with every frame counted whole: what the line alone misses.
    """

    video: str
    at_knots: Array
    between: Array
    whole_between: Array


def default_errors(frames: Sequence[Frame], found: LossCurves, whole: Array, many: int) -> DefaultErrors:
    """Return how far curves are from the definition in float64, dimmed, rebuilt and compared.

    Parameters
    ----------
    frames : sequence of Frame
        Those of the video, in memory.
    found : LossCurves
        Their curves, by default.
    whole : array, (frames, knots)
        Loss with every frame counted whole: the frame that is farthest from it is compared.
    many : int
        How many other frames, evenly spread over the video; 0 for none.
    """
    knots = found.factors
    at = knots[::-EVERY][::-1]
    between = np.sqrt(knots[:-1] * knots[1:])[::BETWEEN_EVERY]
    asked = np.concatenate([at, between])
    worst = int(np.abs(found.loss - whole).max(axis=1).argmax())
    spread = [(2 * k + 1) * len(frames) // (2 * many) for k in range(many)]
    missed = []
    for k in sorted({worst, *spread}):
        emitted = emitted_luminance(frames[k].pixel_values, found.display)
        expected = loss_curves_by_definition(emitted, asked, found.display)
        lines = [np.interp(asked, knots, loss[k]) for loss in (found.loss, whole)]
        missed.append(np.abs(np.array(lines) - expected))
    by_default, counted_whole = np.array(missed).swapaxes(0, 1)
    height, width, _ = frames[0].pixel_values.shape
    name, n = f"{found.video} at {width} x {height}", len(at)
    return DefaultErrors(name, by_default[:, :n], by_default[:, n:], counted_whole[:, n:])


def default_claims(errors: Sequence[DefaultErrors]) -> list[BenchmarkClaim]:
    """Return the targets: the default keeps to the definition at the knots, and between them."""
    words = "loss by default (tolerance and one pass together), against the definition in float64, "
    at, between = f"{words}at knots", f"{words}between knots"
    if not errors:
        return [not_measured(each, TARGET_ERROR, "", "no video could be made") for each in (at, between)]
    frames = ", ".join(f"{len(e.between)} of {e.video}" for e in errors)
    of_frames = f"every {EVERY}th knot of {frames}; the frame that the tolerance costs most is among them"
    apart = np.concatenate([e.between.ravel() for e in errors])
    over = (apart > TARGET_ERROR).mean()
    alone = max(float(e.whole_between.max()) for e in errors)
    note = (
        f"the same frames at {errors[0].between.shape[1]} factors; median {np.median(apart):.1g}, "
        f"{over:.1%} above {TARGET_ERROR:g}; {alone:.2g} with every frame counted whole: single pixels of "
        f"the coarse bands make steps, which a straight line cannot follow"
    )
    return [
        claim(at, TARGET_ERROR, max(float(e.at_knots.max()) for e in errors), "", of_frames),
        claim(between, TARGET_ERROR, float(apart.max()), "", note),
    ]
