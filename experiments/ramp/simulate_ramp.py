"""Many simulated participants of the ramp experiment at once, without a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.dataset_layout import SIMULATED_TRUTH
from evenlight.data_schema.recordings.dataset_writing import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial, Response
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.storage.text_files import write_json
from evenlight.experiments.ramp.ramp_observer import (
    MEDIAN_RATE_LIMIT,
    ObserverPopulation,
    SimulatedObserver,
    answer_generator,
    draw_observer,
)
from evenlight.experiments.ramp.ramp_plan import (
    RampCondition,
    RampLevel,
    levels_of,
    ramp_conditions,
    ramp_levels,
)
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.method.preset_files import load_rate_limit

SESSION = "01"


@dataclass(frozen=True, slots=True)
class RampSimulation:
    """What is simulated."""

    participants: int  # how many
    seed: int  # of all random numbers; participant k is the same however many there are
    display: Display  # what the ramps are shown on
    design: RampDesign  # which ramps
    limit: RateLimit  # the median person's yes/no threshold
    population: ObserverPopulation  # how participants differ


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
            about = {"task": "ramp", "n_trials": len(trials), "provenance": provenance}
            manifest = simulated_manifest(simulation, participant, order_index, **about)
            write_session(staging, manifest, trials)
            truths.append(_truth(participant, observer, simulation))
            report(done)
        write_json(staging / SIMULATED_TRUTH, _truth_file(simulation, truths))


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
    limit = load_rate_limit(MEDIAN_RATE_LIMIT)
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


def _row(ramp: PlannedTrial, participant: str, trial_index: int, response: Response) -> RampTrial:
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


def simulated_manifest(simulation: Any, participant: str, order_index: int, **about: Any) -> SessionManifest:
    """Return the manifest of a complete simulated session.

    Parameters
    ----------
    simulation : RampSimulation or ViewingSimulation
        Display and design.
    participant : str
        Who takes part.
    order_index : int
        The participant's place in the data set.
    **about
        The manifest's other fields: task, number of trials, provenance, stimuli.
    """
    return SessionManifest(
        participant_id=participant,
        session_id=SESSION,
        simulated=True,
        status=SessionStatus.COMPLETE,
        display=simulation.display,
        design=simulation.design,
        order_index=order_index,
        **about,
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
