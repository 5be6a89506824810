"""The parts of the reproduction, each as findings, in the order of the paper."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.findings import Findings
from evenlight.analysis.reproduction.adaptation_findings import adaptation_findings
from evenlight.analysis.reproduction.glance import glance_findings
from evenlight.analysis.reproduction.online_findings import online_findings
from evenlight.analysis.reproduction.online_run import TargetSweep, online_run, target_sweep
from evenlight.analysis.reproduction.power_comparison import power_findings
from evenlight.analysis.reproduction.reproduced_slopes import slope_findings
from evenlight.analysis.reproduction.reproduced_tables import detail_quality_findings
from evenlight.analysis.reproduction.reproduced_tracks import (
    contrast_findings,
    example_findings,
    sequence_findings,
)
from evenlight.analysis.reproduction.reproduction import Reproduction
from evenlight.data_schema.loss_curves import LossCurves
from evenlight.data_schema.statistic import Origin
from evenlight.method.controller import Controller, ControllerSettings
from evenlight.method.curve_lookup import loss_and_slope
from evenlight.method.scalar_rate_limit import scalar_rate_limit

SWEPT = "basement"  # the sequence of the paper's curve of target loss against brightness
TARGETS = 20  # target losses of that curve, up to what the lowest factor loses on average
WALK_FACTOR = (
    0.5  # the walk's target is what this factor would lose on average: the paper does not say which it held
)
SHOWN = "library"  # the sequence whose frame shows lost contrast


def parts_of(made: Reproduction) -> tuple[Findings, ...]:
    """Return what the reproduction found, part by part.

    Parameters
    ----------
    made : Reproduction
        What the pipeline made.
    """
    found = made.tasks.findings
    simulated = made.tasks.simulated["ramp"]
    by_name = {sequence.name: sequence for sequence in made.sequences}
    parts = (
        slope_findings(found["ramp"], made.panel.rate_limit),
        contrast_findings(by_name[SHOWN]),
        example_findings(made.examples, simulated),
        sequence_findings(made.sequences, simulated),
        detail_quality_findings(found["rating"], found["comparison"]),
        found["rating"],
        found["comparison"],
        found["search"],
        adaptation_findings([sequence.tracks for sequence in made.sequences], Origin.COMPUTED),
        power_findings(made.sequences, made.plan.data),
        _online(made, by_name[SWEPT].curves),
    )
    return glance_findings({part.name: part for part in parts}), *parts


def _online(made: Reproduction, swept: LossCurves) -> Findings:
    """Return what the online controller does on the walk, and over target losses."""
    limit = scalar_rate_limit(made.panel.rate_limit, made.panel.display.reflected_luminance)
    controller = Controller(ControllerSettings(_mean_loss(made.walk, WALK_FACTOR)), limit)
    largest = _mean_loss(swept, float(swept.factors[0]))
    sweep = target_sweep(swept, controller, np.linspace(0.0, largest, TARGETS + 1)[1:].tolist())
    return online_findings(online_run(made.walk, controller), TargetSweep(SWEPT, swept.n_frames, sweep))


def _mean_loss(curves: LossCurves, factor: float) -> float:
    """Return the contrast loss under constant dimming, mean over time."""
    loss, _ = loss_and_slope(curves, np.full(curves.n_frames, factor))
    return float(np.average(loss, weights=curves.durations))
