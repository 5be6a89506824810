"""Many simulated participants of a viewing experiment at once, without a window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.dataset_layout import SIMULATED_TRUTH
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.session import DESIGN_OF_TASK
from evenlight.data_schema.recordings.viewing import (
    ComparisonDesign,
    ComparisonTrial,
    RatingDesign,
    RatingTrial,
    Version,
)
from evenlight.data_schema.storage.text_files import write_json
from evenlight.experiments.design_files import load_task_design
from evenlight.experiments.ramp.simulate_ramp import SESSION, participant_id, simulated_manifest
from evenlight.experiments.sessions.dataset import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.experiments.stimulus_folder import LoadedStimulus, load_stimuli
from evenlight.experiments.viewing.comparison_task import PlannedComparison, comparison_order
from evenlight.experiments.viewing.rating_task import PlannedRating, rating_order
from evenlight.experiments.viewing.search_schedule import PlannedSearch, search_order, search_points
from evenlight.experiments.viewing.simulated_viewers import (
    SimulatedViewer,
    Viewing,
    ViewingDesign,
    open_viewing,
)
from evenlight.method.preset_files import load_display
from evenlight.stimuli.rings.landolt import gap_pixels
from evenlight.stimuli.rings.ring_light import shown_contrast

TITLES = {"rating": "detail rating", "comparison": "artifact comparison", "search": "Landolt-ring search"}
Planned = PlannedRating | PlannedComparison | PlannedSearch
ViewingTrial = RatingTrial | ComparisonTrial | SearchTrial


@dataclass(frozen=True, slots=True)
class ViewingSimulation:
    """What is simulated.

    Attributes
    ----------
    participants : int
        How many.
    seed : int
        Of all random numbers; participant k is the same however many there are.
    display : Display
        What everything is shown on.
    design : RatingDesign, ComparisonDesign or SearchDesign
        Which experiment.
    stimuli : sequence of LoadedStimulus
        The sequences of the design.
    """

    participants: int
    seed: int
    display: Display
    design: ViewingDesign
    stimuli: Sequence[LoadedStimulus]

    @property
    def task(self) -> str:
        """Name of the experiment."""
        return next(task for task, cls in DESIGN_OF_TASK.items() if isinstance(self.design, cls))


def load_simulation(
    task: str, folder: Path, people: tuple[int, int], display: str, design: str
) -> ViewingSimulation:
    """Return what a command names.

    Parameters
    ----------
    task : str
        "rating", "comparison" or "search".
    folder : Path
        With a folder for each sequence.
    people : (int, int)
        How many participants, from which seed.
    display, design : str
        Presets or files.

    Raises
    ------
    InputError
        If one of them cannot be loaded, or they do not go together.
    """
    shown, asked = load_display(display), cast(ViewingDesign, load_task_design(task, design))
    stimuli = load_stimuli(folder, asked.sequences, shown, with_video=False)
    return ViewingSimulation(*people, shown, asked, stimuli)


def simulate_viewing(
    simulation: ViewingSimulation, dataset: Path, report: Callable[[int], None] = lambda done: None
) -> None:
    """Write a data set of simulated sessions of a viewing experiment, and the truth behind it.

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
    orders = _orders(simulation)
    with (
        open_viewing(simulation.design, simulation.stimuli, simulation.display) as viewing,
        new_dataset(dataset) as staging,
    ):
        write_description(staging, f"Evenlight {TITLES[simulation.task]}", True, provenance)
        ids = [participant_id(k, simulation.participants) for k in range(simulation.participants)]
        write_participants(staging, ids, simulated=True)
        truths = []
        for order_index, participant in enumerate(ids):
            viewer = SimulatedViewer(viewing, (simulation.seed, order_index))
            trials = answered_trials(simulation, orders(order_index), participant, viewer)
            manifest = simulated_manifest(
                simulation,
                participant,
                order_index,
                task=simulation.task,
                n_trials=len(trials),
                provenance=provenance,
                stimuli=tuple(stimulus.stimulus for stimulus in simulation.stimuli),
            )
            write_session(staging, manifest, trials)
            truths.append({"participant_id": participant, **viewer.truth()})
            report(order_index + 1)
        write_json(staging / SIMULATED_TRUTH, _truth_file(simulation, viewing, truths))


def answered_trials(
    simulation: ViewingSimulation, order: Sequence[Planned], participant: str, viewer: SimulatedViewer
) -> list[ViewingTrial]:
    """Return the trials of a session as a simulated participant answers them; practice is left out."""
    rows: dict[type[Planned], Callable[..., ViewingTrial]] = {
        PlannedRating: _rating,
        PlannedComparison: _comparison,
        PlannedSearch: _search,
    }
    trials = []
    for index, planned in enumerate(order):
        place = {
            "participant_id": participant,
            "session_id": SESSION,
            "trial_index": index,
            "simulated": True,
            "response_time": None,
        }
        trials.append(rows[type(planned)](simulation, planned, viewer, place))
    return trials


def _rating(
    simulation: ViewingSimulation, planned: PlannedRating, viewer: SimulatedViewer, place: dict[str, Any]
) -> RatingTrial:
    """Return the row of a rated video."""
    return RatingTrial(
        **place,
        **planned.columns,
        mean_factor=_stimulus(simulation, planned.sequence).mean_factor(planned.version),
        rating=viewer.answer(planned, place["trial_index"]),
    )


def _comparison(
    simulation: ViewingSimulation, planned: PlannedComparison, viewer: SimulatedViewer, place: dict[str, Any]
) -> ComparisonTrial:
    """Return the row of a comparison."""
    stimulus = _stimulus(simulation, planned.sequence)
    return ComparisonTrial(
        **place,
        **planned.columns,
        mean_factor=stimulus.mean_factor(Version.OURS),
        baseline_factor=stimulus.mean_factor(Version.BASELINE),
        response=viewer.answer(planned, place["trial_index"]),
    )


def _search(
    simulation: ViewingSimulation, planned: PlannedSearch, viewer: SimulatedViewer, place: dict[str, Any]
) -> SearchTrial:
    """Return the row of a search."""
    answer, display = viewer.answer(planned, place["trial_index"]), simulation.display
    found, limit = answer.found_after is not None, viewer.viewing.time_limit
    background = viewer.viewing.views.of(planned).background_luminance
    return SearchTrial(
        **place,
        **planned.columns,
        shown_contrast=shown_contrast(
            planned.ring.contrast, background, planned.factor, display, by_pixels=True
        ),
        background_luminance=background,
        gap_pixels=gap_pixels(planned.ring, display.pixels_per_degree),
        time_limit=limit,
        found=found,
        search_time=answer.found_after if found else limit,
        reported_orientation=answer.orientation,
    )


def _stimulus(simulation: ViewingSimulation, name: str) -> LoadedStimulus:
    """Return the stimulus of a name."""
    return next(stimulus for stimulus in simulation.stimuli if stimulus.name == name)


def _orders(simulation: ViewingSimulation) -> Callable[[int], Sequence[Planned]]:
    """Return what gives the trials of the participant at a place in the data set."""
    design = simulation.design
    if isinstance(design, RatingDesign):
        return lambda order_index: rating_order(design, order_index)
    if isinstance(design, ComparisonDesign):
        return lambda order_index: comparison_order(design, order_index)
    points = search_points(design, simulation.stimuli, simulation.display)
    return lambda order_index: search_order(design, points, simulation.seed, order_index)


def _truth_file(
    simulation: ViewingSimulation, viewing: Viewing, participants: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the content of the file that holds the truth."""
    return {
        "simulated": True,
        "task": simulation.task,
        "seed": simulation.seed,
        "population": mapping_from_record(viewing.population),
        "stimuli": viewing.shared_truth(),
        "participants": participants,
    }
