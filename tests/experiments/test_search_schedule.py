"""The order of searches: each keypoint once in each version, never twice at the same place."""

from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchDesign
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.experiments import stimulus_folder
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.stimulus_folder import LoadedStimulus, as_searched
from evenlight.experiments.viewing import search_schedule
from evenlight.experiments.viewing.search_schedule import (
    SearchPoint,
    relative_azimuth,
    search_order,
    search_points,
    search_practice,
)
from evenlight.method.preset_files import load_display
from evenlight.stimuli.rings.ring_scene import PRACTICE_SIZE, KeypointRings, RingPlaces, ring_places
from evenlight.stimuli.scenes.content.catalogue import PATHS, files_sha256, path_named, scene_searched
from evenlight.stimuli.scenes.engine.camera import Camera

XR3 = load_display("varjo-xr3")
N = 12
BALANCED = 4  # participants after which versions and places are balanced


def point(k: int) -> SearchPoint:
    return SearchPoint(
        sequence="library",
        keypoint=f"place {k}",
        scene="school",
        camera=Camera((float(k), 0.0, 1.65), 350.0, focal_length=1000.0),
        rings=KeypointRings(f"place {k}", (20.0, -25.0), (5.0, -5.0), (8.0 + k, 8.5 + k), 3.0, 22.0, 9.0),
        factors={Version.OURS: 0.6, Version.BASELINE: 0.5},
    )


POINTS = [point(k) for k in range(N)]
DESIGN = SearchDesign(sequences=("library",), practice_trials=3)


def order_of(participant: int, seed: int = 1) -> tuple[PlannedTrial, ...]:
    return search_order(DESIGN, POINTS, seed, participant)


@pytest.mark.parametrize("participant", range(BALANCED + 1))
def test_everybody_searches_each_keypoint_once_in_each_version_at_two_places(participant: int) -> None:
    order = order_of(participant)
    assert Counter((t.keypoint, t.version) for t in order) == {
        (p.keypoint, version): 1 for p in POINTS for version in Version
    }
    assert len({(t.keypoint, t.ring_place) for t in order}) == 2 * N


@pytest.mark.parametrize("participant", range(BALANCED))
def test_each_half_of_a_session_has_every_keypoint_and_both_versions_equally_often(participant: int) -> None:
    for block in (1, 2):
        half = [t for t in order_of(participant) if t.block == block]
        assert {t.keypoint for t in half} == {p.keypoint for p in POINTS}
        assert Counter(t.version for t in half) == {Version.OURS: N // 2, Version.BASELINE: N // 2}


def test_over_four_participants_no_version_of_a_keypoint_is_tied_to_a_half_or_a_place() -> None:
    seen = Counter(
        (t.keypoint, t.version, t.block, t.ring_place) for p in range(BALANCED) for t in order_of(p)
    )
    combinations = N * 2 * 2 * 2
    assert len(seen) == combinations
    assert set(seen.values()) == {1}


def test_of_any_ten_participants_about_half_see_a_version_of_a_keypoint_first() -> None:
    firsts = [
        {t.keypoint for t in order_of(p) if t.block == 1 and t.version is Version.OURS} for p in range(30)
    ]
    for start in range(21):
        ours = Counter(name for own in firsts[start : start + 10] for name in own)
        assert all(4 <= ours[p.keypoint] <= 6 for p in POINTS)
    assert len(set(map(frozenset, firsts))) > 10  # two, before they were drawn


@pytest.mark.parametrize("n", [5, 12, 21])
def test_no_place_in_the_session_is_tied_to_a_version(n: int) -> None:
    """Over four rounds of the square, half of the trials at each place of the session are ours."""
    everybody = 4 * n * (1 + n % 2)
    points = [point(k) for k in range(n)]
    ours = [0] * (2 * n)
    for participant in range(everybody):
        for place, trial in enumerate(search_order(DESIGN, points, 1, participant)):
            ours[place] += trial.version is Version.OURS
    assert set(ours) == {everybody // 2}


def test_each_participant_has_an_order_of_their_own_and_keeps_it() -> None:
    orders = [[t.keypoint for t in order_of(participant)] for participant in range(BALANCED)]
    assert len({tuple(order) for order in orders}) == BALANCED
    assert order_of(2) == order_of(2)


def test_the_gap_points_everywhere_as_often_as_possible() -> None:
    turned = Counter(t.ring.orientation for t in order_of(0))
    assert set(turned) == set(ORIENTATIONS)
    assert max(turned.values()) - min(turned.values()) <= 1
    assert [t.ring.orientation for t in order_of(0)] != [t.ring.orientation for t in order_of(0, seed=2)]


def test_the_ring_lies_where_the_file_says_from_the_first_direction_of_view() -> None:
    for trial in order_of(0):
        azimuth = {1: 20.0, 2: -25.0}[trial.ring_place]
        assert trial.columns["ring_azimuth"] == pytest.approx(azimuth)
        assert trial.ring.azimuth == pytest.approx(350.0 + azimuth)
        assert trial.factor == {Version.OURS: 0.6, Version.BASELINE: 0.5}[trial.version]


def test_practice_has_larger_rings_at_places_that_the_session_does_not_use() -> None:
    practice = search_practice(DESIGN, POINTS, 1, 0)
    assert len(practice) == DESIGN.practice_trials
    for trial in practice:
        assert trial.ring.gap == PRACTICE_SIZE * DESIGN.ring_gap
        assert trial.ring.contrast == DESIGN.ring_contrast
        assert relative_azimuth(trial.ring.azimuth, trial.camera.azimuth) == pytest.approx(3.0)
        assert trial.ring.altitude == 22.0
        assert trial.practice
        assert trial.block == 0


@pytest.mark.parametrize(
    ("azimuths", "altitude", "practice", "refused"),
    [
        ((20.0, -61.0), 0.0, 3.0, "farther off than the view turns; need azimuths of 60 and alt"),
        ((20.0, -25.0), 61.0, 3.0, "farther off"),
        ((20.0, -25.0), 0.0, -170.0, "farther off"),
        ((20.0, 39.9), 0.0, 3.0, "need two that are 20 degrees apart"),
    ],
)
def test_places_of_ones_own_are_reached_and_apart(monkeypatch, azimuths, altitude, practice, refused):
    rings = KeypointRings("stacks", azimuths, (0.0, altitude), (8.0, 8.0), practice, 5.0, 8.0)
    own = RingPlaces("library", 1, (rings,))
    monkeypatch.setattr(search_schedule, "ring_places", lambda path: own)
    with pytest.raises(InputError, match=f"^library/stacks: its places of rings .*{refused}"):
        stacks(-0.3, 0.9)


class Track:
    """A brightness track of one factor for each version, as long as any path."""

    folder = "folder"
    track = SimpleNamespace(times=np.array([0.0]))
    stimulus = SimpleNamespace(duration=path_named("library").duration)

    def __init__(self, name: str, ours: float) -> None:
        self.name = self.path = name
        self._factors = {Version.OURS: ours, Version.BASELINE: 0.9}

    def factors(self, version: Version) -> list[float]:
        return [self._factors[version]]


def stacks(contrast: float, factor: float, actuator: Actuator = Actuator.PIXELS) -> tuple[SearchPoint, ...]:
    """The darkest keypoint of the library, on the headset."""
    design = SearchDesign(sequences=("library",), keypoints=("library/stacks",), ring_contrast=contrast)
    return search_points(design, [Track("library", factor)], XR3, actuator)


def test_a_path_in_a_file_beside_the_folder_of_its_track_is_searched(tmp_path, monkeypatch) -> None:
    """It goes before a built-in one of its name, in the scene that it says."""
    stimulus = LoadedStimulus(SimpleNamespace(name="library"), tmp_path / "library", None)
    assert stimulus.path == "library"
    (tmp_path / "library.json").write_text((PATHS / "library.json").read_text())
    assert stimulus.path == str(tmp_path / "library.json")
    monkeypatch.setattr(search_schedule, "ring_places", lambda path: ring_places(Path(path).stem))
    track = Track("library", 0.9)
    track.path = stimulus.path
    design = SearchDesign(sequences=("library",), keypoints=("library/stacks",))
    assert [point.scene for point in search_points(design, [track], XR3)] == [stimulus.path]
    assert scene_searched(stimulus.path).name == "school"


@pytest.mark.parametrize(("made_of", "refused"), [("other", True), ("now", False), (None, False)])
def test_a_track_that_was_made_of_another_scene_is_not_searched_with(tmp_path, monkeypatch, made_of, refused):
    """Tracks of earlier versions do not say what they were made of."""
    path = tmp_path / "walk.json"
    path.write_text((PATHS / "library.json").read_text())
    for name in ("ring_places", "_require_true_size", "search_sha256"):
        monkeypatch.setattr(stimulus_folder, name, str)
    inputs = {} if made_of is None else {"path": made_of}
    if made_of == "now":
        inputs["path"] = files_sha256(path_named(str(path)))
    track = SimpleNamespace(header=SimpleNamespace(provenance=SimpleNamespace(inputs=inputs)))
    stimulus = Stimulus("walk", "", "0" * 64, 1, 1.0, 0.5, 0.5)
    loaded = LoadedStimulus(stimulus, tmp_path / "walk", track)
    told = pytest.raises(InputError, match=r"was made when .* or its scene was another")
    with told if refused else nullcontext():
        assert as_searched([loaded])[0].stimulus.video_sha256 == str(path)


def darkest_around_the_stacks() -> float:
    """Eq. 1 for the display and the code of the darkest of the three places, by hand [cd/m^2]."""
    rings = next(each for each in ring_places("library").keypoints if each.keypoint == "stacks")
    luminance = min(*rings.luminances, rings.practice_luminance)
    return (104.4 - 0.2) * (luminance / 100) ** (1.95 / 2.2) + 0.2


def test_a_contrast_that_dimming_pixels_would_take_a_tenth_of_is_refused() -> None:
    """A dark ring at black has the contrast black / (b I) - 1: b is taken just above and below where that is
    nine tenths of -0.5.
    """
    edge = 0.2 / (darkest_around_the_stacks() * (1 - 0.45))
    assert len(stacks(-0.5, edge * 1.001)) == 1
    with pytest.raises(
        InputError,
        match=r"library/stacks the version ours \(b = 0\.\d+\) .*than 0\.2: .*-0\.5, -0\.45 .* -0\.49",
    ):
        stacks(-0.5, edge * 0.999)
    assert len(stacks(-0.5, edge * 0.999, Actuator.BACKLIGHT)) == 1


@pytest.mark.parametrize("factor", [0.2, 0.24, 0.3])
def test_the_contrast_that_the_refusal_names_is_accepted(factor) -> None:
    with pytest.raises(InputError, match="would be left") as caught:
        stacks(-0.7, factor)
    named = float(str(caught.value).partition("give one from ")[2].partition(" to 0")[0])
    assert named < 0
    assert len(stacks(named, factor)) == 1


def test_where_even_the_surroundings_would_be_black_no_contrast_is_named() -> None:
    with pytest.raises(InputError, match="would be left; name keypoints without this one"):
        stacks(-0.2, 0.1)
