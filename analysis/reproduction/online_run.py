"""The online controller over a walk, and over targets: what the figures of Section 6 are drawn from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.online.control_curves import ControlledTrack, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings


@dataclass(frozen=True, slots=True)
class OnlineRun:
    """A walk of N frames under the controller, and under constant dimming of the same mean brightness.

    Attributes
    ----------
    name, settings, track : str, ControllerSettings, ControlledTrack
        Name of the walk, the controller's settings, and what it did.
    times : array, (N,)
        When each frame appears [s].
    constant_factor : float
        Mean over time of the controller's factors; of equal power, where power is linear in brightness.
    constant_loss : array, (N,)
        Contrast loss of each frame at that factor.
    """

    name: str
    settings: ControllerSettings
    times: Array
    track: ControlledTrack
    constant_factor: float
    constant_loss: Array


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """A sequence under the controller with one target.

    Attributes
    ----------
    target_loss : float
        What the controller was to hold.
    mean_factor, mean_loss : float
        What came of it, means over time.
    """

    target_loss: float
    mean_factor: float
    mean_loss: float


@dataclass(frozen=True, slots=True)
class TargetSweep:
    """A sequence under the controller with several targets.

    Attributes
    ----------
    name, n_frames : str, int
        Name of the sequence, and how many frames it has.
    points : tuple of SweepPoint
        One for each target, rising.
    """

    name: str
    n_frames: int
    points: tuple[SweepPoint, ...]

    def __post_init__(self) -> None:
        targets = [point.target_loss for point in self.points]
        if len(targets) < 2 or sorted(set(targets)) != targets:
            raise InputError(f"{self.name}: expected two targets or more, rising, got {targets}")


def online_run(curves: LossCurves, controller: Controller) -> OnlineRun:
    """Return the run of a controller over a walk, with constant dimming beside it.

    Parameters
    ----------
    curves : LossCurves
        Of the walk.
    controller : Controller
        Target, gains, bounds and rate limit.
    """
    track = control_curves(curves, controller)
    constant = np.full(curves.n_frames, min(track.mean_factor, 1.0))  # rounding may add 1e-16
    return OnlineRun(
        name=curves.video,
        settings=controller.settings,
        times=curves.times,
        track=track,
        constant_factor=float(constant[0]),
        constant_loss=loss_and_slope(curves, constant)[0],
    )


def target_sweep(
    curves: LossCurves, controller: Controller, targets: Iterable[float]
) -> tuple[SweepPoint, ...]:
    """Return what a controller does to a sequence with each of some targets.

    Parameters
    ----------
    curves : LossCurves
        Of the sequence.
    controller : Controller
        Gains, bounds and rate limit; its own target is not used.
    targets : iterable of float
        c_r, in [0, 1].
    """
    points = []
    for target in targets:
        aimed = replace(controller, settings=replace(controller.settings, target_loss=target))
        track = control_curves(curves, aimed)
        mean_loss = float(track.time_share @ track.contrast_loss)
        points.append(SweepPoint(target, track.mean_factor, mean_loss))
    return tuple(points)
