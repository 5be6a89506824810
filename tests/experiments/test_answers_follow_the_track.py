"""Simulated viewers' answers change with the track that they see, and their population's truth says how."""

import dataclasses
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from example_tracks import example_track, header_of
from numpy.typing import ArrayLike

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.assumed_effect import CHOSEN, CHOSEN_UNMASKED, assumed_effects_in
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import SearchDesign
from evenlight.data_schema.recordings.viewing import ComparisonDesign, RatingDesign, Stimulus, Version
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.experiments.sessions.search_stage import RingPicture
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing import ring_views, search_schedule, search_task
from evenlight.experiments.viewing.ring_views import ring_alone
from evenlight.experiments.viewing.search_schedule import SearchPoint
from evenlight.experiments.viewing.simulate_viewing import (
    ViewingSimulation,
    repeated_viewing,
    simulate_viewing,
)
from evenlight.method.preset_files import load_display, load_rate_limit
from evenlight.method.rate_limit import rate_limit_at
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import KeypointRings
from evenlight.stimuli.scenes.content.catalogue import path_named
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.scene import Vector

XR3, LIMIT = load_display("varjo-xr3"), load_rate_limit("surace2025")
DESIGNS = {
    "rating": RatingDesign(sequences=("walk",)),
    "comparison": ComparisonDesign(sequences=("walk",)),
    "search": SearchDesign(sequences=("walk",)),
}
SETS, PEOPLE = 10, 17
RATE = 12.5  # [Hz] frames


@pytest.fixture
def shown(tmp_path: Path, make_curves: Callable[..., LossCurves]) -> Callable[..., LoadedStimulus]:
    """Return what makes a stimulus of factors, baseline, and content: frame means, losses at factor 0."""

    def stimulus(
        factors: ArrayLike, baseline: float, full: ArrayLike = 50.0, strength: ArrayLike = 0.1
    ) -> LoadedStimulus:
        b = np.asarray(factors, dtype=float)
        n = b.size
        curves = make_curves(np.broadcast_to(strength, n), luminance=full, frames_per_second=RATE)
        folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        write_loss_curves(folder / "loss_curves.npz", curves)
        light = b * full + XR3.reflected_luminance
        header = header_of(XR3, video="walk")
        track = example_track(b, RATE, header, mean_luminance=light, rate_limit=1.0, power=1.0)
        about = Stimulus("walk", "", "0" * 64, n, n / RATE, float(b.mean()), baseline)
        return LoadedStimulus(about, folder, track)

    return stimulus


def simulation(task: str, stimulus: LoadedStimulus, people: int = PEOPLE) -> ViewingSimulation:
    return ViewingSimulation(people, 1, task, XR3, DESIGNS[task], (stimulus,))


def ratings_of(stimulus: LoadedStimulus) -> tuple[float, float]:
    """Return the assumed difference of ratings, and the mean one of the answers."""
    (assumed,), sets = repeated_viewing(simulation("rating", stimulus), SETS)
    given = {v: [t.rating for trials in sets for t in trials if t.version is v] for v in Version}
    return assumed.value, float(np.mean(given[Version.OURS]) - np.mean(given[Version.BASELINE]))


def test_ratings_follow_the_track_in_size_and_in_sign(shown) -> None:
    # Half of the film loses (1 - b) · 0.4, half (1 - b) · 0.1; constant dimming to 0.6 loses 0.16 and 0.04.
    strength = np.repeat([0.4, 0.1], 50)

    def halves(first: float, second: float) -> LoadedStimulus:
        return shown(np.repeat([first, second], 50), 0.6, strength=strength)

    none, little, much, swapped = (
        ratings_of(halves(*factors)) for factors in ((0.6, 0.6), (0.7, 0.5), (0.8, 0.4), (0.4, 0.8))
    )
    assert none[0] == 0.0
    assert much[0] > little[0] + 0.2 > 0.4
    assert swapped[0] < -0.4
    # 170 ratings of each version, by the same people: standard error of the difference below 0.08.
    for assumed, answered in (none, little, much, swapped):
        assert answered == pytest.approx(assumed, abs=4 * 0.08)


def at_times_the_limit(multiple: float, full: Array) -> Array:
    """Return factors that go up and down between 0.3 and 0.9, at a multiple of the rate limit."""
    factor, way, factors = 0.5, 1.0, []
    for light in full:
        factors.append(factor)
        factor += way * multiple * float(rate_limit_at(LIMIT, factor * light)) / RATE / light
        factor = float(np.clip(factor, 0.3, 0.9))
        way = -1.0 if factor == 0.9 else 1.0 if factor == 0.3 else way
    return np.array(factors)


def choices_of(stimulus: LoadedStimulus) -> tuple[float, float, list[bool]]:
    """Return assumed chances of choosing ours, masked and not, and whether it was chosen, trial by trial."""
    assumed, sets = repeated_viewing(simulation("comparison", stimulus), SETS)
    chance = {effect.what: effect.value for effect in assumed}
    return chance[CHOSEN], chance[CHOSEN_UNMASKED], [trial.chose_ours for trials in sets for trial in trials]


def test_a_track_of_ten_times_the_limit_is_chosen_nearly_always_and_none_by_chance(shown) -> None:
    # A walk whose mean luminance falls and rises by 10 % per second, between 36 and 60 cd/m^2.
    times = np.arange(round(40 * RATE)) / RATE
    full = 60 * np.exp(-0.1 * (5 - np.abs(times % 10 - 5)))
    still = choices_of(shown(np.full(times.size, 0.5), 0.5, full))
    at_limit, fast = (choices_of(shown(at_times_the_limit(m, full), 0.5, full)) for m in (1.0, 10.0))
    assert still[0] == pytest.approx(0.5, abs=1e-6)
    assert fast[0] > 0.95
    assert still[0] < at_limit[0] < fast[0]
    assert at_limit[1] > 0.9  # without masking the limit is where the calibration's participants said "yes"
    # 170 choices: standard error 0.04 at most.
    for assumed, _, chosen in (still, at_limit, fast):
        assert np.mean(chosen) == pytest.approx(assumed, abs=4 * 0.04)
    assert still[2] != fast[2]


class UniformGround:
    """Paints rings on uniform ground."""

    def __init__(self, display: Display, side: int) -> None:
        self.display = display

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        return RingPicture(ring_alone(ring, 5.0, 64, self.display), 5.0)


@contextmanager
def uniform_painter(display: Display, side: int) -> Iterator[UniformGround]:
    yield UniformGround(display, side)


def points(
    design: SearchDesign, stimuli: Sequence[LoadedStimulus], display: Display, actuator: Actuator
) -> tuple[SearchPoint, ...]:
    """Two keypoints, both as bright as the track's first frame."""
    (stimulus,) = stimuli
    factors = {version: float(stimulus.factors(version)[0]) for version in Version}
    return tuple(
        SearchPoint(
            "walk", name, "house", Camera((float(k), 0.0, 1.65), 10.0),
            KeypointRings(name, (-20.0, 15.0), (0.0, 5.0), (9.0, 9.0), -5.0, 12.0, 9.5), factors,
        )
        for k, name in enumerate(("here", "there"))
    )  # fmt: skip


def searches_of(stimulus: LoadedStimulus) -> tuple[dict[str, float], dict[Version, float]]:
    """Return assumed ratios of search times, and geometric means of the times, cut at the limit."""
    assumed, sets = repeated_viewing(simulation("search", stimulus), SETS)
    trials = list(itertools.chain.from_iterable(sets))
    logs = {v: [np.log(t.search_time) for t in trials if t.version is v] for v in Version}
    return {e.group: e.value for e in assumed}, {v: float(np.exp(np.mean(logs[v]))) for v in Version}


def test_searches_follow_the_track_and_a_swapped_track_swaps_the_effect(
    shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ring_views, "OffscreenPainter", uniform_painter)
    for module in (ring_views, search_task):
        monkeypatch.setattr(module, "search_points", points)
    lighter, much_lighter, darker, same = (
        searches_of(shown(np.full(20, ours), baseline))
        for ours, baseline in ((0.4, 0.3), (0.8, 0.3), (0.3, 0.8), (0.5, 0.5))
    )
    assert same[0] == {"walk": 1.0}
    assert much_lighter[0]["walk"] < lighter[0]["walk"] < 1.0
    assert much_lighter[0]["walk"] * darker[0]["walk"] == pytest.approx(1.0)
    assert much_lighter[0]["brightened"] == much_lighter[0]["walk"]
    assert darker[0]["dimmed"] == darker[0]["walk"]
    assert much_lighter[1][Version.OURS] < much_lighter[1][Version.BASELINE]
    assert darker[1][Version.OURS] > darker[1][Version.BASELINE]


def test_simulated_searchers_see_a_display_that_dims_as_the_model_has_it(shown) -> None:
    # All of the basement at 0.05: pixels of a headset, no darker than 0.2 cd/m^2, would wash rings out there.
    seconds = path_named("basement").duration
    dark = shown(np.full(round(seconds * RATE), 0.05), 0.3)
    about = dataclasses.replace(dark.stimulus, name="basement", duration=seconds)
    stimuli, design = (dataclasses.replace(dark, stimulus=about),), SearchDesign(sequences=("basement",))
    with pytest.raises(InputError, match="would be left"):
        search_schedule.search_points(design, stimuli, XR3, Actuator.PIXELS)
    rig = simulation("search", dark).setting("01", 0, Provenance(seed=1)).rig
    assert search_schedule.search_points(design, stimuli, XR3, rig.actuator)


def test_the_first_of_many_data_sets_is_the_one_of_that_seed_and_its_truth_is_written(
    shown, tmp_path: Path
) -> None:
    chosen = simulation(
        "rating", shown(np.repeat([0.8, 0.4], 50), 0.6, strength=np.repeat([0.4, 0.1], 50)), 3
    )
    simulate_viewing(chosen, tmp_path / "data")
    lines = [
        json.loads(line)["rating"]
        for who in ("01", "02", "03")
        for line in (tmp_path / f"data/sub-{who}/ses-01/trials.jsonl").read_text().splitlines()
    ]
    assumed, sets = repeated_viewing(chosen, 2)
    assert [trial.rating for trial in sets[0]] == lines
    assert [trial.rating for trial in sets[1]] != lines
    assert assumed_effects_in(tmp_path / "data") == assumed
