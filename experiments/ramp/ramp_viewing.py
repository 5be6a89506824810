"""Who sees the ramps of a simulated session: observers of known thresholds, and what is true of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import RampDesign, Response
from evenlight.experiments.chance import Purpose
from evenlight.experiments.ramp.ramp_observer import (
    MEDIAN_RATE_LIMIT,
    ObserverPopulation,
    SimulatedObserver,
    draw_observer,
)
from evenlight.experiments.ramp.ramp_plan import (
    RampCondition,
    RampLevel,
    levels_of,
    ramp_conditions,
    ramp_levels,
)
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.method.preset_files import load_rate_limit


@dataclass(frozen=True, slots=True)
class RampViewing(Viewing):
    """Ramps: answers are those of `Response`."""

    # which ramps, on what
    design: RampDesign
    display: Display
    # the median person's yes/no threshold
    limit: RateLimit = field(default_factory=lambda: load_rate_limit(MEDIAN_RATE_LIMIT))
    population: ObserverPopulation = field(default_factory=ObserverPopulation)  # how participants differ
    purposes: tuple[Purpose, Purpose] = (Purpose.PERSON, Purpose.ANSWERS)

    def draw(self, rng: np.random.Generator) -> SimulatedObserver:
        """Return a participant."""
        luminances = tuple(level.luminance for level in ramp_levels(self.design, self.display))
        return draw_observer(self.limit, luminances, rng, self.population)

    def person_of(self, session: tuple[int, int]) -> SimulatedObserver:
        """Return the participant of a seed and a place, the same however many there are."""
        seed, place = session
        return self.draw(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(place,))))

    def answer(self, person: SimulatedObserver, planned: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return the answer to a ramp."""
        return person.answer(planned, rng)

    def truth(self, person: SimulatedObserver) -> dict[str, Any]:
        """Return what is true of a participant: in yes/no, and at each level as the design asks."""
        return {
            "sensitivity": person.sensitivity,
            "caution": person.caution,
            "width": person.width,
            "guess_rate": person.guess_rate,
            "lapse_rate": person.lapse_rate,
            "levels": [
                self._true_level(person, level, condition)
                for condition in ramp_conditions(self.design)
                for level in levels_of(self.design, self.display, condition)
            ],
        }

    def _true_level(
        self, person: SimulatedObserver, level: RampLevel, condition: RampCondition
    ) -> dict[str, Any]:
        """Return what is true of a participant at a level, in one direction and duration."""
        procedure, direction, duration = self.design.procedure, condition.direction, condition.duration
        function = person.function_at(level.luminance, procedure, direction, duration)
        return {
            "screen": level.screen,
            "factor": level.factor,
            "luminance_cd_m2": level.luminance,
            "direction": direction.value,
            "ramp_duration_s": duration,
            "procedure": procedure.value,
            "threshold_cd_m2_s": function.threshold,
            "width": function.width,
        }

    def truth_file(self, setting: SessionSetting, participants: list[dict[str, Any]]) -> dict[str, Any]:
        """Return what is true of a data set."""
        return {
            "simulated": True,
            "seed": setting.session[0],
            "rate_limit": self.limit.name,
            "population": mapping_from_record(self.population),
            "participants": participants,
        }


def ramp_viewing(setting: SessionSetting) -> RampViewing:
    """Return what simulated participants of a ramp session see in a setting."""
    return RampViewing(setting.design, setting.display)
