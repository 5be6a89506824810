"""Rays find in the tree of boxes what a look at every patch finds, however the patches lie."""

import numpy as np
import pytest

from evenlight.stimuli.scenes.engine.light.ray_tree import CHOSEN, DEPTH, LEAF, blocker, nearest, ray_tree
from evenlight.stimuli.scenes.engine.scene import Patches

N_RAYS = 1500
EDGE = 1e-4  # share of a patch's side: whether so near its edge a ray hits is up to rounding


def patches_of(origin, along, across, triangle):
    n = len(origin)
    return Patches(
        origin, along, across, triangle, np.zeros((n, 3, 3)), np.zeros((n, 3, 2)),
        np.zeros(n, dtype=np.int64), np.ones((n, 3)), np.zeros((n, 3)),
    )  # fmt: skip


def random_patches(rng, n):
    """Parallelograms and triangles up to 3 m long, strewn over 20 m."""
    origin, along, across = (rng.uniform(-reach, reach, (n, 3)) for reach in (10, 1.5, 1.5))
    return patches_of(origin, along, across, rng.random(n) < 0.5)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def random_rays(rng, n, reach=12.0):
    """Starts and directions, rounded to what compiled code computes with."""
    starts, directions = rng.uniform(-reach, reach, (n, 3)), unit(rng.normal(size=(n, 3)))
    return starts.astype(np.float32), directions.astype(np.float32)


def tree_of(patches):
    return ray_tree(patches, np.ones(len(patches)))


def met(patches, start, direction):
    """Distance at which a ray meets each patch (infinity: never), and whether an edge is too near to say.

    By Cramer's rule for o + d x = p + a s + b t, in doubles; a ray along a patch's plane does not meet it.
    """
    d, a, b = direction.astype(float), patches.along, patches.across
    normal, away = np.cross(a, b), start.astype(float) - patches.origin
    volume = normal @ -d
    sizes = np.linalg.norm(normal, axis=1)
    volume = np.where(np.abs(volume) > 1e-12 * sizes, volume, np.nan)
    x = (away * normal).sum(axis=1) / volume
    s = (np.cross(away, b) @ -d) / volume
    t = (np.cross(a, away) @ -d) / volume
    third = np.where(patches.triangle, 1 - s - t, np.minimum(1 - s, 1 - t))
    inside = np.minimum(np.minimum(s, t), third)  # how far inside, in sides
    unsure = (np.abs(inside) < EDGE) & (x > -EDGE)
    return np.where((inside >= 0) & (x > 0), x, np.inf), bool(unsure.any())


def found(tree, start, direction, own=-1):
    """Patch and distance of the nearest hit by the tree: -1 and infinity for none."""
    k, far, _, _ = nearest(tree, *start, *direction, own, 0, np.empty((2, DEPTH)))
    return (int(tree.patch[k]) if k >= 0 else -1), float(far)


def stopped(tree, start, direction, far, own=-1, other=-1):
    ray = *start, *direction, np.float32(far), own, other, 0
    first = blocker(tree, *ray, -1, np.empty((2, DEPTH)))
    # What is tried first changes nothing, be it that which stops the ray or anything else.
    for guess in (first, 0):
        assert (blocker(tree, *ray, guess, np.empty((2, DEPTH))) >= 0) == (first >= 0)
    return first >= 0


def levels(tree):
    """How many levels of nodes lie below the first one."""
    deepest, left = 0, [(0, 0)]
    while left:
        node, level = left.pop()
        deepest = max(deepest, level)
        if tree.many[node] == 0:
            left += [(int(tree.first[node]) + side, level + 1) for side in (0, 1)]
    return deepest


@pytest.mark.parametrize(("seed", "n"), [(1, 3), (2, 40), (3, 600)])
def test_the_nearest_hit_is_that_of_a_look_at_every_patch(seed, n):
    rng = np.random.default_rng(seed)
    patches = random_patches(rng, n)
    tree, unsure_rays, hits = tree_of(patches), 0, 0
    for start, direction in zip(*random_rays(rng, N_RAYS), strict=True):
        distances, unsure = met(patches, start, direction)
        unsure_rays += unsure
        if unsure:
            continue
        patch, far = found(tree, start, direction)
        assert (patch >= 0) == bool(np.isfinite(distances).any())
        if patch >= 0:
            hits += 1
            assert far == pytest.approx(distances.min(), abs=1e-4)
            assert distances[patch] == pytest.approx(distances.min(), abs=1e-4)
    assert unsure_rays < 0.05 * N_RAYS
    assert 0 < hits < N_RAYS - unsure_rays  # both answers came up


def test_a_ray_does_not_see_the_patch_it_starts_from():
    rng = np.random.default_rng(4)
    patches = random_patches(rng, 600)
    tree, seen = tree_of(patches), 0
    for start, direction in zip(*random_rays(rng, 500), strict=True):
        distances, unsure = met(patches, start, direction)
        if unsure or not np.isfinite(distances).any():
            continue
        first = int(distances.argmin())
        distances[first] = np.inf
        patch, far = found(tree, start, direction, own=first)
        assert far == pytest.approx(distances.min(), abs=1e-4)
        assert patch != first
        seen += 1
    assert seen > 50


def test_a_shadow_falls_where_a_look_at_every_patch_finds_something_in_between():
    rng = np.random.default_rng(5)
    patches = random_patches(rng, 600)
    tree, answers = tree_of(patches), []
    for start, direction in zip(*random_rays(rng, N_RAYS), strict=True):
        far = rng.uniform(0.5, 20)
        own, other = rng.integers(0, 600, 2)
        distances, unsure = met(patches, start, direction)
        distances[[own, other]] = np.inf
        if unsure or (np.abs(distances - far) < 1e-4).any():
            continue
        expected = bool((distances < far).any())
        assert stopped(tree, start, direction, far, own, other) == expected
        answers.append(expected)
    assert len(answers) > 0.95 * N_RAYS
    assert 0.1 < np.mean(answers) < 0.9


def test_something_beyond_the_end_of_a_ray_casts_no_shadow():
    wall = patches_of(*np.array([[[-1.0, 2, -1]], [[2.0, 0, 0]], [[0, 0, 2.0]]]), np.array([False]))
    tree, start, north = tree_of(wall), np.zeros(3, np.float32), np.array([0, 1, 0], np.float32)
    assert not stopped(tree, start, north, 1.999)
    assert stopped(tree, start, north, 2.001)
    assert not stopped(tree, start, north, 2.001, other=0)
    assert found(tree, start, north) == (0, 2.0)


def growing_patches(per_side, growth):
    """Squares on all six half axes, each time farther from the middle and larger by a factor.

    Of twelve even slices along an axis, the outermost squares have the first and the last, and all others
    share those in the middle.
    """
    size = 1e-3 * growth ** np.repeat(np.arange(per_side), 6)
    axis, sign = np.tile(np.arange(6) // 2, per_side), np.tile([1.0, -1.0], 3 * per_side)
    ahead, along, across = (np.eye(3)[(axis + turn) % 3] for turn in range(3))
    size = size[:, None]
    middle = sign[:, None] * ahead * size
    return patches_of(
        middle - 0.05 * size * (along + across), 0.1 * size * along, 0.1 * size * across,
        np.zeros(len(size), dtype=bool),
    )  # fmt: skip


def test_patches_that_part_off_one_by_one_make_no_deeper_tree_than_rays_can_walk():
    """A walk keeps one node a level: with more levels than its stack has places it would write beyond it.

    A step of six squares takes three levels at least, one for each axis: 28 steps would take more than 64.
    """
    patches = growing_patches(28, 12.5)
    tree = tree_of(patches)
    assert 3 * 28 - LEAF > DEPTH
    assert levels(tree) <= DEPTH
    assert np.sort(tree.patch).tolist() == list(range(len(patches)))


def test_rays_between_patches_that_grow_find_what_a_look_at_every_patch_finds():
    """Three levels for each of 14 steps are more than are split where it is cheapest: the rest is halved."""
    assert 3 * 14 - LEAF > CHOSEN
    rng = np.random.default_rng(6)
    patches = growing_patches(14, 12.5)
    tree, hits = tree_of(patches), 0
    middles = patches.origin + 0.5 * (patches.along + patches.across)
    for k in range(len(patches)):
        # Just in front of a square, and from there past the others.
        start = (0.9 * middles[k]).astype(np.float32)
        for direction in [unit(middles[k]), *unit(rng.normal(size=(5, 3)))]:
            direction = direction.astype(np.float32)
            distances, unsure = met(patches, start, direction)
            if unsure:
                continue
            patch, far = found(tree, start, direction)
            assert (patch >= 0) == bool(np.isfinite(distances).any())
            if patch >= 0:
                hits += 1
                assert far == pytest.approx(distances.min(), rel=1e-3)
    assert hits >= len(patches)


def test_patches_in_one_place_are_halved_until_they_are_few():
    """None is told apart from another by its place: 2^10 patches in leaves of 2 make 9 levels."""
    one = np.array([[-1.0, 3, -1]]), np.array([[2.0, 0, 0]]), np.array([[0, 0, 2.0]])
    patches = patches_of(*(np.repeat(row, 1024, axis=0) for row in one), np.zeros(1024, dtype=bool))
    tree = tree_of(patches)
    assert levels(tree) == 9
    assert found(tree, np.zeros(3, np.float32), np.array([0, 1, 0], np.float32))[1] == 3.0
