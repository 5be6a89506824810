"""Simulated participants of the ramp experiment in memory: their answers, and what is true of them."""

from __future__ import annotations

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_plan import ramp_levels
from evenlight.experiments.ramp.ramp_schedule import RampSchedule
from evenlight.experiments.ramp.ramp_task import ramp_row
from evenlight.experiments.ramp.ramp_viewing import RampViewing
from evenlight.experiments.viewing.simulate_viewing import answered_trials, participant_id
from evenlight.experiments.viewing.simulated_viewers import SimulatedViewer


def simulated_trials_and_thresholds(
    design: RampDesign, display: Display, participants: int, seed: int, viewing: RampViewing | None = None
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
    viewing : RampViewing, optional
        Of whom they are drawn.

    Returns
    -------
    trials : list of RampTrial
        Of all participants.
    thresholds : dict
        By participant and initial luminance [cd/m^2]: the rate of 75 % "yes", or 75 % right where the design
        asks so, for the design's first direction and duration [cd/m^2/s].
    """
    viewing = viewing or RampViewing(design, display)
    trials: list[RampTrial] = []
    thresholds = {}
    asked = design.procedure, design.directions[0], design.ramp_durations[0]
    for place in range(participants):
        who, observer = participant_id(place, participants), viewing.person_of((seed, place))
        trials += answered_session(viewing, (seed, place), who, observer)
        for level in ramp_levels(design, display):
            thresholds[who, level.luminance] = observer.function_at(level.luminance, *asked).threshold
    return trials, thresholds


def answered_session(
    viewing: RampViewing, session: tuple[int, int], participant: str, observer: SimulatedObserver
) -> list[RampTrial]:
    """Return the trials of a session, of a seed and place, as an observer answers them; no practice."""
    schedule = RampSchedule(viewing.design, viewing.display, *session)
    return answered_trials(schedule, ramp_row, participant, SimulatedViewer(viewing, session, observer))
