"""Rings in a scene's picture: size, shape and contrast measured back are those that were asked for.

The scene is a pattern that is known in closed form, drawn for any camera; the real scenes go the same way.
"""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest
from seen_points import project

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Dither
from evenlight.data_schema.recordings.search import ORIENTATIONS
from evenlight.stimuli.image_renderer import DimmedImage, Image, ImageRenderer
from evenlight.stimuli.rings.landolt import PaintedRing, Ring
from evenlight.stimuli.rings.ring_scene import RingScene
from evenlight.stimuli.scenes.engine.camera import Camera, focal_length_of
from evenlight.stimuli.scenes.engine.graphics import offscreen_context

SIZE = (400, 300)
HERE = (1.0, 2.0, 1.65)
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])  # ITU-R BT.709
HEADSET = Display("headset", 104.4, 0.2, 1.95, pixels_per_degree=24.0)
ROOM = Display("room", 250.0, 0.4, 2.2, pixels_per_degree=24.0, reflected_luminance=3.0)


class Pattern:
    """A warm wall with a slow change from left to right, and a fine check, in a renderer's stead."""

    def __init__(self, context, size=SIZE, level=0.45, fineness=0.04) -> None:
        self.size, self._level, self._fineness = size, level, fineness
        self.codes = context.texture(size, 4, dtype="u2")
        self.renders = 0

    def render(self, camera: Camera) -> None:
        self.renders += 1
        self._seen = directions(camera, self.size)

    def encode(self) -> None:
        azimuth = np.degrees(np.arctan2(self._seen[..., 0], self._seen[..., 1]))
        altitude = np.degrees(np.arcsin(np.clip(self._seen[..., 2], -1, 1)))
        check = np.sign(np.sin(40 * azimuth) * np.sin(40 * altitude))
        grey = self._level + 0.002 * azimuth + self._fineness * check
        shares = np.clip(grey[..., np.newaxis] * np.array([1.15, 1.0, 0.7]), 0, 1)
        codes = np.zeros((*grey.shape, 4), np.uint16)
        codes[..., :3] = np.rint(shares * 1023)
        self.codes.write(np.ascontiguousarray(codes[::-1]).tobytes())  # the lowest row first, as drawn


def directions(camera: Camera, size: tuple[int, int]) -> np.ndarray:
    """Return the unit vector of each pixel's middle, (height, width, 3), by the geometry of a pinhole."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5 - size[0] / 2, size[1] / 2 - 0.5 - np.arange(size[1]))
    right, up, ahead = camera.axes()
    rays = x[..., None] * right + y[..., None] * up + camera.focal_pixels(size[0]) * ahead
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def luminance_of(pixel_values: np.ndarray, display: Display) -> np.ndarray:
    """Eq. 1 without reflected light, transcribed [cd/m^2]."""
    linear = (pixel_values / 65535) ** display.gamma @ WEIGHTS
    return np.asarray(linear * (display.peak_luminance - display.black_level) + display.black_level)


@pytest.fixture(scope="module")
def context() -> Iterator[object]:
    context = offscreen_context()
    yield context
    context.release()


def ring_of(gap: float = 12.0, orientation: int = 0, contrast: float = -0.3, **where: float) -> Ring:
    return Ring(where.get("azimuth", 40.0), where.get("altitude", 10.0), gap, contrast, orientation)


class Shown:
    """A ring in a picture, and where its own coordinates lie there."""

    def __init__(self, scene: RingScene, painted: PaintedRing, camera: Camera, display: Display) -> None:
        self.ring, self.camera = painted.ring, camera
        scene.draw(camera)
        without = luminance_of(scene.pixel_values(), display)
        scene.draw(camera, painted)
        self.luminance = luminance_of(scene.pixel_values(), display)
        around = painted.surroundings.luminance
        # What the ring changed, as a share of what a full pixel of it changes: its coverage.
        self.coverage = (self.luminance - without) / ((1 + self.ring.contrast) * around - without)
        self.without = without

    def at(self, points: np.ndarray, image: np.ndarray) -> np.ndarray:
        """Return an image at points of the ring's plane, in gaps, by linear interpolation between pixels."""
        right, up, ahead = Camera(HERE, self.ring.azimuth, self.ring.altitude).axes()
        gap = math.radians(self.ring.gap / 60)
        in_scene = np.array(HERE) + ahead + gap * (points[:, :1] * right + points[:, 1:] * up)
        x, y = (project(self.camera, in_scene, SIZE) - 0.5).T
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        s, t = x - left, y - top
        upper = image[top, left] * (1 - s) + image[top, left + 1] * s
        lower = image[top + 1, left] * (1 - s) + image[top + 1, left + 1] * s
        return np.asarray(upper * (1 - t) + lower * t)

    def profile(self, start: tuple[float, float], end: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return distances from the first point, and the coverage there; x points to the gap."""
        turn = math.radians(self.ring.orientation)
        turned = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        share = np.linspace(0, 1, 2001)[:, np.newaxis]
        line = (np.array(start) + share * (np.array(end) - np.array(start))) @ turned
        return share[:, 0] * math.dist(start, end), self.at(line, self.coverage)


def width_at_half_height(distances: np.ndarray, height: np.ndarray) -> float:
    above = distances[height > 0.5]
    return float(above.max() - above.min())


def shown(context, display: Display, ring: Ring, right: float = 0.0, up: float = 0.0) -> Shown:
    """Show a ring some degrees to the right of the middle of the picture, and above it."""
    scene = RingScene(context, Pattern(context), display)
    camera = Camera(HERE, ring.azimuth - right, ring.altitude - up, focal_length=focal_length_of(display))
    return Shown(scene, scene.paint(ring, HERE), camera, display)


CASES = [
    *[(12.0, orientation, 0.0, 0.0) for orientation in ORIENTATIONS],
    *[(gap, 45, 0.013, -0.021) for gap in (5.0, 7.5, 30.0)],  # 2, 3 and 12 pixels; not on the pixels' grid
    *[(12.0, orientation, 5.0, 3.0) for orientation in ORIENTATIONS],
    (5.0, 0, -5.5, 4.0),
]


@pytest.mark.parametrize(("gap", "orientation", "right", "up"), CASES)
def test_gap_stroke_and_diameter_are_right_to_half_a_pixel(context, gap, orientation, right, up) -> None:
    """Widths at half height; one pixel is 60 / 24 arcmin in the middle, and less aside."""
    ring = ring_of(gap, orientation)
    picture = shown(context, HEADSET, ring, right, up)
    half_a_pixel = 0.5 * 2.5
    # Beside the middle of the stroke too, where pixels are small: a wedge would be wider further out.
    for radius in (1.8, 2.0, 2.15) if gap >= 7.5 else (2.0,):
        distances, covered = picture.profile((radius, -0.9), (radius, 0.9))
        assert width_at_half_height(distances, 1 - covered) * gap == pytest.approx(gap, abs=half_a_pixel)
    distances, covered = picture.profile((-0.5, 0.0), (-3.5, 0.0))
    assert width_at_half_height(distances, covered) * gap == pytest.approx(gap, abs=half_a_pixel)
    distances, covered = picture.profile((0.0, -3.5), (0.0, 3.5))
    assert width_at_half_height(distances, covered) * gap == pytest.approx(5 * gap, abs=half_a_pixel)


@pytest.mark.parametrize(("gap", "orientation", "right", "up"), CASES)
def test_the_ring_covers_the_solid_angle_of_its_shape(context, gap, orientation, right, up) -> None:
    """11.55 square gaps (tests/stimuli/test_rings.py derives the area), and each pixel cos^3 / focal^2."""

    def strip(radius: float) -> float:
        return math.sqrt(radius**2 - 0.25) / 2 + radius**2 * math.asin(0.5 / radius)

    picture = shown(context, HEADSET, ring_of(gap, orientation), right, up)
    ahead = directions(picture.camera, SIZE) @ picture.camera.axes()[2]
    solid_angle = (picture.coverage * ahead**3).sum() / focal_length_of(HEADSET) ** 2
    area = math.pi * 4 - (strip(2.5) - strip(1.5))
    assert solid_angle / math.radians(gap / 60) ** 2 == pytest.approx(area, rel=0.02)


@pytest.mark.parametrize("contrast", [-1.0, -0.3, -0.05, 0.2, 1.5])
@pytest.mark.parametrize("display", [HEADSET, dataclasses.replace(ROOM, black_level=0.0)])
def test_the_contrast_is_right_to_two_percent(context, contrast, display) -> None:
    """Weber: the ring's luminance against the mean between its edge and twice its radius, without it."""
    if contrast == -1.0:
        display = dataclasses.replace(display, black_level=0.0)
    picture = shown(context, display, ring_of(20.0, 90, contrast), 3.0, -2.0)
    around = annulus(picture)
    on_ring = picture.luminance[picture.coverage > 0.9999]
    assert len(on_ring) > 300
    measured = on_ring.mean() / picture.without[around].mean() - 1
    assert measured == pytest.approx(contrast, rel=0.02)
    assert np.ptp(on_ring) == 0


def annulus(picture: Shown) -> np.ndarray:
    """Return which pixels are 2.5 to 5 gaps from the ring's middle, by the angle between directions."""
    ahead = Camera(HERE, picture.ring.azimuth, picture.ring.altitude).axes()[2]
    angle = np.degrees(np.arccos(np.clip(directions(picture.camera, SIZE) @ ahead, -1, 1))) * 60
    return np.asarray((angle > 2.5 * picture.ring.gap) & (angle < 5 * picture.ring.gap))


@pytest.mark.parametrize("factor", [1.0, 0.6, 0.25])
@pytest.mark.parametrize("display", [HEADSET, ROOM])
def test_in_the_window_the_ring_differs_by_its_contrast_times_the_dimmed_light(
    context, factor, display
) -> None:
    """8-bit codes with noise, the mean of 16 frames: luminance differs by c b I, whatever is reflected.

    One step of 8 bits is at most 1.3 cd/m^2 at the rings' 20 to 130 cd/m^2, so 16 frames of 400 pixels have
    a mean within 4 standard errors of 4 x 0.65 / 80 = 0.03 cd/m^2.
    """
    ring = ring_of(20.0, 135, -0.3)
    scene = RingScene(context, Pattern(context), display)
    painted = scene.paint(ring, HERE)
    camera = Camera(HERE, ring.azimuth - 2, ring.altitude, focal_length=focal_length_of(display))
    picture = Shown(scene, painted, camera, display)
    covered, around = picture.coverage > 0.9999, annulus(picture)
    with_ring = window_mean(context, scene, display, factor)[covered].mean()
    scene.draw(camera)
    background = window_mean(context, scene, display, factor)[around].mean()
    dimmed = factor * picture.without[around].mean()
    assert background == pytest.approx(dimmed + display.reflected_luminance, abs=0.05)
    assert with_ring - background == pytest.approx(-0.3 * dimmed, rel=0.02, abs=0.0)


def window_mean(context, scene: RingScene, display: Display, factor: float) -> np.ndarray:
    """Return the luminance of each pixel of a window of 8 bits, mean of 16 frames [cd/m^2]."""
    renderer = ImageRenderer(context, display, 8, Dither.NOISY_BIT)
    target = context.framebuffer(context.texture(SIZE, 4))
    total = np.zeros((SIZE[1], SIZE[0]))
    for frame in range(16):
        image = Image(scene.texture, 65536)
        renderer.draw(target, DimmedImage(image, factor, display.peak_luminance), frame, seed=3)
        codes = np.frombuffer(target.read(components=3), np.uint8).reshape(SIZE[1], SIZE[0], 3)[::-1]
        linear = (codes / 255) ** display.gamma @ WEIGHTS
        emitted = linear * (display.peak_luminance - display.black_level) + display.black_level
        total += emitted + display.reflected_luminance
    return total / 16


def test_below_the_displays_black_nothing_is_darker_so_a_dark_ring_there_loses_contrast(context) -> None:
    """At b = 0.3, 0.5 cd/m^2 would be 0.15, below the black of 0.2: ring and surroundings are both black."""
    dim = Pattern(context, level=-0.045, fineness=0.0)
    scene = RingScene(context, dim, HEADSET)
    ring = ring_of(20.0, 0, -0.3)
    painted = scene.paint(ring, HERE)
    assert 0.3 * painted.surroundings.luminance < 0.2
    scene.draw(Camera(HERE, ring.azimuth, ring.altitude, focal_length=focal_length_of(HEADSET)), painted)
    assert np.ptp(window_mean(context, scene, HEADSET, 0.3)) == 0


def test_without_a_ring_the_picture_is_the_scenes_own_to_the_code(context) -> None:
    pattern = Pattern(context)
    scene = RingScene(context, pattern, HEADSET)
    scene.draw(Camera(HERE, 40.0, 10.0, focal_length=500.0))
    codes = np.frombuffer(pattern.codes.read(), np.uint16).reshape(SIZE[1], SIZE[0], 4)[::-1, :, :3]
    np.testing.assert_array_equal(scene.pixel_values(), (codes.astype(int) * 65535 + 511) // 1023)


def test_away_from_the_ring_no_pixel_changes_and_behind_one_there_is_none(context) -> None:
    ring = ring_of(20.0)
    picture = shown(context, HEADSET, ring, 3.0, 1.0)
    ahead = Camera(HERE, ring.azimuth, ring.altitude).axes()[2]
    angle = np.degrees(np.arccos(np.clip(directions(picture.camera, SIZE) @ ahead, -1, 1))) * 60
    assert (picture.coverage[angle > 2.5 * 20.0 + 2.5] == 0).all()
    assert (shown(context, HEADSET, ring, 180.0, 2 * ring.altitude).coverage == 0).all()


def test_the_ring_has_the_colour_of_its_surroundings_where_the_display_reaches_it(context) -> None:
    scene = RingScene(context, Pattern(context), ROOM)
    painted = scene.paint(ring_of(contrast=-0.3), HERE)
    np.testing.assert_allclose(painted.light, 0.7 * np.array(painted.surroundings.light))


def test_a_colour_out_of_reach_is_made_paler_at_the_same_luminance(context) -> None:
    """Red : green : blue are as 1.15 : 1 : 0.7 in pixel values; a bright ring's red would exceed white."""
    scene = RingScene(context, Pattern(context, level=0.7, fineness=0.0), HEADSET)
    around = scene.surroundings(ring_of(), HERE)
    contrast = 0.98 * HEADSET.peak_luminance / around.luminance - 1
    painted = scene.paint(ring_of(contrast=contrast), HERE)
    assert (1 + contrast) * around.light[0] > HEADSET.peak_luminance
    assert max(painted.light) == pytest.approx(HEADSET.peak_luminance)
    assert np.dot(painted.light, WEIGHTS) == pytest.approx(0.98 * HEADSET.peak_luminance)


def test_a_ring_that_the_display_cannot_show_is_refused_in_one_line(context) -> None:
    scene = RingScene(context, Pattern(context, level=0.7), HEADSET)
    with pytest.raises(
        InputError, match=r"ring_contrast: 5 against .* emits 0\.2 to 104\.4: give a contrast"
    ):
        scene.paint(ring_of(contrast=5.0), HERE)
    with pytest.raises(InputError, match="give a contrast"):
        scene.paint(ring_of(contrast=-1.0), HERE)
    with pytest.raises(InputError, match="larger than a window of 400 x 300 pixels"):
        scene.paint(ring_of(gap=600.0), HERE)
    with pytest.raises(InputError, match="must be 2 or more"):
        scene.paint(ring_of(gap=4.0), HERE)
