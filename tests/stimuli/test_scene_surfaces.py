"""Surfaces from near and round ones: fine texels, albedo that stays, light without seams."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evenlight.stimuli.scenes.content.catalogue import scene_named
from evenlight.stimuli.scenes.content.house.materials import PLINTH
from evenlight.stimuli.scenes.content.textures.detail import LAWN, PLASTERED, SAWN, WOVEN
from evenlight.stimuli.scenes.content.textures.garden import leaves
from evenlight.stimuli.scenes.content.textures.interior import wood
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.light.bake import charts_of, texels_of
from evenlight.stimuli.scenes.engine.material_textures import CUTOFF, material_textures
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene
from evenlight.stimuli.scenes.engine.surface_detail import (
    SIZE,
    Detail,
    detail_coordinates,
    detail_of,
    detail_tiles,
)

GREEN, DARK = (0.4, 0.6, 0.1), (0.05, 0.1, 0.02)

EVEN = (0.4, 0.4, 0.4)


def plane(material: Material, side: float, *, facing_up: bool = True, sunlit: bool = False) -> Scene:
    """Return one square of a material around the origin, level."""
    model = SceneModel("plane", 1)
    corners = [[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]]
    model.quad(corners if facing_up else corners[::-1], material)
    if sunlit:
        model.sun(0.0, 90.0, 60.0)
    return model.build()


def seen_from(scene: Scene, *heights: float) -> list[np.ndarray]:
    """Return the luminance of views straight down, 20 degrees wide, in light that is the same all over."""
    with offscreen_context() as context:
        renderer = SceneRenderer(context, scene, (128, 128), None)
        pictures = []
        for height in heights:
            renderer.render(Camera((0.0, 0.0, height), 0.0, -90.0, field_of_view=20.0))
            pictures.append(renderer.luminance().astype(float))
        return pictures


@pytest.mark.slow
@pytest.mark.parametrize("name", ["house", "school"])
def test_all_that_a_ring_may_lie_on_has_35_texels_per_degree_at_2_m(name) -> None:
    scene = scene_named(name)
    patches = scene.patches
    has_detail = np.array([detail_of(material) is not None for material in scene.materials])
    ring_like = ~(scene.holed() | patches.emission.any(axis=1))
    assert has_detail[patches.material[ring_like]].all()
    at = detail_coordinates(scene)[ring_like] * SIZE
    degree = 2 * math.tan(math.radians(1))  # [m] at 2 m
    for first, last, edge in (
        (0, 1, patches.along),
        (0, 2, patches.across),
        (1, 2, patches.across - patches.along),
    ):
        texels = np.linalg.norm(at[:, last] - at[:, first], axis=1)
        assert (texels / np.linalg.norm(edge[ring_like], axis=1)).min() * degree >= 35


@pytest.mark.parametrize("detail", [PLASTERED, SAWN, WOVEN, LAWN])
def test_a_detail_keeps_the_mean_albedo_and_varies_it_by_its_strength(detail) -> None:
    def even(rng: np.random.Generator, size: int) -> np.ndarray:
        return np.full((size, size, 3), 0.4, dtype=np.float32)

    vars(even)["detail"] = detail
    tiles, chosen = detail_tiles(
        [Material("plain", lambda rng, size: even(rng, size), 1.0), Material("even", even, 1.0)]
    )
    assert chosen[0].tolist() == [0, 0]
    factor = 1 + chosen[1, 1] * (2.0 * tiles[int(chosen[1, 0])] / 255 - 1)
    assert factor.mean() == pytest.approx(1, abs=2e-4)
    assert factor.std() == pytest.approx(detail.strength, rel=0.05)


@pytest.mark.slow
def test_a_board_shows_its_fibres_from_near_and_its_mean_from_afar() -> None:
    board = Material("board", wood(EVEN, EVEN), 0.8)  # an even texture: all that varies is the detail
    near, far = seen_from(plane(board, 20.0), 0.5, 40.0)
    (bare,) = seen_from(
        plane(Material("bare", lambda rng, size: wood(EVEN, EVEN)(rng, size), 0.8), 20.0), 0.5
    )
    assert near.std() / near.mean() == pytest.approx(SAWN.strength, rel=0.3)  # a pixel is 1.4 mm
    assert max(far.std() / far.mean(), bare.std() / bare.mean()) < 0.01
    assert far.mean() == pytest.approx(bare.mean(), rel=0.005)
    assert near.mean() == pytest.approx(bare.mean(), rel=0.02)  # half a tile


def test_a_detail_stronger_than_its_light_is_refused() -> None:
    with pytest.raises(ValueError, match=r"strength of detail from 0 to 0\.29, got 0\.5"):
        Detail(LAWN.relief, 0.5)


@pytest.mark.parametrize("number", [40, 400])
def test_small_copies_of_leaves_keep_the_share_that_is_there(number) -> None:
    scene = plane(Material("leaves", leaves(GREEN, DARK, number), 0.7, cutout=True), 1.0)
    textures = material_textures(scene, 256)
    copy = textures.codes[0][..., 3] / 255
    share = (copy >= CUTOFF).mean()
    for cutoff in textures.cutoffs[0, 1:5]:
        copy = copy.reshape(len(copy) // 2, 2, len(copy) // 2, 2).mean(axis=(1, 3))
        assert (copy >= cutoff).mean() == pytest.approx(share, abs=0.02)


def test_a_sprig_does_not_reach_the_edges_of_its_card() -> None:
    there = leaves(GREEN, DARK)(np.random.default_rng(2), 128)[..., 3]
    assert there[0].max() == there[-1].max() == there[:, 0].max() == there[:, -1].max() == 0
    assert 0.25 < there.mean() < 0.65


@pytest.mark.slow
def test_a_leaf_lets_half_of_the_suns_light_through() -> None:
    def opaque(rng: np.random.Generator, size: int) -> np.ndarray:
        return np.full((size, size, 4), [0.4, 0.4, 0.4, 1.0], dtype=np.float32)

    leaf = Material("leaf", opaque, 1.0, cutout=True)
    front, back = (
        lit[0][64, 64] - unlit[0][64, 64]
        for lit, unlit in (
            [seen_from(plane(leaf, 5.0, facing_up=up, sunlit=sun), 2.0) for sun in (True, False)]
            for up in (True, False)
        )
    )
    assert front == pytest.approx([0.4 * 60 / math.pi] * 3, rel=0.02)
    assert back[:2] == pytest.approx(front[:2] / 2, rel=0.02)


# --- scene round surfaces

SEGMENTS = 32


def test_the_pieces_of_a_boiler_have_their_light_at_the_seams_and_no_diagonal():
    model = SceneModel("boiler", 1)
    model.cylinder([0, 0, 0], [0, 0, 0.95], 0.23, PLINTH, segments=SEGMENTS, caps=False)
    patches = model.build().patches
    assert len(patches) == SEGMENTS  # whole rectangles: halves would be lit for themselves
    charts = charts_of(patches, np.zeros(SEGMENTS, bool))
    texels = texels_of(patches, charts)
    where = patches.origin[texels.patch] + texels.s[:, None] * patches.along[texels.patch]
    where += texels.t[:, None] * patches.across[texels.patch]
    np.testing.assert_allclose(np.linalg.norm(where[:, :2], axis=1), 0.23)  # on edges, not chords
    first, last = texels.column == 0, texels.column == charts.columns[texels.patch] - 1
    rows = int(charts.rows[0])
    ends, starts = where[last].reshape(SEGMENTS, rows, 3), where[first].reshape(SEGMENTS, rows, 3)
    np.testing.assert_allclose(ends, np.roll(starts, -1, axis=0), atol=1e-12)


def test_flat_pieces_keep_their_light_off_the_edges_where_others_touch():
    model = SceneModel("wall", 1)
    model.quad([[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1]], PLINTH)
    patches = model.build().patches
    texels = texels_of(patches, charts_of(patches, np.zeros(1, bool)))
    np.testing.assert_allclose([2 * texels.s.min(), texels.t.min()], 0.015)  # [m]
    np.testing.assert_allclose([2 * texels.s.max(), texels.t.max()], [1.985, 0.985])
