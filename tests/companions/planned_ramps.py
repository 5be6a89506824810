"""Simulated observers to plan ramps with, quick to fit: one screen, five factors."""

from __future__ import annotations

import numpy as np
from example_ramps import ramp_of

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial, Response
from evenlight.method.contrast.luminance import displayed_luminance
from evenlight.method.psychometric import PsychometricFunction, yes_probability

PARTICIPANT_SD, LEVEL_SD = 0.25, 0.1  # of ln(threshold)
RELATIVE_THRESHOLD = 0.03  # [1/s]
# One screen of five factors: enough for the fourth degree, and few fits.
DESIGN = RampDesign(screens=("white",), relative_rates=(0.012, 0.02, 0.03, 0.045, 0.07))


def simulated(
    design: RampDesign, display: Display, participants: int, seed: int
) -> tuple[list[RampTrial], dict[tuple[str, float], float]]:
    """Logistic observers with thresholds about 3 %/s, shown constant stimuli in passes of all rates."""
    trials, truth = [], {}
    peak = float(displayed_luminance(1.0, display)) - display.reflected_luminance
    for k in range(participants):
        rng, who, index = np.random.default_rng([seed, k]), f"{k + 1:02d}", 0
        sensitivity = float(np.exp(PARTICIPANT_SD * rng.standard_normal()))
        for factor in design.factors:
            luminance = factor * peak
            own = sensitivity * float(np.exp(LEVEL_SD * rng.standard_normal()))
            truth[who, luminance] = RELATIVE_THRESHOLD * luminance * own
            function = PsychometricFunction(truth[who, luminance], 1.6, 0.05, 0.02)
            rates = [r for _ in range(design.repetitions) for r in rng.permutation(design.relative_rates)]
            for relative in (*rates, *([0.0] * round(len(rates) * 0.25))):
                seen = rng.random() < float(yes_probability(relative * luminance, function))
                trials.append(
                    ramp_of(
                        luminance, relative * luminance, participant_id=who, trial_index=index, factor=factor,
                        response=Response.YES if seen else Response.NO,
                    )
                )  # fmt: skip
                index += 1
    return trials, truth
