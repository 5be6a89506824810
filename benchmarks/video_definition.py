"""How far the curves of a video are from the definition: the one pass, and the line between two knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.curve_definition import loss_curves_by_definition
from benchmarks.frame_points import EVERY
from benchmarks.measured import claim, not_measured
from benchmarks.records import BenchmarkClaim
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.loss_curves import LossCurves
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
    """

    video: str
    at_knots: Array
    between: Array


def default_errors(frames: Sequence[Frame], found: LossCurves, many: int) -> DefaultErrors:
    """Return how far curves are from the definition in float64, dimmed, rebuilt and compared.

    Parameters
    ----------
    frames : sequence of Frame
        Those of the video, in memory.
    found : LossCurves
        Their curves.
    many : int
        How many frames are compared, evenly spread over the video.
    """
    knots = found.factors
    at = knots[::-EVERY][::-1]
    between = np.sqrt(knots[:-1] * knots[1:])[::BETWEEN_EVERY]
    asked = np.concatenate([at, between])
    missed = []
    for k in [(2 * k + 1) * len(frames) // (2 * many) for k in range(many)]:
        emitted = emitted_luminance(frames[k].pixel_values, found.display)
        expected = loss_curves_by_definition(emitted, asked, found.display)
        missed.append(np.abs(np.interp(asked, knots, found.loss[k]) - expected))
    errors = np.array(missed)
    height, width, _ = frames[0].pixel_values.shape
    name, n = f"{found.video} at {width} x {height}", len(at)
    return DefaultErrors(name, errors[:, :n], errors[:, n:])


def default_claims(errors: Sequence[DefaultErrors]) -> list[BenchmarkClaim]:
    """Return the targets: the curves keep to the definition at the knots, and between them."""
    words = "loss of a video's frames, against the definition in float64, "
    at, between = f"{words}at knots", f"{words}between knots"
    if not errors:
        return [not_measured(each, TARGET_ERROR, "", "no video could be made") for each in (at, between)]
    frames = ", ".join(f"{len(e.between)} of {e.video}" for e in errors)
    of_frames = f"every {EVERY}th knot of {frames}"
    apart = np.concatenate([e.between.ravel() for e in errors])
    over = (apart > TARGET_ERROR).mean()
    note = (
        f"the same frames at {errors[0].between.shape[1]} factors; median {np.median(apart):.1g}, "
        f"{over:.1%} above {TARGET_ERROR:g}: single pixels of the coarse bands make steps, which a straight "
        f"line cannot follow"
    )
    return [
        claim(at, TARGET_ERROR, max(float(e.at_knots.max()) for e in errors), "", of_frames),
        claim(between, TARGET_ERROR, float(apart.max()), "", note),
    ]
