"""A ramp session conducted without a window, by a simulated participant, with what a test lets happen."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ramp_tasks import ramp_task

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.dataset_writing import enrol
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_viewing import RampViewing
from evenlight.experiments.sessions.conduct_session import SessionParts, conduct_session
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.session_store import SessionStore, begin_session
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.sessions.task import SimulatedParticipant
from evenlight.experiments.stage import RampInterval, ShownInterval
from evenlight.experiments.viewing.simulated_viewers import SimulatedViewer, ViewingAnswers
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock
from evenlight.method.preset_files import load_rate_limit

DISPLAY = Display("bench", 100.0, 0.1, 2.2, 60.0)
RIG = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0)
KEYS = Keys()
DESIGN = RampDesign(
    screens=("white",),
    factors=(0.5,),
    relative_rates=(0.02, 0.06),
    repetitions=2,
    catch_share=0.2,
    practice_trials=0,
    trials_between_breaks=0,
    ramp_durations=(0.5,),
)  # 4 ramps and a catch trial
OBSERVER = SimulatedObserver(load_rate_limit("surace2025"), 1.0, {}, 1.6, 0.05, 0.02)


class Stage(BlindStage):
    """A stage on which something happens at the ramps of some numbers, counted from 0."""

    def __init__(self, happens: dict[int, Callable[[ShownInterval], ShownInterval]]) -> None:
        self.clock = RefreshClock(RIG.refresh_rate)
        self.keyboard = SimulatedKeyboard(self.clock.now)
        super().__init__(RIG, self.clock, self.keyboard)
        self._happens, self.shown, self.pages = happens, 0, [""]

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        shown = super().show_ramp(interval)
        number, self.shown = self.shown, self.shown + 1
        return self._happens.get(number, lambda same: same)(shown)

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> Any:
        self.pages.append(text)
        return super().show_page(text, keys, footer)


class Sitter(SimulatedParticipant):
    """A simulated participant who presses the pause key on pages with some words."""

    def __init__(self, stage: Stage, *stops_at: str, observer: SimulatedObserver = OBSERVER) -> None:
        viewer = SimulatedViewer(RampViewing(DESIGN, DISPLAY), (1, 0), observer)
        super().__init__(ViewingAnswers(viewer, KEYS), stage.keyboard.queue, KEYS, (1, 0))
        self._stage, self._stops_at = stage, list(stops_at)

    def see_page(self, keys: Sequence[str]) -> None:
        # A page is announced before it is shown, so the pages are counted: the next is the one meant.
        number = str(len(self._stage.pages))
        stop = number in self._stops_at
        self._stage.keyboard.queue(keys[1] if stop else keys[0], 0.1)


def drop_ten_frames(shown: ShownInterval) -> ShownInterval:
    return dataclasses.replace(shown, frames_dropped=10)


def begun(folder: Path, design: RampDesign = DESIGN) -> SessionStore:
    enrol(folder, "01", simulated=True, provenance=Provenance())
    task = ramp_task(design, DISPLAY, RIG)
    manifest = SessionManifest(
        "01", "01", "ramp", True, SessionStatus.RUNNING, task.n_trials, DISPLAY, design, Provenance(seed=1)
    )
    return begin_session(folder, manifest, utc=str)


def conducted(
    store: SessionStore,
    stage: Stage,
    *stops_at: str,
    design: RampDesign = DESIGN,
    observer: SimulatedObserver = OBSERVER,
    report: Callable[[int], None] = lambda usable: None,
) -> SessionStatus:
    task = ramp_task(design, DISPLAY, RIG)
    cast = SessionParts(task, stage, Sitter(stage, *stops_at, observer=observer), load_pages("en"), KEYS)
    with store:
        return conduct_session(store, cast, report)
