"""The school: what is where, how it is lit, and that the two walks through it meet no wall."""

import itertools

import numpy as np
import pytest
from scene_places import place_at

from evenlight.stimuli.scenes.content.catalogue import path_named, scene_named
from evenlight.stimuli.scenes.content.school import building
from evenlight.stimuli.scenes.content.school.school import school
from evenlight.stimuli.scenes.content.school.shelves import book_row
from evenlight.stimuli.scenes.content.textures.school import SPINE_ROWS, faded_spines, library_spines
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import SEED, Material

pytestmark = pytest.mark.slow

CLEARANCE = 0.2  # [m] between an eye and what it passes
# In the order of the paper's description of its library: bright, rooms with dimmer light, the dark shelves.
WALKS = {
    "library": ["schoolyard", "lobby", "corridor", "reading hall", "stacks"],
    "gym": ["schoolyard", "lobby", "corridor", "changing room", "gym"],
}
PLACES = {
    "reading hall": (10.8, -6.0), "window bay": (10.8, -9.8), "stacks": (-1.8, -5.9), "corridor": (8.0, 1.5),
    "lobby": (21.5, -2.0), "changing room": (29.0, -1.9), "gym": (44.0, -5.0), "schoolyard": (21.5, -15.0),
}  # fmt: skip
MATERIALS = [
    material
    for value in vars(building).values()
    for material in (value.values() if isinstance(value, dict) else [value])
    if isinstance(material, Material)
]


@pytest.fixture(scope="module")
def scene():
    return scene_named("school")


@pytest.mark.parametrize("name", PLACES)
def test_each_place_is_where_its_name_says(scene, name):
    assert place_at(scene, (*PLACES[name], 1.65)) == name


def test_the_same_seed_builds_the_same_school_and_another_seed_other_books(scene):
    again = school(SEED)
    for column in ("origin", "along", "across", "uvs", "tint", "material"):
        np.testing.assert_array_equal(getattr(again.patches, column), getattr(scene.patches, column))
    first, second = (shelf(seed) for seed in (SEED, SEED + 1))
    assert first.shape != second.shape or (first != second).any()


def shelf(seed):
    """Return which spines stand on a shelf of the library, as texture coordinates."""
    model = SceneModel("school", seed)
    book_row(model, model.rng_for("reading hall"), 0.9, 0.3)
    return model.build().patches.uvs


def test_it_has_no_more_triangles_than_a_processor_draws_in_time(scene):
    assert 2 * len(scene.patches) - np.count_nonzero(scene.patches.triangle) <= 250_000


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_keeps_its_distance_from_all_there_is(scene, walk):
    path = path_named(walk)
    corners = triangles(scene.patches)
    low, high = corners.min(axis=1) - CLEARANCE, corners.max(axis=1) + CLEARANCE
    for time in np.arange(0.0, path.duration, 0.2):
        eye = path.position(time)
        near = ((eye >= low) & (eye <= high)).all(axis=1)
        if near.any():
            assert distances(eye, corners[near]).min() >= CLEARANCE, f"{walk} at {time:.1f} s, {eye}"


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_stays_where_one_may_walk(scene, walk):
    path = path_named(walk)
    for time in np.arange(0.0, path.duration, 0.1):
        x, y, _ = path.position(time)
        assert any(ground.contains(x, y) for ground in scene.walkable), (
            f"{walk} at {time:.1f} s, {x:.2f} {y:.2f}"
        )


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_is_no_run(walk):
    path = path_named(walk)
    places = np.array([path.position(time) for time in np.arange(0.0, path.duration, 0.25)])
    pace = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.25
    assert pace.max() < 2.0  # [m/s]: people stroll at 1 to 1.5 (Bohannon 1997)


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_leads_from_the_sun_through_dimmer_rooms(scene, walk):
    path = path_named(walk)
    places = [place_at(scene, point.position) for point in path.keypoints]
    assert [place for place, _ in itertools.groupby(places) if place] == WALKS[walk]
    assert 60 <= path.duration <= 80


@pytest.mark.parametrize("walk", WALKS)
def test_a_walker_turns_no_faster_than_an_eighth_of_a_circle_in_a_second(walk):
    path = path_named(walk)
    azimuths = [path.camera(time).azimuth for time in np.arange(0.0, path.duration, 0.1)]
    turns = np.abs((np.diff(azimuths) + 180) % 360 - 180) / 0.1
    assert turns.max() <= 45


@pytest.mark.parametrize("walk", WALKS)
def test_what_is_searched_on_a_walk_lies_in_five_places(scene, walk):
    path = path_named(walk)
    assert len(path.places) == 5
    assert len({place_at(scene, path.keypoint(name).position) for name in path.places}) >= 3


def test_no_two_surfaces_lie_in_each_other(scene):
    # Where two different ones show the same side in one plane, chance says which is drawn: it flickers.
    patches, found = scene.patches, []
    flat = (np.abs(patches.along * patches.across).max(axis=1) < 1e-9) & ~patches.triangle
    facing = np.cross(patches.along, patches.across)
    corners = np.stack([patches.origin, patches.origin + patches.along + patches.across], axis=1)
    low, high = corners.min(axis=1), corners.max(axis=1)
    for axis, sign in itertools.product(range(3), (-1, 1)):
        size = np.linalg.norm(facing, axis=1)
        chosen = np.flatnonzero(flat & (sign * facing[:, axis] > 0.9999 * size))
        chosen = chosen[np.argsort(low[chosen, axis], kind="stable")]
        level, across = low[chosen, axis], [a for a in range(3) if a != axis]
        for step in itertools.count(1):
            first = np.flatnonzero(level[step:] - level[:-step] < 0.0005)
            if not first.size:
                break
            a, b = chosen[first], chosen[first + step]
            shared = np.minimum(high[a], high[b]) - np.maximum(low[a], low[b])
            other = (patches.material[a] != patches.material[b]) | (patches.tint[a] != patches.tint[b]).any(1)
            area = shared[:, across].clip(0).prod(axis=1)
            found += [low[k].round(2).tolist() for k in a[other & (area > 1e-4)]]
    assert found == []


def test_a_book_of_the_store_is_never_too_dark_to_be_shown_dimmed():
    # White paper in the stacks has 3 cd/m^2 or more where it is not hidden. A book that reflects 5 % of that,
    # 0.15 cd/m^2, is 0.20 cd/m^2 at a factor of 0.57 on a display whose black is 0.2: (0.2 + 0.15) * 0.57.
    assert faded_spines(np.random.default_rng(2), 64).min() >= 0.05


@pytest.mark.parametrize("material", MATERIALS, ids=lambda material: material.name)
def test_a_texture_reflects_no_more_than_all_light_and_is_the_same_again(material):
    first, second = (material.texture(np.random.default_rng(5), 64) for _ in range(2))
    assert first.shape == (64, 64, 4 if material.cutout else 3)
    assert first.dtype == np.float32
    assert first.min() >= 0
    assert first.max() <= 1
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(
    "name", ["ceiling tiles", "gym floor", "cork", "paint", "vinyl", "linoleum", "chain link"]
)
def test_a_surface_goes_on_without_a_seam(name):
    texture = next(material.texture for material in MATERIALS if material.name == name)
    picture = texture(np.random.default_rng(7), 128)
    for axis in (0, 1):
        steps = np.abs(picture - np.roll(picture, 1, axis=axis)).mean(axis=(1 - axis, 2))
        assert steps[0] <= steps[1:].max()  # the step over the edge is one of those inside


def test_every_book_of_a_row_of_spines_is_as_tall_as_the_row():
    # The rows are told apart by the labels at their feet: nothing runs over from one to the next.
    spines = library_spines(np.random.default_rng(2), 256)
    rows = spines.reshape(SPINE_ROWS, -1, *spines.shape[1:])
    foot = rows[:, int(0.84 * rows.shape[1])].mean(axis=(1, 2))
    head = rows[:, int(0.10 * rows.shape[1])].mean(axis=(1, 2))
    assert (foot > 1.5 * head).all()


def triangles(patches):
    """Return the corners of all triangles, (n, 3, 3): a parallelogram is two."""
    o, a, b = patches.origin, patches.origin + patches.along, patches.origin + patches.across
    far = (a + patches.across)[~patches.triangle]
    other = np.stack([a[~patches.triangle], far, b[~patches.triangle]], axis=1)
    return np.concatenate([np.stack([o, a, b], axis=1), other])


def distances(point, corners):
    """Return how far a point is from triangles, (n,): from the plane above the inside, else an edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    out = point - corners
    along = np.clip((out * edges).sum(2) / (edges**2).sum(2), 0, 1)
    from_edges = np.linalg.norm(out - along[..., None] * edges, axis=2).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    inside = ((np.cross(edges, out) * normal[:, None]).sum(2) >= 0).all(axis=1)
    from_plane = np.abs((out[:, 0] * normal).sum(1)) / np.linalg.norm(normal, axis=1)
    return np.where(inside, from_plane, from_edges)


def test_the_distance_from_a_triangle_is_that_from_its_nearest_point():
    corners = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]])
    assert distances(np.array([1.0, 1, 3]), corners) == pytest.approx(3)
    assert distances(np.array([2.0, -3, 4]), corners) == pytest.approx(5)
    assert distances(np.array([-2.0, -1, 2]), corners) == pytest.approx(3)
