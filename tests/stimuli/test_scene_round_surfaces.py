"""Light on round surfaces is continuous: pieces of a cylinder have it at the edge that they share."""

from __future__ import annotations

import numpy as np

from evenlight.stimuli.scenes.content.house.materials import PLINTH
from evenlight.stimuli.scenes.engine.light.bake import charts_of, texels_of
from evenlight.stimuli.scenes.engine.model import SceneModel

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
