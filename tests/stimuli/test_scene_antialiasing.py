"""Pictures of scenes are free of jags: as closed forms and many more samples say, at rest and in motion."""

import dataclasses
import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from evenlight.stimuli.scenes.engine import antialiasing
from evenlight.stimuli.scenes.engine.antialiasing import EYES, LIVE, NONE, OFFLINE, Antialiasing
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene

SIZE = (64, 36)
TRUTH, SQUARE = Antialiasing(16), Antialiasing(8)
AHEAD = Camera((0.0, 0.0, 1.0), 0.0)


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    with offscreen_context() as context:
        yield context


def room() -> Scene:
    """A chequered floor, and in front of it a fence of posts and wires that are thinner than a pixel."""
    squares = (np.indices((64, 64)) // 32).sum(axis=0) % 2 * 0.6 + 0.2

    def chequered(_: np.random.Generator, size: int) -> np.ndarray:
        grey = np.kron(squares, np.ones((size // 64, size // 64)))
        return np.repeat(grey[..., np.newaxis], 3, axis=2).astype(np.float32)

    model = SceneModel("chequered", 1)
    model.quad([(-20, 0, 0), (20, 0, 0), (20, 40, 0), (-20, 40, 0)], Material("floor", chequered, tile=1.0))
    post = Material("post", lambda _, size: np.full((size, size, 3), 0.9, np.float32), tile=1.0)
    for x in np.arange(-4.0, 4.0, 0.37):
        model.box((x, 4.0, 0.0), (x + 0.07, 4.05, 1.5), post)
    for z in (1.0, 1.2, 1.4):
        model.box((-4.0, 4.0, z), (4.0, 4.02, z + 0.03), post)
    model.sky((20.0, 30.0, 50.0), (60.0, 60.0, 50.0))
    return model.build()


def drawn(context: moderngl.Context, scene: Scene, cameras: list[Camera], grid: Antialiasing) -> np.ndarray:
    """Return the luminance of views, (n, height, width)."""
    renderer = SceneRenderer(context, scene, SIZE, None, grid)
    pictures = []
    for camera in cameras:
        renderer.render(camera)
        pictures.append(renderer.luminance() @ [0.2126, 0.7152, 0.0722])
    return np.stack(pictures)


@pytest.mark.parametrize("grid", [LIVE, OFFLINE, Antialiasing(4), Antialiasing(3, 2)])
def test_every_pixel_has_its_samples_once_and_a_turned_grid_has_no_two_in_a_row(grid: Antialiasing) -> None:
    n, m = grid.along, grid.aside
    places = {
        (u + n * x + m * y, v + n * y - m * x) for u, v in grid.places() for x in (0, 1) for y in (0, 1)
    }
    assert len(places) == 4 * (n * n + m * m)  # those of four neighbours, none shared
    across = {n * (2 * u + 1) - m * (2 * v + 1) for u, v in grid.places()}
    assert len(across) == (n if m == 0 else n * n + m * m)


@pytest.mark.parametrize("grid", [NONE, LIVE, OFFLINE, Antialiasing(4)])
def test_the_samples_of_each_pixel_are_numbered(grid: Antialiasing) -> None:
    n, m = grid.along, grid.aside
    b, c, d, g = grid.numbering()
    for x, y in ((0, 0), (1, 0), (3, 2)):
        places = [(9 + u + n * x + m * y, 99 + v + n * y - m * x) for u, v in grid.places()]
        numbers = {g * ((u + b * v) % c + c * (v % d)) % (c * d) for u, v in places}
        assert numbers == set(range(len(places)))


def test_far_leaves_cover_each_pixel_evenly(context: moderngl.Context) -> None:
    """In front of a lamp, random leaves far smaller than samples leave half of it in every pixel."""

    def leaves(rng: np.random.Generator, size: int) -> np.ndarray:
        there = np.kron(rng.random((size // 2, size // 2)) < 0.5, np.ones((2, 2)))
        return np.dstack([np.zeros((size, size, 3)), there]).astype(np.float32)

    model = SceneModel("leaves", 1)
    wall = [(-99.0, 20.0, -99.0), (99.0, 20.0, -99.0), (99.0, 20.0, 99.0), (-99.0, 20.0, 99.0)]
    model.quad(wall, Material("leaves", leaves, tile=1.0, cutout=True))
    model.lamp([(x, 21.0, z) for x, _, z in wall], 50.0)
    for grid in (OFFLINE, Antialiasing(4), EYES):
        (picture,) = drawn(context, model.build(), [AHEAD], grid)
        assert picture == pytest.approx(25.0, rel=0.2)
        assert picture.mean() == pytest.approx(25.0, rel=0.03)


@pytest.mark.parametrize(
    ("grid", "steps"), [(NONE, 1), (LIVE, 5), (EYES, 4), (OFFLINE, OFFLINE.along**2 + OFFLINE.aside**2)]
)
@pytest.mark.parametrize("upright", [True, False])
def test_an_edge_covers_its_share_of_a_pixel(
    context: moderngl.Context, grid: Antialiasing, steps: int, upright: bool
) -> None:
    """A lamp whose edge is at 0.3 of a pixel fills 0.3 of it, to half a step of the samples."""
    focal, edge = 32.0, 4.3  # pixels from the middle
    near, far = (edge / focal, 3.0) if upright else (3.0, edge / focal)
    model = SceneModel("edge", 1)
    model.lamp([(-3, 1, -3), (near, 1, -3), (near, 1, far), (-3, 1, far)], 50.0)
    (picture,) = drawn(context, model.build(), [Camera((0.0, 0.0, 0.0), 0.0)], grid)
    line = picture[18] if upright else picture[::-1, 16]
    middle = SIZE[0] // 2 if upright else SIZE[1] // 2
    assert line[middle + 3] == pytest.approx(50.0, rel=2e-3)
    assert line[middle + 4] / 50.0 == pytest.approx(0.3, abs=0.5 / steps + 2e-3)
    assert line[middle + 5] == 0.0


@pytest.fixture(scope="module")
def pans(context: moderngl.Context) -> dict[Antialiasing, np.ndarray]:
    """Return 3 frames of a pan by about 1 pixel each, with several grids."""
    cameras = [dataclasses.replace(AHEAD, azimuth=math.degrees(k / 32)) for k in range(3)]
    scene = room()
    return {grid: drawn(context, scene, cameras, grid) for grid in (TRUTH, SQUARE, NONE, LIVE, OFFLINE)}


def test_a_floor_and_wires_are_within_3_percent_of_64_and_of_256_samples(
    pans: dict[Antialiasing, np.ndarray],
) -> None:
    def wrong(grid: Antialiasing, truth: Antialiasing) -> float:
        return math.sqrt(((pans[grid] - pans[truth]) ** 2).mean()) / float(pans[truth].mean())

    assert wrong(OFFLINE, SQUARE) < 0.03
    assert wrong(OFFLINE, TRUTH) < wrong(SQUARE, TRUTH) < 0.03  # a turned grid does with half the samples
    assert wrong(LIVE, TRUTH) < 0.06
    assert wrong(NONE, TRUTH) > 0.15  # the fence is in pieces


def test_a_slow_pan_flickers_less_than_with_64_samples_on_a_square_grid(
    pans: dict[Antialiasing, np.ndarray],
) -> None:
    """What changes from frame to frame beyond what changes with 256 samples, as a share of that."""
    moving = {grid: np.diff(pictures, axis=0) for grid, pictures in pans.items()}

    def flicker(grid: Antialiasing) -> float:
        return math.sqrt(((moving[grid] - moving[TRUTH]) ** 2).mean() / (moving[TRUTH] ** 2).mean())

    assert flicker(OFFLINE) < flicker(SQUARE)
    assert flicker(OFFLINE) < 0.1  # of wires, which are worse than rooms
    assert flicker(NONE) > 0.6


def test_tiles_are_parts_of_the_whole(context: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = drawn(context, room(), [AHEAD], OFFLINE)
    monkeypatch.setattr(antialiasing, "MOST_DRAWN", 64 * 36 * 5)
    assert len(antialiasing.tiles(SIZE, OFFLINE)) > 3
    in_tiles = drawn(context, room(), [AHEAD], OFFLINE)
    assert (np.abs(in_tiles - whole) > 0.01 * whole.mean()).mean() < 0.001
