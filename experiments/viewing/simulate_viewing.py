"""Many simulated participants of an experiment at once, without a window."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.recordings.assumed_effect import AssumedEffect
from evenlight.data_schema.recordings.dataset_layout import SIMULATED_TRUTH
from evenlight.data_schema.recordings.dataset_writing import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.data_schema.recordings.ramp import Trial
from evenlight.data_schema.recordings.rig import Actuator, Rig
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.storage.text_files import write_json
from evenlight.experiments.design_files import load_task_design
from evenlight.experiments.experiment_kinds import EXPERIMENTS
from evenlight.experiments.sessions.fixed_order import FixedOrder
from evenlight.experiments.sessions.task import SessionSetting, Task
from evenlight.experiments.stimulus_folder import LoadedStimulus, load_stimuli, track_display
from evenlight.experiments.viewing.simulated_viewers import SimulatedViewer, Viewing
from evenlight.method.preset_files import DEFAULT_DISPLAY, load_display
from evenlight.stimuli.rings.ring_scene import ring_places

SESSION = "01"


@dataclass(frozen=True, slots=True)
class ViewingSimulation:
    """What is simulated."""

    participants: int  # how many
    seed: int  # of all random numbers; participant k is the same however many there are
    task: str  # which experiment
    display: Display  # what everything is shown on
    design: Any  # the experiment's
    stimuli: Sequence[LoadedStimulus] = ()  # the sequences of the design; none of ramps

    def setting(self, participant: str, order_index: int, provenance: Provenance) -> SessionSetting:
        """Return what a participant's session is made from."""
        manifest = SessionManifest(
            participant_id=participant,
            session_id=SESSION,
            task=self.task,
            simulated=True,
            status=SessionStatus.COMPLETE,
            n_trials=0,
            display=self.display,
            design=self.design,
            provenance=provenance,
            order_index=order_index,
            stimuli=tuple(stimulus.stimulus for stimulus in self.stimuli),
        )
        rig = Rig(
            "simulated",
            self.display.name,
            viewing_distance=1.0,
            refresh_rate=60.0,
            # Videos dim as the model has it: all that the display emits, its black included.
            actuator=Actuator.PIXELS if self.task == "ramp" else Actuator.BACKLIGHT,
            backlight="simulated",
        )
        return SessionSetting(manifest, rig, self.stimuli)


def load_simulation(
    task: str, folder: Path | None, people: tuple[int, int], display: str | None, design: str | None
) -> ViewingSimulation:
    """Return what a command names.

    Parameters
    ----------
    task : str
        Which experiment.
    folder : Path or None
        With a folder for each sequence, if it shows sequences.
    people : (int, int)
        How many participants, from which seed.
    display : str or None
        Preset or file; None for the one that the first sequence's track was made for, else `varjo-xr3`.
    design : str or None
        Preset or file; None for the task's default.

    Raises
    ------
    InputError
        If one of them cannot be loaded, or they do not go together.
    """
    asked: Any = load_task_design(task, design)
    shown = track_display(folder, asked.sequences) if display is None and folder is not None else None
    shown = shown or load_display(display or DEFAULT_DISPLAY)
    stimuli = load_stimuli(folder, asked.sequences, shown, with_video=False) if folder is not None else ()
    for each in () if EXPERIMENTS[task].shows_videos else stimuli:
        if each.path.endswith(".json"):
            ring_places(each.path)  # where they are still to be chosen, before what draws them is opened
    return ViewingSimulation(*people, task, shown, asked, stimuli)


def simulate_viewing(
    simulation: ViewingSimulation, dataset: Path, report: Callable[[int], None] = lambda done: None
) -> None:
    """Write a data set of simulated sessions of an experiment, and the truth behind it.

    Parameters
    ----------
    simulation : ViewingSimulation
        Who and what.
    dataset : Path
        Folder to be made; it must not hold anything.
    report : callable, optional
        Called with the number of participants done.

    Raises
    ------
    InputError
        If there is something already, or the stimuli do not serve; for a search, without OpenGL.
    """
    provenance = provenance_now(seed=simulation.seed)
    experiment = EXPERIMENTS[simulation.task]
    ids = [participant_id(k, simulation.participants) for k in range(simulation.participants)]
    settings = [simulation.setting(who, k, provenance) for k, who in enumerate(ids)]
    if experiment.viewing is None:
        raise InputError(f"the task {simulation.task!r} declares no simulated observer")
    with experiment.viewing(settings[0]) as viewing, new_dataset(dataset) as staging:
        write_description(staging, f"Evenlight {experiment.title}", True, provenance)
        write_participants(staging, ids, simulated=True)
        truths = []
        for setting in settings:
            viewer, task = SimulatedViewer(viewing, setting.session), experiment.task(setting)
            trials = answered_trials(task, task.row, setting.manifest.participant_id, viewer)
            write_session(staging, dataclasses.replace(setting.manifest, n_trials=len(trials)), trials)
            truths.append({"participant_id": setting.manifest.participant_id, **viewer.truth()})
            report(len(truths))
        write_json(staging / SIMULATED_TRUTH, viewing.truth_file(settings[0], truths))


def repeated_viewing(
    simulation: ViewingSimulation, repetitions: int
) -> tuple[tuple[AssumedEffect, ...], tuple[tuple[Trial, ...], ...]]:
    """Return what is true of the population, and the trials of many data sets, in memory.

    The first has the seed of the simulation, and the trials that `simulate_viewing` writes; the seeds of the
    others follow it.

    Parameters
    ----------
    simulation, repetitions : ViewingSimulation, int
        Who and what, and how many data sets.
    """
    experiment, provenance = EXPERIMENTS[simulation.task], provenance_now(seed=simulation.seed)
    if experiment.viewing is None:
        raise TypeError(f"the task {simulation.task} is no viewing experiment")
    with experiment.viewing(simulation.setting("01", 0, provenance)) as viewing:
        assumed = viewing.assumed(simulation.setting("01", 0, provenance))
        seeds = range(simulation.seed, simulation.seed + repetitions)
        origins = (dataclasses.replace(provenance, seed=seed) for seed in seeds)
        return assumed, tuple(tuple(_trials_of(simulation, viewing, origin)) for origin in origins)


def _trials_of(simulation: ViewingSimulation, viewing: Viewing, provenance: Provenance) -> Iterator[Trial]:
    """Yield the trials of the data set of a seed, which the provenance has, participant by participant."""
    for place in range(simulation.participants):
        who = participant_id(place, simulation.participants)
        setting = simulation.setting(who, place, provenance)
        task = EXPERIMENTS[simulation.task].task(setting)
        yield from answered_trials(task, task.row, who, SimulatedViewer(viewing, setting.session))


def answered_trials(
    order: FixedOrder | Task, row: Callable[..., Any], participant: str, viewer: SimulatedViewer
) -> list[Any]:
    """Return the trials of a session as a simulated participant answers them; practice is left out.

    Parameters
    ----------
    order : FixedOrder or Task
        What comes next.
    row : callable
        Makes the record of a trial of what was planned, the answer, and the other columns.
    participant, viewer : str, SimulatedViewer
        Who answers.
    """
    trials: list[Any] = []
    while (planned := order.next_trial()) is not None:
        columns = {
            "participant_id": participant,
            "session_id": SESSION,
            "trial_index": len(trials),
            "simulated": True,
            "response_time": None,
            **viewer.viewing.columns(planned),
        }
        trial = row(planned, viewer.answer(planned, len(trials)), columns)
        order.take(trial)
        trials.append(trial)
    return trials


def participant_id(order_index: int, participants: int) -> str:
    """Return the id of a simulated participant.

    >>> participant_id(0, 10)
    '01'
    """
    return f"{order_index + 1:0{max(2, len(str(participants)))}d}"
