"""Draws a Landolt ring into a scene as a screen or both eyes of a headset show it, and holds rings' places.

Along a camera path there are three places at each keypoint. They are chosen once (`chosen_places`) and stored
beside the path, so that every participant and every laboratory searches for the same rings, and a session
needs no rendering before it can be planned.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.progress import note
from evenlight.stimuli.rings import landolt
from evenlight.stimuli.rings.landolt import (
    GAPS_IN_DIAMETER,
    OUTER,
    PaintedRing,
    Ring,
    Surroundings,
    levels_of,
    painted,
    require_drawable,
    surroundings_of,
)
from evenlight.stimuli.scenes.content.catalogue import PATHS, files_sha256, path_named
from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.array_cache import scenes_sha256
from evenlight.stimuli.scenes.engine.camera import Camera, View, focal_length_of
from evenlight.stimuli.scenes.engine.light.seen_patches import met_from
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene, Vector, direction_of
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer
from evenlight.stimuli.shaders import over_all, set_uniforms, shader

if TYPE_CHECKING:
    import moderngl

SUBSAMPLES = 8  # along each side of a pixel: an edge is drawn within 1/16 pixel of its place
SUFFIX = ".rings.json"
PLACES = 2  # at each keypoint: one for each version that a participant sees; there is one more for practice
PRACTICE_SIZE = 2  # of a ring for practice, as a multiple of the design's


class RingScene:
    """A scene whose pictures have a ring in them, as a display shows it."""

    def __init__(self, context: moderngl.Context, renderer: SceneRenderer, display: Display) -> None:
        self._context, self._renderer, self._display = context, renderer, display
        self.size = renderer.size
        self.texture = context.texture(self.size, 4, dtype="u2")
        self.texture.filter = graphics.NEAREST, graphics.NEAREST
        self._target = context.framebuffer(self.texture)
        self._whole = over_all(context, shader("ring").replace("SUBSAMPLES", str(SUBSAMPLES)))
        self._set(codes=0, outer=GAPS_IN_DIAMETER / 2, gamma=display.gamma)
        self._set(black=display.black_level, white=display.peak_luminance)

    def surroundings(self, ring: Ring, position: Vector) -> Surroundings:
        """Return the light around a ring's place, measured on a picture that has it in its middle.

        The picture has the display's resolution, or less if the surroundings would not fit into it.

        Raises
        ------
        InputError
            If the ring itself is larger than the picture.
        """
        require_drawable(ring, self._display)
        focal = focal_length_of(self._display)
        if focal * ring.gap_on_plane * GAPS_IN_DIAMETER > min(self.size):
            raise InputError(
                f"ring_gap_arcmin: a ring of {ring.diameter / 60:.3g} degrees is larger than a window of "
                f"{self.size[0]} x {self.size[1]} pixels on the display {self._display.name!r}: give a "
                "smaller gap, or a larger window"
            )
        focal = min(focal, min(self.size) / 2 / (ring.gap_on_plane * OUTER))
        self.draw(Camera(position, ring.azimuth, ring.altitude, focal_length=focal))
        return surroundings_of(self.pixel_values(), focal, ring, self._display)

    def paint(self, ring: Ring, position: Vector) -> PaintedRing:
        """Return a ring with the light that it has at a place, seen from a position [m].

        Raises
        ------
        InputError
            If the display does not reach its luminance.
        """
        return painted(ring, self.surroundings(ring, position), self._display)

    def draw(self, camera: View, painted_ring: PaintedRing | None = None) -> None:
        """Draw the scene, and the ring in it if one is given, into `texture`.

        `texture` has pixel values over the 16-bit range in its first three components, row 0 on top.
        """
        self._renderer.render(camera)
        self._renderer.encode()
        self._set(there=painted_ring is not None)
        if painted_ring is not None:
            self._place(camera, painted_ring)
        with graphics.own(self._context):
            self._target.use()
            self._renderer.codes.use(0)
            self._whole.render(vertices=3)

    def pixel_values(self) -> NDArray[np.uint16]:
        """Return the pixel values that `texture` holds, (height, width, 3), row 0 on top."""
        width, height = self.size
        data = np.frombuffer(self.texture.read(), dtype=np.uint16)
        return data.reshape(height, width, 4)[:, :, :3].copy()

    def release(self) -> None:
        """Free what the graphics card holds of it; the renderer stays."""
        for held in (self._whole, self._whole.program, self._target, self.texture):
            held.release()

    def _place(self, camera: View, painted_ring: PaintedRing) -> None:
        ring, size = painted_ring.ring, np.array(self.size)
        axes = Camera(painted_ring.seen_from, ring.azimuth, ring.altitude).axes()
        seen = axes @ camera.axes().T
        turn = math.radians(ring.orientation)
        self._set(right=seen[0], up=seen[1], towards=seen[2], gap=(math.cos(turn), math.sin(turn)))
        away = np.array(camera.position) - painted_ring.seen_from
        self._set(size=ring.gap_on_plane, eye=axes @ away / painted_ring.distance)
        left, right, down, up = camera.tangents(self.size)
        focal = size / [right - left, up - down]
        self._set(focal=focal, ahead=focal * [-left, -down])
        self._set(light=painted_ring.light, levels=levels_of(painted_ring.light, self._display))

    def _set(self, **uniforms: object) -> None:
        set_uniforms(self._whole, **uniforms)


class StereoRings:
    """A scene whose pictures, one for each view of a headset, have a ring in them.

    Attributes
    ----------
    eyes : list of RingScene
        Of each view, left and right first: its `texture` holds what is seen.
    """

    def __init__(
        self, context: moderngl.Context, pictures: StereoRenderer, scene: Scene, display: Display
    ) -> None:
        self._scene = scene
        self.eyes = [RingScene(context, eye, display) for eye in pictures.eyes]

    def paint(self, ring: Ring, position: Vector) -> PaintedRing:
        """Return a ring with the light that it has at a place, and its distance, seen from a position [m].

        Raises
        ------
        InputError
            If the display does not reach its luminance.
        """
        direction = direction_of(ring.azimuth, ring.altitude)
        distance = float(met_from(self._scene.patches, position, direction[None])[0][0])
        return replace(self.eyes[0].paint(ring, position), seen_from=position, distance=distance)

    def draw(self, views: Sequence[View], painted_ring: PaintedRing | None = None) -> None:
        """Draw what is seen in each view, and the ring in it if one is given, into `texture` of each."""
        for eye, view in zip(self.eyes, views, strict=True):
            eye.draw(view, painted_ring)


@dataclass(frozen=True, slots=True)
class KeypointRings:
    """The places of rings at one keypoint."""

    keypoint: str = described("name of the keypoint")
    azimuths: tuple[float, ...] = quantity(
        "deg",
        "azimuth of each place, from the keypoint's first direction of view",
        minimum=-180.0,
        maximum=180.0,
    )
    altitudes: tuple[float, ...] = quantity(
        "deg", "altitude of each place, from the horizon", minimum=-90.0, maximum=90.0
    )
    luminances: tuple[float, ...] = quantity(
        "cd/m^2",
        "mean luminance around a ring at each place, on a display of 100 cd/m^2 without black",
        above=0.0,
    )
    practice_azimuth: float = quantity(
        "deg",
        "azimuth of a third place, for the larger ring of practice: no ring of the session lies there",
        minimum=-180.0,
        maximum=180.0,
    )
    practice_altitude: float = quantity(
        "deg", "altitude of the place for practice, from the horizon", minimum=-90.0, maximum=90.0
    )
    practice_luminance: float = quantity(
        "cd/m^2", "mean luminance around the ring of practice, on the same display", above=0.0
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if not len(self.azimuths) == len(self.altitudes) == len(self.luminances) == PLACES:
            raise ValueError(
                f"need {PLACES} places at each keypoint, got {len(self.azimuths)} azimuths, "
                f"{len(self.altitudes)} altitudes and {len(self.luminances)} luminances"
            )


@dataclass(frozen=True, slots=True)
class RingPlaces:
    """The places of rings along a camera path; the file `NAME.rings.json` beside it."""

    path: str = described("name of the camera path")
    seed: int = quantity("1", "seed of the choice", minimum=0)
    keypoints: tuple[KeypointRings, ...] = described(
        "the keypoints of the path that a search uses, with their places"
    )
    chosen_in: str = described(
        "SHA-256 of the path and the files of its scene, for which they serve; empty for any", default=""
    )

    def __post_init__(self) -> None:
        names = [each.keypoint for each in self.keypoints]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"need keypoints, each once, got {', '.join(names) or 'none'}")


def search_sha256(path: str) -> str:
    """Return the SHA-256 of what a search along a camera path shows: scenes, path, rings and their places."""
    files = (_rings_file(path), Path(str(landolt.__file__)), Path(__file__))
    shown = scenes_sha256() + files_sha256(path_named(path))
    return sha256_of_bytes(shown.encode() + b"".join(file.read_bytes() for file in files))


@lru_cache(maxsize=16)
def ring_places(path: str) -> RingPlaces:
    """Return where rings are searched for along a camera path, by name or .json file.

    Along a path of a file they are chosen the first time, and stored beside it.

    Raises
    ------
    InputError
        If there are none, or those beside a file are of another path or scene.
    """
    file = _rings_file(path)
    if not path.endswith(".json"):
        if not file.is_file():
            known = sorted(each.name.removesuffix(SUFFIX) for each in PATHS.glob(f"*{SUFFIX}"))
            raise InputError(
                f"no rings are searched for along {path!r}; there is {', '.join(known)}; or put {path}.json, "
                "a path of your own, beside the folder of its track"
            )
        return read_json_record(RingPlaces, file)
    walk = path_named(path)
    if not file.exists():
        from evenlight.stimuli.rings.chosen_places import places_along

        if not os.access(file.parent, os.W_OK):
            raise InputError(
                f"{file}: places of rings are chosen once and stored there: need a folder to write to"
            )
        note(f"{path}: chooses places of rings, and stores them in {file}")
        write_json_record(file, replace(places_along(walk), chosen_in=files_sha256(walk)))
    places = read_json_record(RingPlaces, file)
    unknown = {each.keypoint for each in places.keypoints} - {point.name for point in walk.keypoints}
    if places.path != walk.name or unknown or places.chosen_in not in ("", files_sha256(walk)):
        what = f"no keypoint {min(unknown)!r} is on the path" if unknown else "the path or the scene changed"
        what = what if places.path == walk.name else f"they are of the path {places.path!r}"
        raise InputError(f"{file}: its places of rings do not serve: {what}; delete it, to choose them anew")
    return places


def _rings_file(path: str) -> Path:
    return Path(path.removesuffix(".json") + SUFFIX) if path.endswith(".json") else PATHS / f"{path}{SUFFIX}"
