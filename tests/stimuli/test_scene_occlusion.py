"""What is left out because walls hide it would not have been seen: frames are the same with it drawn."""

import numpy as np
import pytest

from evenlight.stimuli.scenes.engine import renderer
from evenlight.stimuli.scenes.engine.camera import FAR, NEAR, Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.vertices import Blocks, not_hidden

SIZE = (320, 180)
CODE = 65535 / 1023  # pixel values per code of 10 bits


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def grained(rng, size):
    return rng.uniform(0.2, 0.9, (size, size, 3)).astype(np.float32)


def leafy(rng, size):
    there = (rng.random((size, size, 1)) < 0.7).astype(np.float32)
    return np.concatenate([grained(rng, size), there], axis=2)


def house_with_a_door():
    """Two rooms, 12 by 8 m, with a door in the wall between them, things in both, and trees outside."""
    model, rng = SceneModel("rooms", 1), np.random.default_rng(8)
    wall, floor, thing = (Material(name, grained, 1.0) for name in ("wall", "floor", "thing"))
    leaves = Material("leaves", leafy, 0.5, cutout=True)
    model.box([-40, -40, -0.3], [40, 40, 0], floor)
    for low, high in [
        ([-6, -4.2, 0], [6, -4, 3]),
        ([-6, 4, 0], [6, 4.2, 3]),
        ([-6.2, -4, 0], [-6, 4, 3]),
        ([6, -4, 0], [6.2, 4, 3]),
        ([-0.1, -4, 0], [0.1, 0.5, 3]),  # between the rooms, up to the door
        ([-0.1, 1.5, 0], [0.1, 4, 3]),
        ([-0.1, 0.5, 2.1], [0.1, 1.5, 3]),
        ([-6.2, -4.2, 3], [6.2, 4.2, 3.2]),
    ]:
        model.box(low, high, wall)
    for y in (-2.5, 2.0):  # 3 cm in front of a wall, in blocks of their own
        model.quad([[-0.13, y, 1], [-0.13, y + 1.2, 1], [-0.13, y + 1.2, 2], [-0.13, y, 2]], leaves)
    for x, y in rng.uniform([-5.5, -3.5], [5.5, 3.5], (60, 2)):
        size, turn = rng.uniform(0.05, 0.3), rng.uniform(0, 90)
        model.box([x, y, 0], [x + size, y + size, rng.uniform(0.2, 2.5)], thing, turn=turn)
    for x, y in rng.uniform(-30, 30, (60, 2)):
        if max(abs(x) / 7, abs(y) / 5) > 1:
            model.quad([[x, y, 0], [x + 1.5, y, 0], [x + 1.5, y, 4], [x, y, 4]], leaves)
            model.cylinder([x, y, 0], [x, y, 3], 0.1, thing)
    model.sphere([3, 1, 1.2], 0.3, thing)
    model.sky((20.0, 30.0, 50.0), (60.0, 60.0, 50.0))
    return model.build()


CAMERAS = {
    "at the door, from afar": Camera((-5.0, 1.0, 1.65), 90.0),
    "past the door's edge": Camera((-1.5, 2.6, 1.65), 120.0),
    "close to a wall": Camera((-0.4, -2.0, 1.65), 88.0, -5.0),
    "in the door": Camera((0.0, 1.0, 1.65), 75.0),
    "up at the lintel": Camera((-0.8, 1.0, 1.2), 90.0, 40.0),
    "outside": Camera((-15.0, -9.0, 1.65), 60.0),
    "from above": Camera((-9.0, -14.0, 9.0), 35.0, -30.0),
}


@pytest.fixture(scope="module")
def frames():
    """Pixel values with and without looking for what is hidden, and how many blocks that left out, by view.

    Without a quality of light: what is hidden is hidden in any.
    """
    counts: list[tuple[int, int]] = []
    plain = renderer.not_hidden

    def counted(blocks, chosen, matrix, depth):
        kept = plain(blocks, chosen, matrix, depth)
        counts.append((len(chosen), len(kept)))
        return kept

    def hides_nothing(blocks, chosen, matrix, depth):
        return chosen

    with pytest.MonkeyPatch.context() as patched, offscreen_context() as context:
        drawn = SceneRenderer(context, house_with_a_door(), SIZE, None)
        pictures = []
        for function in (counted, hides_nothing):
            patched.setattr(renderer, "not_hidden", function)
            pictures.append([])
            for camera in CAMERAS.values():
                drawn.render(camera)
                drawn.encode()
                pictures[-1].append(drawn.pixel_values().astype(int))
    return dict(zip(CAMERAS, zip(*pictures, counts, strict=True), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("view", CAMERAS)
def test_nothing_vanishes_that_is_not_behind_a_wall(frames, view):
    """But for single pixels: walls that meet leave pixels between them where rounding lets through what is
    behind, in the large picture, and the small one, with a ninth of the pixels, need not have such a gap.
    """
    with_it, without, _ = frames[view]
    other = (np.abs(with_it - without) > CODE + 1).any(axis=2)
    assert other.mean() < 1e-4
    assert np.ptp(without) > 100 * CODE  # there is something to be seen


@pytest.mark.slow
def test_what_is_in_another_room_is_left_out(frames):
    """Else the comparison would be of equals: facing a wall, less than half of what is ahead is drawn."""
    ahead, kept = frames["close to a wall"][2]
    assert kept < ahead / 2
    assert all(kept <= ahead for _, _, (ahead, kept) in frames.values())
    assert sum(kept < ahead for _, _, (ahead, kept) in frames.values()) >= 5


@pytest.mark.slow
def test_a_picture_lacks_what_is_wrongly_taken_for_hidden(monkeypatch):
    """The comparison tells: with every other block left out, far more pixels differ than may."""
    camera = CAMERAS["at the door, from afar"]
    pictures = []
    with offscreen_context() as context:
        drawn = SceneRenderer(context, house_with_a_door(), SIZE, None)
        for step in (1, 2):
            monkeypatch.setattr(renderer, "not_hidden", lambda b, chosen, m, d, step=step: chosen[::step])
            drawn.render(camera)
            drawn.encode()
            pictures.append(drawn.pixel_values().astype(int))
    assert (np.abs(pictures[0] - pictures[1]) > CODE + 1).any(axis=2).mean() > 1e-2


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize(("across", "seen"), [((0.2, 0.8), False), ((-0.3, 0.8), True)])
def test_what_is_wholly_behind_a_wall_is_left_out_whatever_is_beside_it(turns, across, seen):
    """A wall 5 m ahead fills half of the view, to the right, above, to the left or below; a box is at 10 m.

    The eye is at the origin and looks along z: a point is at (x, y) / z of the view.
    """
    matrix = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 1.0, 0]])
    distance = np.full((32, 32), FAR)
    distance[:, 16:] = 5.0
    corners = np.array([[across[0], -0.3], [across[1], 0.3]]) * [[10.0], [10.0]]
    for _ in range(turns):  # the view, counted from below, by a quarter each
        distance, corners = np.rot90(distance, -1), corners @ [[0.0, 1.0], [-1.0, 0.0]]
    low, high = corners.min(axis=0), corners.max(axis=0)
    one = np.zeros(1, dtype=np.int64)
    block = Blocks(one, one, one + 1, np.array([[*low, 10.0]]), np.array([[*high, 10.1]]), one == 1)
    depth = ((FAR + NEAR - 2 * FAR * NEAR / distance) / (FAR - NEAR) + 1) / 2
    kept = not_hidden(block, one, matrix, np.ascontiguousarray(depth, dtype=np.float32))
    assert kept.tolist() == ([0] if seen else [])
