"""Between two intervals there is no other clue than the change: an observer of the steps is at chance."""

from collections.abc import Sequence

import numpy as np
import pytest
from ramp_tasks import ramp_task

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.recordings.ramp import IntervalGap, Procedure, RampDesign
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.ramp_task import RampTask
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.staging import BlindStage
from evenlight.experiments.sessions.task import TrialPlace
from evenlight.experiments.stage import RampInterval, ShownInterval
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.protocols import KeyPress
from evenlight.hardware.simulated.clocks import RefreshClock

DISPLAY = Display("bench", 100.0, 0.1, 2.2, 60.0)
RIG = Rig("bench", "bench.toml", viewing_distance=0.6, refresh_rate=60.0)
TRIALS = 600


class Steps(BlindStage):
    """Notes how far the luminance steps where an interval ends, and where one begins: ln of the ratio."""

    def __init__(self) -> None:
        clock = RefreshClock(60.0)
        super().__init__(RIG, clock, SimulatedKeyboard(clock.now))
        self._shown, self._is_end = 1.0, False
        self.into: list[float] = []
        self.out: list[float] = []

    def _step_to(self, luminance: float) -> float:
        step, self._shown = float(np.log(luminance / self._shown)), luminance
        return step

    def _after_an_interval(self, luminance: float) -> None:
        step = self._step_to(luminance)
        if self._is_end:
            self.out.append(step)
        self._is_end = False

    def wait(self, seconds: float, luminance: float, pixel_value: float | None = None) -> None:
        self._after_an_interval(luminance)

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        self.into.append(self._step_to(interval.initial_luminance))
        self._shown, self._is_end = interval.final_luminance, True
        return ShownInterval(0.0, (0.0,), (interval.initial_luminance,))

    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        self._after_an_interval(luminance)
        return KeyPress(keys[0], 1.0)


class Nobody:
    def see_page(self, keys: Sequence[str]) -> None: ...

    def see_trial(self, planned: PlannedTrial, trial_index: int) -> None: ...


def observed(
    factor: float, screens: tuple[str, ...], kind: IntervalGap = IntervalGap.RANDOM_STEPS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which interval changed in many trials, by 7 % in 5 s, and the steps out of and into both, (n, 2)."""
    design = RampDesign(
        procedure=Procedure.TWO_INTERVAL,
        screens=screens,
        factors=(factor,),
        relative_rates=(0.014,),
        repetitions=TRIALS,
        interval_gap_kind=kind,
    )
    task, pages = ramp_task(design, DISPLAY, RIG), load_pages("en")
    planned = task.next_trial()
    assert planned is not None
    sides = 1 + np.arange(TRIALS) % 2
    stages = [Steps() for _ in sides]
    for index, (side, stage) in enumerate(zip(sides.tolist(), stages, strict=True)):
        shown = planned.but(ramp_interval=side)
        task.conduct(shown, TrialPlace("01", "01", index, 1, True), stage, Nobody(), pages)
    return sides, np.array([stage.out for stage in stages]), np.array([stage.into for stage in stages])


@pytest.mark.parametrize(("factor", "screens"), [(0.5, ("white",)), (1.0, ("white",)), (0.2, ("gray",))])
def test_who_looks_at_the_steps_alone_is_right_in_half_of_the_trials(
    factor: float, screens: tuple[str, ...]
) -> None:
    """The interval with the greater step up, or the greater step, out of it or into it: all are at chance.

    3 standard errors of the share of 600 trials are 6 %.
    """
    sides, out, into = observed(factor, screens)
    for steps in (out, np.abs(out), into, np.abs(into)):
        assert steps.shape == (TRIALS, 2)
        chosen = 1 + np.argmax(steps, axis=1)
        assert abs(np.mean(chosen == sides) - 0.5) < 0.062


@pytest.mark.parametrize(("factor", "screens"), [(0.5, ("white",)), (1.0, ("white",)), (0.2, ("gray",))])
def test_with_a_steady_gap_nothing_steps_whichever_interval_changes(
    factor: float, screens: tuple[str, ...]
) -> None:
    _, out, into = observed(factor, screens, IntervalGap.STEADY)
    assert out.shape == into.shape == (TRIALS, 2)
    np.testing.assert_allclose(out, 0.0, atol=1e-12)
    np.testing.assert_allclose(into, 0.0, atol=1e-12)


@pytest.mark.parametrize(("ramp_interval", "ends"), [(1, [(50, 45), (45, 45)]), (2, [(50, 50), (50, 45)])])
def test_with_a_steady_gap_the_second_interval_goes_on_where_the_first_ended(
    ramp_interval: int, ends: list[tuple[float, float]]
) -> None:
    """50 cd/m^2 that fall by 2 % per second for 5 s, to 45."""
    design = RampDesign(
        procedure=Procedure.TWO_INTERVAL, screens=("white",), factors=(0.5,), relative_rates=(0.02,),
        interval_gap_kind=IntervalGap.STEADY,
    )  # fmt: skip
    task = ramp_task(design, DISPLAY, RIG)
    planned = task.next_trial()
    assert planned is not None
    intervals = task._intervals(planned.but(ramp_interval=ramp_interval), noise_seed=0)
    assert [(i.initial_luminance, i.final_luminance) for i in intervals] == [
        (pytest.approx(initial), pytest.approx(final)) for initial, final in ends
    ]
    assert [interval.label for interval in intervals] == ["1", "2"]


def test_a_design_of_an_earlier_version_means_what_it_meant_and_says_so_to_the_participant() -> None:
    """Its steps are in the instructions now; a new design's participant reads that nothing steps."""
    old = record_from_mapping(RampDesign, {"procedure": "two_interval"}, "manifest.json")
    assert (old.interval_gap_kind, old.fixation_mark) == (IntervalGap.RANDOM_STEPS, False)
    pages = load_pages("en")
    for design, words in (
        (old, "the brightness jumps several times"),
        (load_design("recommended"), "nothing jumps"),
    ):
        assert words in pages.text(ramp_task(design, DISPLAY, RIG).instructions, Keys())


def test_with_a_gap_of_one_luminance_the_greater_step_would_always_tell(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So that the tests above can fail: from 7 % lower it is a greater step up to 60 cd/m^2."""
    monkeypatch.setattr(RampTask, "_gaps", lambda *_: [(60.0, 60.0)] * 3)
    sides, out, _ = observed(0.5, ("white",))
    assert (1 + np.argmax(out, axis=1) == sides).all()


def test_every_step_is_another_and_mostly_greater_than_a_change_at_threshold() -> None:
    _, out, into = observed(0.5, ("white",))
    assert len(set(np.round(out, 9).ravel())) == 2 * TRIALS
    assert np.median(np.abs(out)) > 0.07
    assert np.median(np.abs(into)) > 0.07
