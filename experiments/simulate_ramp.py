"""Many simulated participants of the ramp experiment at once, without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data_schema.dataset_layout import SIMULATED_TRUTH
from data_schema.display import Display
from data_schema.mapping import mapping_from_record
from data_schema.provenance import Provenance, provenance_now
from data_schema.ramp import RampDesign, RampTrial
from data_schema.rate_limit import RateLimit
from data_schema.session import SessionManifest, SessionStatus
from data_schema.text_files import write_json
from experiments.dataset import new_dataset, write_description, write_participants, write_session
from experiments.design import PlannedRamp, RampLevel, ramp_levels, ramp_order
from experiments.simulated_observers import ObserverPopulation, SimulatedObserver, draw_observer

SESSION = "01"


@dataclass(frozen=True, slots=True)
class RampSimulation:
    """What is simulated.

    Attributes
    ----------
    participants : int
        How many.
    seed : int
        Of all random numbers; participant k is the same however many there are.
    display : Display
        What the ramps are shown on.
    design : RampDesign
        Which ramps.
    limit : RateLimit
        The population's median threshold.
    population : ObserverPopulation
        How participants differ.
    """

    participants: int
    seed: int
    display: Display
    design: RampDesign
    limit: RateLimit
    population: ObserverPopulation


def simulate_dataset(
    simulation: RampSimulation, dataset: Path, report: Callable[[int], None] = lambda done: None
) -> None:
    """Write a data set of simulated ramp sessions, and the truth behind it.

    Parameters
    ----------
    simulation : RampSimulation
        Who and what.
    dataset : Path
        Folder to be made; it must not hold anything.
    report : callable, optional
        Called with the number of participants done.
    """
    provenance = provenance_now(seed=simulation.seed)
    digits = max(2, len(str(simulation.participants)))
    ids = [f"{k + 1:0{digits}d}" for k in range(simulation.participants)]
    seeds = np.random.SeedSequence(simulation.seed).spawn(simulation.participants)
    levels = ramp_levels(simulation.design, simulation.display)
    luminances = tuple(level.luminance for level in levels)
    truths = []
    with new_dataset(dataset) as staging:
        write_description(staging, "Evenlight ramp calibration", simulated=True, provenance=provenance)
        write_participants(staging, ids, simulated=True)
        for done, (participant, seed) in enumerate(zip(ids, seeds, strict=True), start=1):
            rng = np.random.default_rng(seed)
            observer = draw_observer(simulation.limit, luminances, rng, simulation.population)
            order = ramp_order(simulation.design, simulation.display, rng)
            trials = answered(order, participant, observer, simulation.design, rng)
            write_session(staging, _manifest(simulation, participant, len(trials), provenance), trials)
            truths.append(_truth(participant, observer, levels))
            report(done)
        write_json(staging / SIMULATED_TRUTH, _truth_file(simulation, truths))


def answered(
    order: list[PlannedRamp],
    participant: str,
    observer: SimulatedObserver,
    design: RampDesign,
    rng: np.random.Generator,
) -> list[RampTrial]:
    """Return the trials of a session as a simulated observer answers them."""
    return [
        RampTrial(
            participant_id=participant,
            session_id=SESSION,
            trial_index=index,
            screen=ramp.level.screen,
            factor=ramp.level.factor,
            initial_luminance=ramp.level.luminance,
            final_luminance=ramp.final_luminance,
            rate=ramp.rate,
            duration=design.ramp_duration,
            is_catch=ramp.is_catch,
            response=observer.answer(ramp.level.luminance, ramp.rate, rng),
            response_time=None,
            simulated=True,
        )
        for index, ramp in enumerate(order)
    ]


def _manifest(
    simulation: RampSimulation, participant: str, n_trials: int, provenance: Provenance
) -> SessionManifest:
    """Return the manifest of a complete simulated session."""
    return SessionManifest(
        participant_id=participant,
        session_id=SESSION,
        task="ramp",
        simulated=True,
        status=SessionStatus.COMPLETE,
        n_trials=n_trials,
        display=simulation.display,
        design=simulation.design,
        provenance=provenance,
    )


def _truth(participant: str, observer: SimulatedObserver, levels: tuple[RampLevel, ...]) -> dict[str, Any]:
    """Return what is true of a simulated participant."""
    return {
        "participant_id": participant,
        "sensitivity": observer.sensitivity,
        "width": observer.width,
        "guess_rate": observer.guess_rate,
        "lapse_rate": observer.lapse_rate,
        "levels": [
            {
                "screen": level.screen,
                "factor": level.factor,
                "luminance_cd_m2": level.luminance,
                "threshold_cd_m2_s": observer.threshold_at(level.luminance),
            }
            for level in levels
        ],
    }


def _truth_file(simulation: RampSimulation, participants: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the content of the file that holds the truth."""
    return {
        "simulated": True,
        "seed": simulation.seed,
        "rate_limit": simulation.limit.name,
        "population": mapping_from_record(simulation.population),
        "participants": participants,
    }
