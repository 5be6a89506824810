"""Many simulated participants of the ramp experiment at once, without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.dataset_layout import SIMULATED_TRUTH
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.ramp import Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.session import SessionManifest, SessionStatus
from evenlight.data_schema.text_files import write_json
from evenlight.experiments.dataset import new_dataset, write_description, write_participants, write_session
from evenlight.experiments.design import PlannedRamp, RampCondition, RampLevel, ramp_conditions, ramp_levels
from evenlight.experiments.ramp_schedule import RampSchedule
from evenlight.experiments.session_plan import levels_of
from evenlight.experiments.simulated_observers import (
    ObserverPopulation,
    SimulatedObserver,
    answer_generator,
    draw_observer,
)
from evenlight.method.preset_files import load_rate_limit

SESSION = "01"
PUBLISHED = "surace2025"  # whose rate limit is the median person's yes/no threshold


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
        The median person's yes/no threshold.
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
    truths = []
    with new_dataset(dataset) as staging:
        write_description(staging, "Evenlight ramp calibration", simulated=True, provenance=provenance)
        ids = [participant_id(k, simulation.participants) for k in range(simulation.participants)]
        write_participants(staging, ids, simulated=True)
        for done, (order_index, participant) in enumerate(enumerate(ids), start=1):
            observer = participant_of(simulation, order_index)
            trials = answered_session(simulation, order_index, participant, observer)
            manifest = _manifest(simulation, order_index, participant, len(trials), provenance)
            write_session(staging, manifest, trials)
            truths.append(_truth(participant, observer, simulation))
            report(done)
        write_json(staging / SIMULATED_TRUTH, _truth_file(simulation, truths))


def simulated_trials(
    design: RampDesign,
    display: Display,
    participants: int,
    seed: int,
    population: ObserverPopulation | None = None,
) -> list[RampTrial]:
    """Return the trials of simulated participants, in memory, of the published population."""
    return simulated_trials_and_thresholds(design, display, participants, seed, population)[0]


def simulated_trials_and_thresholds(
    design: RampDesign,
    display: Display,
    participants: int,
    seed: int,
    population: ObserverPopulation | None = None,
) -> tuple[list[RampTrial], dict[tuple[str, float], float]]:
    """Return the trials of simulated participants, and what is true of them.

    Parameters
    ----------
    design : RampDesign
        Which ramps.
    display : Display
        What they are shown on.
    participants, seed : int
        How many, from which seed.
    population : ObserverPopulation, optional
        How participants differ.

    Returns
    -------
    trials : list of RampTrial
        Of all participants.
    thresholds : dict
        By participant and initial luminance [cd/m^2]: the rate of 75 % "yes", or 75 % right where the design
        asks so, for the design's first direction and duration [cd/m^2/s].
    """
    limit = load_rate_limit(PUBLISHED)
    people = population or ObserverPopulation()
    simulation = RampSimulation(participants, seed, display, design, limit, people)
    trials: list[RampTrial] = []
    thresholds = {}
    for order_index in range(participants):
        participant = participant_id(order_index, participants)
        observer = participant_of(simulation, order_index)
        trials += answered_session(simulation, order_index, participant, observer)
        for level in ramp_levels(design, display):
            function = observer.function_at(
                level.luminance, design.procedure, design.directions[0], design.ramp_durations[0]
            )
            thresholds[participant, level.luminance] = function.threshold
    return trials, thresholds


def participant_id(order_index: int, participants: int) -> str:
    """Return the id of a simulated participant.

    >>> participant_id(0, 10)
    '01'
    """
    return f"{order_index + 1:0{max(2, len(str(participants)))}d}"


def participant_of(simulation: RampSimulation, order_index: int) -> SimulatedObserver:
    """Return a participant of a simulation, the same however many there are."""
    chance = np.random.default_rng(np.random.SeedSequence(simulation.seed, spawn_key=(order_index,)))
    luminances = tuple(level.luminance for level in ramp_levels(simulation.design, simulation.display))
    return draw_observer(simulation.limit, luminances, chance, simulation.population)


def answered_session(
    simulation: RampSimulation, order_index: int, participant: str, observer: SimulatedObserver
) -> list[RampTrial]:
    """Return the trials of a session as a simulated observer answers them; practice is left out."""
    schedule = RampSchedule(simulation.design, simulation.display, simulation.seed, order_index)
    trials: list[RampTrial] = []
    while (ramp := schedule.next_trial()) is not None:
        chance = answer_generator(simulation.seed, order_index, len(trials))
        response = observer.answer(ramp, chance)
        trial = _row(ramp, participant, len(trials), response)
        schedule.take(trial)
        trials.append(trial)
    return trials


def _row(ramp: PlannedRamp, participant: str, trial_index: int, response: Response) -> RampTrial:
    """Return the record of an answered trial."""
    return RampTrial(
        participant_id=participant,
        session_id=SESSION,
        trial_index=trial_index,
        response=response,
        response_time=None,
        simulated=True,
        **ramp.columns,
    )


def _manifest(
    simulation: RampSimulation, order_index: int, participant: str, n_trials: int, provenance: Provenance
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
        order_index=order_index,
    )


def _truth(participant: str, observer: SimulatedObserver, simulation: RampSimulation) -> dict[str, Any]:
    """Return what is true of a simulated participant: in yes/no, and at each level as the design asks."""
    return {
        "participant_id": participant,
        "sensitivity": observer.sensitivity,
        "caution": observer.caution,
        "width": observer.width,
        "guess_rate": observer.guess_rate,
        "lapse_rate": observer.lapse_rate,
        "levels": [
            _true_level(level, condition, observer, simulation.design.procedure)
            for condition in ramp_conditions(simulation.design)
            for level in levels_of(simulation.design, simulation.display, condition)
        ],
    }


def _true_level(
    level: RampLevel, condition: RampCondition, observer: SimulatedObserver, procedure: Procedure
) -> dict[str, Any]:
    """Return what is true of a simulated participant at a level, in one direction and duration."""
    function = observer.function_at(level.luminance, procedure, condition.direction, condition.duration)
    return {
        "screen": level.screen,
        "factor": level.factor,
        "luminance_cd_m2": level.luminance,
        "direction": condition.direction.value,
        "ramp_duration_s": condition.duration,
        "procedure": procedure.value,
        "threshold_cd_m2_s": function.threshold,
        "width": function.width,
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
