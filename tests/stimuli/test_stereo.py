"""Scenes for both eyes: what is nearer is farther apart in the pictures, and a frame costs no transfer."""

import math

import moderngl
import numpy as np
import pytest
from headset_frames import FOVS, POSES, frame_of
from scipy.spatial.transform import Rotation

from evenlight.hardware.presentation.headset_views import EyeFov
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.scenes.engine import stereo as stereo_scenes
from evenlight.stimuli.scenes.engine.antialiasing import EYES, LIVE, NONE, OFFLINE, tiles
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import BRIGHTEST, SceneRenderer
from evenlight.stimuli.scenes.engine.scene import direction_of
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

SIZE = (320, 240)
HERE = (1.0, 2.0, 1.65)
SPAN = math.tan(0.7) + math.tan(0.9)
EVEN = EyeFov(-0.7, 0.7, 0.6, -0.6)


@pytest.fixture(scope="module")
def context():
    with offscreen_context() as context:
        yield context


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


def lamps(*directions_and_distances):
    """Squares of 6 cm per metre of distance that face `HERE`, in the dark."""
    model = SceneModel("lamps", 1)
    for azimuth, altitude, distance in directions_and_distances:
        right, up, ahead = Camera(HERE, azimuth, altitude).axes()
        corners = [HERE + distance * (ahead + 0.03 * (a * right + b * up)) for a, b in AROUND]
        model.lamp(corners, 50.0)
    return model.build()


AROUND = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def room_behind_leaves():
    """A room with a wall across, leaves before it, things before and behind it, and the sky above."""
    model, rng = SceneModel("room", 1), np.random.default_rng(3)
    wall, leaves = Material("wall", grained, 1.0), Material("leaves", leafy, 0.5, cutout=True)
    model.box([-8, -8, -0.2], [8, 8, 0], wall)
    model.box([-8, 5, 0], [8, 5.2, 3], wall)
    model.quad([[-1, 4, 0], [3, 4, 0], [3, 4, 2.5], [-1, 4, 2.5]], leaves)
    for x, y in rng.uniform([-6, 3], [6, 7.5], (30, 2)):
        model.box([x, y, 0], [x + 0.3, y + 0.2, rng.uniform(0.5, 2)], wall)
    model.sun(200.0, 40.0, 20000.0)
    model.sky((20.0, 30.0, 50.0), (60.0, 60.0, 50.0))
    return model.build()


def centre_of_mass(light, near=None):
    """Return the mean place of light, from the upper left corner [pixels]; of what is near one, if given."""
    rows, columns = np.mgrid[: light.shape[0], : light.shape[1]] + 0.5
    if near is not None:
        light = np.where(np.hypot(columns - near[0], rows - near[1]) < 25, light, 0)
    return np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()


def pictures(stereo, views):
    stereo.render(views)
    return [eye.luminance()[..., 1].astype(float) for eye in stereo.eyes]


def drawn_with(samples, context, scene, views):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(stereo_scenes, "EYES", samples)
        return pictures(StereoRenderer(context, scene, (SIZE, SIZE), None), views)


@pytest.mark.parametrize("distance", [1.0, 3.0])
def test_a_lamp_is_shifted_by_half_the_eye_distance_over_its_distance(context, distance):
    stereo = StereoRenderer(context, lamps((0.0, 0.0, distance)), (SIZE, SIZE), None)
    left, right = pictures(stereo, eye_views(frame_of(), HERE, 0.0))
    shift = 0.0315 / distance / SPAN * 320
    assert centre_of_mass(left)[0] == pytest.approx(math.tan(0.9) / SPAN * 320 + shift, abs=0.5)
    assert centre_of_mass(right)[0] == pytest.approx(math.tan(0.7) / SPAN * 320 - shift, abs=0.5)
    # With the frustums alike, all that is left between the eyes is the disparity; at 1 m, 12 pixels.
    even = eye_views(frame_of(fovs=(EVEN, EVEN)), HERE, 0.0)
    left, right = pictures(stereo, even)
    apart = centre_of_mass(left)[0] - centre_of_mass(right)[0]
    assert apart == pytest.approx(0.063 / distance * 320 / (2 * math.tan(0.7)), abs=0.5)


@pytest.mark.parametrize("azimuth", [0.0, 130.0])
def test_the_lamp_one_turns_to_is_straight_ahead(context, azimuth):
    """30 degrees to the left, 20 up; and with the head on the left shoulder the level to the right drops."""
    scene = lamps((azimuth - 30, 0.0, 3.0), (azimuth, 20.0, 3.0), (azimuth + 20, 0.0, 3.0))
    stereo = StereoRenderer(context, scene, (SIZE, SIZE), None)
    aside = math.tan(math.radians(20)) * np.array([math.cos(math.radians(15)), math.sin(math.radians(15))])
    expected = {"30 to the left": (0, 0), "20 up": (0, 0), "15 to the left shoulder": aside}
    for pose, (right, down) in expected.items():
        frame = frame_of(POSES[pose], eye_distance=0.0)
        for light, eye in zip(pictures(stereo, eye_views(frame, HERE, azimuth)), frame.eyes, strict=True):
            fov = eye.fov
            x = (right - math.tan(fov.left)) / SPAN * 320
            y = (down + math.tan(fov.up)) / (math.tan(fov.up) - math.tan(fov.down)) * 240
            np.testing.assert_allclose(centre_of_mass(light, near=(x, y)), [x, y], atol=0.5)


def test_eyes_at_one_place_see_the_same(context):
    stereo = StereoRenderer(context, room_behind_leaves(), (SIZE, SIZE), None)
    views = eye_views(frame_of(POSES["20 up"], eye_distance=0.0, fovs=FOVS[:1] * 2), HERE, 10.0)
    left, right = pictures(stereo, views)
    assert np.ptp(left) > 10
    np.testing.assert_array_equal(left, right)


def test_all_of_a_scene_is_what_is_chosen_of_it(context):
    """Drawn whole, or without what is hidden: the same but for single pixels where walls meet."""
    scene = room_behind_leaves()
    stereo, chosen = (
        StereoRenderer(context, scene, (SIZE, SIZE), None),
        SceneRenderer(context, scene, SIZE, None, EYES),
    )
    views = eye_views(frame_of(Rotation.from_euler("yxz", [5, -8, 12], degrees=True)), HERE, 0.0)
    whole = pictures(stereo, views)
    for light, view in zip(whole, views, strict=True):
        chosen.render(view)
        differs = np.abs(chosen.luminance()[..., 1] - light) > 0.01 * light
        assert differs.mean() < 1e-4
    assert (np.abs(whole[0] - whole[1]) > 0.1 * whole[0]).mean() > 0.1


def test_the_sky_turns_with_the_head_and_has_no_symmetry(context):
    """Each direction looks as a level camera shows it in its middle, with the same pixels per degree."""
    model = SceneModel("sky", 1)
    model.lamp(
        HERE + 3 * direction_of(0.0, -90.0) + 0.01 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        1.0,
    )
    model.sun(20.0, 25.0, 1000.0)
    model.sky((5.0, 10.0, 30.0), (30.0, 28.0, 20.0))
    scene = model.build()
    stereo = StereoRenderer(context, scene, (SIZE, SIZE), None)
    frame = frame_of(Rotation.from_euler("yxz", [-20, 15, 25], degrees=True))
    drawn = pictures(stereo, eye_views(frame, HERE, 0.0))
    level = SceneRenderer(context, scene, (41, 41), None, EYES)
    for light, eye in zip(drawn, frame.eyes, strict=True):
        fov = eye.fov
        for column, row in [(20, 20), (300, 30), (30, 220), (290, 210), (160, 120), (200, 60), (90, 150)]:
            across = math.tan(fov.left) + (column + 0.5) / 320 * SPAN
            up = math.tan(fov.up) - (row + 0.5) / 240 * (math.tan(fov.up) - math.tan(fov.down))
            x, y, z = Rotation.from_quat(eye.pose.orientation).apply([across, up, -1.0])
            azimuth, altitude = np.degrees([math.atan2(x, -z), math.atan2(y, math.hypot(x, z))])
            level.render(Camera(HERE, azimuth, altitude, focal_length=400.0))
            assert light[row, column] == pytest.approx(level.luminance()[20, 20, 1], rel=0.03)
        assert np.ptp(light) > 10


def test_an_edge_at_a_slant_covers_its_share_of_a_pixel(context):
    """A lamp far brighter than what is drawn, with an edge that rises by 1 pixel in 10.

    Were it level, 4 samples in rows of their own, 1/4 apart, would be wrong by 1/8 at most and 1/16 in the
    mean; one sample by 1/2 and 1/4. That they lie up to 3/8 aside moves each by as much of the slope. What
    29 samples say is itself wrong by 1/58.
    """
    model = SceneModel("slant", 1)
    right, up, ahead = Camera(HERE, 0.0).axes()
    for_edge = [(-9, -9), (9, -9), (9, 1 + 0.013), (-9, -1 + 0.013)]
    model.lamp([HERE + ahead + a * right + b * up for a, b in for_edge], 20 * BRIGHTEST)
    views = eye_views(frame_of(fovs=(EVEN, EVEN)), HERE, 0.0)
    shares = {
        grid: np.stack(drawn_with(grid, context, model.build(), views)) / BRIGHTEST
        for grid in (NONE, EYES, OFFLINE)
    }
    truth = shares[OFFLINE]
    edge = (truth > 0.05) & (truth < 0.95)
    assert edge.sum() > 500
    wrong = {grid: np.abs(share - truth)[edge] for grid, share in shares.items()}
    assert wrong[EYES].max() < 1 / 8 + 0.1 * 3 / 8 + 1 / 58
    assert wrong[EYES].mean() < 1 / 16 + 1 / 58
    assert wrong[NONE].mean() > 3 * wrong[EYES].mean()
    np.testing.assert_allclose(shares[EYES][truth > 0.999], 1.0, rtol=1e-3)
    assert shares[EYES][truth == 0.0].max() == 0.0


def test_a_card_that_takes_fewer_samples_takes_those(context):
    room = lamps((0.0, 0.0, 1.0))
    views = eye_views(frame_of(), HERE, 0.0)
    two, one, alone = (
        drawn_with(grid, context, room, views) for grid in (EYES.possible(2), EYES.possible(0), NONE)
    )
    np.testing.assert_array_equal(one, alone)
    assert np.abs(np.array(two) - alone).max() > 1  # the lamp's edge has shares of it
    assert EYES.possible(10**6) == EYES


def test_a_large_eye_is_drawn_whole():
    assert len(tiles((2880, 2720), EYES)) == len(tiles((4096, 4096), EYES)) == 1
    assert len(tiles((2880, 2720), LIVE)) > 1


def test_a_frame_uploads_nothing_reads_nothing_back_and_draws_five_times_for_each_eye(context, monkeypatch):
    """What is solid, the sky, what has holes, the mean of the samples, the codes."""
    stereo = StereoRenderer(context, room_behind_leaves(), (SIZE, SIZE), None)
    counts: dict[str, int] = {}

    def counted(kind, name):
        plain = getattr(kind, name)

        def call(*arguments, **options):
            counts[f"{kind.__name__}.{name}"] = counts.get(f"{kind.__name__}.{name}", 0) + 1
            return plain(*arguments, **options)

        monkeypatch.setattr(kind, name, call)

    for kind, names in TRANSFERS.items():
        for name in names:
            counted(kind, name)
    counted(moderngl.VertexArray, "render")
    for turn in (-10, 0, 10):
        counts.clear()
        views = eye_views(frame_of(Rotation.from_euler("y", turn, degrees=True)), HERE, 0.0)
        stereo.render(views)
        stereo.encode()
        assert counts == {"VertexArray.render": 10}
    SceneRenderer(context, lamps((0.0, 0.0, 1.0)), SIZE, None, EYES).render(Camera(HERE, 0.0))
    assert counts["Buffer.write"] > 0  # the count sees what a window does
    assert counts["Texture.read"] > 0


TRANSFERS = {
    moderngl.Buffer: ("write", "read", "read_into", "orphan"),
    moderngl.Texture: ("write", "read", "read_into"),
    moderngl.Framebuffer: ("read", "read_into"),
    moderngl.Context: ("buffer", "texture", "texture_array", "depth_texture", "framebuffer", "program"),
}
